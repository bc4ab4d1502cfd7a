"""The residual map: the scan in colours of its distance to the posed prior, with its key."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.picture.raster import light, rasterise
from boltpose.picture.view import View
from boltpose.report.markup import Html, join, number, tag
from boltpose.report.overlay import label
from boltpose.report.residuals import BINS, FULL_MM, REACH_MM, Residuals, residual_tints

_PAPER = np.array([1.0, 1.0, 1.0])
_BESIDE = np.array([0.90, 0.90, 0.90])
"""Scan points that do not belong to the motor."""
_BARE = np.array([0.66, 0.76, 0.90])
"""Prior that no scan point covers; striped, so that it is told from the scan without colours."""
_STRIPE_PX = 5
_SPLAT_MM = 1.6
"""Priors are thinned to about 1 mm."""
_PULL_MM = 1.0
"""Towards the camera by a hair, so that the scan wins where both lie on the same surface."""
_CONTRAST = 0.35
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
    image = rasterise(fine, np.vstack([pulled, motor_camera]), _SPLAT_MM)
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
    """A colour scale in mm with the histogram of the distances standing on it."""
    width, tall, beyond = 132.0, 26.0, 9.0
    left, bottom = view.width - width - beyond - 14, view.height - 20.0
    step = width / BINS
    shares = residuals.histogram()
    top = max(float(shares.max()), 1e-9)
    ground = tag(
        "rect",
        x=left - 8,
        y=bottom - tall - 40,
        width=width + beyond + 18,
        height=tall + 58,
        fill="#fff",
        fill_opacity="0.88",
    )
    bars: list[Html] = []
    for row, share in enumerate(shares):
        is_last = row == BINS
        x = left + row * step + (3 if is_last else 0)
        middle = np.array([FULL_MM if is_last else (row + 0.5) * FULL_MM / BINS])
        color = "#" + "".join(f"{round(255 * v):02x}" for v in residual_tints(middle)[0])
        height = tall * float(share) / top
        bars += [
            tag("rect", x=_px(x), y=_px(bottom - 8), width=_px(step), height=8, fill=color),
            tag(
                "rect",
                x=_px(x),
                y=_px(bottom - 9 - height),
                width=_px(step - 0.8),
                height=_px(height),
                fill="#444",
            ),
        ]
    ticks = [
        label(text, left + place * width, bottom + 14, anchor="middle")
        for text, place in (("0", 0.0), (f"{FULL_MM / 2:g}", 0.5), (f"{FULL_MM:g} mm", 1.0))
    ]
    frame = tag(
        "rect",
        x=_px(left),
        y=_px(bottom - 8),
        width=_px(width),
        height=8,
        fill="none",
        stroke="#111",
        stroke_width=0.7,
    )
    lines = [
        label(text, left - 2, bottom - tall - 26 + 13 * row)
        for row, text in enumerate(_key_lines(residuals))
    ]
    return join([ground, *bars, frame, *ticks, *lines])


def _key_lines(residuals: Residuals) -> list[str]:
    if not len(residuals.rows):
        return [f"no scan within {REACH_MM:g} mm"]
    half, most = residuals.quantile_mm(0.5), residuals.quantile_mm(0.95)
    return [f"half < {number(half, 2)}, 95 % < {number(most, 2)} mm"]


def _px(value: float) -> float:
    return round(float(value), 1)
