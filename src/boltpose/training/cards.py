"""Model cards, written from the files they describe so that they cannot disagree."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import onnx

from boltpose.io.atomic import write_atomic
from boltpose.segmentation.models import PARTS_FILE, PARTS_LOCAL_FILE, SCENE_FILE, SCENE_LOCAL_FILE
from boltpose.training.runs import METRICS_FILE

_PARTS = """# Model card: parts of a full scan

**What.** Two networks label every point of a complete scan of a starter motor (about
100 000 points, 0.8-1.1 mm apart, mm) with one of six parts: main housing, connector
(drive-end bracket), solenoid, electrical connector, gear, bolt head. `parts_local.onnx`
is a perceptron (hidden 128) that judges each point by {features} dense features (13 of
its place in a label-free canonical frame, 14 of its surroundings at each of 5 radii
from 1.8 to 15 mm, all measured on the full scan). `parts.onnx` is PCT (offset
attention, {layers} layers, {channels} channels, {parameters}) over random sub-clouds of
{sub_cloud} points, each with those features, the perceptron's probabilities and their
averages over 3, 6 and 12 mm. Both vote (geometric mean); one temperature calibrates.

**Data.** First 240 motors of the motor factory (`boltpose synth motors -n 240 --seed 0`,
16 families, worn; 2 without a canonical frame left out), then reman18, 18 starter
motors of 6 families from another generator. All scans are **simulated** (see
`docs/factory.md`, `data/reman18/README.md`). No real scan was used: expect worse on
real ones, and measure.

**Recipe.** Pretrained on the factory's motors (recipe `many`), then fine-tuned on
reman18 (recipe `fine-tune`) with 3 clouds per motor (the scan, and two copies scaled
0.9-1.1, tilted, thinned to 60-100 % and with 0.03 mm of noise), mirrored at random;
every position column stretched (sigma 10 %) and shifted (sigma 0.3 standard deviations)
at random, because where a housing ends or a pinion sits differs between families.
Stage one cross-fitted: stage two learns on probabilities by perceptrons that have not
seen the family at hand.
AdamW, cosine, cross-entropy with class weights 1, 1, 1, 2, 2, 3 and label smoothing
0.05; all numbers in `metrics.json`, key `recipe`. The recipe was chosen by looking at
some of the families left out (`docs/experiments.md`), so the numbers below are slightly
optimistic; it is one recipe for all, and no network was chosen by its score. Networks
with a family left out start from the same pretrained ones: the factory's motors are of
its own families, none was made after reman18.
"""

_SCENE = """# Model card: motor or not, in a view

**What.** Two networks tell for every point of one camera view whether it is on the
motor. The view is thinned to 5 mm voxels and levelled by the plate under the clamp (the
largest plane that hardly anything lies behind). `scene_local.onnx` is a perceptron
(hidden 128) over {features} features of each voxel (height, normal, surroundings at 12,
22, 40 and 70 mm). `scene.onnx` is PCT (offset attention, {layers} layers, {channels}
channels, {parameters}) over random sub-clouds of {sub_cloud} voxels, each with its
place, its features, the perceptron's probability and its averages over 12, 25 and 50
mm. One temperature calibrates. The mask is meant to be refined by registration
(register, relabel, register).

**Data.** First 320 views of 80 motors of the motor factory in 10 kinds of clamps
(`boltpose synth scenes -n 80 --views 4 --seed 0`), then reman18: 72 views of 18 starter
motors of 6 families in 5 kinds of clamps, no table around the base plate. All views are
**simulated** (see `docs/factory.md`, `data/reman18/README.md`). No real view was used.
The clamps of the held-out family's views are of the same kinds as in training.

**Recipe.** Pretrained (recipe `many`), fine-tuned (recipe `fine-tune`). Scenes turned
about the plate's normal (sigma 0.6 rad), tilted, mirrored, scaled 0.9-1.1, cropped.
Stage one cross-fitted as for the parts. AdamW, cosine, cross-entropy with label
smoothing 0.05; all numbers in `metrics.json`, key `recipe`.
The features were chosen by looking at two of the families left out.
"""

_LIMITS = {
    "parts": """\
**Limits.** Needs a complete scan in mm with outward normals, of a motor whose housing
(radius 22-60 mm) and solenoid have parallel axes. Without a solenoid the turn about the
axis is arbitrary and labels are unreliable
(`PartProbabilities.frame.has_second_cylinder` tells). The border between housing and
bracket, both parts of one smooth wall, is the weakest point, and pinions beside the
main axis (`offset_reduction`) are often taken for the bracket. Bolt heads are
recessed, worn or hidden at times: every bolt is checked by geometry afterwards.
Probabilities are calibrated on simulated data only.
""",
    "scene": """\
**Limits.** One motor in a clamp on a plate, camera above or beside it, mm. Scenes with
large other objects or several motors were not seen in training; a scene
without any motor still gets a mask. Never trust the mask alone: the pose found with it
is verified against the scan.
""",
}

_RETRAIN = """\
**Retrain.** `make models` does it all, from the synthetic data sets to this card. Plan
half a day of one core; no run of the whole was timed. On your own motors:
`docs/train-your-own.md`.
"""


def write_cards(folder: Path, shipped: Path, families: Sequence[str]) -> tuple[Path, ...]:
    """Write the model cards of the shipped networks.

    Args:
        folder: Holds one folder of networks and metrics per family left out.
        shipped: Folder of the shipped networks; the cards go there.
        families: Families left out, one after the other.

    Returns:
        The cards' paths.
    """
    metrics = {
        family: json.loads((folder / family / METRICS_FILE).read_text()) for family in families
    }
    cards: list[Path] = []
    for network, text, files in (
        ("parts", _PARTS, (PARTS_LOCAL_FILE, PARTS_FILE)),
        ("scene", _SCENE, (SCENE_LOCAL_FILE, SCENE_FILE)),
    ):
        found = {family: values[network] for family, values in metrics.items()}
        recipe = next(iter(found.values()))["recipe"]
        local, context = (shipped / name for name in files)
        head = text.format(
            features=_settings(local)["inputs"],
            layers=recipe["layers"],
            channels=recipe["channels"],
            sub_cloud=recipe["sub_cloud"],
            parameters=f"{_parameters(context) / 1e6:.2f} M parameters",
        )
        hashes = "\n".join(
            f"    {hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}"
            for path in (local, context)
        )
        temperature = _settings(context).get("temperature", 1.0)
        sections = (
            head,
            _table(found),
            f"**Calibration.** Temperature {temperature}, fitted on families not seen.\n",
            _LIMITS[network],
            _RETRAIN,
            f"**Files** (SHA-256)\n\n{hashes}\n",
        )
        path = shipped / f"{network}.md"
        _write(path, "\n".join(sections))
        cards.append(path)
    return tuple(cards)


def _table(found: dict[str, Any]) -> str:
    """Scores on the families left out, one row each, and their mean."""
    names = list(next(iter(found.values()))["held_out"]["iou"])
    head = ["family left out", "OA", "mIoU", *(name.replace("_", " ") for name in names)]
    rows: list[list[float]] = []
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for family, values in found.items():
        scores = values["held_out"]
        row = [scores["overall_accuracy"], scores["mean_iou"], *(scores["iou"][n] for n in names)]
        rows.append(row)
        lines.append(f"| {family} | " + " | ".join(f"{100 * value:.1f}" for value in row) + " |")
    means = [sum(column) / len(rows) for column in zip(*rows, strict=True)]
    lines.append("| *mean* | " + " | ".join(f"{100 * value:.1f}" for value in means) + " |")
    return (
        "**Scores** on motors of a family the networks have not seen, through the exported files,\n"
        "in percent (IoU per class); `python -m boltpose.training scores` prints them:\n\n"
        + "\n".join(lines)
        + "\n"
    )


def _settings(path: Path) -> dict[str, Any]:
    """Settings in a network's metadata."""
    model = onnx.load(path)
    return json.loads(
        next(entry.value for entry in model.metadata_props if entry.key == "boltpose.settings")
    )


def _parameters(path: Path) -> int:
    """Numbers stored in a network."""
    return sum(math.prod(constant.dims) for constant in onnx.load(path).graph.initializer)


def _write(path: Path, text: str) -> None:
    def write(stream: BinaryIO) -> None:
        stream.write(text.encode())

    write_atomic(path, write)
