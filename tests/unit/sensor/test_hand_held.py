from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from boltpose.errors import EmptyScanError
from boltpose.factory.model import Material
from boltpose.factory.solids import box, cylinder
from boltpose.sensor.hand_held import HandHeldScan, scan_motor
from boltpose.sensor.hand_held_config import HandHeldConfig
from boltpose.sensor.raycast import RayCaster
from tests.unit.sensor.shapes import CLEAN, as_solid, distance_to_solids, toy_motor

MOTOR = toy_motor()
CASTER = RayCaster(MOTOR)
CONFIG = HandHeldConfig(directions=20, pitch_mm=1.5, cell_mm=2.0)


def scan(config: HandHeldConfig, seed: int = 0) -> HandHeldScan:
    return scan_motor(CASTER, config, np.random.default_rng(seed))


def cells(points: np.ndarray, cell_mm: float) -> np.ndarray:
    """Shape (N, 3): cell numbers on any grid aligned with the axes."""
    return np.floor((points - points.min(axis=0)) / cell_mm)


@pytest.mark.parametrize("seed", [0, 1])
def test_without_noise_the_cloud_lies_on_the_mesh_with_its_labels(seed: int) -> None:
    result = scan(CONFIG.noiseless(), seed)

    chosen = np.random.default_rng(seed).integers(0, len(result.points), 400)
    distances = distance_to_solids(result.points[chosen], MOTOR)
    assert distances.min(axis=0).max() < 1e-6
    index = result.solid_index[chosen]
    assert distances[index, np.arange(400)].max() < 1e-6
    np.testing.assert_array_equal(result.labels[chosen], [int(MOTOR[row].part) for row in index])
    assert not result.is_stray.any()


def test_fusion_keeps_one_point_per_cell() -> None:
    config = CONFIG.noiseless()
    dense = scan(replace(config, cell_mm=0.05))

    result = scan(config)

    # the same sweeps, hardly fused: their cells of 2 mm are those that hold one point each
    low = dense.points.min(axis=0)
    occupied = np.unique(np.floor((dense.points - low) / 2.0), axis=0)
    kept = np.unique(np.floor((result.points - low) / 2.0), axis=0)
    assert len(result.points) == len(kept)
    assert len(kept) == pytest.approx(len(occupied), rel=0.002)


def test_the_same_seed_gives_the_same_bits_and_another_seed_does_not() -> None:
    first, second, other = scan(CONFIG, 5), scan(CONFIG, 5), scan(CONFIG, 6)

    for name in ("points", "labels", "solid_index", "is_stray"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    assert len(other.points) != len(first.points)


def test_threads_of_linear_algebra_change_no_bits() -> None:
    scans: list[HandHeldScan] = []
    for threads in (1, 2):
        with threadpool_limits(threads):
            scans.append(scan(CONFIG))
    np.testing.assert_array_equal(scans[0].points, scans[1].points)


def test_an_empty_cloud_is_an_error() -> None:
    dark = replace(CONFIG, min_signal=1e3, saturation_signal=1e4)
    with pytest.raises(EmptyScanError, match="0 points"):
        scan(dark)


def test_all_sides_are_scanned() -> None:
    block = as_solid(box((80, 80, 80)))
    result = scan_motor([block], CONFIG, np.random.default_rng(0))

    for axis in range(3):
        for side in (-40, 40):
            on_face = np.abs(result.points[:, axis] - side) < 0.3
            assert on_face.sum() > 0.6 * (80 / CONFIG.cell_mm) ** 2


def test_a_recess_too_deep_for_triangulation_stays_empty() -> None:
    """A hole of 10 mm: the detector sees its floor only down to about 10 mm / tan(angle)."""

    def floor_points(depth_mm: float, angle_deg: float) -> int:
        hole = cylinder(5, 40 - depth_mm, 50)
        block = as_solid(box((30, 30, 80)) - hole)
        config = replace(CONFIG, directions=60, pitch_mm=0.7, triangulation_deg=angle_deg)
        result = scan_motor([block], config.noiseless(), np.random.default_rng(1))
        radius = np.hypot(result.points[:, 0], result.points[:, 1])
        height = result.points[:, 2] - (40 - depth_mm)
        return int(((radius < 4.9) & (np.abs(height) < 1e-3)).sum())

    # light enters and leaves over at most the diameter: tan a + tan b <= d / depth with a + b fixed
    assert floor_points(5, 25) > 5
    assert floor_points(30, 40) == 0
    assert floor_points(30, 8) > 0


def test_noise_is_the_quoted_one_and_strips_are_off() -> None:
    plate = as_solid(box((120, 120, 4)), material=Material.GREY_PLASTIC)
    still = replace(
        CONFIG,
        cell_mm=0.4,
        noise_mm=0.05,
        noise_incidence=0.0,
        strip_shift_mm=0.0,
        strip_turn_deg=0.0,
        stray_share=0.0,
        missed_patches=0.0,
        max_incidence_deg=35.0,
        triangulation_deg=1.0,
        directions=40,
        finish=CLEAN,
    )

    def off(config: HandHeldConfig) -> np.ndarray:
        result = scan_motor([plate], config, np.random.default_rng(0))
        inner = (np.abs(result.points[:, :2]) < 55).all(axis=1)
        return np.abs(result.points[inner, 2]) - 2

    # along the beam, seen across the plate: cosines between cos 35 and 1
    assert 0.05 * 0.82 < off(still).std() < 0.05
    moved = off(replace(still, noise_mm=0.0, strip_shift_mm=0.1))
    assert 0.04 < moved.std() < 0.2
    assert np.abs(off(replace(still, noise_mm=0.0))).max() < 1e-6


def test_strays_are_few_and_far() -> None:
    config = replace(CONFIG, stray_share=0.02, noise_mm=0.01)
    result = scan(config)

    # fusion keeps strays more often: they have their cell for themselves
    assert 0.01 < result.is_stray.mean() < 0.25
    chosen = np.flatnonzero(result.is_stray)[:200]
    assert np.median(distance_to_solids(result.points[chosen], MOTOR).min(axis=0)) > 0.3
    surface = np.flatnonzero(~result.is_stray)[:300]
    assert distance_to_solids(result.points[surface], MOTOR).min(axis=0).max() < 0.3


def test_dark_surfaces_lose_points() -> None:
    def count(material: Material) -> int:
        block = as_solid(box((40, 40, 40)), material=material)
        config = replace(CONFIG, min_signal=0.05, missed_patches=0.0, finish=CLEAN)
        return len(scan_motor([block], config, np.random.default_rng(0)).points)

    assert count(Material.BLACK_PLASTIC) < 0.9 * count(Material.GREY_PLASTIC)
