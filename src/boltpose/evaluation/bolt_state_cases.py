"""Clamped motors whose bolts are there, lost, exchanged or surplus, with what a camera saw of them.

All of it is simulated: reman18, and the pairs of `boltpose.synthesis.changed_bolts`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.arrays import FloatArray
from boltpose.errors import InputFileError
from boltpose.evaluation.reman18 import TrueView
from boltpose.geometry.transforms import Transform
from boltpose.io.scan import read_scan
from boltpose.registration.prepare import PreparedPrior
from boltpose.schema import PriorBolt

SAME_BOLT_MM = 3.0
"""A prior's bolt whose head is so near a true one is that one."""
_DEPTH_BIAS_MM = (0.1, 0.2)
"""Along the viewing direction, either way: what cameras and ICP together leave."""
_LATERAL_SIGMA_MM = 0.05
_ROTATION_SIGMA_RAD = float(np.radians(0.02))


class Fate(StrEnum):
    """What became of a bolt between full scan and clamping."""

    KEPT = "kept"
    LOST = "lost"
    REPLACED = "replaced"
    FALSE = "false"
    """The prior promises a bolt that the motor never had."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueHead:
    """One bolt of a prior in one view."""

    bolt_id: str
    fate: Fate
    visible_before: float
    """Share of the head that the same camera measures as long as it is there; of reman18, which
    shows no motor twice, the same as `visible_after`."""
    visible_after: float
    """Share of the head that is there now; 0 if none is."""
    higher_mm: float = 0.0
    """How much the new head is higher; negative if it is lower."""
    wider_mm: float = 0.0
    """How much the new head's flank is wider; negative if it is narrower."""
    heads: tuple[str, str] = ("", "")
    """Shapes before and after; empty after if it is gone."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Surplus:
    """A head that the motor has and its full scan lacks."""

    head_top_mm: FloatArray
    """Shape (3,), mm, frame `camera`."""
    diameter_mm: float
    height_mm: float
    visible_fraction: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BoltView:
    """One view, and what is true of every bolt of the prior."""

    name: str
    camera_from_prior: Transform
    """The truth, a little off, as a good registration is."""
    points: FloatArray
    """Shape (N, 3), mm, frame `camera`: the whole scan."""
    heads: tuple[TrueHead, ...]
    """In the prior's order."""
    surplus: tuple[Surplus, ...]
    present_mm: FloatArray
    """Shape (K, 3), frame `camera`: tops of all heads that are there, known to the prior or not."""
    changes: tuple[str, ...]


def read_bolt_view(root: Path, view: TrueView, prepared: PreparedPrior, *, seed: int) -> BoltView:
    """Read a view and tell what became of every bolt of its prior.

    Args:
        root: Folder of the data set.
        view: One of its views.
        prepared: The prior of that motor.
        seed: Of the error of the pose.

    Raises:
        InputFileError: A file cannot be read.
    """
    folder = root / view.motor
    bolts = _read_json(folder / "bolts.json")
    scanned = _read_json(folder / "prior_gt.json")["bolts"]
    now = bolts[str(view.index)]
    # pairs of views: the scanned motor, then the other one, from the same place
    before = bolts[str(view.index - view.index % 2)] if "surplus" in now else now
    heads = tuple(
        _true_head(bolt, scanned, before["bolts"], now["bolts"]) for bolt in prepared.prior.bolts
    )
    rng = np.random.default_rng([seed, int(view.motor.rsplit("_", 1)[1]), view.index])
    present = [entry["B"]["head_top"] for entry in now["bolts"] if entry.get("present", True)]
    present += [entry["head_top_B"] for entry in now.get("surplus", ())]
    return BoltView(
        present_mm=np.array(present, dtype=np.float64).reshape(-1, 3),
        name=f"{view.motor}/{view.index}",
        camera_from_prior=misplace(view.camera_from_prior, prepared.centre_mm, rng),
        points=np.asarray(read_scan(view.depth_path).points),
        heads=heads,
        surplus=tuple(
            Surplus(
                head_top_mm=np.array(entry["head_top_B"], dtype=np.float64),
                diameter_mm=float(entry["head_diameter"]),
                height_mm=float(entry["head_height"]),
                visible_fraction=float(entry["visible_fraction"]),
            )
            for entry in now.get("surplus", ())
        ),
        changes=tuple(now.get("changes", ())),
    )


def misplace(
    camera_from_prior: Transform, centre_prior: FloatArray, rng: np.random.Generator
) -> Transform:
    """Put a pose off as a good registration is: mostly along the viewing direction."""
    centre = camera_from_prior.apply(centre_prior)
    ray = centre / np.linalg.norm(centre)
    shift = rng.normal(0.0, _LATERAL_SIGMA_MM, 3)
    shift += (rng.choice([-1.0, 1.0]) * rng.uniform(*_DEPTH_BIAS_MM) - shift @ ray) * ray
    turn = Rotation.from_rotvec(rng.normal(0.0, _ROTATION_SIGMA_RAD, 3)).as_matrix()
    moved = Transform.from_parts("camera", "camera", turn, centre + shift - turn @ centre)
    return moved @ camera_from_prior


def _true_head(
    bolt: PriorBolt,
    scanned: list[dict[str, Any]],
    before: list[dict[str, Any]],
    now: list[dict[str, Any]],
) -> TrueHead:
    tops = np.array([entry["C"]["head_top"] for entry in scanned])
    distance = np.linalg.norm(tops - bolt.prior_from_bolt.translation_mm, axis=1)
    row = int(np.argmin(distance))
    if distance[row] > SAME_BOLT_MM:
        return TrueHead(bolt_id=bolt.id, fate=Fate.FALSE, visible_before=0.0, visible_after=0.0)
    old, new = scanned[row], now[row]
    fate = Fate.KEPT
    if not new.get("present", True):
        fate = Fate.LOST
    elif (new["head"], new["across"]) != (old["head"], old["across"]):
        fate = Fate.REPLACED
    return TrueHead(
        bolt_id=bolt.id,
        fate=fate,
        visible_before=float(before[row]["visible_fraction"]),
        visible_after=float(new["visible_fraction"]),
        higher_mm=float(new["head_height"] - old["head_height"]) if fate is Fate.REPLACED else 0.0,
        wider_mm=(
            float(new["head_diameter"] - old["head_diameter"]) if fate is Fate.REPLACED else 0.0
        ),
        heads=(str(old["head"]), "" if fate is Fate.LOST else str(new["head"])),
    )


def _read_json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputFileError(path, str(error), "a JSON file in the layout of reman18") from error
