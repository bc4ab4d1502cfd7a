"""From what a person set in Blender's panel to a specification; knows nothing of Blender."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, TypeVar, cast, get_args

import numpy as np
from pydantic import ValidationError

from boltpose.errors import ConfigError
from boltpose.factory.build import build_motor
from boltpose.factory.families import FAMILIES, sample_motor
from boltpose.factory.model import MotorModel
from boltpose.factory.spec import (
    GearboxSpec,
    MotorSpec,
    SolenoidSpec,
    SpecModel,
)
from boltpose.factory.spec_fasteners import BoltSpec, DistractorSpec, HeadKind, Site
from boltpose.factory.wear import wear_motor
from boltpose.factory.wear_spec import sample_wear
from boltpose.synthesis.user_model import read_spec

_Fastener = TypeVar("_Fastener", BoltSpec, DistractorSpec)
_Spec = TypeVar("_Spec", bound=SpecModel)

NoseStyle = Literal["closed", "open", "stub"]

PLAIN = "plain"
"""The family that is `MotorSpec()`: the same motor for every seed."""
AS_DRAWN = "as_drawn"
"""Heads stay as the family drew them."""
NOSE_STYLES: tuple[str, ...] = get_args(NoseStyle)
HEADS: tuple[str, ...] = (AS_DRAWN, *(str(kind) for kind in HeadKind))

_ROUNDING_MM = 1e-3
_SOLENOID_SITES = frozenset({Site.SOLENOID_FRONT, Site.SOLENOID_REAR, Site.SOLENOID_CAP})


@dataclass(frozen=True, slots=True, kw_only=True)
class Dimensions:
    """The dimensions that the panel offers, mm; the rest stays as drawn."""

    yoke_radius_mm: float = 37
    yoke_length_mm: float = 95
    has_gearbox: bool = False
    gearbox_length_mm: float = 24
    """Of no meaning without a gearbox."""
    nose_style: str = "closed"
    nose_length_mm: float = 48
    has_solenoid: bool = True
    solenoid_radius_mm: float = 25
    solenoid_length_mm: float = 66
    solenoid_offset_mm: float = 65
    """All three of no meaning without a solenoid."""
    pinion_teeth: int = 10
    bolt_heads: str = AS_DRAWN
    """A `HeadKind` for all bolts, or `AS_DRAWN`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PanelValues:
    """Everything that the panel holds."""

    family: str = PLAIN
    """One of `FAMILIES`, or `PLAIN`."""
    seed: int = 0
    spec_file: str = ""
    """A `MotorSpec` as JSON; it takes the place of family and seed."""
    by_hand: bool = False
    """True: `dimensions` count; False: they only show what was drawn."""
    dimensions: Dimensions = Dimensions()
    worn: bool = False
    """Rust, dents and dirt, drawn from the seed."""


def drawn_spec(values: PanelValues) -> MotorSpec:
    """Draw or read the motor before any dimension is set by hand.

    Raises:
        ConfigError: There is no such family.
        InputFileError: The file cannot be read or is no `MotorSpec`.
    """
    if values.spec_file:
        return read_spec(values.spec_file)
    if values.family == PLAIN:
        return MotorSpec()
    if values.family not in FAMILIES:
        raise ConfigError(f"family must be one of {', '.join(FAMILIES)}, got '{values.family}'")
    return sample_motor(np.random.default_rng(values.seed), values.family)


def first_mistake(error: ValidationError) -> str:
    """Say in one line where the first mistake of a specification is and what it is."""
    mistake = error.errors()[0]
    place = ".".join(str(step) for step in mistake["loc"])
    return f"{place}: {mistake['msg']}" if place else str(mistake["msg"])


def dimensions_of(spec: MotorSpec) -> Dimensions:
    """Read the panel's dimensions off a motor; defaults where it lacks the part."""
    plain = Dimensions()
    gearbox, solenoid = spec.gearbox, spec.solenoid
    return Dimensions(
        yoke_radius_mm=spec.housing.radius_mm,
        yoke_length_mm=spec.housing.length_mm,
        has_gearbox=gearbox is not None,
        gearbox_length_mm=gearbox.length_mm if gearbox else plain.gearbox_length_mm,
        nose_style=spec.bracket.nose.style,
        nose_length_mm=spec.bracket.nose.length_mm,
        has_solenoid=solenoid is not None,
        solenoid_radius_mm=solenoid.radius_mm if solenoid else plain.solenoid_radius_mm,
        solenoid_length_mm=solenoid.length_mm if solenoid else plain.solenoid_length_mm,
        solenoid_offset_mm=solenoid.offset_mm if solenoid else plain.solenoid_offset_mm,
        pinion_teeth=spec.gear.teeth,
    )


def with_dimensions(spec: MotorSpec, wanted: Dimensions) -> MotorSpec:
    """Give a motor other dimensions.

    What is mounted around the yoke moves with its mantle, so that a thicker yoke gets a wider
    bracket and no bolt ends up inside it.

    Raises:
        ConfigError: A dimension is out of its range.
    """
    try:
        return _with_dimensions(spec, wanted)
    except ValidationError as error:
        raise ConfigError(f"no such motor: {first_mistake(error)}") from error


def _with_dimensions(spec: MotorSpec, wanted: Dimensions) -> MotorSpec:
    """As above; pydantic's own error for what is out of range."""
    old = dimensions_of(spec)
    wanted = _settled(wanted, old)
    grown_mm = wanted.yoke_radius_mm - old.yoke_radius_mm
    housing = _changed(
        spec.housing, {"radius_mm": wanted.yoke_radius_mm, "length_mm": wanted.yoke_length_mm}
    )
    bracket = spec.bracket
    nose_changes: dict[str, Any] = {
        "style": wanted.nose_style,
        "length_mm": wanted.nose_length_mm,
        "window_length_mm": bracket.nose.window_length_mm
        * min(1.0, wanted.nose_length_mm / old.nose_length_mm),
    }
    bracket_changes: dict[str, Any] = {
        "radius_mm": bracket.radius_mm + grown_mm,
        "flange_radius_mm": _plus(bracket.flange_radius_mm, grown_mm),
        "ears": tuple(_changed(ear, {"reach_mm": ear.reach_mm + grown_mm}) for ear in bracket.ears),
        "nose": _changed(bracket.nose, nose_changes),
    }
    changes: dict[str, Any] = {
        "housing": housing,
        "rear_cap": _changed(
            spec.rear_cap, {"radius_mm": _plus(spec.rear_cap.radius_mm, grown_mm)}
        ),
        "gearbox": _gearbox(spec, wanted, grown_mm),
        "bracket": _changed(bracket, bracket_changes),
        "solenoid": _solenoid(spec, wanted, old, grown_mm),
        "gear": _changed(spec.gear, {"teeth": wanted.pinion_teeth}),
        "bolts": _moved(spec.bolts, wanted, old, grown_mm),
        "distractors": _moved(spec.distractors, wanted, old, grown_mm),
    }
    if wanted.bolt_heads != AS_DRAWN:
        changes["bolts"] = tuple(
            _changed(bolt, {"head": wanted.bolt_heads, "across_mm": None, "head_height_mm": None})
            for bolt in cast("Sequence[BoltSpec]", changes["bolts"])
        )
    return _changed(spec, changes)


def _settled(wanted: Dimensions, old: Dimensions) -> Dimensions:
    """Take lengths that only Blender's float32 rounded as the ones that were drawn."""
    drawn: dict[str, Any] = {}
    for field in fields(Dimensions):
        new, before = getattr(wanted, field.name), getattr(old, field.name)
        is_number = isinstance(before, int | float) and not isinstance(before, bool)
        if is_number and abs(new - before) < _ROUNDING_MM:
            drawn[field.name] = before
    return replace(wanted, **drawn)


def _gearbox(spec: MotorSpec, wanted: Dimensions, grown_mm: float) -> GearboxSpec | None:
    """The gearbox ring, a new one a little wider than the yoke."""
    if not wanted.has_gearbox:
        return None
    if spec.gearbox is None:
        return GearboxSpec(radius_mm=wanted.yoke_radius_mm + 2, length_mm=wanted.gearbox_length_mm)
    changes = {
        "radius_mm": spec.gearbox.radius_mm + grown_mm,
        "length_mm": wanted.gearbox_length_mm,
    }
    return _changed(spec.gearbox, changes)


def _solenoid(
    spec: MotorSpec, wanted: Dimensions, old: Dimensions, grown_mm: float
) -> SolenoidSpec | None:
    """The solenoid; it keeps its distance from the yoke unless its offset was set too."""
    if not wanted.has_solenoid:
        return None
    was_moved = wanted.solenoid_offset_mm != old.solenoid_offset_mm
    shift_mm = 0.0 if was_moved else grown_mm
    wider = wanted.solenoid_radius_mm / old.solenoid_radius_mm
    before = spec.solenoid or SolenoidSpec()
    cap_radius_mm = None if before.cap_radius_mm is None else before.cap_radius_mm * wider
    changes = {
        "radius_mm": wanted.solenoid_radius_mm,
        "length_mm": wanted.solenoid_length_mm,
        "offset_mm": wanted.solenoid_offset_mm + shift_mm,
        "cap_radius_mm": cap_radius_mm,
        "flange_radius_mm": _plus(
            before.flange_radius_mm, wanted.solenoid_radius_mm - old.solenoid_radius_mm
        ),
    }
    return _changed(before, changes)


def _moved(
    fasteners: Sequence[_Fastener], wanted: Dimensions, old: Dimensions, grown_mm: float
) -> tuple[_Fastener, ...]:
    """Fasteners outside the old yoke's core follow its mantle; those of no solenoid go."""
    result: list[_Fastener] = []
    for fastener in fasteners:
        if fastener.site in _SOLENOID_SITES:
            if wanted.has_solenoid:
                shift_mm = wanted.solenoid_radius_mm - old.solenoid_radius_mm
                result.append(_shifted(fastener, old.solenoid_radius_mm, shift_mm))
        elif fastener.site == Site.NOSE_FRONT:
            if wanted.nose_style == old.nose_style:
                result.append(fastener)
        else:
            result.append(_shifted(fastener, old.yoke_radius_mm, grown_mm))
    return tuple(result)


def _shifted(fastener: _Fastener, body_mm: float, shift_mm: float) -> _Fastener:
    """Further out by what the body grew, if it sits in the outer half of the body."""
    if fastener.radius_mm < 0.5 * body_mm:
        return fastener
    return _changed(fastener, {"radius_mm": fastener.radius_mm + shift_mm})


def _plus(value: float | None, more: float) -> float | None:
    """None stays None: it means "as the body"."""
    return None if value is None else value + more


def _changed(spec: _Spec, changes: dict[str, Any]) -> _Spec:
    """A checked copy: pydantic's own `model_copy` checks nothing."""
    return type(spec).model_validate(dict(spec) | changes)


def spec_of(values: PanelValues) -> MotorSpec:
    """The specification that the panel stands for.

    Raises:
        ConfigError: A dimension is out of its range, or there is no such family.
        InputFileError: The file cannot be read or is no `MotorSpec`.
    """
    spec = drawn_spec(values)
    return with_dimensions(spec, values.dimensions) if values.by_hand else spec


def model_of(values: PanelValues) -> MotorModel:
    """Build the motor that the panel stands for.

    Raises:
        BoltposeError: The file cannot be read, or there is no such motor.
    """
    model = build_motor(spec_of(values))
    if not values.worn:
        return model
    rng = np.random.default_rng((values.seed, 1))
    return wear_motor(model, sample_wear(rng), values.seed)


def showing(values: PanelValues) -> PanelValues:
    """The values with the dimensions of what was drawn, so that a person starts from those.

    Raises:
        ConfigError: There is no such family.
        InputFileError: The file cannot be read or is no `MotorSpec`.
    """
    if values.by_hand:
        return values
    return replace(values, dimensions=dimensions_of(drawn_spec(values)))
