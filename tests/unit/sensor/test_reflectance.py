from __future__ import annotations

import numpy as np
import pytest

from boltpose.factory.model import Material
from boltpose.sensor.reflectance import (
    REFLECTANCES,
    Finish,
    Surface,
    paint_surface,
    returned_light,
)
from tests.unit.sensor.shapes import slab


def test_every_material_reflects_less_than_it_gets() -> None:
    assert set(REFLECTANCES) == set(Material)
    for row in REFLECTANCES.values():
        assert 0 < row.albedo + row.mirror < 1
        assert 0.05 < row.roughness < 1


@pytest.mark.parametrize("roughness", [0.1, 0.25, 0.5])
def test_the_highlight_hands_on_no_more_light_than_its_mirror_takes(roughness: float) -> None:
    """Integrate the lobe over all eyes above the surface: Monte Carlo, lamp along the normal."""
    rng = np.random.default_rng(0)
    eyes = rng.standard_normal((400000, 3))
    eyes /= np.linalg.norm(eyes, axis=1)[:, None]
    eyes[:, 2] = np.abs(eyes[:, 2])
    half = eyes + (0, 0, 1)
    half /= np.linalg.norm(half, axis=1)[:, None]
    count = len(eyes)
    ones = np.ones(count, dtype=np.float32)
    surface = Surface(albedo=0 * ones, mirror=ones, roughness=np.float32(roughness) * ones)

    _, highlight = returned_light(
        surface, ones, eyes[:, 2].astype(np.float32), half[:, 2].astype(np.float32), ones
    )

    # the unit is a matt white surface: radiance 1 / pi; hemisphere 2 pi
    energy = float(np.mean(highlight * eyes[:, 2]) * 2)
    assert 0.7 < energy < 1.05


def test_the_highlight_is_brightest_in_the_mirror_direction() -> None:
    cos_half = np.cos(np.linspace(0, 1.2, 50)).astype(np.float32)
    ones = np.ones(50, dtype=np.float32)
    surface = Surface(albedo=ones, mirror=ones, roughness=np.float32(0.2) * ones)

    _, highlight = returned_light(surface, ones, ones, cos_half, ones)

    assert highlight.argmax() == 0
    assert highlight[-1] < 1e-3 * highlight[0]


def test_stains_look_the_same_from_everywhere() -> None:
    rng = np.random.default_rng(0)
    solids = [slab(Material.ZINC), slab(Material.BLACK_PLASTIC)]
    points = rng.uniform(-100, 100, (1000, 3))
    index = rng.integers(0, 2, 1000)
    some = np.flatnonzero(rng.random(1000) < 0.3)

    whole = paint_surface(solids, points, index, Finish(), np.random.default_rng(1))
    part = paint_surface(solids, points[some], index[some], Finish(), np.random.default_rng(1))

    np.testing.assert_array_equal(whole.albedo[some], part.albedo)
    np.testing.assert_array_equal(whole.roughness[some], part.roughness)


def test_rust_covers_its_share_of_what_rusts() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-300, 300, (50000, 3))
    solids = [slab(Material.BARE_STEEL), slab(Material.COPPER)]
    finish = Finish(spread=0, stains=0, rust_share=0.2)

    shares = []
    for solid in (0, 1):
        index = np.full(len(points), solid)
        surface = paint_surface(solids, points, index, finish, np.random.default_rng(2))
        clean = np.float32(REFLECTANCES[solids[solid].material].mirror)
        shares.append(float(np.mean(surface.mirror < clean / 2)))

    assert abs(shares[0] - 0.2) < 0.05
    assert shares[1] == 0
