"""Fit the weights of `boltpose.prior.confidence`: `python -m boltpose.training.bolt_confidence`."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from rich.console import Console
from scipy.optimize import minimize

from boltpose.arrays import BoolArray, FloatArray
from boltpose.datasets.reman18 import Reman18
from boltpose.errors import BoltposeError, InputFileError
from boltpose.io.scan import read_scan
from boltpose.prior.build import build_prior
from boltpose.prior.confidence import describe_head
from boltpose.prior.find_bolts import FindBoltsConfig, drop_doubles, lateral_sigma_mm, may_be_bolt
from boltpose.prior.heads import Head, MotorCloud, find_heads
from boltpose.schema import Prior, Scan, Side
from boltpose.segmentation.models import load_models
from boltpose.segmentation.predictor import PartPredictor, PartProbabilities

WEIGHTS = (
    "constant",
    "class_log_odds",
    "log_sigma",
    "small_per_mm",
    "terminal",
    "unseen_face",
)
"""Fields of `ConfidenceConfig` in the order of the evidence."""
THRESHOLDS = (0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6)
_GATE_MM = 5.0
"""A head whose top is this near to a true one of its side is that bolt's."""
_SHRINK = 0.1
"""Weight of the squared weights in the loss: a kind never seen true must not weigh infinitely."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Candidates:
    """Heads of all motors that might be bolts."""

    evidence: FloatArray
    """Shape (N, 6), rows of `describe_head`."""
    is_bolt: BoolArray
    """Shape (N,)."""
    support: FloatArray
    """Shape (N,), of the head fit."""
    true_bolts: int
    """Of the motors, found among the candidates or not."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TrueHead:
    """A bolt of the truth, frame `prior`."""

    side: Side
    head_top_mm: FloatArray
    """Shape (3,)."""


class _Keeper:
    """Passes a predictor on and remembers what it said."""

    def __init__(self, predictor: PartPredictor) -> None:
        self._predictor = predictor
        self.found: PartProbabilities | None = None

    def predict(self, points_prior: npt.ArrayLike, normals: npt.ArrayLike) -> PartProbabilities:
        """Label every point."""
        self.found = self._predictor.predict(points_prior, normals)
        return self.found


def collect_candidates(
    root: Path, motors: Sequence[str], predictor: PartPredictor, config: FindBoltsConfig
) -> Candidates:
    """Measure every head that might be a bolt and look up whether it is one.

    Args:
        root: Motors with their true bolts, from `boltpose synth motors` or like reman18.
        motors: Which of them; of those no prior can be built for the true bolts are counted.
        predictor: Networks that have not seen these motors.
        config: Settings of the search.

    Returns:
        The candidates of all motors.

    Raises:
        InputFileError: A file cannot be read.
    """
    evidence: list[tuple[float, ...]] = []
    flags: list[bool] = []
    support: list[float] = []
    true_bolts = 0
    for name in motors:
        truth = read_truth(root / name / "prior_gt.json")
        true_bolts += len(truth)
        scan = read_scan(root / name / "prior.ply")
        keeper = _Keeper(predictor)
        try:
            prior = build_prior(Scan(points=scan.points, source=scan.source), keeper, name=name)
        except BoltposeError:
            continue
        assert keeper.found is not None
        for head in candidate_heads(prior, keeper.found, config):
            sigma = lateral_sigma_mm(head, config)
            evidence.append(describe_head(head, sigma, config.confidence.small_radius_mm))
            flags.append(is_true(prior, head, truth))
            support.append(head.support)
    return Candidates(
        evidence=np.array(evidence, dtype=np.float64).reshape(-1, len(WEIGHTS)),
        is_bolt=np.array(flags, dtype=np.bool_),
        support=np.array(support, dtype=np.float64),
        true_bolts=true_bolts,
    )


def candidate_heads(prior: Prior, parts: PartProbabilities, config: FindBoltsConfig) -> list[Head]:
    """Every head of a motor that might be a bolt, doubles dropped, none judged."""
    motor_from_prior = prior.alignment.prior_from_motor.inverse()
    cloud = MotorCloud.build(
        motor_from_prior.apply(prior.points),
        motor_from_prior.rotate(prior.normals),
        parts.probabilities.astype(np.float64),
    )
    return drop_doubles(
        [head for head in find_heads(cloud, config.heads) if may_be_bolt(head, config)]
    )


def is_true(prior: Prior, head: Head, truth: Sequence[TrueHead]) -> bool:
    """Whether a true bolt of the head's side lies within 5 mm."""
    top = prior.alignment.prior_from_motor.apply(head.centre_mm)
    return any(
        bolt.side is head.side and float(np.linalg.norm(bolt.head_top_mm - top)) <= _GATE_MM
        for bolt in truth
    )


def read_truth(path: Path) -> tuple[TrueHead, ...]:
    """Read the true bolts of a motor.

    Raises:
        InputFileError: The file is missing or holds something else.
    """
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))["bolts"]
        return tuple(
            TrueHead(
                side=Side(entry["side"]),
                head_top_mm=np.array(entry["C"]["head_top"], dtype=np.float64),
            )
            for entry in entries
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputFileError(path, repr(error), "prior_gt.json of a labelled motor") from error


def fit_weights(evidence: FloatArray, is_bolt: BoolArray) -> FloatArray:
    """Fit a logistic model, weights lightly shrunk but for the constant.

    Args:
        evidence: Shape (N, K), its first column 1.
        is_bolt: Shape (N,).

    Returns:
        Weights, shape (K,).
    """
    sign = np.where(is_bolt, -1.0, 1.0)

    def loss(weights: FloatArray) -> float:
        odds = evidence @ weights
        return float(np.logaddexp(0.0, sign * odds).sum() + _SHRINK * (weights[1:] ** 2).sum())

    found: Any = minimize(loss, np.zeros(evidence.shape[1]), method="BFGS")
    return np.asarray(found.x, dtype=np.float64)


def main(arguments: list[str] | None = None) -> int:
    """Print the weights and what each threshold would let in and lose."""
    parser = argparse.ArgumentParser(
        prog="python -m boltpose.training.bolt_confidence", description=__doc__
    )
    parser.add_argument(
        "--data", type=Path, required=True, help="motors the networks have not seen"
    )
    parser.add_argument("--models", type=Path, help="folder of networks; the shipped ones if not")
    parser.add_argument("--motors", type=int, help="only so many motors, the first ones")
    options = parser.parse_args(arguments)
    console = Console()
    try:
        config = FindBoltsConfig()
        names = Reman18(root=options.data).motors[: options.motors]
        predictor = load_models(options.models).parts
        found = collect_candidates(options.data, names, predictor, config)
        if found.is_bolt.all() or not found.is_bolt.any():
            raise InputFileError(
                options.data, f"{len(found.is_bolt)} candidates of one kind", "both"
            )
    except BoltposeError as error:
        Console(stderr=True).print(f"boltpose: {error}", style="red", soft_wrap=True)
        return 2
    weights = fit_weights(found.evidence, found.is_bolt)
    console.print(
        f"{len(names)} motors, {found.true_bolts} bolts, {len(found.is_bolt)} candidates, "
        f"{int(found.is_bolt.sum())} true"
    )
    for name, weight in zip(WEIGHTS, weights, strict=True):
        console.print(f"{name}: float = {weight:.1f}")
    probability = 1.0 / (1.0 + np.exp(-found.evidence @ weights))
    for threshold in THRESHOLDS:
        kept = (probability >= threshold) | (found.support >= config.full_support)
        console.print(
            f"from {threshold:.2f}: {int((kept & found.is_bolt).sum())} true, "
            f"{int((kept & ~found.is_bolt).sum())} false"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
