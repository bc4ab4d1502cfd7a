"""How much light comes back: a matt part and a highlight per material, with stains and rust.

The unit of `signal` is the light that a matt white surface returns when it faces projector and
camera at the working distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from boltpose.arrays import Float32Array, FloatArray, IntArray
from boltpose.factory.model import Material, SolidPart
from boltpose.sensor.fields import surface_field

_MIN_COSINE = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Reflectance:
    """How a clean surface reflects visible light."""

    albedo: float
    """Share of the light that the matt part returns, 0 to 1."""
    mirror: float
    """Share that the rough mirror returns at normal incidence, 0 to 1."""
    roughness: float
    """Root mean square slope of the mirror's microfacets (Beckmann's m)."""
    rusts: bool = False
    """Whether rust patches grow on it."""


REFLECTANCES: dict[Material, Reflectance] = {
    # paint on a yoke: dark, half matt; 4 % is the Fresnel mirror of any lacquer
    Material.PAINTED_STEEL: Reflectance(albedo=0.20, mirror=0.04, roughness=0.30, rusts=True),
    # metals: normal reflectance of iron 0.56, zinc 0.6, aluminium 0.9, copper 0.6 in blue to
    # green light, shared between mirror and what tarnish and machining marks scatter
    Material.BARE_STEEL: Reflectance(albedo=0.22, mirror=0.34, roughness=0.20, rusts=True),
    Material.ZINC: Reflectance(albedo=0.32, mirror=0.28, roughness=0.24, rusts=True),
    Material.CAST_ALUMINIUM: Reflectance(albedo=0.42, mirror=0.25, roughness=0.38),
    Material.CAST_IRON: Reflectance(albedo=0.16, mirror=0.10, roughness=0.45, rusts=True),
    Material.COPPER: Reflectance(albedo=0.20, mirror=0.35, roughness=0.22),
    # carbon black leaves 3 to 5 %
    Material.BLACK_PLASTIC: Reflectance(albedo=0.045, mirror=0.04, roughness=0.25),
    Material.GREY_PLASTIC: Reflectance(albedo=0.28, mirror=0.04, roughness=0.30),
    Material.RUBBER: Reflectance(albedo=0.05, mirror=0.03, roughness=0.50),
    Material.RUST: Reflectance(albedo=0.11, mirror=0.01, roughness=0.60),
    Material.GREASE: Reflectance(albedo=0.06, mirror=0.04, roughness=0.12),
    Material.WOOD: Reflectance(albedo=0.35, mirror=0.03, roughness=0.50),
    Material.STRAP: Reflectance(albedo=0.16, mirror=0.02, roughness=0.50),
}
"""By material.

Source: normal reflectances of metals after Johnson and Christy, Phys. Rev. B 6 and 9 (1972, 1974);
albedos and roughness are estimates of ours in the ranges of Ward, SIGGRAPH 1992, table 1 (rolled
aluminium, white and grey paints, plastics). They are the middle of what `Finish` spreads.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Finish:
    """How far surfaces are from clean and equal."""

    spread: float = 0.25
    """Standard deviation of the logarithm of albedo, and of roughness, from part to part."""
    stains: float = 0.30
    """Standard deviation of the logarithm of albedo across one part."""
    stain_mm: float = 14.0
    """Size of stains and rust patches."""
    rust_share: float = 0.10
    """Share of the surface of rusting materials that is rusty, 0 to 1."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Surface:
    """The optical properties of points, one row each."""

    albedo: Float32Array
    mirror: Float32Array
    roughness: Float32Array


def paint_surface(
    solids: Sequence[SolidPart],
    points: FloatArray | Float32Array,
    solid_index: IntArray,
    finish: Finish,
    rng: np.random.Generator,
) -> Surface:
    """Look up the materials of points and age them.

    Stains belong to places on the solids, not to pixels, so they look the same from everywhere.

    Args:
        solids: All solids of the scene.
        points: Shape (N, 3), mm, frame of the solids.
        solid_index: Shape (N,), which solid each point is on.
        finish: How dirty.
        rng: Draws what differs from part to part and where stains are.

    Returns:
        One row per point.
    """
    table = [REFLECTANCES[solid.material] for solid in solids]
    part_factor = np.exp(finish.spread * rng.standard_normal(len(table)))
    rough_factor = np.exp(finish.spread * rng.standard_normal(len(table)))
    albedo = _column([row.albedo for row in table] * part_factor)[solid_index]
    mirror = _column([row.mirror for row in table])[solid_index]
    roughness = _column([row.roughness for row in table] * rough_factor)[solid_index]
    stain = surface_field(points, finish.stain_mm, rng)
    albedo *= np.exp(np.float32(finish.stains) * stain)
    field = surface_field(points, finish.stain_mm, rng)
    if finish.rust_share > 0:
        rusty = _column([float(row.rusts) for row in table])[solid_index]
        # the field is near normal: its upper share is rusty, with soft rims
        level = np.float32(ndtri(1 - min(finish.rust_share, 0.999)))
        weight = rusty * np.clip((field - level) / np.float32(0.3) + np.float32(0.5), 0, 1)
        rust = REFLECTANCES[Material.RUST]
        albedo += weight * (np.float32(rust.albedo) - albedo)
        mirror += weight * (np.float32(rust.mirror) - mirror)
        roughness += weight * (np.float32(rust.roughness) - roughness)
    return Surface(
        albedo=np.clip(albedo, 0.005, 0.95),
        mirror=mirror,
        roughness=np.clip(roughness, 0.06, 0.9),
    )


def returned_light(
    surface: Surface,
    cos_lamp: Float32Array,
    cos_eye: Float32Array,
    cos_half: Float32Array,
    falloff: Float32Array,
) -> tuple[Float32Array, Float32Array]:
    """The matt part and the highlight of the signal.

    Args:
        surface: Of N points.
        cos_lamp: Shape (N,), cosine between normal and direction to the lamp.
        cos_eye: Shape (N,), to the eye.
        cos_half: Shape (N,), to the direction half way between the two.
        falloff: Shape (N,), (working distance / distance of the lamp) squared.

    Returns:
        Two arrays of shape (N,). The matt part does not depend on the eye: what a tilted patch
        loses in brightness, a pixel gains in area.

    Source:
        Lambert; Cook and Torrance, ACM TOG 1(1), 1982, with Beckmann's distribution, the Fresnel
        term fixed to its value at normal incidence and no shadowing term.
    """
    matt = surface.albedo * cos_lamp * falloff
    half = np.maximum(cos_half, np.float32(_MIN_COSINE))
    slope2 = (1 / (half * half) - 1) / (surface.roughness * surface.roughness)
    peak = 4 * surface.roughness**2 * half**4 * np.maximum(cos_eye, np.float32(_MIN_COSINE))
    highlight = surface.mirror * np.exp(-slope2) / peak * falloff
    return matt.astype(np.float32), highlight.astype(np.float32)


def _column(values: Sequence[float] | FloatArray) -> Float32Array:
    return np.asarray(values, dtype=np.float32)
