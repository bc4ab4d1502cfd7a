"""How long one report takes: `python benchmarks/bench_report.py poses.json [poses.json ...]`.

Each result is drawn as it was saved, and once more with its scan thickened to two million points.
The page is checked before its time is told.
"""

from __future__ import annotations

import argparse
import statistics
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from boltpose.report import render_report
from boltpose.saved_result import SavedResult, open_saved_result
from boltpose.schema import Scan

MANY_POINTS = 2_000_000


def thickened(scan: Scan, count: int) -> Scan:
    """The same surface with more points: every point again, moved by less than the spacing."""
    rng = np.random.default_rng(0)
    rows = np.arange(count) % len(scan)
    return Scan(points=scan.points[rows] + rng.uniform(-0.1, 0.1, (count, 3)), source=scan.source)


def measure(saved: SavedResult, repeats: int) -> tuple[float, float, int]:
    """Median wall and processor seconds, and the size of the page in bytes."""
    first = render_report(saved.result, saved.scan, saved.prior)
    word = "OK" if saved.result.is_ok else "REFUSED"
    if f"<h1>{word}" not in first or first.count("<image ") < 1:
        raise SystemExit(f"the page of {saved.path} does not say {word}, or shows nothing")
    walls, works = [], []
    for _ in range(repeats):
        wall, work = time.perf_counter(), time.process_time()
        again = render_report(saved.result, saved.scan, saved.prior)
        walls.append(time.perf_counter() - wall)
        works.append(time.process_time() - work)
        if again != first:
            raise SystemExit(f"two pages of {saved.path} differ")
    return statistics.median(walls), statistics.median(works), len(first.encode())


def main() -> None:
    """Print one row per result and size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "poses",
        nargs="*",
        type=Path,
        default=[Path("demo_output/poses.json")],
        help="of `make demo`",
    )
    parser.add_argument("--repeats", type=int, default=5)
    arguments = parser.parse_args()
    print("| result | points | wall s | CPU s | page kB |\n|---|---|---|---|---|")
    for path in arguments.poses:
        saved = open_saved_result(path)
        for scan in (saved.scan, thickened(saved.scan, MANY_POINTS)):
            wall, work, size = measure(replace(saved, scan=scan), arguments.repeats)
            status = saved.result.verdict.status
            print(f"| {status} | {len(scan)} | {wall:.2f} | {work:.2f} | {size // 1000} |")


if __name__ == "__main__":
    main()
