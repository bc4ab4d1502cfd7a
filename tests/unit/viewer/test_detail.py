"""What is sent of a scan, and when."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from boltpose.errors import ConfigError
from boltpose.viewer.config import ViewerConfig
from boltpose.viewer.detail import COARSE, FINE, MIDDLE, Sight, cut, wanted_levels

CONFIG = ViewerConfig(
    first_points=1000, middle_points=3000, moving_points=2000, still_points=10_000
)


def plane(count: int, seed: int = 0, edge_mm: float = 600.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-edge_mm / 2, edge_mm / 2, size=(count, 3))
    points[:, 2] = 700 + 20 * np.sin(points[:, 0] / 50)
    return points


def sight(distance_mm: float, *, aside_rad: float = 0.0) -> Sight:
    return Sight(
        position_mm=np.array([0.0, 0.0, 700.0 - distance_mm]),
        forward=np.array([np.sin(aside_rad), 0.0, np.cos(aside_rad)]),
        half_angle_rad=0.5,
        pixels_per_rad=1000.0,
    )


@settings(deadline=None, max_examples=25)
@given(count=st.integers(0, 20_000), seed=st.integers(0, 5))
def test_every_point_is_in_one_tile_and_level(count: int, seed: int) -> None:
    points = plane(count, seed)
    detail = cut(points, CONFIG)
    rows = [tile.rows[level] for tile in detail.tiles for level in (COARSE, MIDDLE, FINE)]
    together = np.sort(np.concatenate(rows)) if rows else np.zeros(0)
    np.testing.assert_array_equal(together, np.arange(count))
    for tile in detail.tiles:
        away = np.linalg.norm(points[np.concatenate(tile.rows)] - tile.centre_mm, axis=1)
        assert away.max() <= tile.radius_mm + 0.01


def test_levels_have_about_the_points_asked_for_and_lie_evenly() -> None:
    points = plane(40_000)
    detail = cut(points, CONFIG)
    assert 500 <= detail.count(COARSE) <= 2000
    assert 2000 <= detail.count(MIDDLE) <= 8000
    assert detail.count(FINE) == 40_000
    coarse, middle, fine = detail.spacing_mm
    assert coarse > middle > fine
    # even: every quarter of the plane has its share of the first picture
    first = points[np.concatenate([tile.rows[COARSE] for tile in detail.tiles])]
    quarters = np.bincount(2 * (first[:, 0] > 0) + (first[:, 1] > 0), minlength=4)
    assert quarters.min() > 0.8 * quarters.mean()


def test_a_stray_point_far_away_does_not_blur_the_rest() -> None:
    detail = cut(np.vstack([plane(30_000), [[9e5, 9e5, 9e5]]]), CONFIG)
    assert detail.count(FINE) == 30_001
    assert detail.count(COARSE) > 100


def test_a_small_scan_is_sent_at_once() -> None:
    detail = cut(plane(900), CONFIG)
    assert detail.count(COARSE) == 900


def test_few_points_while_the_view_turns() -> None:
    detail = cut(plane(40_000), CONFIG)
    levels = wanted_levels(detail, sight(100), CONFIG, is_moving=True)
    assert set(levels) == {COARSE}


def test_more_where_the_viewer_is_near_and_looks_and_never_over_the_budget() -> None:
    detail = cut(plane(40_000), CONFIG)
    near = wanted_levels(detail, sight(300), CONFIG, is_moving=False)
    far = wanted_levels(detail, sight(30_000), CONFIG, is_moving=False)
    away = wanted_levels(detail, sight(300, aside_rad=np.pi), CONFIG, is_moving=False)
    assert FINE in near
    assert FINE not in far
    assert FINE not in away
    drawn = sum(tile.count(level) for tile, level in zip(detail.tiles, near, strict=True))
    assert drawn <= CONFIG.still_points
    # what is fine lies nearer than what is not
    distance = np.array([np.linalg.norm(tile.centre_mm[:2]) for tile in detail.tiles])
    fine = np.array(near) == FINE
    assert distance[fine].mean() < distance[~fine].mean()


@pytest.mark.parametrize(
    "change", [{"port": -1}, {"port": 70_000}, {"first_points": 1}, {"detail_px": float("nan")}]
)
def test_impossible_settings_are_refused(change: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match=next(iter(change))):
        ViewerConfig(**change)  # type: ignore[arg-type] - wrong on purpose
