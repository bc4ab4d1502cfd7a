from __future__ import annotations

import numpy as np
import pytest

from boltpose.errors import ConfigError, UnitError
from boltpose.io.units import Unit, as_unit, check_extent, check_translation, robust_extent


@pytest.mark.parametrize(
    ("unit", "mm"), [(Unit.MM, 1), (Unit.M, 1000), (Unit.CM, 10), (Unit.INCH, 25.4)]
)
def test_millimetres_in_one(unit: Unit, mm: float) -> None:
    assert unit.mm == mm


def test_unknown_unit_lists_what_there_is() -> None:
    with pytest.raises(ConfigError, match="unknown unit 'km', there are mm, m, cm, inch"):
        as_unit("km")


@pytest.mark.parametrize("size_mm", [100, 350, 1500, 5000])
@pytest.mark.parametrize("unit", list(Unit))
def test_motors_and_cells_pass_in_their_own_unit(size_mm: float, unit: Unit) -> None:
    check_extent("a.ply", size_mm / unit.mm, unit, option="--scan-unit")


@pytest.mark.parametrize("size_mm", [100, 350, 1500, 2999])
def test_metres_taken_for_millimetres_are_refused(size_mm: float) -> None:
    with pytest.raises(UnitError, match=r"a\.ply.*extent.*looks like m: set --scan-unit m"):
        check_extent("a.ply", size_mm / 1000, Unit.MM, option="--scan-unit")


@pytest.mark.parametrize("size_mm", [100, 350, 1500])
def test_millimetres_taken_for_metres_are_refused(size_mm: float) -> None:
    with pytest.raises(UnitError, match="looks like mm: set --unit mm"):
        check_extent("a.ply", size_mm, Unit.M, option="--unit")


@pytest.mark.parametrize("unit", [Unit.CM, Unit.INCH])
@pytest.mark.parametrize("size_mm", [150, 250, 299])
def test_a_bare_motor_in_any_other_unit_is_refused_as_mm(size_mm: float, unit: Unit) -> None:
    with pytest.raises(UnitError):
        check_extent("a.ply", size_mm / unit.mm, Unit.MM, option="--scan-unit")


@pytest.mark.parametrize("extent", [0.0, np.inf, np.nan, 1e-9, 1e9])
def test_sizes_of_nothing_are_refused_without_a_suggestion(extent: float) -> None:
    with pytest.raises(UnitError, match="no unit fits"):
        check_extent("a.ply", extent, Unit.MM, option="--scan-unit")


@pytest.mark.parametrize("distance_mm", [300, 1000, 3000])
@pytest.mark.parametrize("unit", list(Unit))
def test_translations_pass_in_their_own_unit(distance_mm: float, unit: Unit) -> None:
    check_translation("a.yaml", distance_mm / unit.mm, unit, option="--hand-eye-unit")


@pytest.mark.parametrize("distance_mm", [6, 300, 1000, 4999])
def test_translations_in_metres_are_refused_as_mm(distance_mm: float) -> None:
    with pytest.raises(UnitError, match="looks like m: set --hand-eye-unit m"):
        check_translation("a.yaml", distance_mm / 1000, Unit.MM, option="--hand-eye-unit")


def test_translations_in_mm_are_refused_as_metres() -> None:
    with pytest.raises(UnitError, match="looks like mm: set --hand-eye-unit mm"):
        check_translation("a.yaml", 1200.0, Unit.M, option="--hand-eye-unit")


@pytest.mark.parametrize("unit", list(Unit))
def test_no_translation_at_all_is_legal(unit: Unit) -> None:
    check_translation("a.yaml", 0.0, unit, option="--hand-eye-unit")


def test_stray_points_do_not_hide_the_size() -> None:
    points = np.random.default_rng(0).uniform(-0.1, 0.1, (5000, 3))
    points[:25] = 800.0

    assert robust_extent(points) == pytest.approx(0.2, rel=0.05)
