"""Where the time of `locate` goes, and how it grows with the scan (reman18, simulated).

    python benchmarks/bench_locate.py                               # six motors, one of a family
    python benchmarks/bench_locate.py --sizes 50000 200000 5000000  # cost against points
    python benchmarks/bench_locate.py --start                       # cold start of the command

Run it alone on the machine. Networks are those that never saw the motor's family. A pose is checked
before its time counts: a fast wrong answer is no result. The first call, which opens the networks,
is left out. Larger scans than the camera's are made by repeating points with 0.02 mm of noise.
Registration methods of others, timed in one run with ours: `make bench-registration`.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from boltpose.evaluation.reman18 import TrueMotor, TrueView, read_motor
from boltpose.io.scan import read_scan
from boltpose.locate import locate
from boltpose.prior.build import build_prior
from boltpose.prior.file import read_prior, write_prior
from boltpose.registration.prepare import PreparedPrior, prepare_prior
from boltpose.schema import Prior, Scan
from boltpose.segmentation.models import Models, load_models
from boltpose.stages import OnStage

MOTORS = tuple(f"motor_{number:03d}" for number in range(6))
STAGES = ("segmentation", "registration", "relabelling", "verification", "bolts")
COMMANDS = {
    "import numpy": [sys.executable, "-c", "import numpy"],
    "boltpose --help": [sys.executable, "-m", "boltpose", "--help"],
    "imports of locate": [
        sys.executable,
        "-c",
        "import boltpose.cli.load, boltpose.results, boltpose.segmentation.models, boltpose.locate",
    ],
}


@dataclass(frozen=True, kw_only=True)
class Job:
    """One view with all that is known about it."""

    truth: TrueMotor
    view: TrueView
    scan: Scan
    prior: Prior
    models: Models


def main() -> None:
    """Parse, measure, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, default=Path("data/reman18"))
    parser.add_argument("--models", type=Path, default=Path("data/models/leave_family_out"))
    parser.add_argument("--priors", type=Path, default=Path("runs/priors"), help="kept priors")
    parser.add_argument("--motors", nargs="+", default=list(MOTORS))
    parser.add_argument("--views", type=int, default=4)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--sizes", type=int, nargs="*", default=[], help="points per scan")
    parser.add_argument("--picture", type=Path, help="plot of the stages against the points")
    parser.add_argument("--start", action="store_true")
    arguments = parser.parse_args()
    if arguments.start:
        print_start(arguments.repeats)
        return
    jobs = list(read_jobs(arguments))
    if not arguments.sizes:
        print_stages(jobs, arguments.repeats)
    medians = {}
    for size in arguments.sizes:
        sized = [replace(job, scan=resize(job.scan, size)) for job in jobs[:: arguments.views]]
        print(f"\n{size} points")
        medians[size] = print_stages(sized, arguments.repeats)
    if arguments.picture is not None and medians:
        draw_sizes(medians, arguments.picture)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory of this process, all scans held: {peak:.0f} MB")


def read_jobs(arguments: argparse.Namespace) -> Iterator[Job]:
    """Read views, and priors made by networks that never saw the family."""
    arguments.priors.mkdir(parents=True, exist_ok=True)
    for motor in arguments.motors:
        truth = read_motor(arguments.data, motor)
        folder = arguments.data / motor
        models = load_models(arguments.models / truth.family)
        path = arguments.priors / f"{motor}.prior.npz"
        if not path.exists():
            full_scan = Scan(points=read_scan(folder / "prior.ply").points)
            write_prior(path, build_prior(full_scan, models.parts, name=motor))
        prior = read_prior(path)
        for number, view in enumerate(truth.views[: arguments.views]):
            scan = read_scan(folder / "depth" / f"{number:06d}.png")
            yield Job(truth=truth, view=view, scan=scan, prior=prior, models=models)


def resize(scan: Scan, size: int) -> Scan:
    """Thin a scan by chance, or repeat its points with some noise."""
    rng = np.random.default_rng(size)
    if size <= len(scan):
        return Scan(points=scan.points[rng.permutation(len(scan))[:size]])
    points = np.tile(scan.points, (-(-size // len(scan)), 1))[:size]
    return Scan(points=points + rng.normal(scale=0.02, size=points.shape))


def draw_sizes(medians: dict[int, dict[str, float]], path: Path) -> None:
    """Plot the wall time of the stages against the points of a scan."""
    stages = [name for name in next(iter(medians.values())) if name in STAGES]
    figure = Figure(figsize=(6.4, 3.8), layout="constrained")
    axes = figure.add_subplot()
    axes.stackplot(
        list(medians),
        [[row[name] for row in medians.values()] for name in stages],
        labels=stages,
    )
    axes.set(xscale="log", xlabel="points of the scan", ylabel="wall time, s (median)")
    axes.legend(loc="upper left", fontsize=8)
    figure.savefig(path, dpi=110)


def print_stages(jobs: list[Job], repeats: int) -> dict[str, float]:
    """Print medians and quartiles of every stage; returns the median wall seconds."""
    wall: dict[str, list[float]] = defaultdict(list)
    cpu: dict[str, list[float]] = defaultdict(list)
    worst: list[float] = []

    def clock(name: str, began: tuple[float, float]) -> tuple[float, float]:
        now = time.perf_counter(), time.process_time()
        wall[name].append(now[0] - began[0])
        cpu[name].append(now[1] - began[1])
        return now

    for repeat in range(repeats + 1):
        for job in jobs if repeat else jobs[:1]:
            began = time.perf_counter(), time.process_time()
            prepared = prepare_prior(job.prior)
            stage = total = clock("(prepare prior)", began)

            def note(name: str, _seconds: float) -> None:
                nonlocal stage
                stage = clock(name, stage)

            error = _locate(job, prepared, note)
            clock("locate", total)
            worst.append(error)
        if repeat == 0:
            wall.clear()
            cpu.clear()
    registering = ("registration", "relabelling", "verification")
    for kind in (wall, cpu):
        columns = [kind[name] for name in registering]
        kind["registration to verdict"] = [sum(row) for row in zip(*columns, strict=True)]
    print(f"{len(jobs)} views x {repeats}, worst bolt {max(worst):.2f} mm; seconds:")
    for name, seconds in wall.items():
        quarter, half, three = np.percentile(seconds, [25, 50, 75])
        print(
            f"  {name:24s} wall {half:6.3f} (quartiles {quarter:.3f} to {three:.3f}), "
            f"cpu {np.median(cpu[name]):6.3f}"
        )
    return {name: float(np.median(seconds)) for name, seconds in wall.items()}


def _locate(job: Job, prepared: PreparedPrior, note: OnStage) -> float:
    """Locate, and return how far the worst point of a bolt is off, mm."""
    result = locate(
        job.scan,
        prepared,
        job.view.base_from_camera,
        job.models.scene,
        on_stage=note,
    )
    if not result.is_ok or result.registration is None:
        raise SystemExit(f"{job.truth.name}: {'; '.join(result.verdict.reasons)}")
    heads = np.array([bolt.prior_from_bolt.translation_mm for bolt in job.prior.bolts])
    moved = result.registration.camera_from_prior.apply(heads)
    error = float(np.linalg.norm(moved - job.view.camera_from_prior.apply(heads), axis=1).max())
    if error > 1.0:
        raise SystemExit(f"{job.truth.name}: a bolt is off by {error:.2f} mm")
    return error


def print_start(repeats: int) -> None:
    """Print how long commands take until they could begin with their work."""
    for name, command in COMMANDS.items():
        seconds = []
        for _ in range(repeats + 1):
            start = time.perf_counter()
            subprocess.run(command, check=True, capture_output=True)
            seconds.append(time.perf_counter() - start)
        print(f"{name:20s} {np.median(seconds[1:]):.2f} s wall")


if __name__ == "__main__":
    main()
