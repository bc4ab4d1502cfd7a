"""Settings of every stage between a scan and its poses."""

from __future__ import annotations

from dataclasses import dataclass, field

from boltpose.errors import ConfigError
from boltpose.placement import PlacementConfig
from boltpose.registration.config import RegistrationConfig, VerifyConfig, VisibilityConfig
from boltpose.registration.extra_heads import ExtraHeadConfig
from boltpose.registration.head_sight import BoltStateConfig
from boltpose.tool_fit import ToolTolerance


@dataclass(frozen=True, slots=True, kw_only=True)
class LocateConfig:
    """Settings of every stage between a scan and its poses."""

    max_points: int = 200_000
    """Of a larger scan so many points are chosen for segmentation and registration: 2.3 M points
    are then as fast and as accurate as 0.2 M (FINDINGS, section 1, "Budget")."""
    max_near_points: int = 300_000
    """Of more scan points around the motor so many are chosen to judge its bolts."""
    max_state_points: int = 1_000_000
    """Of more scan points so many are chosen to tell whether the bolts are still there."""
    min_motor_probability: float = 0.5
    """Scan points from this probability on are taken for the motor."""
    relabel_mm: float = 1.5
    """After registration the motor is what lies this near to the posed prior; 0 keeps the
    network's labels. Raised 96 to 99.8 % of right labels (FINDINGS, section 2)."""
    label_scan: bool = False
    """Fill `LocateResult.motor_mask`: pictures and reports want it, a robot does not."""
    registration: RegistrationConfig = field(default_factory=RegistrationConfig)
    verification: VerifyConfig = field(default_factory=VerifyConfig)
    visibility: VisibilityConfig = field(default_factory=VisibilityConfig)
    bolt_state: BoltStateConfig = field(default_factory=BoltStateConfig)
    extra_heads: ExtraHeadConfig = field(default_factory=ExtraHeadConfig)
    placement: PlacementConfig = field(default_factory=PlacementConfig)
    tool: ToolTolerance | None = None
    """What the tool forgives; given, `LocatedBolt.p_tool_fits` is filled."""

    def __post_init__(self) -> None:
        for name in ("max_points", "max_near_points", "max_state_points"):
            if not getattr(self, name) >= 1000:
                raise ConfigError(f"{name} must be >= 1000, got {getattr(self, name)}")
        if not 0 < self.min_motor_probability < 1:
            raise ConfigError(
                f"min_motor_probability must be in (0, 1), got {self.min_motor_probability}"
            )
        if not 0 <= self.relabel_mm < 10:
            raise ConfigError(f"relabel_mm must be in [0, 10), got {self.relabel_mm}")
