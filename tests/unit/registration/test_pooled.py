from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from boltpose.registration.config import EvidenceConfig
from boltpose.registration.evidence import EVIDENCE_NAMES, Evidence, gather_evidence
from boltpose.registration.pooled import BY_POINTS, BY_SURFACE, OF_ALL, SeenPose, pool_evidence
from boltpose.registration.register import register
from boltpose.registration.scene import build_scene
from tests.unit.registration.scenes import pose, prepared_motor, view

CONFIG = EvidenceConfig()


def seen(turn: tuple[float, float, float]) -> SeenPose:
    points, is_motor = view(pose(turn=turn))
    scene = build_scene(points)
    best = register(prepared_motor(), points[is_motor], scene=scene).best
    assert best is not None
    return SeenPose(
        camera_from_prior=best.camera_from_prior,
        motor_points=points[is_motor],
        scene=scene,
        evidence=gather_evidence(best, prepared_motor(), scene, points[is_motor], CONFIG),
    )


@pytest.fixture(scope="module")
def views() -> list[SeenPose]:
    return [seen((0.4, 1.9, 0.3)), seen((0.4, -1.2, 0.3))]


def pooled(views: list[SeenPose]) -> Evidence:
    return pool_evidence(
        views,
        prepared_motor(),
        margin=0.3,
        bolt_sigma_mm=0.1,
        free_space_mm=CONFIG.free_space_mm,
    )


def test_every_number_of_the_evidence_has_its_rule() -> None:
    assert sorted([*BY_POINTS, *BY_SURFACE, *OF_ALL]) == sorted(EVIDENCE_NAMES)


def test_one_view_is_its_own_evidence(views) -> None:
    alone = views[0].evidence
    found = pooled(views[:1])
    for name in (*BY_POINTS, *BY_SURFACE, "judged_points", "converged"):
        assert getattr(found, name) == pytest.approx(getattr(alone, name)), name
    # the voxels lie elsewhere in frame `prior`
    assert found.motor_points == pytest.approx(alone.motor_points, rel=0.25)


def test_what_two_views_see_counts_once(views) -> None:
    twice, both = pooled([views[0], views[0]]), pooled(views)
    alone = pooled(views[:1])
    assert twice.judged_points == alone.judged_points
    assert twice.motor_points == alone.motor_points
    assert both.judged_points > alone.judged_points
    assert both.judged_points <= sum(one.evidence.judged_points for one in views)


def test_shares_lie_between_those_of_the_views(views) -> None:
    both = pooled(views)
    for name in (*BY_POINTS, *BY_SURFACE):
        values = [getattr(one.evidence, name) for one in views]
        assert min(values) - 1e-12 <= getattr(both, name) <= max(values) + 1e-12, name


def test_a_view_without_motor_points_adds_none(views) -> None:
    blind = replace(
        views[1],
        motor_points=np.zeros((0, 3)),
        evidence=replace(views[1].evidence, motor_points=0, judged_points=0, tight=0.0),
    )
    assert pooled([views[0], blind]).tight == views[0].evidence.tight
