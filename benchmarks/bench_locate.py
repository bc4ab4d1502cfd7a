"""Time of `locate`, stage by stage, on the views of one motor (reman18, simulated).

Run alone on the machine: python benchmarks/bench_locate.py [--motor motor_001] [--repeats 5]

The pose is checked before its time counts: a fast wrong answer is no result. Printed are medians
of wall and CPU seconds over views and repeats; the first call, which opens the networks, is left
out. Beside them, as a peer in the same run, stands small_gicp's GICP on the same motor points,
from the true pose: what a well-kept library needs for the fine step alone.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from pathlib import Path

import numpy as np
import small_gicp

from boltpose.evaluation.reman18 import read_motor
from boltpose.io.scan import read_scan
from boltpose.locate import locate
from boltpose.prior.build import build_prior
from boltpose.registration.prepare import prepare_prior
from boltpose.registration.relabel import relabel
from boltpose.schema import Scan
from boltpose.segmentation.models import load_models


def main() -> None:
    """Parse, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=Path("data/reman18"))
    parser.add_argument("--models", type=Path, default=Path("data/models/leave_family_out"))
    parser.add_argument("--motor", default="motor_001")
    parser.add_argument("--repeats", type=int, default=5)
    arguments = parser.parse_args()
    truth = read_motor(arguments.data, arguments.motor)
    folder = arguments.data / arguments.motor
    models = load_models(arguments.models / truth.family)
    start = time.perf_counter()
    full_scan = Scan(points=read_scan(folder / "prior.ply").points)
    prior = build_prior(full_scan, models.parts, name=arguments.motor)
    print(f"prior build, networks opened: {time.perf_counter() - start:.1f} s wall")
    wall: dict[str, list[float]] = defaultdict(list)
    cpu: dict[str, list[float]] = defaultdict(list)

    def clock(name: str, began: tuple[float, float]) -> tuple[float, float]:
        now = time.perf_counter(), time.process_time()
        wall[name].append(now[0] - began[0])
        cpu[name].append(now[1] - began[1])
        return now

    for repeat in range(arguments.repeats + 1):
        for number, view in enumerate(truth.views):
            scan = read_scan(folder / "depth" / f"{number:06d}.png")
            began = time.perf_counter(), time.process_time()
            prepared = prepare_prior(prior)
            stage = total = clock("(prepare prior)", began)

            def note(name: str, _seconds: float) -> None:
                nonlocal stage
                stage = clock(name, stage)

            result = locate(scan, prepared, view.base_from_camera, models.scene, on_stage=note)
            clock("locate", total)
            assert result.is_ok
            assert result.registration is not None
            moved = result.registration.camera_from_prior.apply(prior.points)
            off = np.linalg.norm(moved - view.camera_from_prior.apply(prior.points), axis=1)
            assert off.max() < 0.5, f"view {number} is off by {off.max():.2f} mm"
            is_motor = relabel(prepared, view.camera_from_prior, scan.points)
            began = time.perf_counter(), time.process_time()
            small_gicp.align(
                prior.points,
                scan.points[is_motor],
                view.camera_from_prior.inverse().matrix,
                registration_type="GICP",
                downsampling_resolution=1.0,
                max_correspondence_distance=3.0,
                num_threads=2,
            )
            clock("(peer: small_gicp GICP)", began)
        if repeat == 0:
            wall.clear()
            cpu.clear()
    print(f"{arguments.motor}, {len(truth.views)} views x {arguments.repeats}, medians:")
    for name, seconds in wall.items():
        quarter, half, three = np.percentile(seconds, [25, 50, 75])
        print(
            f"  {name:24s} wall {half:5.2f} s (quartiles {quarter:.2f} to {three:.2f}), "
            f"cpu {np.median(cpu[name]):5.2f} s"
        )


if __name__ == "__main__":
    main()
