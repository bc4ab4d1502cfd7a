"""How well a bolt added by a click agrees with the one that was found by itself.

Every bolt of the priors given is taken out and put back by clicks on random points of its head,
once with the labels that prior has, once with all labels of class bolt taken away (a head the
network missed). Prints one table; the motors of reman18 are simulated.

    python benchmarks/bench_added_bolts.py runs/priors/motor_0??.prior.npz
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from boltpose.prior.edit import add_bolt, remove_bolt
from boltpose.prior.file import read_prior
from boltpose.prior.review_edits import made_bolt
from boltpose.schema import Part, Prior, PriorBolt

CLICKS = 2


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
    same_side: bool


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
    labels = prior.labels
    if not with_labels:
        labels = np.where(labels == Part.BOLT, np.uint8(Part.CONNECTOR), labels)
    for bolt in prior.bolts:
        rest = remove_bolt(replace(prior, labels=labels), bolt.id)
        for click in clicks_on(prior, bolt, rng):
            made = made_bolt(rest, add_bolt(rest, click))
            assert made is not None
            x, y, z = bolt.prior_from_bolt.inverse().apply(made.prior_from_bolt.translation_mm)
            yield Row(
                was_sure=bolt.is_sure,
                is_fitted=made.head_fit_support > 0,
                is_sure=made.is_sure,
                lateral_mm=float(np.hypot(x, y)),
                axial_mm=abs(float(z)),
                diameter_mm=abs(made.head_diameter_mm - bolt.head_diameter_mm),
                height_mm=abs(made.head_height_mm - bolt.head_height_mm),
                same_side=made.side is bolt.side,
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
                f"{sum(row.is_sure and row.lateral_mm > 0.5 for row in group)} sure and over "
                f"0.5 mm off"
            )
            for name in ("lateral_mm", "axial_mm", "diameter_mm", "height_mm"):
                values = np.array([getattr(row, name) for row in fitted])
                shown = " ".join(f"{v:.3f}" for v in np.percentile(values, (50, 95, 99, 100)))
                print(f"  {name:12s} median, 95 %, 99 %, worst: {shown}")


if __name__ == "__main__":
    main()
