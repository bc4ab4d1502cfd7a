from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from boltpose.errors import ShapeError
from boltpose.factory.solids import box
from boltpose.sensor.raycast import RayCaster
from tests.unit.sensor.shapes import as_solid, distance_to_solids, toy_motor

MOTOR = toy_motor()
CASTER = RayCaster(MOTOR)


def rays(seed: int, count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """From a sphere of 800 mm around the motor to places in and around it."""
    rng = np.random.default_rng(seed)
    origins = rng.standard_normal((count, 3))
    origins *= 800 / np.linalg.norm(origins, axis=1)[:, None]
    directions = rng.uniform(-70, 70, (count, 3)) - origins
    return origins, directions / np.linalg.norm(directions, axis=1)[:, None]


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_hits_lie_on_the_mesh_and_on_their_ray(seed: int) -> None:
    origins, directions = rays(seed, 100)

    hits = CASTER.first_hits(origins, directions)

    on = hits.is_hit
    distances = distance_to_solids(hits.points[on], MOTOR)
    assert distances.min(axis=0).max(initial=0) < 1e-6
    reached = origins[on] + hits.distance_mm[on, None] * directions[on]
    # across the ray single precision may show, a thousand times below a micrometre
    assert np.abs(reached - hits.points[on]).max(initial=0) < 1e-3
    own = distances[hits.solid_index[on], np.arange(on.sum())]
    assert own.max(initial=0) < 1e-6


def test_hits_are_the_first_of_all_triangles() -> None:
    origins, directions = rays(5)

    hits = CASTER.first_hits(origins, directions)

    nearest = np.full(len(origins), np.inf)
    for a, b, c in CASTER.vertices[CASTER.faces]:  # Moeller and Trumbore, 1997
        across = np.cross(directions, c - a)
        determinant = across @ (b - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.einsum("ij,ij->i", origins - a, across) / determinant
            turned = np.cross(origins - a, b - a)
            v = np.einsum("ij,ij->i", directions, turned) / determinant
            t = turned @ (c - a) / determinant
        met = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        nearest = np.where(met, np.minimum(nearest, t), nearest)
    assert 0.2 < hits.is_hit.mean() < 0.98
    np.testing.assert_array_equal(hits.is_hit, np.isfinite(nearest))
    np.testing.assert_allclose(hits.distance_mm, nearest, atol=1e-6)


def test_normals_look_out_of_the_solids() -> None:
    origins, directions = rays(6)

    hits = CASTER.first_hits(origins, directions)

    on = hits.is_hit
    facing = np.einsum("ij,ij->i", hits.normals[on], directions[on])
    assert (facing < 0).all()
    np.testing.assert_allclose(np.linalg.norm(hits.normals[on], axis=1), 1)


def test_a_miss_says_so_in_every_field() -> None:
    hits = CASTER.first_hits(np.array([[0.0, 0, 500]]), np.array([[0.0, 0, 1], [0, 0, -1]]))

    assert hits.is_hit.tolist() == [False, True]
    assert hits.face_index[0] == hits.solid_index[0] == -1
    assert hits.distance_mm[0] == np.inf
    assert hits.points[0].tolist() == [0, 0, 500]
    assert hits.normals[0].tolist() == [0, 0, 0]


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_what_a_ray_hits_first_is_not_blocked_and_what_it_hits_later_is(seed: int) -> None:
    origins, directions = rays(seed)
    hits = CASTER.first_hits(origins, directions)
    on = hits.is_hit
    origins, directions, points = origins[on], directions[on], hits.points[on]

    assert not CASTER.is_blocked(origins, points).any()
    # half a millimetre behind the first surface, seen from the eye
    assert CASTER.is_blocked(origins, points + 0.5 * directions).all()


def test_points_need_not_be_near_a_surface() -> None:
    wall = RayCaster([as_solid(box((100, 100, 1)))])
    eye = np.array([[0.0, 0, 50]])
    targets = np.array([[0.0, 0, 10], [0, 0, -10], [0, 200, -10]])

    assert wall.is_blocked(eye, targets).tolist() == [False, True, False]


def test_nothing_to_hit_is_refused() -> None:
    with pytest.raises(ShapeError, match="at least one solid"):
        RayCaster([])
