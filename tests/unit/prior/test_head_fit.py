from __future__ import annotations

import numpy as np
import pytest

from boltpose.errors import ConfigError
from boltpose.prior.head_fit import HeadFit, HeadFitConfig, fit_head
from boltpose.schema import Side
from tests.support.toy_heads import PLATE_MM, ToyHead, toy_plate


def fit_one(head: ToyHead, start: tuple[float, float], seed: int = 0) -> HeadFit:
    plate = toy_plate([head], seed=seed)
    above = plate.points[:, 2] > 0
    top = PLATE_MM / 2 - head.sunk + head.height
    fit = fit_head(
        plate.points[above] - (0.0, 0.0, top),
        plate.normals[above],
        np.array(start),
        HeadFitConfig(),
    )
    assert fit is not None
    return fit


@pytest.mark.parametrize("corners", [0, 6], ids=["round", "hexagon"])
@pytest.mark.parametrize("radius", [3.5, 5.0, 6.5])
def test_centre_and_spanner_size_of_a_head(corners: int, radius: float) -> None:
    head = ToyHead(x=3.2, y=-4.7, radius=radius, corners=corners)
    fit = fit_one(head, (4.4, -4.0))
    np.testing.assert_allclose(fit.centre_mm, (3.2, -4.7), atol=0.06)
    assert fit.radius_mm == pytest.approx(radius, abs=0.06)
    assert fit.support > 10
    assert fit.sigma_mm < 0.05


def test_a_head_seen_from_one_side_is_not_pulled_there() -> None:
    head = ToyHead(x=0.0, y=0.0, seen_from_deg=20.0, seen_deg=210.0)
    fit = fit_one(head, (1.0, 0.8))
    np.testing.assert_allclose(fit.centre_mm, (0.0, 0.0), atol=0.2)


def test_the_less_flank_is_seen_the_lower_the_support() -> None:
    supports = [
        fit_one(ToyHead(x=0.0, y=0.0, corners=0, seen_deg=seen), (0.3, 0.2)).support
        for seen in (360.0, 240.0, 180.0, 130.0)
    ]
    assert supports == sorted(supports, reverse=True)
    assert supports[0] > 10 > 3 > supports[-1]


def test_the_wall_of_a_counterbore_does_not_count() -> None:
    head = ToyHead(x=0.0, y=0.0, corners=0, sunk=4.0)
    fit = fit_one(head, (0.8, -0.5))
    np.testing.assert_allclose(fit.centre_mm, (0.0, 0.0), atol=0.05)
    assert fit.radius_mm == pytest.approx(5.0, abs=0.05)


def test_a_bare_plate_has_no_head() -> None:
    plate = toy_plate([])
    above = plate.points[:, 2] > 0
    points = plate.points[above] - (0.0, 0.0, PLATE_MM / 2)
    assert fit_head(points, plate.normals[above], np.zeros(2), HeadFitConfig()) is None


def test_a_handful_of_points_is_no_head() -> None:
    points = np.zeros((5, 3))
    normals = np.tile([1.0, 0.0, 0.0], (5, 1))
    assert fit_head(points, normals, np.zeros(2), HeadFitConfig()) is None


def test_sigma_covers_the_error_of_half_seen_heads() -> None:
    ratio = []
    for seed in range(20):
        head = ToyHead(x=0.0, y=0.0, seen_from_deg=18.0 * seed, seen_deg=240.0, side=Side.TOP)
        fit = fit_one(head, (0.5, 0.0), seed)
        ratio.append(float(np.linalg.norm(fit.centre_mm)) / np.hypot(1.5 * fit.sigma_mm, 0.05))
    assert np.mean(np.array(ratio) < 2.448) >= 0.9


@pytest.mark.parametrize(
    "settings",
    [
        {"radius_range_mm": (5.0, 4.0)},
        {"depth_mm": (0.0, 4.0)},
        {"start_radii_mm": ()},
        {"cutoffs_mm": ()},
        {"start_shift_mm": float("nan")},
        {"max_face_offset_mm": -1.0},
    ],
)
def test_settings_out_of_range_are_refused(settings: dict) -> None:
    with pytest.raises(ConfigError):
        HeadFitConfig(**settings)
