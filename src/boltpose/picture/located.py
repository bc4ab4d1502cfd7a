"""The picture of a located motor: what the camera saw, how the prior fits it, and every bolt."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from boltpose.arrays import BoolArray, FloatArray
from boltpose.errors import FrameError
from boltpose.geometry.transforms import Transform
from boltpose.picture import paint
from boltpose.picture.behind import choose_direction, heads_in_sight
from boltpose.picture.bolt_marks import BoltMark, Ink, arrow_tips, mark_of
from boltpose.picture.fit import tint_fit
from boltpose.picture.fit_key import draw_fit_key
from boltpose.picture.marks import draw_bolts, draw_scale_bar, legend_handles
from boltpose.picture.sheet import Panel, Sheet
from boltpose.picture.view import View, frame_subject, look_along
from boltpose.schema import (
    BoltState,
    LocatedBolt,
    LocateResult,
    Part,
    Prior,
    Scan,
    Side,
    Visibility,
)

_MAIN = Panel(left=0, top=0, width=900, height=820)
_FIT = Panel(left=906, top=0, width=594, height=407)
_BEHIND = Panel(left=906, top=413, width=594, height=407)
_GREEN, _RED = "#1b7f3b", "#b3001b"


def draw_located(
    path: str | Path,
    result: LocateResult,
    scan: Scan,
    prior: Prior,
    base_from_camera: Transform | None = None,
) -> None:
    """Draw a result: the scan with an arrow at every bolt, the fit, and the motor from behind.

    A refused result shows the reasons instead of arrows, so that nobody follows it.

    Args:
        path: .png, .svg or .pdf.
        result: Of `locate`.
        scan: The scan it was made from, frame `camera`.
        prior: The prior it was made with.
        base_from_camera: The hand-eye it was made with; needed when `result.frame` is `base`.

    Raises:
        FrameError: The result is in `base` and no hand-eye was given.
        InputFileError: The suffix is not known.
    """
    if result.frame == "base" and base_from_camera is None:
        raise FrameError("a result in frame 'base' needs base_from_camera to be drawn")
    camera_from_frame = (
        Transform.identity("camera", "camera")
        if base_from_camera is None or result.frame == "camera"
        else base_from_camera.inverse()
    )
    marks = [mark_of(bolt, camera_from_frame) for bolt in result.bolts]
    candidate = None if result.registration is None else result.registration.camera_from_prior
    motor_camera = None if candidate is None else candidate.apply(prior.points)

    sheet = Sheet(_MAIN.left + _FIT.left + _FIT.width, _MAIN.height)
    sheet.banner(*_headline(result))
    _draw_camera_panel(sheet, result, scan, motor_camera, marks)
    if motor_camera is not None and candidate is not None:
        _draw_fit_panel(sheet, result, scan, motor_camera, candidate.rotate(prior.normals))
    if result.is_ok and motor_camera is not None:
        _draw_behind_panels(sheet, result, prior, motor_camera, marks, camera_from_frame)
    else:
        _draw_reasons_panel(sheet, result, _BEHIND if motor_camera is not None else _FIT)
    inks = [ink for ink in Ink if any(mark.ink is ink for mark in marks)]
    unsure = any(not mark.is_sure for mark in marks)
    sheet.footer(
        legend_handles(inks, with_unsure=unsure),
        f"scan {Path(scan.source).name}   prior {result.prior_name}   frame {result.frame}   mm",
    )
    sheet.save(Path(path))


def _headline(result: LocateResult) -> tuple[str, str, str]:
    if not result.is_ok:
        codes = ", ".join(str(check) for check in result.verdict.failed)
        return "REFUSED", codes.replace("_", " "), _RED
    seen = {level: sum(b.visibility is level for b in result.bolts) for level in Visibility}
    words = zip(("seen", "partly seen", "hidden"), Visibility, strict=True)
    detail = ", ".join(f"{seen[level]} {word}" for word, level in words if seen[level])
    forbidden = [bolt.id for bolt in result.bolts if bolt.state is BoltState.CONTRADICTED]
    if forbidden:
        detail = f"NO TOOL AT {', '.join(forbidden)};  {detail}"
    return f"OK   {len(result.bolts)} bolts in frame '{result.frame}'", detail, _GREEN


def _draw_camera_panel(
    sheet: Sheet,
    result: LocateResult,
    scan: Scan,
    motor_camera: FloatArray | None,
    marks: list[BoltMark],
) -> None:
    subject = _subject(scan, motor_camera)
    view = _camera_view(np.vstack([subject, *arrow_tips(marks)]), _MAIN)
    mask = _mask(result, scan)
    tints = np.where(mask[:, None], paint.MOTOR, paint.SURROUNDINGS)
    axes = sheet.panel(_MAIN, paint.paint(view, scan.points, tints), "what the camera saw")
    draw_bolts(axes, view, marks)
    draw_scale_bar(axes, view)
    if not result.is_ok:
        axes.text(
            _MAIN.width / 2,
            _MAIN.height / 2,
            "REFUSED",
            color=_RED,
            alpha=0.75,
            fontsize=84,
            fontweight="bold",
            rotation=25,
            ha="center",
            va="center",
        )


def _draw_fit_panel(
    sheet: Sheet,
    result: LocateResult,
    scan: Scan,
    motor_camera: FloatArray,
    normals_camera: FloatArray,
) -> None:
    view = _camera_view(motor_camera, _FIT)
    points, tints = tint_fit(scan.points, _mask(result, scan), motor_camera, normals_camera)
    title = "registered prior" if result.is_ok else "rejected candidate: do not use"
    draw_fit_key(sheet.panel(_FIT, paint.paint(view, points, tints), title), _FIT)


def _draw_behind_panels(
    sheet: Sheet,
    result: LocateResult,
    prior: Prior,
    motor_camera: FloatArray,
    marks: list[BoltMark],
    camera_from_frame: Transform,
) -> None:
    """Show the motor from where hidden bolts can be seen; from both ends if they are on both."""
    hidden = [
        [mark for bolt, mark in zip(result.bolts, marks, strict=True) if _is_hidden(bolt, side)]
        for side in Side
    ]
    groups = [group for group in hidden if group] or [marks]
    width = (_BEHIND.width - 6 * (len(groups) - 1)) // len(groups)
    # upright as the robot stands where the hand-eye is known, else as the camera holds it
    up = (
        camera_from_frame.z_axis
        if camera_from_frame.source == "base"
        else np.array([0.0, -1.0, 0.0])
    )
    is_bolt = (prior.labels == Part.BOLT)[:, None]
    tints = np.where(is_bolt, 0.4 * paint.PRIOR + 0.6 * paint.PAPER, paint.PRIOR)
    middle = motor_camera.mean(axis=0)
    for number, group in enumerate(groups):
        place = replace(_BEHIND, left=_BEHIND.left + number * (width + 6), width=width)
        view = frame_subject(
            look_along(choose_direction(motor_camera, group), up, middle, "camera", 2000.0),
            np.vstack([motor_camera, *arrow_tips(marks)]),
            width=place.width,
            height=place.height,
        )
        title = "hidden bolts on the prior" if number == 0 else "... and on its other end"
        axes = sheet.panel(place, paint.paint(view, motor_camera, tints), title)
        in_sight = heads_in_sight(view, motor_camera, marks)
        shown = [m for m, s in zip(marks, in_sight, strict=True) if s or m in group]
        draw_bolts(axes, view, shown)
        draw_scale_bar(axes, view)


def _is_hidden(bolt: LocatedBolt, side: Side) -> bool:
    # one that is gone needs no view from which it can be seen
    is_there = bolt.state is not BoltState.CONTRADICTED
    return is_there and bolt.visibility is Visibility.HIDDEN and bolt.side is side


def _draw_reasons_panel(sheet: Sheet, result: LocateResult, place: Panel) -> None:
    axes = sheet.panel(place, None, "why no pose is given")
    codes = ", ".join(str(check) for check in result.verdict.failed)
    lines = _wrap(codes, 60)
    axes.text(16, 44, "\n".join(lines), fontsize=11, fontweight="bold", color=_RED, va="top")
    top = 50.0 + 18 * len(lines)
    for reason in result.verdict.reasons:
        lines = _wrap(reason, 70)
        axes.text(
            16,
            top,
            "\n".join(lines),
            fontsize=10.5,
            va="top",
            color="#222222",
            parse_math=False,  # a sentence may hold a file's name, with any sign in it
        )
        top += 12 + 17 * len(lines)


def _wrap(text: str, width: int) -> list[str]:
    lines = [""]
    for word in text.split():
        if len(lines[-1]) + 1 + len(word) > width:
            lines.append(word)
        else:
            lines[-1] = f"{lines[-1]} {word}".strip()
    return lines


def _camera_view(subject_camera: FloatArray, place: Panel) -> View:
    """As the camera sees it; side by side if the subject is not in front (a mirrored scan, say)."""
    return frame_subject(
        Transform.identity("view", "camera"),
        subject_camera,
        width=place.width,
        height=place.height,
        is_pinhole=bool(np.median(subject_camera[:, 2]) > 0),
    )


def _subject(scan: Scan, motor_camera: FloatArray | None) -> FloatArray:
    return scan.points if motor_camera is None else motor_camera


def _mask(result: LocateResult, scan: Scan) -> BoolArray:
    if result.motor_mask is None or len(result.motor_mask) != len(scan):
        return np.zeros(len(scan), dtype=np.bool_)
    return result.motor_mask
