"""The picture of a prior: the full scan by class from both ends, with its bolts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D

from boltpose.picture import paint
from boltpose.picture.bolt_marks import BoltMark, Ink
from boltpose.picture.marks import draw_bolts, draw_scale_bar
from boltpose.picture.sheet import Panel, Sheet
from boltpose.picture.view import frame_subject, look_along
from boltpose.schema import Part, Prior, Side

_PANELS = {
    Side.TOP: Panel(left=0, top=0, width=747, height=700),
    Side.BOTTOM: Panel(left=753, top=0, width=747, height=700),
}
_INK = Ink.SEEN


def draw_prior(path: str | Path, prior: Prior) -> None:
    """Draw a prior from both ends of the motor, coloured by class, with every bolt.

    Args:
        path: .png, .svg or .pdf.
        prior: What to draw.

    Raises:
        InputFileError: The suffix is not known.
    """
    motor_from_prior = prior.alignment.prior_from_motor.inverse()
    points_motor = motor_from_prior.apply(prior.points)
    marks = [
        BoltMark(
            name=bolt.id,
            scene_from_bolt=motor_from_prior @ bolt.prior_from_bolt,
            head_diameter_mm=bolt.head_diameter_mm,
            ink=_INK,
            is_sure=bolt.is_sure,
        )
        for bolt in prior.bolts
    ]
    unsure = [bolt.id for bolt in prior.bolts if not bolt.is_sure]
    sheet = Sheet(1500, 700)
    sheet.banner(
        f"prior '{prior.name}'   {len(prior.bolts)} bolts",
        f"please check: {', '.join(unsure)}" if unsure else "every bolt sure",
        "#a35a00" if unsure else "#2f4b7c",
    )
    tints = paint.part_tints(prior.labels)
    middle = (points_motor.min(axis=0) + points_motor.max(axis=0)) / 2
    tips = [mark.scene_from_bolt.apply(np.array([[0.0, 0.0, 30.0]])) for mark in marks]
    for side, place in _PANELS.items():
        sign = 1.0 if side is Side.TOP else -1.0
        # 40 deg off the axis: heads are seen from above and arrows still have a length
        forward = np.array([-0.45, -0.35, -0.85 * sign])
        view = frame_subject(
            look_along(forward, np.array([0.0, 1.0, 0.0]), middle, "motor", 2000.0),
            np.vstack([points_motor, *tips]),
            width=place.width,
            height=place.height,
        )
        image = paint.paint(view, points_motor, tints)
        end = "connector end, +z" if side is Side.TOP else "rear end, -z"
        axes = sheet.panel(place, image, f"{side} bolts ({end})")
        bolts = zip(prior.bolts, marks, strict=True)
        draw_bolts(axes, view, [mark for bolt, mark in bolts if bolt.side is side])
        draw_scale_bar(axes, view)
    sheet.footer(_class_handles(prior), f"{len(prior.points)} points   frame motor   mm")
    sheet.save(Path(path))


def _class_handles(prior: Prior) -> list[Line2D]:
    present = np.unique(prior.labels)
    return [
        Line2D(
            [],
            [],
            ls="",
            marker="s",
            ms=11,
            mfc=paint.PART_COLORS[part],
            mec="#666666",
            label=str(part.name).lower().replace("_", " "),
        )
        for part in Part
        if int(part) in present
    ]
