from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

from boltpose.geometry.transforms import Transform
from boltpose.registration.config import EvidenceConfig
from boltpose.registration.evidence import _is_near_any, gather_evidence
from boltpose.registration.register import register
from boltpose.registration.scene import build_scene
from boltpose.schema import Registration
from tests.unit.registration.scenes import pose, prepared_motor, view

TRUTH = pose(turn=(0.4, 1.9, 0.3))
CONFIG = EvidenceConfig()


@pytest.fixture(scope="module")
def scan() -> tuple[np.ndarray, np.ndarray]:
    return view(TRUTH)


@pytest.fixture(scope="module")
def best(scan: tuple[np.ndarray, np.ndarray]) -> Registration:
    points, is_motor = scan
    found = register(prepared_motor(), points[is_motor], scene=build_scene(points)).best
    assert found is not None
    return found


def test_a_right_pose_fits_in_every_direction(scan, best) -> None:
    points, is_motor = scan

    right = gather_evidence(best, prepared_motor(), build_scene(points), points[is_motor], CONFIG)

    assert 0.9 < right.weakest_tight <= 1.0
    assert right.sunk < 0.01


def test_a_slide_shows_most_where_it_is_felt(scan, best) -> None:
    points, is_motor = scan
    # along its axis most of a motor looks the same: the share of all points hardly notices
    inner = Transform.from_parts("prior", "prior", np.eye(3), (0.0, 0.0, 2.5))
    slid = replace(best, camera_from_prior=best.camera_from_prior @ inner)

    found = gather_evidence(slid, prepared_motor(), build_scene(points), points[is_motor], CONFIG)

    assert found.weakest_tight < 0.5 < found.tight


@pytest.mark.parametrize(("offset_mm", "is_impossible"), [(-1.5, True), (1.5, False)])
def test_only_what_lies_inside_the_motor_is_sunk(
    scan, best, offset_mm: float, is_impossible
) -> None:
    points, is_motor = scan
    towards_camera = -points / np.linalg.norm(points, axis=1, keepdims=True)
    moved = points.copy()
    patch = is_motor & (np.linalg.norm(points - points[is_motor][0], axis=1) < 30.0)
    moved[patch] += offset_mm * towards_camera[patch]

    found = gather_evidence(best, prepared_motor(), build_scene(moved), moved[is_motor], CONFIG)

    # a clamp may lie on the motor, nothing may lie in it
    assert (found.sunk > 0.02) == is_impossible


def test_nearness_by_cells_is_nearness_by_distance_to_half_a_cell() -> None:
    rng = np.random.default_rng(0)
    surface, points = rng.uniform(0, 40, (3000, 3)), rng.uniform(-5, 45, (5000, 3))
    distance, _ = KDTree(points).query(surface)

    near = _is_near_any(surface, points, 2.0)

    # cells of half the reach: right but for a cell's diagonal
    assert near[distance < 2.0 - np.sqrt(3.0)].all()
    assert not near[distance > 2.0 + np.sqrt(3.0)].any()
    assert abs(near.mean() - (distance < 2.0).mean()) < 0.1


def test_nothing_taken_for_the_motor_is_no_fit(scan, best) -> None:
    points, _ = scan

    found = gather_evidence(best, prepared_motor(), build_scene(points), np.zeros((0, 3)), CONFIG)

    assert (found.explained, found.tight, found.weakest_tight) == (0, 0, 0)


def test_a_pose_beside_the_scan_is_not_covered_and_all_sunk(scan, best) -> None:
    points, is_motor = scan
    aside = Transform.from_parts("prior", "prior", np.eye(3), (0.0, 0.0, 5000.0))
    wrong = replace(best, camera_from_prior=best.camera_from_prior @ aside)

    found = gather_evidence(wrong, prepared_motor(), build_scene(points), points[is_motor], CONFIG)

    assert found.coverage == 0.0
    assert found.sunk == 1.0
