from __future__ import annotations

import numpy as np
import pytest
import trimesh

from boltpose.errors import ConfigError
from boltpose.io import MeshPart, sample_mesh
from boltpose.schema import Part

NAMES = {"bolt_*": Part.BOLT, "*": Part.MAIN_HOUSING}


def part(name: str, mesh: trimesh.Trimesh) -> MeshPart:
    return MeshPart(
        name=name,
        vertices=np.asarray(mesh.vertices, dtype=np.float64),
        faces=np.asarray(mesh.faces, dtype=np.int64),
    )


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def motor() -> list[MeshPart]:
    """A block, 40 x 40 x 30, with a bolt whose upper 4 mm of 20 stand out of the top face."""
    bolt = trimesh.creation.cylinder(radius=5, height=20)
    bolt.apply_translation((0, 0, 9))
    return [part("housing", trimesh.creation.box((40, 40, 30))), part("bolt_1", bolt)]


def test_points_lie_on_the_surface_evenly_with_normals_outwards() -> None:
    size = np.array([100.0, 80.0, 60.0])
    scan = sample_mesh([part("a", trimesh.creation.box(size))], spacing_mm=2.0, rng=rng())

    assert scan.labels is None
    assert scan.normals is not None
    area = 2 * (100 * 80 + 100 * 60 + 80 * 60)
    assert len(scan) == round(area / 4)  # a box hides none of itself
    axis = np.abs(scan.normals).argmax(axis=1)
    sign = scan.normals[np.arange(len(scan)), axis]
    np.testing.assert_allclose(np.abs(sign), 1)
    on_face = scan.points[np.arange(len(scan)), axis]
    np.testing.assert_allclose(on_face, sign * size[axis] / 2)
    for index in range(3):
        for side in (-1, 1):
            is_here = (axis == index) & (np.sign(sign) == side)
            expected = np.delete(size, index).prod() / 4
            assert is_here.sum() == pytest.approx(expected, abs=2)
            spread = scan.points[is_here].std(axis=0)
            np.testing.assert_allclose(np.delete(spread, index), np.delete(size, index) / 12**0.5,
                                       rtol=0.05)  # fmt: skip


def test_what_no_direction_sees_is_left_out() -> None:
    scan = sample_mesh(motor(), NAMES, spacing_mm=1.0, rng=rng())

    assert scan.labels is not None
    bolt = scan.points[scan.labels == Part.BOLT]
    housing = scan.points[scan.labels == Part.MAIN_HOUSING]
    assert len(bolt) == pytest.approx(np.pi * 25 + np.pi * 10 * 4, rel=0.1)
    assert bolt[:, 2].min() > 13.5
    is_under_head = (np.hypot(housing[:, 0], housing[:, 1]) < 4.0) & (housing[:, 2] > 14)
    assert not is_under_head.any()  # but for a rim of half a millimetre
    assert len(housing) == pytest.approx(8000 - np.pi * 25, rel=0.01)


def test_hidden_surfaces_can_be_kept() -> None:
    scan = sample_mesh(motor(), NAMES, spacing_mm=1.0, rng=rng(), keep_hidden=True)
    assert scan.labels is not None
    whole = 2 * np.pi * 25 + np.pi * 10 * 20
    assert (scan.labels == Part.BOLT).sum() == pytest.approx(whole, rel=0.02)


def test_a_motor_sized_hollow_keeps_its_open_inside() -> None:
    tube = trimesh.creation.annulus(r_min=30, r_max=40, height=50)
    scan = sample_mesh([part("a", tube)], spacing_mm=2.0, rng=rng())
    radius = np.hypot(scan.points[:, 0], scan.points[:, 1])
    assert (radius < 30.5).sum() == pytest.approx(2 * np.pi * 30 * 50 / 4, rel=0.03)


def test_same_seed_same_bits_and_another_seed_another_sample() -> None:
    first, again, other = (
        sample_mesh(motor(), NAMES, spacing_mm=3.0, rng=rng(seed)) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first.points, again.points)
    np.testing.assert_array_equal(first.labels, again.labels)
    assert not np.array_equal(first.points[:100], other.points[:100])


def test_faces_without_area_do_no_harm() -> None:
    mesh = trimesh.creation.box((50, 50, 50))
    faces = np.concatenate([[[0, 0, 1]], mesh.faces, [[2, 2, 2]]]).astype(np.int64)
    whole = MeshPart(name="a", vertices=np.asarray(mesh.vertices, dtype=float), faces=faces)
    scan = sample_mesh([whole], spacing_mm=2.0, rng=rng())
    assert scan.normals is not None
    np.testing.assert_allclose(np.linalg.norm(scan.normals, axis=1), 1)


@pytest.mark.parametrize("spacing", [0.0, -1.0, float("nan"), 1e-4, 1e4])
def test_absurd_spacings_are_refused(spacing: float) -> None:
    with pytest.raises(ConfigError, match="spacing_mm"):
        sample_mesh(motor(), spacing_mm=spacing, rng=rng())


def test_parts_without_a_class_are_refused() -> None:
    with pytest.raises(
        ConfigError, match=r"no class for the parts housing; the patterns are bolt_\*"
    ):
        sample_mesh(motor(), {"bolt_*": Part.BOLT}, rng=rng())
