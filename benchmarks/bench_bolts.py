"""Bolts and axes found in the full scans of reman18 (simulated), against the truth.

Run: python benchmarks/bench_bolts.py --labels true
     python benchmarks/bench_bolts.py --labels DIR   (motor_XXX.npz: `probabilities`, (N, 6))

Lateral error: distance of the found head_top from the true axis line. Matching: Hungarian, 5 mm.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment
from threadpoolctl import threadpool_limits

from boltpose.datasets.reman18 import Reman18
from boltpose.geometry.normals import estimate_normals, orient_outward
from boltpose.geometry.transforms import angle_between_rad
from boltpose.prior.alignment import align_motor
from boltpose.prior.find_bolts import find_bolts
from boltpose.schema import Alignment, PriorBolt

GATE_MM = 5.0


@dataclass
class Tally:
    """What was found, over motors."""

    true_count: int = 0
    matched: list[dict[str, Any]] = field(default_factory=list)
    false: list[PriorBolt] = field(default_factory=list)
    axis_deg: list[float] = field(default_factory=list)
    roll_deg: list[float] = field(default_factory=list)
    axis_sigma_deg: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)


def main() -> None:
    """Print one line per motor, every error worth a look, and the summary."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=Path("data/reman18"))
    parser.add_argument("--labels", default="true", help="`true` or a folder of probabilities")
    parser.add_argument("--motors", nargs="*", help="names; all by default")
    parser.add_argument("--quiet", action="store_true", help="summary only")
    args = parser.parse_args()
    data = Reman18(root=args.data)
    tally = Tally()
    for motor in args.motors or data.motors:
        with threadpool_limits(1, user_api="blas"):
            bench_motor(data, motor, args.labels, tally, quiet=args.quiet)
    report(tally, args.labels)


def bench_motor(data: Reman18, motor: str, labels: str, tally: Tally, *, quiet: bool) -> None:
    """Find the bolts of one motor and add what came out to the tally."""
    scan = data.full_scan(motor)
    truth = json.loads((data.root / motor / "prior_gt.json").read_text())
    normals = orient_outward(scan.points, estimate_normals(scan.points, 20))
    if labels == "true":
        probabilities = (scan.labels[:, None] == np.arange(1, 7)).astype(np.float32)
    else:
        with np.load(Path(labels) / f"{motor}.npz", allow_pickle=False) as archive:
            probabilities = archive["probabilities"]
    start = perf_counter()
    classes = (probabilities.argmax(axis=1) + 1).astype(np.uint8)
    alignment = align_motor(scan.points, normals, classes)
    aligned = perf_counter()
    bolts = find_bolts(scan.points, normals, probabilities, alignment)
    seconds = perf_counter() - aligned
    axis_deg, roll_deg = axis_errors(alignment, np.array(truth["T_M_to_C"]))
    tally.axis_deg.append(axis_deg)
    tally.roll_deg.append(roll_deg)
    tally.axis_sigma_deg.append(float(np.rad2deg(alignment.axis_sigma_rad)))
    tally.seconds.append(seconds)
    before = len(tally.matched), len(tally.false)
    notes = match(motor, bolts, truth["bolts"], tally)
    sure = sum(bolt.is_sure for bolt in bolts)
    if not quiet:
        print(
            f"{motor} {truth['family_name']:24s} true {len(truth['bolts']):2d} "
            f"matched {len(tally.matched) - before[0]:2d} false {len(tally.false) - before[1]} "
            f"sure {sure:2d}  axis {axis_deg:.3f} deg roll {roll_deg:+.3f} deg  "
            f"align {aligned - start:.2f} s bolts {seconds:.2f} s"
        )
        for note in notes:
            print("   ", note)


def axis_errors(alignment: Alignment, truth: np.ndarray) -> tuple[float, float]:
    """Angle between the z axes and turn about it, degrees."""
    found = alignment.prior_from_motor
    relative = truth[:3, :3].T @ found.rotation
    return (
        float(np.rad2deg(angle_between_rad(found.z_axis, truth[:3, 2]))),
        float(np.rad2deg(np.arctan2(relative[1, 0], relative[0, 0]))),
    )


def match(
    motor: str, bolts: tuple[PriorBolt, ...], truth: list[dict[str, Any]], tally: Tally
) -> list[str]:
    """Pair found and true bolts; returns a line for each one worth a look."""
    tally.true_count += len(truth)
    tops = np.array([bolt["C"]["head_top"] for bolt in truth])
    found = np.array([bolt.prior_from_bolt.translation_mm for bolt in bolts]).reshape(-1, 3)
    cost = np.linalg.norm(found[:, None] - tops[None], axis=2)
    rows, columns = linear_sum_assignment(np.where(cost <= GATE_MM, cost, 1e6))
    pairs = [(r, c) for r, c in zip(rows, columns, strict=True) if cost[r, c] <= GATE_MM]
    notes: list[str] = []
    for r, c in pairs:
        bolt, true = bolts[r], truth[c]
        axis = np.array(true["C"]["axis"])
        offset = found[r] - tops[c]
        axial = float(offset @ axis)
        lateral = float(np.linalg.norm(offset - axial * axis))
        centre = bolt.cluster_centre - tops[c]
        record = {
            "motor": motor,
            "lateral": lateral,
            "axial": axial,
            "cluster": float(np.linalg.norm(np.cross(centre, axis))),
            "side": str(bolt.side) == true["side"],
            "diameter": bolt.head_diameter_mm - true["across"],
            "bolt": bolt,
        }
        tally.matched.append(record)
        if lateral > 0.4 or not record["side"] or not bolt.is_sure or abs(axial) > 0.3:
            notes.append(
                f"{'ok   ' if lateral <= 0.5 else 'OFF  '}{describe(bolt)} lateral {lateral:.2f} "
                f"axial {axial:+.2f} diameter {record['diameter']:+.1f} | {true['head']} "
                f"M{true['M']} recess {true['recess']} {true['scan_points']} points"
                + ("" if record["side"] else "  WRONG SIDE")
            )
    for c in set(range(len(truth))) - {c for _, c in pairs}:
        true = truth[c]
        notes.append(
            f"MISS {true['side']} {true['head']} M{true['M']} {true['group']} "
            f"{np.round(true['motor']['head_top'], 1)} {true['scan_points']} points"
        )
    for r in sorted(set(range(len(bolts))) - {r for r, _ in pairs}):
        tally.false.append(bolts[r])
        away = f"{cost[r].min():.1f} mm from a true bolt" if len(truth) else ""
        notes.append(f"FALSE {describe(bolts[r])} {away}")
    return notes


def describe(bolt: PriorBolt) -> str:
    """One bolt in a line."""
    return (
        f"{bolt.id:3s} {'sure' if bolt.is_sure else 'UNSURE'} n {bolt.point_count} "
        f"p {bolt.class_probability:.2f} support {bolt.head_fit_support:.1f} "
        f"d {bolt.head_diameter_mm:.1f} sigma {bolt.sigma_lateral_mm:.2f} {list(bolt.remarks)}"
    )


def report(tally: Tally, labels: str) -> None:
    """Print the table the targets are checked against."""
    matched, bolts = tally.matched, [record["bolt"] for record in tally.matched]
    sure = [record for record in matched if record["bolt"].is_sure]
    false_sure = sum(bolt.is_sure for bolt in tally.false)
    found = len(matched) + len(tally.false)

    def spread(values: list[float]) -> str:
        if not values:
            return "-"
        a = np.abs(values)
        return f"{np.median(a):.3f} / {np.percentile(a, 95):.3f} / {a.max():.3f}"

    print(f"\nreman18 (simulated), labels: {labels}; median / 95 % / max")
    print(
        f"recall            {len(matched)}/{tally.true_count} = "
        f"{len(matched) / tally.true_count:.4f}"
    )
    print(f"precision         {len(matched)}/{found} = {len(matched) / max(found, 1):.4f}")
    print(f"right side        {sum(r['side'] for r in matched)}/{len(matched)}")
    print(f"sure              {len(sure)}/{len(matched)} = {len(sure) / max(len(matched), 1):.4f}")
    print(f"false but sure    {false_sure}")
    print(f"lateral mm        {spread([r['lateral'] for r in matched])}")
    print(f"lateral mm, sure  {spread([r['lateral'] for r in sure])}")
    print(f"cluster mean mm   {spread([r['cluster'] for r in matched])}")
    print(f"axial mm          {spread([r['axial'] for r in matched])}")
    print(f"diameter mm, sure {spread([r['diameter'] for r in sure])}")
    ratio = [r["lateral"] / b.sigma_lateral_mm for r, b in zip(matched, bolts, strict=True)]
    inside = np.mean(np.array(ratio) < 2.448)
    print(f"lateral / sigma   {spread(ratio)}; {inside:.3f} within the 95 % circle")
    ratio = [r["axial"] / b.sigma_axial_mm for r, b in zip(matched, bolts, strict=True)]
    print(f"axial / sigma     {spread(ratio)}; {np.mean(np.abs(ratio) < 1.96):.3f} within 95 %")
    print(f"axis deg          {spread(tally.axis_deg)}; sigma {spread(tally.axis_sigma_deg)}")
    print(f"roll deg          {spread(tally.roll_deg)}")
    print(f"seconds per motor {spread(tally.seconds)}")


if __name__ == "__main__":
    main()
