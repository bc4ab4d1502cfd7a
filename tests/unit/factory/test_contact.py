import numpy as np
import pytest

from boltpose.factory.clamps.assembly import ClampBody, InfeasibleError
from boltpose.factory.clamps.contact import (
    boxed,
    cut_nests,
    distance_to_surface,
    overlap_depth_mm,
)
from boltpose.factory.clamps.workpiece import eroded, sample_surface
from boltpose.factory.model import Material
from boltpose.factory.solids import Manifold, box, cylinder, mesh_arrays


def piece(body: Manifold, give_mm: float = 0.8) -> ClampBody:
    return ClampBody(name="jaw", body=body, material=Material.BARE_STEEL, give_mm=give_mm)


@pytest.mark.parametrize("depth", [0.1, 0.5, 1.7, 6.0])
def test_depth_of_a_flat_face_pressed_into_a_cylinder(depth: float) -> None:
    post = boxed(cylinder(20, 0, 50))
    on_top = boxed(box((100, 100, 20), (0, 0, 60 - depth)))
    beside = boxed(box((20, 100, 30), (30 - depth, 0, 25)))
    assert overlap_depth_mm([post], [on_top]) == pytest.approx(depth, abs=1e-6)
    assert overlap_depth_mm([beside], [post]) == pytest.approx(depth, abs=0.01)


def test_apart_is_no_depth_and_wholly_inside_is_the_way_out_of_the_surface() -> None:
    outer = boxed(box((40, 40, 40)))
    assert overlap_depth_mm([outer], [boxed(box((10, 10, 10), (30, 0, 0)))]) == 0
    assert overlap_depth_mm([outer], [boxed(box((10, 10, 10)))]) == pytest.approx(15, abs=1e-6)


def test_distance_is_that_of_a_sphere() -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(200, 3))
    points *= rng.uniform(2, 60, size=(200, 1)) / np.linalg.norm(points, axis=1, keepdims=True)
    distance = distance_to_surface(points, Manifold.sphere(20, 128))
    np.testing.assert_allclose(distance, np.abs(np.linalg.norm(points, axis=1) - 20), atol=0.02)


def test_a_nest_leaves_nothing_of_the_motor_in_the_jaw() -> None:
    motor = [boxed(cylinder(20, 0, 50))]
    jaw = piece(box((20, 40, 30), (29.6, 0, 25)))
    nested = cut_nests([jaw], motor)
    assert nested.touching == 1
    assert overlap_depth_mm([boxed(nested.bodies[0].body)], motor) == 0
    assert nested.bodies[0].body.volume() < jaw.body.volume()


def test_what_stands_in_the_way_or_would_be_cut_in_two_is_refused() -> None:
    motor = [boxed(cylinder(20, 0, 50))]
    with pytest.raises(InfeasibleError, match="in the motor's way"):
        cut_nests([piece(box((20, 40, 30), (20, 0, 25)))], motor)
    with pytest.raises(InfeasibleError, match="cut in two"):
        cut_nests([piece(box((100, 4, 4), (0, 0, 25)), give_mm=99)], motor)


def test_what_the_motor_does_not_reach_stays_as_it_is() -> None:
    far = piece(box((5, 5, 5), (200, 0, 0)))
    nested = cut_nests([far], [boxed(cylinder(20, 0, 50))])
    assert nested.touching == 0
    assert nested.bodies[0] is far


def test_samples_lie_on_the_surface_and_are_as_many_as_its_area_asks() -> None:
    body = box((40, 30, 20))
    samples = sample_surface(*mesh_arrays(body))
    assert distance_to_surface(samples, body).max() < 1e-9
    assert len(samples) == pytest.approx(8 + 5200 / 5, abs=2)


def test_a_ring_is_eroded_around_its_seam() -> None:
    ring = np.ones(90, dtype=np.bool_)
    ring[0] = False
    assert np.flatnonzero(~eroded(ring, 8)).tolist() == [0, 1, 2, 88, 89]
