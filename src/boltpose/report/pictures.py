"""The pictures of a report: what the camera saw, how well the prior fits, and the hidden bolts."""

from __future__ import annotations

import io
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from PIL import Image

from boltpose.arrays import Float32Array, FloatArray
from boltpose.geometry.transforms import Transform
from boltpose.picture.behind import choose_direction, heads_in_sight
from boltpose.picture.bolt_marks import (
    BoltMark,
    Ink,
    arrow_tips,
    camera_from_result,
    camera_marks,
)
from boltpose.picture.paint import MOTOR, PAPER, PRIOR, SURROUNDINGS, paint_finely
from boltpose.picture.view import View, frame_subject, look_along
from boltpose.report.legend import mark_key
from boltpose.report.markup import Html, data_uri, join, tag
from boltpose.report.overlay import bolt_marks, extra_marks, ribbon, scale_bar, triad, view_axes
from boltpose.report.residual_map import KEY_PX, draw_residuals
from boltpose.report.residuals import Residuals, measure_residuals
from boltpose.schema import LocateResult, Part, Prior, Scan, Visibility

_DOTS_PER_PX = 2
"""Twice the size at which the page shows it: 300 dots per inch in print."""
_JPEG_QUALITY = 86
_MOST_POINTS = 600_000
"""Of a larger scan so many points are drawn: a picture has no more dots."""
_HEIGHT = 400
_WIDTH_MAIN, _WIDTH_SIDE = 480, 380
_AWAY_MM = 2000.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Scene:
    """What all pictures of one result share; frame `camera`."""

    result: LocateResult
    points: FloatArray
    """Shape (N, 3), mm, the scan, thinned."""
    prior: Prior
    marks: list[BoltMark]
    motor: FloatArray | None
    """Shape (M, 3), mm, the posed prior; None without a candidate."""
    residuals: Residuals | None


def picture_section(result: LocateResult, scan: Scan, prior: Prior) -> Html:
    """Draw all pictures of a result.

    Args:
        result: Of `locate`.
        scan: The scan it was made from, frame `camera`.
        prior: The prior it was made with.

    Returns:
        A section with one figure per picture.
    """
    points = scan.points[:: -(-len(scan) // _MOST_POINTS) or 1]
    candidate = None if result.registration is None else result.registration.camera_from_prior
    scene = _Scene(
        result=result,
        points=points,
        prior=prior,
        marks=camera_marks(result),
        motor=None if candidate is None else candidate.apply(prior.points),
        residuals=None if candidate is None else measure_residuals(points, prior, candidate),
    )
    jobs: list[Callable[[_Scene], Html]] = [_draw_camera]
    if scene.motor is not None:
        jobs.append(_draw_fit)
        if result.is_ok:
            jobs.append(_draw_hidden)
    with ThreadPoolExecutor(2) as pool:
        figures = list(pool.map(_draw, jobs, [scene] * len(jobs)))
    return tag("section", *figures, class_=f"pictures p{len(figures)}")


def _draw(job: Callable[[_Scene], Html], scene: _Scene) -> Html:
    return job(scene)


def _draw_camera(scene: _Scene) -> Html:
    # of a refused scan nobody knows where the motor is: show all of it but strays
    subject = scene.motor if scene.result.is_ok else _without_strays(scene.points)
    if subject is None or not len(subject):
        return tag(
            "figure",
            tag("p", "The scan holds no points."),
            tag("figcaption", "What the camera saw"),
        )
    view = _camera_view(np.vstack([subject, *arrow_tips(scene.marks)]), _WIDTH_MAIN)
    tints = np.tile(SURROUNDINGS, (len(scene.points), 1))
    if scene.residuals is not None and scene.result.is_ok:
        tints[scene.residuals.rows] = MOTOR
    frame = view_axes(view.view_from_scene, camera_from_result(scene.result))
    over = [
        bolt_marks(view, scene.marks),
        scale_bar(view),
        triad(view, frame, f"axes of {scene.result.frame}"),
    ]
    if scene.result.extra_heads:
        heads = np.array([head.head_top_mm for head in scene.result.extra_heads])
        over.append(extra_marks(view, view.project(camera_from_result(scene.result).apply(heads))))
    if not scene.result.is_ok:
        over.append(ribbon(view, "REFUSED: no pose is given"))
    counts = [
        f"{sum(mark.ink is ink for mark in scene.marks)} {ink.label}"
        for ink in Ink
        if any(mark.ink is ink for mark in scene.marks)
    ]
    alt = "The scan as the camera saw it" + (f"; bolts: {', '.join(counts)}." if counts else ".")
    return _figure(
        _canvas(view, _paint(view, scene.points, tints), join(over), alt),
        join(
            ["What the camera saw", mark_key(scene.marks, has_extra=bool(scene.result.extra_heads))]
        ),
    )


def _without_strays(points: FloatArray) -> FloatArray:
    """Points, shape (N, 3), but the outermost of each direction, which make a picture tiny."""
    if not len(points):
        return points
    low, high = np.quantile(points, [0.005, 0.995], axis=0)
    return points[((points >= low) & (points <= high)).all(axis=1)]


def _draw_fit(scene: _Scene) -> Html:
    assert scene.motor is not None
    assert scene.residuals is not None
    view = _camera_view(scene.motor, _WIDTH_SIDE, _HEIGHT - KEY_PX)
    drawn = draw_residuals(view, scene.points, scene.residuals, scene.motor, _DOTS_PER_PX)
    over: list[Html] = [drawn.key]
    title = "Distance of the scan to the prior"
    if not scene.result.is_ok:
        over.append(ribbon(view, "REJECTED: never use this pose"))
        title = "Distance of the scan to the best pose found, which is rejected"
    return _figure(
        _canvas(view, drawn.image, join(over), f"{title}: {drawn.words}.", below=KEY_PX),
        join([title]),
    )


def _draw_hidden(scene: _Scene) -> Html:
    """Show the prior from where hidden bolts can be seen; twice if they are on both ends."""
    assert scene.motor is not None
    hidden = [
        [
            mark
            for bolt, mark in zip(scene.result.bolts, scene.marks, strict=True)
            if bolt.visibility is Visibility.HIDDEN
            and bolt.side is side
            and mark.ink is not Ink.FORBIDDEN
        ]
        for side in dict.fromkeys(bolt.side for bolt in scene.result.bolts)
    ]
    groups = [group for group in hidden if group] or [scene.marks]
    views = _views_of_groups(scene, groups)
    tints = np.tile(0.45 * PRIOR + 0.55 * PAPER, (len(scene.motor), 1))
    tints[scene.prior.labels == Part.BOLT] = 0.2 * PRIOR + 0.8 * PAPER
    canvases: list[Html] = []
    for group, view in zip(groups, views, strict=True):
        in_sight = heads_in_sight(view, scene.motor, scene.marks)
        shown = [m for m, s in zip(scene.marks, in_sight, strict=True) if s or m in group]
        names = ", ".join(mark.name for mark in group)
        canvases.append(
            _canvas(
                view,
                _paint(view, scene.motor, tints),
                join([bolt_marks(view, shown), scale_bar(view)]),
                f"The prior from another side, where these bolts are in sight: {names}.",
            )
        )
    title = "Hidden bolts, on the prior" if any(hidden) else "The prior from another side"
    is_beside = views[0].width < _WIDTH_SIDE
    return _figure(tag("div", *canvases, class_="beside" if is_beside else None), join([title]))


def _views_of_groups(scene: _Scene, groups: list[list[BoltMark]]) -> list[View]:
    """One view per group of bolts, beside or below each other, whichever shows more."""
    assert scene.motor is not None
    camera_from_frame = camera_from_result(scene.result)
    # upright as the robot stands where the hand-eye is known, else as the camera holds it
    up = camera_from_frame.z_axis if camera_from_frame.source == "base" else np.array([0, -1.0, 0])
    middle = scene.motor.mean(axis=0)
    subject = np.vstack([scene.motor, *arrow_tips(scene.marks)])
    poses = [
        look_along(choose_direction(scene.motor, group), up, middle, "camera", _AWAY_MM)
        for group in groups
    ]
    count = len(groups)
    layouts = (
        [
            frame_subject(pose, subject, width=_WIDTH_SIDE, height=(_HEIGHT - count + 1) // count)
            for pose in poses
        ],
        [
            frame_subject(pose, subject, width=(_WIDTH_SIDE - count + 1) // count, height=_HEIGHT)
            for pose in poses
        ],
    )
    return max(layouts, key=lambda views: min(view.scale for view in views))


def _camera_view(subject_camera: FloatArray, width: int, height: int = _HEIGHT) -> View:
    """As the camera sees it; side by side if the subject is not in front (a mirrored scan, say)."""
    return frame_subject(
        Transform.identity("view", "camera"),
        subject_camera,
        width=width,
        height=height,
        margin=0.05,
        is_pinhole=bool(np.median(subject_camera[:, 2]) > 0),
    )


def _paint(view: View, points: FloatArray, tints: FloatArray) -> Float32Array:
    return paint_finely(view, points, tints, _DOTS_PER_PX)


def _canvas(
    view: View, image: FloatArray | Float32Array, over: Html, alt: str, *, below: int = 0
) -> Html:
    stream = io.BytesIO()
    pixels = np.rint(255 * image).astype(np.uint8)
    # no colour subsampling: it smears the edges of the residual map
    Image.fromarray(pixels).save(stream, "JPEG", quality=_JPEG_QUALITY, subsampling=0)
    return tag(
        "svg",
        tag(
            "image",
            href=data_uri(stream.getvalue(), "image/jpeg"),
            width=view.width,
            height=view.height,
        ),
        over,
        viewBox=f"0 0 {view.width} {view.height + below}",
        role="img",
        aria_label=alt,
    )


def _figure(canvas: Html, caption: Html) -> Html:
    return tag("figure", canvas, tag("figcaption", caption))
