"""The residual map: the scan in colours of its distance to the posed prior, with its key."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.picture.paint import typical_spacing_mm
from boltpose.picture.raster import light, rasterise
from boltpose.picture.view import View
from boltpose.report.markup import Html, join, number, tag
from boltpose.report.overlay import label
from boltpose.report.residuals import BINS, FULL_MM, REACH_MM, Residuals, residual_tints

KEY_PX = 50
"""Height of the key below the map."""
_PAPER = np.array([1.0, 1.0, 1.0])
_BESIDE = np.array([0.90, 0.90, 0.90])
"""Scan points that do not belong to the motor."""
_BARE = np.array([0.66, 0.76, 0.90])
"""Prior that no scan point covers; striped, so that it is told from the scan without colours."""
_STRIPE_PX = 5
_SPLAT_MM = 1.6
"""At least: priors are thinned to about 1 mm."""
_PULL_MM = 1.0
"""Towards the camera by a hair, so that the scan wins where both lie on the same surface."""
_CONTRAST = 0.28
"""Little: light and shade must not be read as distance."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ResidualMap:
    """A picture, what is drawn over it, and what it says."""

    image: FloatArray
    """Shape (H, W, 3), 0 to 1."""
    key: Html
    words: str


def draw_residuals(
    view: View,
    points_camera: FloatArray,
    residuals: Residuals,
    motor_camera: FloatArray,
    factor: int,
) -> ResidualMap:
    """Draw how far the scan lies from a posed prior.

    Args:
        view: From the camera.
        points_camera: Shape (N, 3), mm, the scan.
        residuals: Of these points.
        motor_camera: Shape (M, 3), mm, the posed prior.
        factor: Dots per pixel of the view.
    """
    fine = replace(
        view,
        scale=view.scale * factor,
        centre=(view.centre[0] * factor, view.centre[1] * factor),
        width=view.width * factor,
        height=view.height * factor,
    )
    tints = np.tile(_BESIDE, (len(points_camera), 1))
    tints[residuals.rows] = residual_tints(residuals.distance_mm)
    pulled = points_camera * (
        1 - _PULL_MM / np.maximum(np.linalg.norm(points_camera, axis=1, keepdims=True), _PULL_MM)
    )
    splat_mm = max(_SPLAT_MM, 1.4 * typical_spacing_mm(points_camera))
    image = rasterise(fine, np.vstack([pulled, motor_camera]), splat_mm)
    colors = np.vstack([tints, np.tile(_BARE, (len(motor_camera), 1))])
    painted = colors.astype(np.float32)[np.maximum(image.index, 0)]
    row, column = np.indices(image.index.shape)
    stripe = (row + column) // (_STRIPE_PX * factor // 2) % 2 == 0
    is_bare = image.index >= len(points_camera)
    painted[is_bare & stripe] = _PAPER
    lit = 1 - _CONTRAST * (1 - light(image, fine, smooth_mm=1.0))
    painted = np.where(image.filled[..., None], painted * lit[..., None], _PAPER)
    return ResidualMap(
        image=np.clip(painted, 0, 1), key=_key(view, residuals), words=_words(residuals)
    )


def _words(residuals: Residuals) -> str:
    if not len(residuals.rows):
        return f"No scan point lies within {REACH_MM:g} mm of it."
    half, most = residuals.quantile_mm(0.5), residuals.quantile_mm(0.95)
    return f"half within {number(half, 2)} mm, 95 % within {number(most, 2)} mm"


def _key(view: View, residuals: Residuals) -> Html:
    """Below the map: what the colours mean, and the histogram of the distances."""
    left, bottom, width, tall = 122.0, view.height + KEY_PX - 17.0, 128.0, 22.0
    step = width / BINS
    shares = residuals.histogram()
    top = max(float(shares.max()), 1e-9)
    bars: list[Html] = []
    for row, share in enumerate(shares):
        is_last = row == BINS
        # all beyond the scale stands apart
        x = left + row * step + (4 if is_last else 0)
        middle = np.array([FULL_MM if is_last else (row + 0.5) * FULL_MM / BINS])
        color = "#" + "".join(f"{round(255 * v):02x}" for v in residual_tints(middle)[0])
        height = tall * float(share) / top
        bars += [
            _rect(x, bottom - 8, step, 8, fill=color),
            _rect(x, bottom - 9 - height, step - 0.8, height, fill="#444"),
        ]
    ticks = [
        label(text, left + place * width, bottom + 13, anchor="middle")
        for text, place in (("0", 0.0), (f"{FULL_MM / 2:g}", 0.5), (f"{FULL_MM:g} mm", 1.0))
    ]
    frame = _rect(left, bottom - 8, width, 8, fill="none", stroke="#111", stroke_width=0.7)
    lines = [
        label(text, 6, view.height + 18 + 16 * row)
        for row, text in enumerate(_key_lines(residuals))
    ]
    stripes = [
        tag("path", d=f"M{x} {view.height + 22}l10 -10", stroke="#7f9cc9", stroke_width=3)
        for x in (276, 283, 290)
    ]
    bare = [
        label("bare prior", 302, view.height + 21),
        _rect(276, view.height + 29, 22, 9, fill="#e6e6e6", stroke="#888", stroke_width=0.7),
        label("other", 302, view.height + 38),
    ]
    return join([*bars, frame, *ticks, *lines, *stripes, *bare])


def _key_lines(residuals: Residuals) -> list[str]:
    if not len(residuals.rows):
        return ["no scan point", f"within {REACH_MM:g} mm"]
    half, most = residuals.quantile_mm(0.5), residuals.quantile_mm(0.95)
    return [f"half \u2264 {number(half, 2)} mm", f"95 % \u2264 {number(most, 2)} mm"]


def _rect(x: float, y: float, width: float, height: float, **ink: object) -> Html:
    return tag("rect", x=_px(x), y=_px(y), width=_px(width), height=_px(height), **ink)


def _px(value: float) -> float:
    return round(float(value), 1)
