"""How much slower a warm `boltpose serve` is than the library (shipped motor, simulated).

    python benchmarks/bench_service.py                # 20 pairs, library and service in turn
    python benchmarks/bench_service.py --pairs 50

Both do the same work: read the scan, locate with the prepared prior, write the text of poses.json.
Of every pair the order changes; what is compared is the ratio of the medians, because other work on
the machine slows both. The answers are compared before their time counts.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import httpx

from boltpose.cli.demo import DEMO_FOLDER
from boltpose.io.hand_eye import hand_eye_error, read_hand_eye
from boltpose.io.scan import read_scan
from boltpose.locate import locate
from boltpose.prior.build import build_prior
from boltpose.prior.file import read_prior, write_prior
from boltpose.registration.prepare import prepare_prior
from boltpose.results import dump_json
from boltpose.segmentation.models import load_models

SCAN = DEMO_FOLDER / "000002.png"
CAMERA = DEMO_FOLDER / "scene_camera.json"
HAND_EYE = DEMO_FOLDER / "hand_eye.yaml"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--pairs", type=int, default=20)
    parser.add_argument("--prior", type=Path, help="of the shipped motor; built if left out")
    parser.add_argument("--output", type=Path, help="write the numbers here, .json")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        prior = folder / "priors" / "motor.prior.npz"
        prior.parent.mkdir()
        models = load_models()
        if options.prior is None:
            full = read_scan(DEMO_FOLDER / "full_scan.ply")
            write_prior(prior, build_prior(full, models.parts, name="motor"))
        else:
            prior.write_bytes(options.prior.read_bytes())
        prepared = prepare_prior(read_prior(prior))

        scan = folder / SCAN.name
        pixels = SCAN.read_bytes()

        def new_scan() -> None:
            # bytes after the end of a PNG are not looked at, but make another file of it: the
            # service must store it, as it must every scan of a cell
            scan.write_bytes(pixels + os.urandom(16))

        def by_library() -> str:
            found = read_hand_eye(HAND_EYE)
            result = locate(
                read_scan(scan, camera=CAMERA),
                prepared,
                found.transform,
                models.scene,
                hand_eye_error=hand_eye_error(found),
            )
            return dump_json(result)

        process = subprocess.Popen(
            [sys.executable, "-m", "boltpose", "serve", "--port", "0"]
            + ["--data", str(folder / "data"), "--priors", str(prior.parent)],
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            assert process.stdout is not None
            url = process.stdout.readline().split()[2]
            with httpx.Client(base_url=url, trust_env=False, timeout=120) as client:

                def by_service() -> str:
                    files = [
                        ("scan", (scan.name, scan.read_bytes())),
                        ("camera", (CAMERA.name, CAMERA.read_bytes())),
                        ("hand_eye", (HAND_EYE.name, HAND_EYE.read_bytes())),
                    ]
                    answer = client.post("/v1/locate", files=files, data={"prior": "motor"})
                    answer.raise_for_status()
                    return answer.text

                new_scan()
                assert _poses(by_library()) == _poses(by_service())
                seconds = _measure(new_scan, by_library, by_service, options.pairs)
        finally:
            process.terminate()
            process.wait()
    _report(seconds, options.output)


def _measure(
    new_scan: Callable[[], None],
    by_library: Callable[[], str],
    by_service: Callable[[], str],
    pairs: int,
) -> dict[str, list[float]]:
    seconds: dict[str, list[float]] = {"library": [], "service": []}
    for number in range(pairs):
        turns = [("library", by_library), ("service", by_service)]
        for name, call in turns if number % 2 == 0 else reversed(turns):
            new_scan()
            start = time.perf_counter()
            call()
            seconds[name].append(time.perf_counter() - start)
    return seconds


def _poses(text: str) -> object:
    data = json.loads(text)
    return [data[key] for key in ("status", "bolts", "camera_from_prior", "quality")]


def _report(seconds: dict[str, list[float]], output: Path | None) -> None:
    medians = {name: statistics.median(values) for name, values in seconds.items()}
    ratio = medians["service"] / medians["library"]
    for name, values in seconds.items():
        low, _, high = statistics.quantiles(values, n=4)
        print(f"{name:8s} median {medians[name]:.3f} s, quartiles {low:.3f} to {high:.3f} s")
    paired = [s / lib for s, lib in zip(seconds["service"], seconds["library"], strict=True)]
    by_pair = statistics.median(paired)
    print(f"service / library: {ratio:.3f} of the medians, {by_pair:.3f} the median of all pairs")
    print(f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    if output is not None:
        output.write_text(json.dumps({"seconds": seconds, "ratio": ratio}, indent=2) + "\n")


if __name__ == "__main__":
    main()
