"""What judging a bolt looks like: measured points over the head that the prior promises.

    python -m boltpose.evaluation.bolt_state_picture runs/changed motor_00016/1:T1 …

Every row is a bolt of a view (`MOTOR/VIEW:BOLT`): the depth image around it, and the points of the
scan in a slice through the bolt's axis, over the surface of the prior.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from PIL import Image

from boltpose.arrays import FloatArray
from boltpose.errors import MissingExtraError
from boltpose.evaluation.bolt_state_cases import TrueHead, read_bolt_view
from boltpose.evaluation.reman18 import read_motor
from boltpose.geometry.transforms import Transform
from boltpose.io.atomic import write_atomic
from boltpose.prior.file import read_prior
from boltpose.registration.bolt_state import judge_bolts
from boltpose.registration.prepare import prepare_prior
from boltpose.schema import BoltState

PICTURE = Path("docs/images/bolt_state.png")
_HALF_MM = 16.0
_SLICE_MM = 1.0
_COLOURS = {
    BoltState.CONFIRMED: "#2a7f3f",
    BoltState.UNSEEN: "#777777",
    BoltState.CONTRADICTED: "#b3261e",
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("root", type=Path, help="folder of the data set, priors in ROOT/priors")
    parser.add_argument("bolts", nargs="+", metavar="MOTOR/VIEW:BOLT")
    parser.add_argument("-o", "--output", type=Path, default=PICTURE)
    given = parser.parse_args(arguments)
    draw(given.root, given.bolts, given.output)


def draw(root: Path, bolts: Sequence[str], output: Path) -> None:
    """Draw a sheet, two pictures per bolt.

    Args:
        root: Folder of the data set.
        bolts: `MOTOR/VIEW:BOLT` each.
        output: The PNG.

    Raises:
        InputFileError: A file cannot be read.
        MissingExtraError: matplotlib is missing.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("matplotlib", "train") from error
    figure = Figure(figsize=(4.2 * len(bolts), 7.2), dpi=72)
    canvas = FigureCanvasAgg(figure)
    for column, name in enumerate(bolts):
        above = figure.add_subplot(2, len(bolts), column + 1)
        below = figure.add_subplot(2, len(bolts), len(bolts) + column + 1)
        _draw_bolt(root, name, above, below)
    figure.suptitle("Lines of sight to bolt heads (simulated views)", fontsize=13)
    figure.tight_layout()

    def write(stream: BinaryIO) -> None:
        canvas.draw()
        image = Image.fromarray(np.asarray(canvas.buffer_rgba())[:, :, :3])
        image.quantize(128).save(stream, format="PNG", optimize=True)

    output.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(output, write)


def _draw_bolt(root: Path, name: str, above: Any, below: Any) -> None:
    place, bolt_id = name.rsplit(":", 1)
    motor, index = place.rsplit("/", 1)
    prepared = prepare_prior(read_prior(root / "priors" / f"{motor}.prior.npz"))
    view = read_bolt_view(root, read_motor(root, motor).views[int(index)], prepared, seed=0)
    judged = {
        one.bolt_id: one for one in judge_bolts(prepared, view.camera_from_prior, view.points)
    }[bolt_id]
    truth = next(one for one in view.heads if one.bolt_id == bolt_id)
    bolt = prepared.prior.bolt(bolt_id)
    camera_from_bolt = view.camera_from_prior @ bolt.prior_from_bolt
    scan = _around(camera_from_bolt.inverse().apply(view.points))
    prior = _around(bolt.prior_from_bolt.inverse().apply(prepared.points))
    # as the camera sees it: x and y across its line of sight, colour by height over the head
    from_camera = camera_from_bolt.inverse()
    x_axis, y_axis = from_camera.rotation[:, 0], from_camera.rotation[:, 1]
    shades = above.scatter(
        scan @ x_axis,
        scan @ y_axis,
        c=scan[:, 2],
        s=3,
        cmap="viridis",
        vmin=-10,
        vmax=6,
        linewidths=0,
    )
    above.figure.colorbar(shades, ax=above, shrink=0.8, label="mm above the head's face")
    ring = 0.5 * bolt.head_diameter_mm * _circle()
    above.plot(ring @ x_axis, ring @ y_axis, color="#ff7f0e", lw=1.5)
    above.set(
        xlim=(-_HALF_MM, _HALF_MM),
        ylim=(_HALF_MM, -_HALF_MM),
        aspect="equal",
        title=f"truth: {truth.fate}, {_heads(truth)}",
    )
    side = _side(camera_from_bolt)
    for points, style in ((prior, "#f5b183"), (scan, "#1f4e8c")):
        near = np.abs(points @ np.cross(side, [0.0, 0.0, 1.0])) < _SLICE_MM
        below.scatter(points[near] @ side, points[near, 2], s=8, color=style, linewidths=0)
    below.set(
        xlim=(-_HALF_MM, _HALF_MM),
        ylim=(-14, 10),
        aspect="equal",
        xlabel="across the axis, mm",
        ylabel="along the axis, mm",
    )
    below.set_title(f"{judged.state}", color=_COLOURS[judged.state], fontweight="bold")
    below.text(
        0.5,
        0.98,
        _wrapped(judged.reason),
        transform=below.transAxes,
        fontsize=8,
        ha="center",
        va="top",
    )
    below.text(0.02, 0.02, "orange: prior, blue: measured", transform=below.transAxes, fontsize=8)


def _heads(truth: TrueHead) -> str:
    before, after = truth.heads
    return before if after in ("", before) else f"{before} to {after}"


def _around(points: FloatArray) -> FloatArray:
    near = (np.abs(points) < _HALF_MM).all(axis=1)
    return points[near]


def _circle() -> FloatArray:
    angle = np.linspace(0.0, 2 * np.pi, 60)
    return np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)


def _side(camera_from_bolt: Transform) -> FloatArray:
    """Across the bolt's axis, towards the side from which the camera looks; frame `bolt`."""
    to_camera = camera_from_bolt.inverse().translation_mm * (1.0, 1.0, 0.0)
    return to_camera / np.linalg.norm(to_camera)


def _wrapped(text: str) -> str:
    words, lines = text.split(), [""]
    for word in words:
        if len(lines[-1]) + len(word) > 44:
            lines.append("")
        lines[-1] += f" {word}" if lines[-1] else word
    return "\n".join(lines)


if __name__ == "__main__":
    main()
