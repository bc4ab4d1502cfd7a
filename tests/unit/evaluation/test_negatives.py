from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree

from boltpose.arrays import FloatArray
from boltpose.evaluation import decoys
from boltpose.evaluation.negatives import (
    CROPS,
    CaseKind,
    Expectation,
    list_cases,
    make_scan,
)
from boltpose.evaluation.reman18 import TrueMotor, read_motor, read_pixel_labels
from boltpose.schema import Scan
from tests.unit.evaluation.tiny_reman18 import (
    CAMERA,
    FAMILIES,
    SHAPE,
    read_tiny_scan,
    write_tiny_reman18,
)


@pytest.fixture(scope="module")
def motors(tmp_path_factory: pytest.TempPathFactory) -> list[TrueMotor]:
    root = write_tiny_reman18(tmp_path_factory.mktemp("reman18"))
    return [read_motor(root, name) for name in FAMILIES]


def one(motors: list[TrueMotor], kind: CaseKind) -> tuple[Scan, Scan]:
    """The plain view and the case made from it."""
    case = next(case for case in list_cases(motors[0], motors) if case.kind is kind)
    scene = next(motor for motor in motors if motor.name == case.scene_motor)
    plain = read_tiny_scan(scene.views[case.view].depth_path)
    return plain, make_scan(case, scene, read_tiny_scan)


def on_rays(scan: Scan) -> FloatArray:
    """How far, in pixels, points are from the rays of their pixels."""
    assert scan.pixels is not None
    rays = decoys.pixel_rays(scan.pixels, CAMERA)
    return np.abs(scan.points[:, :2] / scan.points[:, 2:] - rays[:, :2]).max() * 200


def test_every_ordered_pair_of_motors_is_a_case(motors: list[TrueMotor]) -> None:
    pairs = Counter(
        (case.prior_motor, case.scene_motor, case.kind)
        for motor in motors
        for case in list_cases(motor, motors)
        if case.prior_motor != case.scene_motor
    )

    assert pairs == {
        ("motor_000", "motor_001", CaseKind.OTHER_FAMILY): 1,
        ("motor_001", "motor_000", CaseKind.OTHER_FAMILY): 1,
        ("motor_001", "motor_002", CaseKind.OTHER_FAMILY): 1,
        ("motor_002", "motor_001", CaseKind.OTHER_FAMILY): 1,
        ("motor_000", "motor_002", CaseKind.OTHER_SIZE): 2,
        ("motor_002", "motor_000", CaseKind.OTHER_SIZE): 2,
    }


def test_every_kind_is_there_and_only_crops_may_be_accepted(motors: list[TrueMotor]) -> None:
    cases = list_cases(motors[0], motors)

    assert {case.kind for case in cases} == set(CaseKind)
    for case in cases:
        may_accept = case.expectation is Expectation.RIGHT_OR_REFUSE
        assert may_accept == (case.kind in CROPS)


@pytest.mark.parametrize("kind", list(CaseKind))
def test_a_case_is_the_same_every_time_and_a_proper_scan(
    motors: list[TrueMotor], kind: CaseKind
) -> None:
    _, first = one(motors, kind)
    _, second = one(motors, kind)

    np.testing.assert_array_equal(first.points, second.points)
    assert len(first) > 0
    assert (first.points[:, 2] > 0).all()
    if kind is not CaseKind.NOISE_IN_BOX:
        assert first.grid_shape == SHAPE
        assert first.pixels is not None
        assert len(np.unique(first.pixels, axis=0)) == len(first)
        if kind is not CaseKind.MIRRORED:  # the centre of the image is not that of the lens
            assert on_rays(first) < 1e-6


def test_without_its_motor_only_the_clamp_is_left(motors: list[TrueMotor]) -> None:
    plain, scan = one(motors, CaseKind.CLAMP_ONLY)

    assert len(plain) - len(scan) == 14 * 20
    assert (scan.points[:, 2] > 650).all()


def test_the_empty_clamp_has_surface_where_the_motor_was(motors: list[TrueMotor]) -> None:
    plain, scan = one(motors, CaseKind.EMPTY_CLAMP)

    assert len(scan) == len(plain)
    np.testing.assert_allclose(scan.points[:, 2], 700, atol=6 * decoys.NOISE_MM)


def test_a_mirrored_scan_has_the_distances_but_not_the_hand(motors: list[TrueMotor]) -> None:
    plain, scan = one(motors, CaseKind.MIRRORED)

    pick = np.random.default_rng(0).integers(len(plain), size=(50, 4))
    for corners in pick:
        a, b = plain.points[corners], scan.points[corners]
        np.testing.assert_allclose(
            np.linalg.norm(a[:, None] - a, axis=2), np.linalg.norm(b[:, None] - b, axis=2)
        )
        np.testing.assert_allclose(
            np.linalg.det(a[1:] - a[0]), -np.linalg.det(b[1:] - b[0]), atol=1e-6
        )


def test_noise_fills_the_box(motors: list[TrueMotor]) -> None:
    plain, scan = one(motors, CaseKind.NOISE_IN_BOX)

    assert len(scan) == len(plain)
    low, high = plain.points.min(axis=0), plain.points.max(axis=0)
    # the variance of an even spread
    np.testing.assert_allclose(scan.points.var(axis=0), (high - low) ** 2 / 12, rtol=0.15)


def test_the_table_is_one_plane(motors: list[TrueMotor]) -> None:
    _, scan = one(motors, CaseKind.PLAIN_TABLE)

    centred = scan.points - scan.points.mean(axis=0)
    spread = np.linalg.svd(centred, compute_uv=False) / np.sqrt(len(scan))
    assert spread[2] < 2 * decoys.NOISE_MM
    assert spread[1] > 10


def test_the_cylinder_is_one_and_stands_where_the_motor_was(motors: list[TrueMotor]) -> None:
    _, scan = one(motors, CaseKind.CYLINDER)

    # its axis is the camera's z: the camera sees the round face, 30 mm before the middle
    near = scan.points[:, 2] < 650
    np.testing.assert_allclose(scan.points[near, 2], 570, atol=6 * decoys.NOISE_MM)
    radius = np.linalg.norm(scan.points[near, :2], axis=1)
    assert radius.max() <= 20.0
    assert radius.max() > 17.0


def test_a_cylinder_across_the_view_is_round() -> None:
    pixels = np.argwhere(np.ones(SHAPE, dtype=bool))
    rays = decoys.pixel_rays(pixels, CAMERA)
    far = Scan(points=rays * 900, pixels=pixels, grid_shape=SHAPE)
    axis = np.array([1.0, 0, 0])

    scan = decoys.swap_for_cylinder(
        far,
        np.zeros(len(far), dtype=bool),
        CAMERA,
        centre_mm=np.array([0.0, 0, 600]),
        axis=axis,
        radius_mm=30.0,
        length_mm=60.0,
        rng=np.random.default_rng(0),
    )

    near = scan.points[scan.points[:, 2] < 800]
    np.testing.assert_allclose(np.hypot(near[:, 1], near[:, 2] - 600), 30, atol=0.5)
    assert np.abs(near[:, 0]).max() <= 30.5
    assert len(near) > 200
    # it hides what is behind it and nothing else is lost
    assert len(scan) == len(far)


@pytest.mark.parametrize("kind", CROPS)
def test_a_crop_keeps_the_clamp_and_little_of_the_motor(
    motors: list[TrueMotor], kind: CaseKind
) -> None:
    plain, scan = one(motors, kind)
    view = motors[0].views[0]
    assert scan.pixels is not None
    assert plain.pixels is not None

    is_motor = read_pixel_labels(view, scan.pixels) > 0
    whole = read_pixel_labels(view, plain.pixels) > 0

    assert (~is_motor).sum() == (~whole).sum()
    assert is_motor.sum() < 0.9 * whole.sum()
    distance, _ = KDTree(plain.points).query(scan.points)
    assert distance.max() == 0


def test_a_case_wants_its_own_scene(motors: list[TrueMotor]) -> None:
    case = list_cases(motors[0], motors)[0]
    with pytest.raises(ValueError, match="the case is about motor_001, got motor_000"):
        make_scan(case, motors[0], lambda path: read_tiny_scan(Path(path)))
