"""What a data set holds: the settings that, with a sample's number, decide every byte of it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from enum import StrEnum
from typing import Any

from pydantic import TypeAdapter, ValidationError

from boltpose.errors import ConfigError

MAX_SIDE_PX = 4096
"""Larger than any camera modelled here."""


class Kind(StrEnum):
    """The two kinds of data sets."""

    MOTORS = "motors"
    """Full scans without a clamp, for part segmentation."""
    SCENES = "scenes"
    """Full scans and views of the motor in clamps: the layout of reman18."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DataSetSettings:
    """Everything a sample follows from, but its number and the version of this package.

    How many samples there are is no setting: a data set grows by asking for more.
    """

    kind: Kind
    seed: int = 0
    families: tuple[str, ...]
    """Topologies to draw from; sample i is of family i modulo their number, so all are as
    frequent."""
    views: int = 0
    """Clampings per motor; 0 for motors alone."""
    angles: int = 1
    """Shots of every clamping, by one camera from places round it."""
    clamps: tuple[str, ...] = ()
    """Clamp designs to draw from."""
    width_px: int = 1224
    height_px: int = 1024
    """Size of the views: a quarter of the pixels of a 5 MP camera, as users of such cameras
    subsample them."""
    with_wear: bool = True
    """False: motors as new."""
    with_changes: bool = True
    """False: the clamped motor is exactly the one that was scanned."""

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise ConfigError(f"seed must be >= 0, got {self.seed}")
        if not self.families:
            raise ConfigError("families must name at least one, got none")
        for name in ("width_px", "height_px"):
            value = getattr(self, name)
            if not 64 <= value <= MAX_SIDE_PX:
                raise ConfigError(f"{name} must be 64 to {MAX_SIDE_PX}, got {value}")
        if self.kind is Kind.MOTORS and (self.views or self.clamps):
            raise ConfigError("a data set of motors alone has neither views nor clamps")
        if self.kind is Kind.SCENES and not 1 <= self.views <= 1000:
            raise ConfigError(f"views must be 1 to 1000, got {self.views}")
        if not 1 <= self.angles <= 100:
            raise ConfigError(f"angles must be 1 to 100, got {self.angles}")
        if self.kind is Kind.MOTORS and self.angles != 1:
            raise ConfigError("a data set of motors alone has no angles")
        if self.kind is Kind.SCENES and not self.clamps:
            raise ConfigError("clamps must name at least one, got none")

    def family_of(self, sample: int) -> str:
        """The family of a sample."""
        return self.families[sample % len(self.families)]

    def clamp_of(self, sample: int, view: int) -> str:
        """The clamp design of a view: all are as frequent, and differ within a motor."""
        # an odd stride over the motors, so that no family always meets the same designs
        return self.clamps[
            (sample * self.views + view + sample // len(self.clamps)) % len(self.clamps)
        ]

    def to_json(self) -> dict[str, Any]:
        """JSON-ready, fields in order."""
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in asdict(self).items()
            # data sets of one shot per clamping say nothing of angles, as before there were any
            if name != "angles" or value != 1
        }

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> DataSetSettings:
        """Read what `to_json` wrote.

        Raises:
            ConfigError: A field is missing, unknown or out of its range.
        """
        known = {field.name for field in fields(cls)}
        if set(data) | {"angles"} != known:
            raise ConfigError(f"settings must have the fields {sorted(known)}, got {sorted(data)}")
        try:
            return TypeAdapter(cls).validate_python(data)
        except ValidationError as error:
            raise ConfigError(
                f"settings that cannot be read ({error.errors()[0]['msg']})"
            ) from error


def choose_names(asked: str | None, known: tuple[str, ...], what: str) -> tuple[str, ...]:
    """Pick names from a list.

    Args:
        asked: Names with commas between, None for all.
        known: What there is.
        what: For the error text, for example `family`.

    Returns:
        The chosen ones, each once, in the order of `known`.

    Raises:
        ConfigError: A name is unknown.
    """
    if asked is None:
        return known
    names = [name.strip() for name in asked.split(",") if name.strip()]
    unknown = [name for name in names if name not in known]
    if unknown or not names:
        shown = f"'{unknown[0]}'" if unknown else "none"
        raise ConfigError(f"{what} must be one of {', '.join(known)}; got {shown}")
    return tuple(name for name in known if name in names)


def parse_size(text: str) -> tuple[int, int]:
    """Read `1224x1024` as width and height in pixels.

    Raises:
        ConfigError: It is no such text.
    """
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise ConfigError(f"size must be WIDTHxHEIGHT like 1224x1024, got '{text}'")
    return int(width), int(height)
