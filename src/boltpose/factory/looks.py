"""How the factory's materials look to people: for pictures, exported models and Blender.

What a sensor sees of a material is another matter; see `sensor.reflectance`.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

from boltpose.factory.model import Material
from boltpose.schema import Part


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """Appearance of one material, as physically based renderers want it."""

    color: tuple[float, float, float]
    """Linear RGB, 0 to 1."""
    metallic: float = 0
    """1 for bare metal, 0 for paint, plastic, rust."""
    roughness: float = 0.6
    """0 is a mirror, 1 is chalk."""


LOOKS: MappingProxyType[Material, Look] = MappingProxyType(
    {
        Material.PAINTED_STEEL: Look(color=(0.055, 0.06, 0.065), roughness=0.45),
        Material.BARE_STEEL: Look(color=(0.42, 0.41, 0.39), metallic=1, roughness=0.35),
        Material.ZINC: Look(color=(0.52, 0.49, 0.36), metallic=1, roughness=0.32),
        Material.CAST_ALUMINIUM: Look(color=(0.56, 0.57, 0.58), metallic=0.8, roughness=0.62),
        Material.CAST_IRON: Look(color=(0.13, 0.125, 0.12), metallic=0.6, roughness=0.75),
        Material.BLACK_PLASTIC: Look(color=(0.022, 0.022, 0.024), roughness=0.55),
        Material.GREY_PLASTIC: Look(color=(0.22, 0.23, 0.25), roughness=0.6),
        Material.COPPER: Look(color=(0.62, 0.25, 0.12), metallic=1, roughness=0.4),
        Material.RUBBER: Look(color=(0.03, 0.03, 0.03), roughness=0.9),
        Material.RUST: Look(color=(0.21, 0.075, 0.03), roughness=0.95),
        Material.GREASE: Look(color=(0.16, 0.11, 0.04), roughness=0.2),
        Material.WOOD: Look(color=(0.42, 0.27, 0.14), roughness=0.8),
        Material.STRAP: Look(color=(0.5, 0.2, 0.04), roughness=0.85),
    }
)
"""Every material's look."""

PART_COLORS: MappingProxyType[Part, tuple[float, float, float]] = MappingProxyType(
    {
        Part.BACKGROUND: (0.604, 0.570, 0.507),
        Part.MAIN_HOUSING: (0.171, 0.319, 0.187),
        Part.CONNECTOR: (0.342, 0.570, 0.263),
        Part.SOLENOID: (0.890, 0.477, 0.119),
        Part.ELECTRICAL_CONNECTOR: (0.848, 0.729, 0.133),
        Part.GEAR: (0.233, 0.342, 0.848),
        Part.BOLT: (0.787, 0.073, 0.064),
    }
)
"""Linear RGB of every class: the colours of `picture.paint`, as light."""
