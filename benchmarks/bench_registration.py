"""Registration and verdict on all views of reman18 (simulated), right and wrong cases.

    python benchmarks/bench_registration.py                    # every motor, all four views
    python benchmarks/bench_registration.py --views 1 --motors motor_000 motor_006
    python benchmarks/bench_registration.py --method paper     # needs the extra `bench`

Masks are the true ones, or the true ones made worse on purpose: what a network gets wrong is
measured by `boltpose evaluate`. Priors are built from the full scans with their true labels.
Families with an even index chose the thresholds of `VerifyConfig`, the odd ones test them.
Times are CPU seconds of this process. `--csv FILE` writes every score of every case, and
`--table FILE ...` prints the tables of such files under today's thresholds. Two are kept:
results/registration_right.csv (`--only right`, 72 views) and
results/registration_right_and_wrong_view0.csv (`--views 1`: every right and wrong case, 18 views).
"""

from __future__ import annotations

import argparse
import csv
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

from boltpose.arrays import FloatArray
from boltpose.datasets.reman18 import Reman18
from boltpose.errors import DegenerateGeometryError
from boltpose.geometry.sampling import voxel_downsample
from boltpose.geometry.transforms import Transform, rotation_angle_rad
from boltpose.io.scan import read_scan
from boltpose.prior.build import BuildConfig, build_prior
from boltpose.prior.file import read_prior, write_prior
from boltpose.registration.config import RegistrationConfig, VerifyConfig
from boltpose.registration.evidence import Evidence
from boltpose.registration.icp import refine_pose
from boltpose.registration.prepare import PreparedPrior, prepare_prior
from boltpose.registration.register import rank_pose, register
from boltpose.registration.scene import Scene, build_scene
from boltpose.registration.verify import decide, refuse_without_pose, verify
from boltpose.registration.visibility import see_bolts
from boltpose.schema import Registration, Status, Verdict

RIGHT_MASKS = ("true mask", "5 % clamp", "10 % clamp", "20 % clamp", "30 % missing")
CSV_COLUMNS = (
    "kind",
    "motor",
    "view",
    "prior",
    "is_right",
    "worst_bolt_mm",
    "rotation_deg",
    "cpu_register_s",
    "cpu_verify_s",
    "status",
    "failed",
)
FALSE_POSITION_MM = 2.0
FALSE_ANGLE_DEG = 2.0


@dataclass(frozen=True, kw_only=True)
class Row:
    """One case: a pose, what is true of it and what the verdict says."""

    kind: str
    is_even_family: bool
    motor: str
    view: int
    prior: str
    is_right: bool
    worst_bolt_mm: float
    rotation_deg: float
    cpu_register_s: float
    cpu_verify_s: float
    verdict: Verdict
    rms_mm: float = float("nan")
    mahalanobis2: float = float("nan")
    sights: tuple[tuple[float, float, bool, bool], ...] = ()


@dataclass(frozen=True, kw_only=True)
class View:
    """One view with everything that is known about it."""

    motor: str
    number: int
    is_even_family: bool
    scan: FloatArray
    is_motor: np.ndarray
    camera_from_prior: Transform
    scene: Scene


def load_priors(data: Reman18, cache: Path) -> dict[str, PreparedPrior]:
    """Build every prior from true labels, or read it from the cache folder."""
    cache.mkdir(parents=True, exist_ok=True)
    prepared = {}
    for motor in data.motors:
        path = cache / f"{motor}.npz"
        if not path.exists():
            scan = read_scan(data.root / motor / "prior.ply")
            config = BuildConfig(use_file_labels=True)
            write_prior(path, build_prior(scan, config=config, name=motor))
        prepared[motor] = prepare_prior(read_prior(path))
    return prepared


def pose_error(pose: Transform, truth: Transform, prepared: PreparedPrior) -> tuple[float, float]:
    """Worst bolt in mm, rotation in degrees."""
    heads = np.array([bolt.prior_from_bolt.translation_mm for bolt in prepared.prior.bolts])
    worst = np.linalg.norm(pose.apply(heads) - truth.apply(heads), axis=1).max()
    return float(worst), float(np.degrees(rotation_angle_rad(pose.rotation.T @ truth.rotation)))


def mahalanobis2(best: Registration, truth: Transform) -> float:
    """Squared distance of the truth in units of the stated covariance; mean 6 if calibrated."""
    turn = Rotation.from_matrix(truth.rotation @ best.camera_from_prior.rotation.T).as_rotvec()
    centre = best.camera_from_prior.inverse().apply(best.centre_mm)
    error = np.concatenate([turn, truth.apply(centre) - best.centre_mm])
    return float(error @ np.linalg.solve(best.covariance, error))


def spoil_mask(view: View, name: str, rng: np.random.Generator) -> FloatArray:
    """Motor points of the view under a worse mask; clamp points come as one patch."""
    motor = view.scan[view.is_motor]
    if name == "true mask":
        return motor
    share = float(name.split()[0]) / 100
    if name.endswith("missing"):
        direction = rng.normal(size=3)
        height = motor @ direction
        return motor[height > np.quantile(height, share)]
    clamp = view.scan[~view.is_motor]
    count = min(int(len(motor) * share / (1 - share)), len(clamp))
    seed = clamp[rng.integers(len(clamp))]
    nearest = np.argsort(np.linalg.norm(clamp - seed, axis=1), kind="stable")[:count]
    return np.vstack([motor, clamp[nearest]])


def judge(
    kind: str,
    view: View,
    prepared: PreparedPrior,
    registration: Registration | None,
    points: FloatArray,
    *,
    can_be_right: bool,
    scene: Scene | None = None,
    cpu_register_s: float = 0.0,
) -> Row:
    """Ask the verdict about a case and note the truth beside it."""
    start = time.process_time()
    verdict = verify(registration, prepared, scene or view.scene, points)
    cpu_verify_s = time.process_time() - start
    worst, angle = float("inf"), float("inf")
    if registration is not None and can_be_right:
        worst, angle = pose_error(registration.camera_from_prior, view.camera_from_prior, prepared)
    return Row(
        kind=kind,
        is_even_family=view.is_even_family,
        motor=view.motor,
        view=view.number,
        prior=prepared.prior.name,
        is_right=worst <= FALSE_POSITION_MM and angle <= FALSE_ANGLE_DEG,
        worst_bolt_mm=worst,
        rotation_deg=angle,
        cpu_register_s=cpu_register_s,
        cpu_verify_s=cpu_verify_s,
        verdict=verdict,
        rms_mm=registration.rms_mm if registration else float("nan"),
    )


def right_cases(
    view: View, prepared: PreparedPrior, data: Reman18, config: RegistrationConfig
) -> Iterator[Row]:
    """The motor's own prior, masks from perfect to poor."""
    for number, name in enumerate(RIGHT_MASKS):
        rng = np.random.default_rng([view.number, number, int(view.motor[-3:])])
        points = spoil_mask(view, name, rng)
        start = time.process_time()
        result = register(prepared, points, config, scene=view.scene)
        cpu = time.process_time() - start
        row = judge(
            name, view, prepared, result.best, points, can_be_right=True, cpu_register_s=cpu
        )
        if name == "true mask" and result.best is not None:
            row = replace(
                row,
                mahalanobis2=mahalanobis2(result.best, view.camera_from_prior),
                sights=compare_sights(view, prepared, result.best, data),
            )
        yield row
        for other in result.candidates[1:]:
            other_row = judge("runner-up", view, prepared, other, points, can_be_right=True)
            if not other_row.is_right:
                yield other_row


def compare_sights(
    view: View, prepared: PreparedPrior, best: Registration, data: Reman18
) -> tuple[tuple[float, float, bool, bool], ...]:
    """Per bolt: visible fraction found and true, visible found and true."""
    sights = see_bolts(prepared, best.camera_from_prior, view.scan)
    heads = np.array([bolt.prior_from_bolt.translation_mm for bolt in prepared.prior.bolts])
    pairs = []
    truths = json.loads((data.root / view.motor / "bolts.json").read_text())
    for truth in truths[str(view.number)]["bolts"]:
        distance = np.linalg.norm(heads - np.array(truth["C"]["head_top"]), axis=1)
        nearest = int(distance.argmin())
        if distance[nearest] < 3.0:
            sight = sights[nearest]
            pairs.append(
                (
                    sight.visible_fraction,
                    float(truth["visible_fraction"]),
                    sight.visibility != "hidden",
                    bool(truth["visible"]),
                )
            )
    return tuple(pairs)


def moved_poses(view: View, prepared: PreparedPrior) -> Iterator[tuple[str, bool, Transform]]:
    """Wrong poses near the true one: kind, whether to refine them again, pose."""
    rng = np.random.default_rng([7, view.number, int(view.motor[-3:])])
    axis = prepared.prior.alignment.prior_from_motor.z_axis
    centre = prepared.centre_mm

    def moved(turn: FloatArray, shift: FloatArray) -> Transform:
        rotation = Rotation.from_rotvec(turn).as_matrix()
        inner = Transform.from_parts("prior", "prior", rotation, centre - rotation @ centre + shift)
        return view.camera_from_prior @ inner

    for size in (2.0, 3.0, 5.0, 10.0):
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        yield f"moved {size:.0f} mm", False, moved(np.zeros(3), 1.05 * size * direction)
        yield f"turned {size:.0f} deg", False, moved(np.radians(1.05 * size) * direction, axis * 0)
    for slide in (-20.0, -10.0, -5.0, 5.0, 10.0, 20.0):
        yield "slid, refined", True, moved(np.zeros(3), slide * axis)
    for roll in (15, 30, 60, 90, 120, 180, 240, 270, 300, 330):
        yield "rolled, refined", True, moved(np.radians(roll) * axis, np.zeros(3))
    across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    across /= np.linalg.norm(across)
    for flip in (across, np.cross(axis, across)):
        yield "flipped, refined", True, moved(np.pi * flip, np.zeros(3))


def near_miss_cases(
    view: View, prepared: PreparedPrior, config: RegistrationConfig
) -> Iterator[Row]:
    """Poses a little or cleverly wrong, the mask true."""
    points = view.scan[view.is_motor]
    result = register(prepared, points, config, scene=view.scene)
    if result.best is None:
        return
    sample = voxel_downsample(points, 2.0)
    sample = sample[np.random.default_rng(0).permutation(len(sample))[:2000]]
    for kind, is_refined, pose in moved_poses(view, prepared):
        candidate = result.best
        if is_refined:
            try:
                fine = refine_pose(pose, points, prepared, config.fine)
            except DegenerateGeometryError:
                continue
            pose = fine.camera_from_prior
            candidate = replace(
                candidate,
                converged=fine.converged,
                covariance=fine.covariance,
                centre_mm=fine.centre_mm,
            )
        # the runner-up stays the one of the right pose: the margin check gets no help from it
        candidate = replace(
            candidate,
            camera_from_prior=pose,
            score=rank_pose(pose, sample, prepared, config, view.scene),
        )
        row = judge(kind, view, prepared, candidate, points, can_be_right=True)
        if not row.is_right:
            yield row


def wrong_scene_cases(
    view: View,
    priors: dict[str, PreparedPrior],
    data: Reman18,
    config: RegistrationConfig,
) -> Iterator[Row]:
    """Another motor in the clamp, a mirrored scan, noise, clamp points taken for the motor."""
    points = view.scan[view.is_motor]
    family = data.family(view.motor)
    rng = np.random.default_rng([9, view.number, int(view.motor[-3:])])
    others = [motor for motor in data.motors_of(family) if motor != view.motor]
    strangers = [motor for motor in data.motors if data.family(motor) != family]
    chosen = [strangers[int(row)] for row in rng.choice(len(strangers), 3, replace=False)]
    own = priors[view.motor]
    mirror = np.array([-1.0, 1.0, 1.0])
    low, high = points.min(axis=0), points.max(axis=0)
    noise = rng.uniform(low, high, size=(60_000, 3))
    clamp = view.scan[~view.is_motor]
    cases: list[tuple[str, PreparedPrior, FloatArray, Scene]] = [
        *(("other size", priors[motor], points, view.scene) for motor in others),
        *(("other family", priors[motor], points, view.scene) for motor in chosen),
        ("mirrored", own, points * mirror, build_scene(view.scan * mirror)),
        ("uniform noise", own, noise, build_scene(noise)),
        ("clamp only", own, clamp, view.scene),
        ("whole scene", own, view.scan, view.scene),
    ]
    for kind, prepared, target, scene in cases:
        start = time.process_time()
        result = register(prepared, target, config, scene=scene)
        cpu = time.process_time() - start
        yield judge(
            kind,
            view,
            prepared,
            result.best,
            target,
            can_be_right=kind == "whole scene",
            scene=scene,
            cpu_register_s=cpu,
        )


def slack(row: Row) -> dict[str, float]:
    """Per score, how far on the accepting side: above 0 accepts, in units of the threshold."""
    result = {}
    for name, wanted in row.verdict.thresholds.items():
        found = row.verdict.scores.get(name, 0.0)
        sign = -1.0 if name in ("free_space_violation", "bolt_sigma_mm") else 1.0
        result[name] = sign * (found - wanted) / wanted
    return result


def print_tables(rows: list[Row]) -> None:
    """Print what a reader wants to know, positives and negatives apart."""
    for title, part in (
        ("all families", rows),
        ("even families (thresholds chosen here)", [r for r in rows if r.is_even_family]),
        ("odd families (test)", [r for r in rows if not r.is_even_family]),
    ):
        print(f"\n== {title}")
        print(
            f"{'case':18s} {'n':>5s} {'right':>6s} {'ok':>5s} {'false ok':>8s}  nearest to accept"
        )
        for kind in dict.fromkeys(row.kind for row in part):
            cases = [row for row in part if row.kind == kind]
            ok = [row for row in cases if row.verdict.status is Status.OK]
            false_ok = sum(not row.is_right for row in ok)
            wrong = [row for row in cases if not row.is_right]
            closest = max((min(slack(row).values()) for row in wrong), default=float("nan"))
            print(
                f"{kind:18s} {len(cases):5d} {sum(r.is_right for r in cases):6d} {len(ok):5d} "
                f"{false_ok:8d}  {closest:+.2f}"
            )
        print_scores(part)


def print_scores(rows: list[Row]) -> None:
    """Per score the worst of the right and the best of the wrong cases."""
    right = [row for row in rows if row.is_right]
    wrong = [row for row in rows if not row.is_right]
    names = dict.fromkeys(name for row in rows for name in row.verdict.scores)
    print(
        f"{'score':22s} {'wanted':>8s}  right: worst, 1 %, median       wrong: median, 99 %, best"
    )
    for name in names:
        lower_is_better = name in ("free_space_violation", "bolt_sigma_mm")
        sign = -1.0 if lower_is_better else 1.0

        def values(part: list[Row], name: str = name, sign: float = sign) -> FloatArray:
            found = [row.verdict.scores[name] for row in part if name in row.verdict.scores]
            return sign * np.sort(sign * np.array(found or [np.nan]))

        good, bad = values(right), values(wrong)
        wanted = next(
            row.verdict.thresholds[name] for row in rows if name in row.verdict.thresholds
        )
        at = [good[0], good[len(good) // 100], good[len(good) // 2]]
        at += [bad[len(bad) // 2], bad[-1 - len(bad) // 100], bad[-1]]
        print(f"{name:22s} {wanted:8.3g}  " + " ".join(f"{value:10.4g}" for value in at))


def print_accuracy(rows: list[Row]) -> None:
    """Print errors, times, covariance and visibility of the right masks."""
    print(
        f"\n{'mask':14s} {'right':>7s} {'worst bolt mm: median, 95 %, max':>34s} "
        f"{'rotation deg':>18s} {'CPU s: register, verify':>24s}"
    )
    for kind in RIGHT_MASKS:
        part = [row for row in rows if row.kind == kind]
        if not part:
            continue
        good = [row for row in part if row.is_right]
        mm = np.array([row.worst_bolt_mm for row in good] or [np.nan])
        deg = np.array([row.rotation_deg for row in good] or [np.nan])
        print(
            f"{kind:14s} {len(good):3d}/{len(part):3d} "
            f"{np.median(mm):18.3f} {np.percentile(mm, 95):7.3f} {mm.max():7.3f} "
            f"{np.median(deg):10.3f} {deg.max():7.3f} "
            f"{np.median([row.cpu_register_s for row in part]):16.2f} "
            f"{np.median([row.cpu_verify_s for row in part]):7.2f}"
        )
    distances = np.array([row.mahalanobis2 for row in rows if np.isfinite(row.mahalanobis2)])
    if len(distances):
        # 12.59 is the 95 % point of chi squared with six degrees of freedom
        print(
            f"truth inside the stated 95 % ellipsoid: {np.mean(distances < 12.59):.3f}, "
            f"mean squared distance {distances.mean():.2f} (6 if calibrated)"
        )
    sights = np.array([sight for row in rows for sight in row.sights], dtype=np.float64)
    if len(sights):
        found, true = sights[:, 0], sights[:, 1]
        print(
            f"visible fraction of {len(sights)} bolt heads: correlation "
            f"{np.corrcoef(found, true)[0, 1]:.3f}, mean absolute error "
            f"{np.abs(found - true).mean():.3f}, bias {np.mean(found - true):+.3f}; "
            f"seen or not agrees in {np.mean(sights[:, 2] == sights[:, 3]):.3f}"
        )


def write_csv(path: Path, rows: list[Row]) -> None:
    """Write every case with every score."""
    names = list(dict.fromkeys(name for row in rows for name in row.verdict.thresholds))
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*CSV_COLUMNS, *names])
        for row in rows:
            writer.writerow(
                [row.kind, row.motor, row.view, row.prior, int(row.is_right)]
                + [f"{row.worst_bolt_mm:.4g}", f"{row.rotation_deg:.4g}"]
                + [f"{row.cpu_register_s:.3f}", f"{row.cpu_verify_s:.3f}"]
                + [row.verdict.status.value, " ".join(check.value for check in row.verdict.failed)]
                + [f"{row.verdict.scores.get(name, float('nan')):.4g}" for name in names]
            )


def read_csv(path: Path, families: dict[str, bool]) -> list[Row]:
    """Read cases back and decide them again with the thresholds of today."""
    rows = []
    with path.open(newline="") as file:
        for line in csv.DictReader(file):
            scores = {name: float(line[name]) for name in line if name not in CSV_COLUMNS}
            if np.isnan(scores["tight"]):
                verdict = refuse_without_pose(0, VerifyConfig())
            else:
                scores["motor_points"] = int(scores["motor_points"])
                scores["judged_points"] = int(scores["judged_points"])
                scores["converged"] = bool(scores["converged"])
                verdict = decide(Evidence(**scores), VerifyConfig())
            rows.append(
                Row(
                    kind=line["kind"],
                    is_even_family=families[line["motor"]],
                    motor=line["motor"],
                    view=int(line["view"]),
                    prior=line["prior"],
                    is_right=line["is_right"] == "1",
                    worst_bolt_mm=float(line["worst_bolt_mm"]),
                    rotation_deg=float(line["rotation_deg"]),
                    cpu_register_s=float(line.get("cpu_register_s") or "nan"),
                    cpu_verify_s=float(line.get("cpu_verify_s") or "nan"),
                    verdict=verdict,
                )
            )
    return rows


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--data", type=Path, default=Path("data/reman18"))
    parser.add_argument("--cache", type=Path, default=Path("/tmp/boltpose-bench-priors"))
    parser.add_argument("--motors", nargs="*")
    parser.add_argument("--views", type=int, default=4)
    parser.add_argument("--only", choices=("right", "near", "wrong"))
    parser.add_argument("--method", default="multi_start")
    parser.add_argument("--csv", type=Path, help="where every case with its scores goes")
    parser.add_argument("--table", type=Path, nargs="*", help="print the tables of such files")
    args = parser.parse_args()
    data = Reman18(root=args.data)
    families = {motor: data.families.index(data.family(motor)) % 2 == 0 for motor in data.motors}
    if args.table:
        print_tables([row for path in args.table for row in read_csv(path, families)])
        return
    config = RegistrationConfig(method=args.method)
    rows: list[Row] = []
    with threadpool_limits(1, user_api="blas"):
        priors = load_priors(data, args.cache)
        for motor in args.motors or data.motors:
            for number in range(min(args.views, data.view_count(motor))):
                cloud = data.view(motor, number)
                view = View(
                    motor=motor,
                    number=number,
                    is_even_family=families[motor],
                    scan=cloud.points,
                    is_motor=cloud.labels > 0,
                    camera_from_prior=Transform(
                        "camera", "prior", data.camera_from_prior(motor, number)
                    ),
                    scene=build_scene(cloud.points),
                )
                if args.only in (None, "right"):
                    rows += right_cases(view, priors[motor], data, config)
                if args.only in (None, "near"):
                    rows += near_miss_cases(view, priors[motor], config)
                if args.only in (None, "wrong"):
                    rows += wrong_scene_cases(view, priors, data, config)
                print(f"{motor} view {number}: {len(rows)} cases", flush=True)
                if args.csv:
                    write_csv(args.csv, rows)
    print_tables(rows)
    print_accuracy(rows)


if __name__ == "__main__":
    main()
