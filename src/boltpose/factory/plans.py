"""Families of starter motors as tables of ranges: what a draw may choose from.

The ranges span what is built into motorcycles and cars up to trucks, from the published
dimension drawings of direct-drive, planetary and offset reduction starters in general; they
describe no make, and no data set was fitted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Range = tuple[float, float]
NoseStyle = Literal["closed", "open", "stub"]
FlangeStyle = Literal["ears", "round", "polygon"]
CapStyle = Literal["flat", "domed", "stepped", "spider"]
Thread = Literal[4, 5, 6, 8]


@dataclass(frozen=True, slots=True, kw_only=True)
class FamilyPlan:
    """One topology. Ranges are smallest and largest values, tuples of words are choices."""

    name: str
    about: str
    yoke_radius_mm: Range
    yoke_aspect: Range
    """Length of the yoke in radii."""
    gear_train: Literal["direct", "planetary", "offset", "coaxial"] = "direct"
    """`coaxial`: an offset gear whose pinion stands in front of the solenoid."""
    nose: tuple[NoseStyle, ...] = ("closed",)
    flange: tuple[FlangeStyle, ...] = ("ears", "round", "polygon")
    ears: tuple[int, ...] = (2, 3)
    solenoid: Literal["none", "short", "normal", "long"] = "normal"
    has_lever_housing: float = 1.0
    """Probability; without it there is a boot or a plain pad."""
    caps: tuple[CapStyle, ...] = ("flat", "domed", "stepped")
    module_mm: Range = (2.0, 2.6)
    teeth: tuple[int, int] = (8, 11)
    bracket_aspect: Range = (0.55, 0.95)
    """Length of the bracket's body in radii of the yoke."""
    bolts: tuple[int, int] = (5, 11)
    threads: tuple[Thread, ...] = (4, 5, 6)
    outer_through_bolts: float = 0.06
    """Probability that long bolts run outside the yoke."""
    is_cast_iron: float = 0.1
    free_gap_mm: Range = (2, 8)
    """From flange to clutch."""


PLANS: tuple[FamilyPlan, ...] = (
    FamilyPlan(
        name="direct_closed",
        about="car, direct drive, bell nose with a window",
        yoke_radius_mm=(33, 44),
        yoke_aspect=(2.2, 3.1),
        ears=(2, 2, 3),
    ),
    FamilyPlan(
        name="direct_open",
        about="car, direct drive, pinion in the open under an arm with the front bearing",
        yoke_radius_mm=(32, 43),
        yoke_aspect=(2.2, 3.0),
        nose=("open",),
        ears=(2, 2, 3),
    ),
    FamilyPlan(
        name="direct_stub",
        about="car, direct drive, pinion standing free before a collar",
        yoke_radius_mm=(32, 42),
        yoke_aspect=(2.0, 2.9),
        nose=("stub",),
        ears=(2, 3),
    ),
    FamilyPlan(
        name="direct_long_solenoid",
        about="van, direct drive, solenoid nearly as long as the yoke",
        yoke_radius_mm=(38, 50),
        yoke_aspect=(2.4, 3.3),
        nose=("closed", "open"),
        solenoid="long",
        ears=(2, 3, 3),
        module_mm=(2.3, 3.0),
        threads=(5, 6),
    ),
    FamilyPlan(
        name="direct_boot",
        about="older car, solenoid on a pad with a rubber boot, linkage in the open",
        yoke_radius_mm=(36, 48),
        yoke_aspect=(2.3, 3.2),
        nose=("closed", "open"),
        has_lever_housing=0.0,
        caps=("flat", "spider", "stepped"),
        outer_through_bolts=0.15,
    ),
    FamilyPlan(
        name="planetary_closed",
        about="car, planetary gear, bell nose",
        yoke_radius_mm=(29, 38),
        yoke_aspect=(1.7, 2.5),
        gear_train="planetary",
        bolts=(6, 12),
    ),
    FamilyPlan(
        name="planetary_open",
        about="car, planetary gear, open nose",
        yoke_radius_mm=(29, 38),
        yoke_aspect=(1.7, 2.5),
        gear_train="planetary",
        nose=("open",),
        bolts=(6, 12),
    ),
    FamilyPlan(
        name="planetary_stub",
        about="car, planetary gear, free pinion, short solenoid",
        yoke_radius_mm=(28, 37),
        yoke_aspect=(1.6, 2.4),
        gear_train="planetary",
        nose=("stub",),
        solenoid="short",
        bolts=(5, 12),
    ),
    FamilyPlan(
        name="offset_lever",
        about="car, offset reduction gear, lever to a solenoid above",
        yoke_radius_mm=(32, 42),
        yoke_aspect=(1.8, 2.6),
        gear_train="offset",
        nose=("closed", "stub", "open"),
        bolts=(6, 14),
    ),
    FamilyPlan(
        name="offset_coaxial",
        about="offset reduction gear with the pinion in line with the solenoid",
        yoke_radius_mm=(31, 42),
        yoke_aspect=(1.9, 2.7),
        gear_train="coaxial",
        nose=("closed", "stub"),
        has_lever_housing=0.0,
        bolts=(6, 14),
    ),
    FamilyPlan(
        name="compact_short",
        about="small car, everything short, spider or domed cap",
        yoke_radius_mm=(26, 33),
        yoke_aspect=(1.6, 2.2),
        gear_train="planetary",
        nose=("closed", "stub", "open"),
        solenoid="short",
        caps=("spider", "domed", "flat"),
        module_mm=(1.6, 2.2),
        threads=(4, 5),
        bolts=(4, 9),
    ),
    FamilyPlan(
        name="heavy_closed",
        about="truck, direct drive, cast-iron bell nose",
        yoke_radius_mm=(52, 70),
        yoke_aspect=(2.4, 3.3),
        solenoid="long",
        ears=(3, 3, 2),
        module_mm=(2.8, 3.9),
        teeth=(9, 12),
        threads=(5, 6, 8, 8),
        is_cast_iron=0.6,
        flange=("round", "ears", "polygon"),
        bolts=(7, 14),
        free_gap_mm=(4, 16),
    ),
    FamilyPlan(
        name="heavy_stub",
        about="truck, planetary gear, free pinion before a round flange",
        yoke_radius_mm=(44, 58),
        yoke_aspect=(1.9, 2.8),
        gear_train="planetary",
        nose=("stub",),
        solenoid="long",
        ears=(3, 3, 4),
        module_mm=(2.6, 3.6),
        teeth=(9, 13),
        threads=(5, 6, 8),
        is_cast_iron=0.5,
        flange=("round", "polygon"),
        bolts=(8, 14),
    ),
    FamilyPlan(
        name="motorcycle",
        about="no solenoid: slim yoke, small flange to one side, free pinion",
        yoke_radius_mm=(20, 31),
        yoke_aspect=(2.6, 4.0),
        nose=("stub",),
        solenoid="none",
        ears=(2, 2, 3),
        flange=("ears", "polygon"),
        module_mm=(1.3, 1.9),
        teeth=(8, 11),
        bracket_aspect=(0.6, 1.0),
        threads=(4, 5, 6),
        outer_through_bolts=0.12,
        bolts=(4, 7),
    ),
    FamilyPlan(
        name="inertia",
        about="no solenoid: inertia drive, pinion far out on a long shaft",
        yoke_radius_mm=(36, 52),
        yoke_aspect=(2.4, 3.4),
        nose=("stub", "open"),
        solenoid="none",
        ears=(2, 3),
        flange=("round", "ears"),
        free_gap_mm=(14, 34),
        bolts=(4, 9),
    ),
    FamilyPlan(
        name="outboard",
        about="no solenoid: outboard or lawn engine, four ears or a polygon plate, closed cap",
        yoke_radius_mm=(28, 40),
        yoke_aspect=(2.0, 3.2),
        nose=("stub", "closed"),
        solenoid="none",
        ears=(2, 4, 3),
        flange=("polygon", "round"),
        module_mm=(1.6, 2.2),
        outer_through_bolts=0.2,
        bolts=(4, 8),
    ),
)
"""All families, in the order of `FAMILIES`."""
