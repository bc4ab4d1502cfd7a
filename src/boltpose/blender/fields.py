"""The panel's fields as a table, from which Blender's properties and its layout are made."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from enum import StrEnum
from typing import Any

from boltpose.blender.panel import (
    HEADS,
    NOSE_STYLES,
    PLAIN,
    Dimensions,
    PanelValues,
)
from boltpose.factory.families import FAMILIES
from boltpose.factory.spec import (
    GearboxSpec,
    GearSpec,
    HousingSpec,
    NoseSpec,
    SolenoidSpec,
    SpecModel,
)


class Kind(StrEnum):
    """Which of Blender's properties a field becomes."""

    FLOAT = "float"
    INT = "int"
    BOOL = "bool"
    CHOICE = "choice"
    FILE = "file"


@dataclass(frozen=True, slots=True, kw_only=True)
class PanelField:
    """One line of the panel."""

    name: str
    """Of `PanelValues` or `Dimensions`."""
    label: str
    kind: Kind
    description: str
    """What the tool tip says."""
    choices: tuple[str, ...] = ()
    limits: tuple[float, float] | None = None
    """Smallest and largest value that can be typed; None for any."""
    shown_if: str | None = None
    """Name of the switch without which this field means nothing."""

    def default(self) -> Any:
        """What a new panel shows."""
        return getattr(Dimensions() if self.is_dimension else PanelValues(), self.name)

    @property
    def is_dimension(self) -> bool:
        """Whether it counts only when dimensions are set by hand."""
        return self.name in _DIMENSIONS


_DIMENSIONS = frozenset(field.name for field in fields(Dimensions))


def limits_of(model: type[SpecModel], field: str) -> tuple[float, float]:
    """Smallest and largest value of a specification's field, as pydantic checks it."""
    low, high = float("-inf"), float("inf")
    for rule in model.model_fields[field].metadata:
        for name in ("gt", "ge"):
            low = max(low, float(getattr(rule, name, low)))
        for name in ("lt", "le"):
            high = min(high, float(getattr(rule, name, high)))
    return low, high


def _length(
    name: str, label: str, model: type[SpecModel], field: str, *, shown_if: str | None = None
) -> PanelField:
    """A length whose limits and tool tip are the specification's own."""
    info = model.model_fields[field]
    return PanelField(
        name=name,
        label=f"{label} (mm)",
        kind=Kind.FLOAT,
        description=info.description or f"{label}, mm",
        limits=limits_of(model, field),
        shown_if=shown_if,
    )


PANEL_FIELDS: tuple[PanelField, ...] = (
    PanelField(
        name="family",
        label="Family",
        kind=Kind.CHOICE,
        description="Topology that the motor is drawn from",
        choices=(PLAIN, *FAMILIES),
    ),
    PanelField(
        name="seed",
        label="Seed",
        kind=Kind.INT,
        description="Another number draws another motor of the family",
        limits=(0, 2**31 - 1),
    ),
    PanelField(
        name="spec_file",
        label="MotorSpec",
        kind=Kind.FILE,
        description="A motor written down as JSON; it takes the place of family and seed",
    ),
    PanelField(
        name="worn",
        label="Wear",
        kind=Kind.BOOL,
        description="Rust, dents and dirt, drawn from the seed",
    ),
    PanelField(
        name="by_hand",
        label="Own dimensions",
        kind=Kind.BOOL,
        description="Off: what was drawn is shown; on: what is shown counts",
    ),
    _length("yoke_radius_mm", "Yoke radius", HousingSpec, "radius_mm"),
    _length("yoke_length_mm", "Yoke length", HousingSpec, "length_mm"),
    PanelField(
        name="has_gearbox",
        label="Gearbox",
        kind=Kind.BOOL,
        description="A reduction gear's ring between yoke and bracket",
    ),
    _length("gearbox_length_mm", "Length", GearboxSpec, "length_mm", shown_if="has_gearbox"),
    PanelField(
        name="nose_style",
        label="Nose",
        kind=Kind.CHOICE,
        description="What stands around the pinion",
        choices=NOSE_STYLES,
    ),
    _length("nose_length_mm", "Nose length", NoseSpec, "length_mm"),
    PanelField(
        name="has_solenoid",
        label="Solenoid",
        kind=Kind.BOOL,
        description="The solenoid beside the yoke",
    ),
    _length("solenoid_radius_mm", "Radius", SolenoidSpec, "radius_mm", shown_if="has_solenoid"),
    _length("solenoid_length_mm", "Length", SolenoidSpec, "length_mm", shown_if="has_solenoid"),
    _length("solenoid_offset_mm", "Offset", SolenoidSpec, "offset_mm", shown_if="has_solenoid"),
    PanelField(
        name="pinion_teeth",
        label="Pinion teeth",
        kind=Kind.INT,
        description="Number of teeth",
        limits=limits_of(GearSpec, "teeth"),
    ),
    PanelField(
        name="bolt_heads",
        label="Bolt heads",
        kind=Kind.CHOICE,
        description="One kind of head for all bolts, or as drawn",
        choices=HEADS,
    ),
)
"""All of them, in the order they are shown."""


def values_from(holder: Any) -> PanelValues:
    """Read the values off an object with one attribute per field."""
    read: Mapping[str, Any] = {field.name: getattr(holder, field.name) for field in PANEL_FIELDS}
    whole = {name: value for name, value in read.items() if name not in _DIMENSIONS}
    parts = {name: value for name, value in read.items() if name in _DIMENSIONS}
    return PanelValues(dimensions=Dimensions(**parts), **whole)


def show_dimensions(values: PanelValues, set_value: Callable[[str, Any], None]) -> None:
    """Hand every dimension to `set_value(name, value)`."""
    for field in PANEL_FIELDS:
        if field.is_dimension:
            set_value(field.name, getattr(values.dimensions, field.name))
