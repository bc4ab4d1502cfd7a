"""`WearSpec`: what use did to a motor, written down. Lengths in mm, shares 0 to 1."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from boltpose.factory.spec_fasteners import SpecModel


class WearSpec(SpecModel):
    """Wear of a motor. `WearSpec()` is a motor of some age, `NEW` one that nothing happened to."""

    warp_mm: float = Field(default=0.05, ge=0, le=0.3)
    """Largest deviation of castings and sheet metal from their drawing."""
    warp_wavelength_mm: float = Field(default=45, ge=10, le=300)
    roughness_mm: float = Field(default=0.02, ge=0, le=0.15)
    """Skin of castings and paint."""
    roughness_wavelength_mm: float = Field(default=5, ge=3, le=20)
    rust_mm: float = Field(default=0.1, ge=0, le=0.6)
    """Thickness of the crust where it is thickest."""
    rust_share: float = Field(default=0.3, ge=0, le=1)
    """Share of the surface under rust."""
    rust_patch_mm: float = Field(default=40, ge=8, le=200)
    """From one patch to the next."""
    rust_wavelength_mm: float = Field(default=6, ge=3, le=30)
    """Of the crust's own relief."""
    dirt_mm: float = Field(default=0.3, ge=0, le=1.5)
    """Thickness of caked dirt where it is thickest."""
    dirt_share: float = Field(default=0.12, ge=0, le=1)
    dirt_patch_mm: float = Field(default=30, ge=8, le=200)
    dents: int = Field(default=1, ge=0, le=20)
    """In yoke and solenoid."""
    dent_mm: float = Field(default=0.6, ge=0, le=3)
    """Depth of the deepest."""
    dent_radius_mm: float = Field(default=9, ge=3, le=40)
    chips: int = Field(default=2, ge=0, le=30)
    """Pieces broken off the edges of the bracket and the gearbox."""
    chip_mm: float = Field(default=2, ge=0.3, le=8)
    """Size of the largest."""
    grease: int = Field(default=1, ge=0, le=20)
    """Lumps of grease, most of them around pinion and flange."""
    grease_mm: float = Field(default=5, ge=1, le=20)
    """Radius of the largest."""
    bolt_share: float = Field(default=0.4, ge=0, le=1)
    """How much of rust and roughness bolts get; rusty ones get all of the rust."""
    clogged_share: float = Field(default=0.3, ge=0, le=1)
    """Share of the bolts whose drive is filled with dirt."""
    clogged: float = Field(default=0.6, ge=0, le=1)
    """How full the fullest is."""
    corner_wear: float = Field(default=0.15, ge=0, le=1)
    """How round the corners of hexagons are: 1 is round down to the flats."""
    edge_mm: float = Field(default=1.8, ge=0.8, le=20)
    """Longest edge of the refined meshes."""

    @property
    def bound_mm(self) -> float:
        """No vertex of a part, bolts left out, moves further than this."""
        dents = self.dent_mm if self.dents else 0.0
        return 1.75 * self.warp_mm + self.roughness_mm + self.rust_mm + self.dirt_mm + dents

    @property
    def bolt_bound_mm(self) -> float:
        """No vertex of a bolt moves further than this along its normal."""
        return self.bolt_share * self.roughness_mm + self.rust_mm


NEW = WearSpec(
    warp_mm=0,
    roughness_mm=0,
    rust_mm=0,
    dirt_mm=0,
    dents=0,
    chips=0,
    grease=0,
    clogged_share=0,
    corner_wear=0,
)
"""Nothing happened to it."""


def sample_wear(rng: np.random.Generator) -> WearSpec:
    """Draw the wear of one motor, from hardly used to found in a field."""
    age = float(rng.beta(1.6, 1.8))

    def draw(low: float, high: float) -> float:
        return float(round(rng.uniform(low, high), 3))

    return WearSpec(
        warp_mm=draw(0.02, 0.1),
        warp_wavelength_mm=draw(30, 80),
        roughness_mm=draw(0.0, 0.04),
        roughness_wavelength_mm=draw(4, 8),
        rust_mm=draw(0.02, 0.06 + 0.2 * age),
        rust_share=draw(0, 0.15 + 0.6 * age),
        rust_patch_mm=draw(15, 70),
        rust_wavelength_mm=draw(3.5, 12),
        dirt_mm=draw(0.05, 0.2 + 0.6 * age),
        dirt_share=draw(0, 0.05 + 0.25 * age),
        dirt_patch_mm=draw(15, 60),
        dents=int(rng.poisson(0.3 + 1.5 * age)),
        dent_mm=draw(0.2, 0.5 + 1.0 * age),
        dent_radius_mm=draw(4, 15),
        chips=int(rng.poisson(0.5 + 3 * age)),
        chip_mm=draw(0.8, 3.5),
        grease=int(rng.poisson(1.2 * age)),
        grease_mm=draw(2, 9),
        bolt_share=draw(0.2, 0.6),
        clogged_share=draw(0, 0.2 + 0.5 * age),
        clogged=draw(0.2, 1),
        corner_wear=draw(0, 0.05 + 0.4 * age),
    )
