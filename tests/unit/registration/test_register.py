import sys
from dataclasses import replace

import numpy as np
import pytest

from boltpose.errors import ConfigError, MissingExtraError, ShapeError
from boltpose.registration.config import (
    CoarseConfig,
    FineConfig,
    FineStep,
    PaperConfig,
    PrepareConfig,
    RegistrationConfig,
    SceneConfig,
    VerifyConfig,
    VisibilityConfig,
)
from boltpose.registration.paper import run_icp
from boltpose.registration.register import register
from boltpose.registration.relabel import relabel
from boltpose.registration.scene import build_scene
from tests.unit.registration.scenes import (
    pose,
    pose_error,
    prepared_motor,
    view,
    visible_points,
)

TRUTH = pose(turn=(0.4, 1.9, 0.3))


def test_finds_the_pose_and_ranks_it_first() -> None:
    scan, is_motor = view(TRUTH)

    result = register(prepared_motor(), scan[is_motor], scene=build_scene(scan))

    assert result.best is not None
    assert pose_error(result.best.camera_from_prior, TRUTH) < 0.05
    assert result.best.converged
    assert result.best.score > result.best.runner_up_score + 0.2
    scores = [candidate.score for candidate in result.candidates]
    assert scores == sorted(scores, reverse=True)


def test_same_points_same_bits() -> None:
    scan, is_motor = view(TRUTH)
    scene = build_scene(scan)
    first = register(prepared_motor(), scan[is_motor], scene=scene).best
    second = register(prepared_motor(), scan[is_motor], scene=scene).best

    assert first is not None
    assert second is not None
    np.testing.assert_array_equal(first.camera_from_prior.matrix, second.camera_from_prior.matrix)
    assert first.score == second.score


def test_too_few_points_are_a_result_that_says_so() -> None:
    for points in (np.zeros((0, 3)), visible_points(TRUTH)[:50]):
        result = register(prepared_motor(), points)

        assert result.best is None
        assert result.candidates == ()
        assert "wanted 300" in result.message


def test_points_of_the_wrong_shape_are_refused() -> None:
    with pytest.raises(ShapeError, match=r"motor_points_camera must have shape \(N, 3\)"):
        register(prepared_motor(), np.zeros((10, 2)))


def test_the_papers_method_without_open3d_names_the_extra(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "open3d", None)
    with pytest.raises(MissingExtraError, match=r"boltpose\[bench\]"):
        register(prepared_motor(), visible_points(TRUTH), RegistrationConfig(method="paper"))


@pytest.mark.parametrize("is_point_to_plane", [True, False])
def test_the_papers_icp_steps_improve_a_near_pose(is_point_to_plane: bool) -> None:
    start = pose(turn=(0.41, 1.9, 0.3))
    found = start
    points = visible_points(TRUTH)[::3]
    for distance in (10.0, 1.0, 0.1):
        found = run_icp(
            found,
            points,
            prepared_motor(),
            max_distance_mm=distance,
            iterations=30,
            is_point_to_plane=is_point_to_plane,
        )

    assert pose_error(found, TRUTH) < 0.5 * pose_error(start, TRUTH)


def test_icp_without_partners_returns_the_start() -> None:
    points = visible_points(TRUTH) + np.array([0.0, 0.0, 500.0])
    found = run_icp(
        TRUTH, points, prepared_motor(), max_distance_mm=1.0, iterations=5, is_point_to_plane=True
    )

    np.testing.assert_allclose(found.matrix, TRUTH.matrix, atol=1e-9)


def test_relabelling_finds_exactly_the_points_near_the_prior() -> None:
    scan, _ = view(TRUTH)
    scan = np.vstack([scan, visible_points(TRUTH) + np.array([0.0, 0.0, -4.0])])
    exact, _ = prepared_motor().tree.query(TRUTH.inverse().apply(scan))

    is_motor = relabel(prepared_motor(), TRUTH, scan, threshold_mm=1.5)

    np.testing.assert_array_equal(is_motor, exact <= 1.5)
    assert 1000 < is_motor.sum() < len(scan) - 1000


@pytest.mark.parametrize(
    "make",
    [
        lambda: PrepareConfig(grid_cell_mm=0.0),
        lambda: CoarseConfig(first_distance_mm=(3.0, 12.0)),
        lambda: CoarseConfig(convincing_score=1.5),
        lambda: FineStep(voxel_mm=1.0, max_distance_mm=-1.0, kernel_mm=0.3),
        lambda: FineConfig(steps=()),
        lambda: SceneConfig(cell_mm=float("nan")),
        lambda: PaperConfig(icp_distances_mm=(10.0, 0.0)),
        lambda: RegistrationConfig(method="guess"),  # type: ignore[arg-type]
        lambda: VerifyConfig(min_tight=1.2),
        lambda: VisibilityConfig(partial_share=0.5, visible_share=0.2),
        lambda: replace(RegistrationConfig(), min_points=0),
    ],
)
def test_settings_out_of_range_are_refused(make) -> None:
    with pytest.raises(ConfigError):
        make()
