"""How well a bolt added by a click agrees with the one that was found, and with the truth.

Every bolt of the priors given is taken out and put back by clicks on random points of its head,
once with the labels that prior has, once with all labels of class bolt taken away (a head the
network missed). Prints one table. A prior named as a motor of `data/reman18` (simulated) is held
against what is true of that motor, any other against the bolt that was found by itself.

    python benchmarks/bench_added_bolts.py runs/priors/motor_0??.prior.npz
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from boltpose.prior.edit import add_bolt, remove_bolt
from boltpose.prior.file import read_prior
from boltpose.prior.review_edits import made_bolt
from boltpose.schema import Part, Prior, PriorBolt

CLICKS = 2
TRUTH = Path(__file__).parents[1] / "data" / "reman18"


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One click."""

    was_sure: bool
    is_fitted: bool
    is_sure: bool
    lateral_mm: float
    axial_mm: float
    diameter_mm: float
    height_mm: float
    """With its sign: less than 0 where the head's lower end is too high."""
    same_side: bool

    @property
    def is_sure_and_wrong(self) -> bool:
        """What must never be."""
        is_off = self.lateral_mm > 0.5 or self.axial_mm > 0.65
        return self.is_sure and (is_off or not self.same_side)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Head:
    """What a click should give; mm, frame `prior`."""

    head_top: np.ndarray
    axis: np.ndarray
    diameter_mm: float
    height_mm: float


def heads_of(prior: Prior) -> tuple[Head, ...]:
    """The true heads of a motor of reman18, else those that were found."""
    path = TRUTH / prior.name / "prior_gt.json"
    if path.exists():
        return tuple(
            Head(
                head_top=np.array(bolt["C"]["head_top"]),
                axis=np.array(bolt["C"]["axis"]),
                diameter_mm=bolt["across"],
                height_mm=bolt["head_height"],
            )
            for bolt in json.loads(path.read_text())["bolts"]
        )
    return tuple(
        Head(
            head_top=bolt.prior_from_bolt.translation_mm,
            axis=bolt.prior_from_bolt.z_axis,
            diameter_mm=bolt.head_diameter_mm,
            height_mm=bolt.head_height_mm,
        )
        for bolt in prior.bolts
    )


def clicks_on(prior: Prior, bolt: PriorBolt, rng: np.random.Generator) -> Iterator[np.ndarray]:
    """Random points of a head's face and flank, as a person might hit them."""
    local = bolt.prior_from_bolt.inverse().apply(prior.points)
    normals = prior.normals @ bolt.prior_from_bolt.rotation
    across = np.hypot(local[:, 0], local[:, 1])
    on_head = (across < 0.55 * bolt.head_diameter_mm) & (normals[:, 2] > -0.3)
    on_head &= (local[:, 2] > -0.8 * bolt.head_height_mm) & (local[:, 2] < 0.6)
    rows = np.flatnonzero(on_head)
    yield from prior.points[rng.choice(rows, size=min(CLICKS, len(rows)), replace=False)]


def measure(prior: Prior, rng: np.random.Generator, *, with_labels: bool) -> Iterator[Row]:
    """Take out and put back every bolt."""
    labels, heads = prior.labels, heads_of(prior)
    if not with_labels:
        labels = np.where(labels == Part.BOLT, np.uint8(Part.CONNECTOR), labels)
    for bolt in prior.bolts:
        rest = remove_bolt(replace(prior, labels=labels), bolt.id)
        for click in clicks_on(prior, bolt, rng):
            made = made_bolt(rest, add_bolt(rest, click))
            assert made is not None
            top = made.prior_from_bolt.translation_mm
            head = min(heads, key=lambda head: float(np.linalg.norm(head.head_top - top)))
            offset = top - head.head_top
            along = float(offset @ head.axis)
            yield Row(
                was_sure=bolt.is_sure,
                is_fitted=made.head_fit_support > 0,
                is_sure=made.is_sure,
                lateral_mm=float(np.linalg.norm(offset - along * head.axis)),
                axial_mm=abs(along),
                diameter_mm=abs(made.head_diameter_mm - head.diameter_mm),
                height_mm=made.head_height_mm - head.height_mm,
                same_side=float(made.prior_from_bolt.z_axis @ head.axis) > 0,
            )


def main() -> None:
    """Print the table."""
    rows: dict[bool, list[Row]] = {True: [], False: []}
    for path in sys.argv[1:] or ["demo_output/motor.prior.npz"]:  # of `make demo`
        prior = read_prior(path)
        for with_labels, kept in rows.items():
            kept += measure(prior, np.random.default_rng(0), with_labels=with_labels)
    for with_labels, kept in rows.items():
        for was_sure in (True, False):
            group = [row for row in kept if row.was_sure is was_sure]
            fitted = [row for row in group if row.is_fitted]
            if not fitted:
                continue
            print(
                f"labels {'kept' if with_labels else 'erased'}, found bolt was "
                f"{'sure' if was_sure else 'unsure'}: {len(group)} clicks, {len(fitted)} fitted, "
                f"{sum(row.is_sure for row in group)} sure, "
                f"{sum(not row.same_side for row in group)} on the other side, "
                f"{sum(row.is_sure_and_wrong for row in group)} sure and wrong"
            )
            heights = np.array([row.height_mm for row in fitted])
            print(
                f"  height_mm    lowest, 5 %, median, 95 %, highest: "
                f"{' '.join(f'{v:+.2f}' for v in np.percentile(heights, (0, 5, 50, 95, 100)))}"
            )
            for name in ("lateral_mm", "axial_mm", "diameter_mm"):
                values = np.array([getattr(row, name) for row in fitted])
                shown = " ".join(f"{v:.3f}" for v in np.percentile(values, (50, 95, 99, 100)))
                print(f"  {name:12s} median, 95 %, 99 %, worst: {shown}")


if __name__ == "__main__":
    main()
