"""Pictures of what each error of the sensors does: without it, and with it alone."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from boltpose.arrays import FloatArray, UInt8Array
from boltpose.factory.model import MotorModel
from boltpose.geometry.transforms import Transform
from boltpose.picture.paint import paint
from boltpose.picture.view import frame_subject, look_along
from boltpose.schema import Part
from boltpose.sensor.camera import PinholeCamera
from boltpose.sensor.hand_held import HandHeldScan, scan_motor
from boltpose.sensor.hand_held_config import HandHeldConfig
from boltpose.sensor.raycast import RayCaster
from boltpose.sensor.reflectance import Finish
from boltpose.sensor.structured_light import CapturedView, capture_view
from boltpose.sensor.structured_light_config import StructuredLightConfig
from boltpose.synthesis.render import RenderConfig, focal_px
from boltpose.synthesis.surface_error import signed_errors_mm
from boltpose.synthesis.tiles import Tile

SIZE_PX = (520, 430)
_MISSING = (38, 44, 66)
_SURROUNDINGS, _MOTOR = (165.0, 165.0, 165.0), (225.0, 222.0, 214.0)
_LAMP = (-0.5, -0.6, -1.0)
"""Towards the light, frame `camera`."""
_NO_ERROR = (245, 245, 245)
_TOO_LOW, _TOO_HIGH = (35, 85, 190), (200, 45, 30)
_HAND_HELD_MM = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """One error of the structured-light camera."""

    name: str
    caption: str
    with_it: StructuredLightConfig
    without: StructuredLightConfig
    drawn: Literal["shaded", "error"]
    limit_mm: float = 0.1
    """Errors of this size are drawn in full colour."""


def quiet_camera() -> StructuredLightConfig:
    """A camera without any error, but not ideal: every error can be switched on alone."""
    default = StructuredLightConfig()
    # so near that the motor fills the picture
    camera = PinholeCamera(width=SIZE_PX[0], height=SIZE_PX[1], focal_px=1500)
    return replace(
        default,
        camera=camera,
        noise_mm=0,
        min_signal=1e-9,
        saturation_signal=1e9,
        highlight_mm=0,
        max_incidence_deg=90,
        dropout_spread=0,
        ripple_mm=0,
        lumps_mm=0,
        warp_mm=0,
        contrast_mm=0,
        mixed_share=0,
        smoothing=0,
        min_neighbours=0,
        finish=Finish(spread=0, stains=0, rust_share=0),
    )


def ideal_camera(size_px: tuple[int, int]) -> StructuredLightConfig:
    """A camera with the field of view of rendered pictures that sees everything, without error."""
    camera = PinholeCamera(
        width=size_px[0], height=size_px[1], focal_px=focal_px(RenderConfig(size_px=size_px))
    )
    return replace(quiet_camera(), camera=camera, baseline_mm=0, is_ideal=True)


def camera_effects() -> tuple[Effect, ...]:
    """Every error of the camera at its default strength."""
    quiet, default = quiet_camera(), StructuredLightConfig()
    real_light = {
        "min_signal": default.min_signal,
        "dropout_spread": default.dropout_spread,
        "finish": default.finish,
    }
    noisy = replace(
        quiet, noise_mm=default.noise_mm, smoothing=default.smoothing, finish=default.finish
    )
    effects = [
        Effect(
            name="shadow",
            caption="projector beside the camera: its shadows are missing",
            without=replace(quiet, baseline_mm=0),
            with_it=quiet,
            drawn="shaded",
        ),
        Effect(
            name="noise",
            caption="noise, more where it is dark or tilted",
            without=quiet,
            with_it=noisy,
            drawn="error",
            limit_mm=0.25,
        ),
        Effect(
            name="ripple",
            caption="ripple across the projector's columns",
            without=quiet,
            with_it=replace(quiet, ripple_mm=default.ripple_mm),
            drawn="error",
            limit_mm=0.05,
        ),
        Effect(
            name="lumps",
            caption="lumps and warp: slow errors of calibration",
            without=quiet,
            with_it=replace(quiet, lumps_mm=default.lumps_mm, warp_mm=default.warp_mm),
            drawn="error",
        ),
        Effect(
            name="highlights",
            caption="highlights: wrong before they are blown out",
            without=quiet,
            with_it=replace(
                quiet,
                highlight_mm=default.highlight_mm,
                saturation_signal=default.saturation_signal,
            ),
            drawn="error",
            limit_mm=0.05,
        ),
        Effect(
            name="contrast",
            caption="contrast: steps in brightness bend the surface",
            without=quiet,
            with_it=replace(quiet, contrast_mm=default.contrast_mm, finish=default.finish),
            drawn="error",
            limit_mm=0.05,
        ),
        Effect(
            name="dropouts",
            caption="dropouts: too dark or too tilted",
            without=quiet,
            with_it=replace(quiet, max_incidence_deg=default.max_incidence_deg, **real_light),
            drawn="shaded",
        ),
        Effect(
            name="mixed_pixels",
            caption="mixed pixels at edges (red and blue)",
            without=quiet,
            with_it=replace(quiet, mixed_share=default.mixed_share),
            drawn="error",
            limit_mm=1.0,
        ),
        Effect(
            name="scale",
            caption="scale error of 0.0003",
            without=quiet,
            with_it=replace(quiet, scale_error=0.0003),
            drawn="error",
            limit_mm=0.3,
        ),
        Effect(
            name="all",
            caption="everything",
            without=replace(quiet, is_ideal=True),
            with_it=replace(default, camera=quiet.camera),
            drawn="shaded",
        ),
        Effect(
            name="all_errors",
            caption="everything",
            without=replace(quiet, is_ideal=True),
            with_it=replace(default, camera=quiet.camera),
            drawn="error",
            limit_mm=0.25,
        ),
    ]
    return tuple(effects)


def draw_effect(
    effect: Effect, caster: RayCaster, frame_from_camera: Transform, seed: int
) -> tuple[Tile, Tile]:
    """Draw a view without an error and with it.

    Args:
        effect: The error.
        caster: What stands before the camera.
        frame_from_camera: Pose of the camera in the frame of the solids.
        seed: Draws the error.
    """
    ideal = capture_view(
        caster,
        frame_from_camera,
        replace(effect.with_it, baseline_mm=0, is_ideal=True),
        np.random.default_rng(seed),
    )
    views = [
        capture_view(caster, frame_from_camera, config, np.random.default_rng(seed))
        for config in (effect.without, effect.with_it)
    ]
    if effect.drawn == "shaded":
        images = [shade_depth(view) for view in views]
        scale = ""
    else:
        images = [error_map(view, ideal, effect.limit_mm) for view in views]
        scale = f", colour: ±{effect.limit_mm:g} mm"
    return Tile(images[0], "without"), Tile(images[1], effect.caption + scale)


def shade_depth(view: CapturedView) -> UInt8Array:
    """A depth image lit from the upper left, shape (H, W, 3); dark blue where it is empty."""
    tint = np.where((view.labels == Part.BACKGROUND)[..., None], _SURROUNDINGS, _MOTOR)
    image = np.where((view.depth_mm > 0)[..., None], tint * _light(view)[..., None], _MISSING)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def _light(view: CapturedView) -> FloatArray:
    """Brightness, shape (H, W), 0 to 1, of the surface that a depth image describes."""
    depth = np.where(view.depth_mm > 0, view.depth_mm, np.nan)
    pitch = depth / view.camera_matrix[0, 0]
    slopes = (_slope(depth, 1) / pitch, _slope(depth, 0) / pitch)
    normal = np.stack([*slopes, -np.ones_like(depth)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    lamp = np.array(_LAMP) / np.linalg.norm(_LAMP)
    return 0.2 + 0.8 * np.clip(np.nan_to_num(normal @ lamp, nan=0.3), 0, 1)


def _slope(depth: FloatArray, axis: int) -> FloatArray:
    """Change of depth per pixel; at holes and edges the smaller one-sided difference."""
    step = np.diff(depth, axis=axis)
    pad = [(0, 0), (0, 0)]
    pad[axis] = (0, 1)
    ahead = np.pad(step, pad, constant_values=np.nan)
    pad[axis] = (1, 0)
    behind = np.pad(step, pad, constant_values=np.nan)
    both = np.stack([np.nan_to_num(ahead, nan=np.inf), np.nan_to_num(behind, nan=np.inf)])
    smaller = np.take_along_axis(both, np.abs(both).argmin(axis=0)[None], axis=0)[0]
    return np.where(np.isfinite(smaller), smaller, 0.0)


def error_map(view: CapturedView, ideal: CapturedView, limit_mm: float) -> UInt8Array:
    """Measured minus true depth, shape (H, W, 3): red is too far, blue too near."""
    error = view.depth_mm - ideal.depth_mm
    known = (view.depth_mm > 0) & (ideal.depth_mm > 0)
    light = 0.35 + 0.65 * _light(ideal)
    colors = light[..., None] * error_colors(error, limit_mm)
    return np.where(known[..., None], colors, _MISSING).astype(np.uint8)


def error_colors(error_mm: FloatArray, limit_mm: float) -> FloatArray:
    """Errors of any shape (...) as colours (..., 3), 0 to 255."""
    share = np.clip(np.abs(error_mm) / limit_mm, 0, 1)[..., None]
    full = np.where((error_mm > 0)[..., None], _TOO_HIGH, _TOO_LOW)
    return (1 - share) * np.array(_NO_ERROR) + share * full


def hand_held_tiles(model: MotorModel, seed: int) -> list[Tile]:
    """The hand-held scanner's errors, one after the other."""
    default = HandHeldConfig()
    quiet = replace(
        default,
        noise_mm=0,
        strip_shift_mm=0,
        strip_turn_deg=0,
        min_signal=1e-9,
        saturation_signal=1e9,
        dropout_spread=0,
        missed_patches=0,
        stray_share=0,
    )
    few = replace(quiet, directions=3, cell_mm=0.8)
    steps = (
        ("one strip beside the other, no error", few),
        (
            "strips out of place",
            replace(
                few, strip_shift_mm=default.strip_shift_mm, strip_turn_deg=default.strip_turn_deg
            ),
        ),
        ("noise along the beam", replace(quiet, noise_mm=default.noise_mm)),
        ("lost light, missed spots, stray points", replace(default, noise_mm=0, strip_shift_mm=0)),
        ("everything", default),
    )
    tiles: list[Tile] = []
    for caption, config in steps:
        scan = scan_motor(model.parts, config, np.random.default_rng(seed))
        errors = signed_errors_mm(scan.points, model.parts)
        colors = error_colors(errors, _HAND_HELD_MM) / 255
        tiles.append(Tile(draw_cloud(scan, colors), f"{caption}, colour: ±{_HAND_HELD_MM:g} mm"))
    return tiles


def draw_cloud(scan: HandHeldScan, colors: FloatArray) -> UInt8Array:
    """A full scan in colours, shape (N, 3), 0 to 1."""
    direction = np.array((-1.2, 0.5, 0.9))
    view_from_motor = look_along(
        -direction,
        np.array((0.0, 0.0, 1.0)),
        np.median(scan.points, axis=0),
        "motor",
        1000.0,
    )
    view = frame_subject(view_from_motor, scan.points, width=SIZE_PX[0], height=SIZE_PX[1])
    return np.clip(np.rint(255 * paint(view, scan.points, colors)), 0, 255).astype(np.uint8)
