"""Measure how well bolts that are lost, exchanged or surplus are told; resumable motor by motor.

    python -m boltpose.synthesis.changed_bolts -n 16 --seed 2000 -o runs/changed
    python -m boltpose.synthesis.changed_bolts -n 16 --seed 2001 -o runs/changed_test
    python -m boltpose.evaluation.bolt_state --reman18 data/reman18 --priors runs/priors \
        --changed runs/changed --changed-test runs/changed_test

Everything is simulated. The thresholds were chosen on reman18 and `changed`; `changed-test` and
`--factory` (a folder of `boltpose synth scenes`) had no part in it.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import logging
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from threadpoolctl import threadpool_limits

import boltpose
from boltpose.errors import InputFileError
from boltpose.evaluation.bolt_state_cases import BoltView, read_bolt_view
from boltpose.evaluation.reman18 import list_motors, read_motor
from boltpose.geometry.sampling import canonical_rows
from boltpose.io.atomic import write_atomic
from boltpose.io.scan import read_scan
from boltpose.prior.build import BuildConfig, build_prior
from boltpose.prior.file import read_prior, write_prior
from boltpose.registration.bolt_state import judge_bolts
from boltpose.registration.extra_heads import find_extra_heads
from boltpose.registration.prepare import PreparedPrior, prepare_prior
from boltpose.schema import Prior

_log = logging.getLogger(__name__)
FOLDER = "bolt_state"
SETS = ("reman18", "changed", "changed_test", "factory")
_SOURCES = ("bolt_state.py", "head_sight.py", "extra_heads.py")
_SAME_HEAD_MM = 3.0
_VIEW_POINTS = 200_000
"""Of a scan, as `locate` chooses them for everything but bolts' states."""
_SEED = 0


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    for name in SETS:
        parser.add_argument(f"--{name.replace('_', '-')}", type=Path, dest=name)
    parser.add_argument("--priors", type=Path, default=Path("runs/priors"), help="kept priors")
    parser.add_argument("--motors", nargs="*", help="only these")
    parser.add_argument("-o", "--output", type=Path, default=Path("results"))
    given = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    with threadpool_limits(1):
        for name in SETS:
            root = getattr(given, name)
            if root is not None:
                # priors of other sets have the same names
                priors = given.priors if name in ("reman18", "factory") else root / "priors"
                measure(name, root, priors, given.output / FOLDER, given.motors)


def measure(
    name: str, root: Path, priors: Path, out: Path, motors: Sequence[str] | None = None
) -> Path:
    """Judge the bolts of every view of a data set.

    Args:
        name: Of the set.
        root: Its folder.
        priors: Folder of kept priors; one that is missing is built from the scan's true labels.
        out: Where `<name>.json` is written, anew after every motor.
        motors: Only these; all by default.

    Returns:
        The file.

    Raises:
        InputFileError: A file cannot be read.
    """
    path = out / f"{name}.json"
    source = _hash_sources()
    document: dict[str, Any] = {"source": source, "motors": {}}
    if path.exists():
        kept = json.loads(path.read_text(encoding="utf-8"))
        document = kept if kept.get("source") == source else document
    out.mkdir(parents=True, exist_ok=True)
    for motor in list_motors(root):
        if motor in document["motors"] or (motors and motor not in motors):
            continue
        prepared = prepare_prior(_prior(root, priors, motor))
        views = [
            _judge_view(read_bolt_view(root, view, prepared, seed=_SEED), prepared)
            for view in read_motor(root, motor).views
        ]
        document["motors"][motor] = views
        _write(path, document)
        _log.info("%s %s", name, motor)
    return path


def _write(path: Path, document: dict[str, Any]) -> None:
    data = json.dumps(document, sort_keys=True, separators=(",", ":")).encode()

    def write(stream: BinaryIO) -> None:
        stream.write(data)

    write_atomic(path, write)


def _prior(root: Path, priors: Path, motor: str) -> Prior:
    path = priors / f"{motor}.prior.npz"
    if path.exists():
        return read_prior(path)
    scan = read_scan(root / motor / "prior.ply")
    prior = build_prior(scan, None, BuildConfig(use_file_labels=True), name=motor)
    priors.mkdir(parents=True, exist_ok=True)
    write_prior(path, prior)
    return prior


def _judge_view(view: BoltView, prepared: PreparedPrior) -> dict[str, Any]:
    judgements = judge_bolts(prepared, view.camera_from_prior, view.points)
    thinned = view.points[canonical_rows(view.points, _VIEW_POINTS)]
    found = find_extra_heads(prepared, view.camera_from_prior, thinned)
    bolts = [
        {
            **{key: _rounded(value) for key, value in asdict(truth).items()},
            "state": str(judged.state),
            "reason": judged.reason,
            "through_share": _rounded(judged.sight.through_share),
            "proud_share": _rounded(judged.sight.proud_share),
        }
        for truth, judged in zip(view.heads, judgements, strict=True)
    ]
    extra: list[dict[str, Any]] = []
    hit: set[int] = set()
    for head in found:
        near = [
            row
            for row, true in enumerate(view.surplus)
            if np.linalg.norm(true.head_top_mm - head.head_top_mm) < _SAME_HEAD_MM
        ]
        hit.update(near)
        off_mm = np.linalg.norm(view.present_mm - head.head_top_mm, axis=1).min(initial=np.inf)
        extra.append(
            {
                # a bolt that the prior failed to find counts too
                "is_true": bool(off_mm < _SAME_HEAD_MM),
                "diameter_mm": _rounded(head.diameter_mm),
                "height_mm": _rounded(head.height_mm),
                "off_mm": _rounded(float(off_mm)) if off_mm < _SAME_HEAD_MM else None,
            }
        )
    surplus = [
        {
            "visible_fraction": _rounded(true.visible_fraction),
            "diameter_mm": true.diameter_mm,
            "height_mm": true.height_mm,
            "is_found": row in hit,
        }
        for row, true in enumerate(view.surplus)
    ]
    return {"name": view.name, "bolts": bolts, "found": extra, "surplus": surplus}


def _rounded(value: Any) -> Any:
    return round(value, 3) if isinstance(value, float) else value


def _hash_sources() -> str:
    folder = Path(boltpose.__file__).parent / "registration"
    digest = hashlib.sha256()
    for name in _SOURCES:
        digest.update((folder / name).read_bytes())
    return digest.hexdigest()[:16]


def read_set(results: Path, name: str) -> list[dict[str, Any]] | None:
    """All views of a measured set, None if it was not measured.

    Raises:
        InputFileError: The file is damaged.
    """
    path = results / FOLDER / f"{name}.json"
    if not path.exists():
        return None
    try:
        motors = json.loads(path.read_text(encoding="utf-8"))["motors"]
        return [view for motor in sorted(motors) for view in motors[motor]]
    except (ValueError, KeyError, TypeError) as error:
        raise InputFileError(
            path, str(error), "results of boltpose.evaluation.bolt_state"
        ) from error


if __name__ == "__main__":
    main()
