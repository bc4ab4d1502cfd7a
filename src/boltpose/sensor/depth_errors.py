"""The errors of a structured-light camera, in the order in which they arise.

Light decides which pixels live; each living pixel gets an error along its ray; edges mix; the
camera's own filters smooth and remove. Lengths in mm, images of shape (H, W).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from boltpose.arrays import BoolArray, Float32Array, FloatArray
from boltpose.factory.model import SolidPart
from boltpose.sensor.depth_filters import (
    binomial_noise_gain,
    mix_edges,
    remove_lone_pixels,
    smooth_depth,
)
from boltpose.sensor.exposure import Exposure
from boltpose.sensor.fields import image_field
from boltpose.sensor.reflectance import paint_surface, returned_light
from boltpose.sensor.structured_light_config import StructuredLightConfig


def disturb(
    exposure: Exposure,
    solids: Sequence[SolidPart],
    config: StructuredLightConfig,
    rng: np.random.Generator,
    lasting_rng: np.random.Generator | None = None,
) -> FloatArray:
    """Turn exact depths into measured ones.

    Args:
        exposure: The pixels that camera and projector see.
        solids: All solids of the scene, for their materials.
        config: The camera and its errors.
        rng: The source of randomness.
        lasting_rng: Source of what lasts from shot to shot: the finish of the solids, and ripple,
            lumps and warp of the camera. `rng` if left out.

    Returns:
        Shape (H, W), float64, mm along the optical axis; 0 where nothing is measured.
    """
    shape = (config.camera.height, config.camera.width)
    # streams of their own: a parameter of one effect leaves the draws of the others alone
    paint_rng, loss_rng, noise_rng, smooth_rng, edge_rng = rng.spawn(5)
    if lasting_rng is not None:
        paint_rng, _, _, smooth_rng, _ = lasting_rng.spawn(5)
    surface = paint_surface(solids, exposure.points, exposure.solid_index, config.finish, paint_rng)
    falloff = (np.float32(config.working_distance_mm) / exposure.lamp_distance_mm) ** 2
    matt, highlight = returned_light(
        surface, exposure.cos_lamp, exposure.cos_eye, exposure.cos_half, falloff
    )
    signal = matt + highlight
    alive = _survives(exposure, signal, config, loss_rng)
    across, down = config.camera.slopes(exposure.pixels)
    error = _random_error(exposure, signal, config, noise_rng)
    error += _smooth_error(exposure, signal, across, config, smooth_rng)
    # along the ray; the optical axis sees its cosine
    depth = exposure.depth_mm * (1 + config.scale_error)
    depth += (error + config.bias_mm) / np.sqrt(across * across + down * down + 1)
    image = np.zeros(shape)
    image.reshape(-1)[exposure.pixels[alive]] = depth[alive]
    mix_edges(image, config.edge_mm, config.mixed_share, edge_rng)
    smooth_depth(image, config.smoothing, config.edge_mm)
    remove_lone_pixels(image, config.lone_mm, config.min_neighbours)
    return image


def _pixels_per(length_mm: float, config: StructuredLightConfig) -> float:
    """A length at the working distance, in pixels."""
    return length_mm * config.camera.focal_px / config.working_distance_mm


def _survives(
    exposure: Exposure,
    signal: Float32Array,
    config: StructuredLightConfig,
    rng: np.random.Generator,
) -> BoolArray:
    """Which pixels see neither too little nor too much light, nor a surface edge on."""
    shape = (config.camera.height, config.camera.width)
    field = image_field(shape, _pixels_per(config.dropout_patch_mm, config), rng)
    spread = np.float32(config.dropout_spread)
    doubt = field.reshape(-1)[exposure.pixels]
    doubt += np.float32(0.5) * rng.standard_normal(len(doubt), dtype=np.float32)
    doubt *= spread
    level = np.log(np.maximum(signal, np.float32(1e-6)))
    alive = level + doubt > np.log(config.min_signal)
    alive &= level + doubt < np.log(config.saturation_signal)
    limit = np.cos(np.radians(config.max_incidence_deg))
    tilt = np.minimum(exposure.cos_eye, exposure.cos_lamp)
    alive &= tilt * np.exp(np.float32(0.5) * doubt) > limit
    return np.asarray(alive)


def _random_error(
    exposure: Exposure,
    signal: Float32Array,
    config: StructuredLightConfig,
    rng: np.random.Generator,
) -> Float32Array:
    """Independent noise per pixel along the ray, before smoothing."""
    # more light than from white paper makes no better fringes: the exposure is set for it
    light = np.clip(signal * np.float32(config.hdr_gain), np.float32(0.02), np.float32(1))
    shot, read = np.float32(config.noise_shot_share), np.float32(config.noise_read_share)
    variance = (1 - shot - read) + (shot + read / light) / light
    cos2 = np.maximum(exposure.cos_eye, np.float32(0.05)) ** 2
    sigma = np.sqrt(variance)
    sigma *= 1 + np.float32(config.noise_incidence) * (1 / cos2 - 1)
    distance = (exposure.depth_mm / config.working_distance_mm).astype(np.float32)
    # quoted for the delivered cloud, so the filter's gain is taken out
    sigma *= distance**2 * np.float32(config.noise_mm / binomial_noise_gain(config.smoothing))
    return sigma * rng.standard_normal(len(sigma), dtype=np.float32)


def _smooth_error(
    exposure: Exposure,
    signal: Float32Array,
    across: FloatArray,
    config: StructuredLightConfig,
    rng: np.random.Generator,
) -> Float32Array:
    """Ripple, lumps, warp, highlights and contrast: errors that neighbours share."""
    shape = (config.camera.height, config.camera.width)
    pixels = exposure.pixels
    distance = (exposure.depth_mm / config.working_distance_mm).astype(np.float32)
    lumps_px = _pixels_per(config.lumps_size_mm, config)
    lumps = image_field(shape, lumps_px, rng).reshape(-1)[pixels]
    error = np.float32(config.lumps_mm) * lumps
    error += _ripple(exposure, across, lumps, config, rng)
    error += np.float32(config.warp_mm) * _warp(shape, rng).reshape(-1)[pixels]
    error *= distance**2
    excess = np.clip(signal / np.float32(config.saturation_signal), 0, 1) ** 2
    shift = image_field(shape, 0.5 * lumps_px, rng).reshape(-1)[pixels]
    error += np.float32(0.5 * config.highlight_mm) * excess * shift
    if config.contrast_mm > 0:
        error += np.float32(config.contrast_mm) * _contrast(shape, exposure, signal)
    return error


def _ripple(
    exposure: Exposure,
    across: FloatArray,
    lumps: Float32Array,
    config: StructuredLightConfig,
    rng: np.random.Generator,
) -> Float32Array:
    """A wave over the projector's columns, as a projector whose gamma is off leaves it."""
    # column of the projector that lights the point, in mm at the working distance
    column = (across - config.baseline_mm / exposure.depth_mm) * config.working_distance_mm
    phase = 2 * np.pi * (column / config.ripple_period_mm + rng.uniform())
    # the amplitude is not the same everywhere
    swing = np.float32(config.ripple_mm) * (1 + np.float32(0.3) * lumps)
    return swing * np.sin(phase).astype(np.float32)


def _warp(shape: tuple[int, int], rng: np.random.Generator) -> Float32Array:
    """A bowl, saddle or wave over the whole image, at most 1 anywhere."""
    x = np.linspace(-1, 1, shape[1])
    y = np.linspace(-1, 1, shape[0])[:, None]
    weights = rng.standard_normal(5)
    bend = (
        weights[0] * (x * x - 1 / 3)
        + weights[1] * (y * y - 1 / 3)
        + weights[2] * x * y
        + 0.5 * weights[3] * (5 * x**3 - 3 * x)
        + 0.5 * weights[4] * (5 * y**3 - 3 * y)
    )
    return (bend / np.abs(bend).max()).astype(np.float32)


def _contrast(shape: tuple[int, int], exposure: Exposure, signal: Float32Array) -> Float32Array:
    """Change of the logarithm of the signal along a row, per pixel, from both neighbours."""
    level = np.log(np.maximum(signal, np.float32(1e-3)))
    image = np.full(shape, np.nan, dtype=np.float32)
    image.reshape(-1)[exposure.pixels] = level
    change = np.zeros(shape, dtype=np.float32)
    change[:, 1:-1] = np.float32(0.5) * (image[:, 2:] - image[:, :-2])
    steps = change.reshape(-1)[exposure.pixels]
    # next to a hole there is no contrast to speak of: nothing but darkness beside it
    return np.clip(np.nan_to_num(steps, copy=False, nan=0.0), -1, 1)
