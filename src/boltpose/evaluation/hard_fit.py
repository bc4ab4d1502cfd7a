"""Fit the weights of the verdict's probability on the even families.

    python -m boltpose.evaluation.hard_fit results/verdict     # prints weights and threshold

The printed values belong into `registration/probability_config.py`; nothing is written.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from boltpose.arrays import BoolArray, FloatArray
from boltpose.errors import EmptyScanError
from boltpose.evaluation.hard_records import HardCase, HardMotor, read_hard_motors
from boltpose.registration.config import VerifyConfig
from boltpose.registration.probability import features, probability_correct
from boltpose.registration.probability_config import FEATURES, ProbabilityConfig

RIDGE = 1e-3
"""Pull of the weights to zero, per unit of standardised feature: perfectly separable cases would
otherwise ask for infinite weights."""


def is_judged(case: HardCase) -> bool:
    """Whether a case tells right from wrong: there is a pose, and it is no half-right one.

    A pose put 1 mm beside the right one on purpose is within the limits and yet none that
    `locate` would hand out; it is counted in the report and not fitted.
    """
    return case.evidence is not None and (case.is_wrong or case.is_settled)


def fit_probability(motors: Sequence[HardMotor]) -> ProbabilityConfig:
    """Fit bias and weights by ridge-penalised logistic loss, weights not negative.

    Right and wrong poses weigh the same in sum, so that the probability is that of a pose about
    which nothing else is known. Every kind of wrong case weighs the same, or else the many easy
    near misses would hide the few mirrored motors.

    Args:
        motors: Records; only choosers are used.

    Returns:
        The shipped settings with fitted bias and weights.

    Raises:
        EmptyScanError: There are no right or no wrong cases.

    Source:
        Platt 1999, with his targets (N+ + 1) / (N+ + 2) and 1 / (N- + 2) against overconfidence.
    """
    cases = [
        case
        for motor in motors
        if motor.is_chooser
        for case in motor.cases
        if is_judged(case) and _is_held(case)
    ]
    right = np.array([not case.is_wrong for case in cases])
    if not right.any() or right.all():
        raise EmptyScanError("a fit needs right and wrong cases of even families")
    table = np.array([features(case.evidence) for case in cases if case.evidence is not None])
    mean, scale = table.mean(axis=0), table.std(axis=0) + 1e-9
    standard = (table - mean) / scale
    solution = _minimise(standard, right, _weights(cases, right))
    weights = solution[1:] / scale
    bias = float(solution[0] - weights @ mean)
    found = {name: float(f"{w:.3g}") for name, w in zip(FEATURES, weights, strict=True)}
    return replace(ProbabilityConfig(), bias=float(f"{bias:.4g}"), **found)


def choose_threshold(motors: Sequence[HardMotor], config: ProbabilityConfig) -> float:
    """Put the threshold in the middle, in log odds, between wrong and good poses of even families.

    Between the highest probability of a wrong pose and the 1 % point of the good ones of motors
    that are sufficiently in view, and never below one half.

    Args:
        motors: Records; only choosers are used.
        config: Fitted weights.
    """
    stated = [
        (probability_correct(case.evidence, config), case)
        for motor in motors
        if motor.is_chooser
        for case in motor.cases
        if case.evidence is not None and is_judged(case) and _is_held(case)
    ]
    highest = max(p for p, case in stated if case.is_wrong)
    good = [p for p, case in stated if not case.is_wrong and not case.is_starved]
    lowest = float(np.quantile(good, 0.01))
    odds = math.sqrt(highest / (1.0 - highest) * lowest / (1.0 - lowest))
    return max(0.5, round(odds / (1.0 + odds), 2))


def _is_held(case: HardCase) -> bool:
    """Leave out poses that the points do not hold: their covariance speaks, not their fit."""
    return case.evidence is not None and (
        case.evidence.bolt_sigma_mm <= VerifyConfig().max_bolt_sigma_mm
    )


def _weights(cases: Sequence[HardCase], right: BoolArray) -> FloatArray:
    kinds = [(case.kind, case.is_wrong) for case in cases]
    count = Counter(kinds)
    weight = np.array([1.0 / count[kind] for kind in kinds])
    for side in (right, ~right):
        weight[side] *= 0.5 / weight[side].sum()
    return weight


def _minimise(table: FloatArray, right: BoolArray, weight: FloatArray) -> FloatArray:
    count = np.array([int((~right).sum()), int(right.sum())])
    target = np.where(right, (count[1] + 1) / (count[1] + 2), 1 / (count[0] + 2))

    def loss(x: FloatArray) -> tuple[float, FloatArray]:
        score = x[0] + table @ x[1:]
        # log(1 + exp(s)) - target * s, without overflow
        value = float(weight @ (np.logaddexp(0.0, score) - target * score))
        slope = weight * (1.0 / (1.0 + np.exp(-np.clip(score, -500, 500))) - target)
        gradient = np.concatenate([[slope.sum()], table.T @ slope + RIDGE * x[1:]])
        return value + 0.5 * RIDGE * float(x[1:] @ x[1:]), gradient

    start = np.concatenate([[0.0], np.full(table.shape[1], 0.5)])
    bounds = [(None, None)] + [(0.0, None)] * table.shape[1]
    # the loss of cases so well apart is tiny: SciPy's own limits would stop half way
    limits = {"gtol": 1e-10, "ftol": 1e-15, "maxiter": 10_000, "maxfun": 20_000}
    result = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds, options=limits)
    return np.asarray(result.x, dtype=np.float64)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the fit."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    given = parser.parse_args(arguments)
    motors = read_hard_motors(given.folder)
    config = fit_probability(motors)
    sys.stdout.write(f"{config}\nmin_p_correct={choose_threshold(motors, config)}\n")


if __name__ == "__main__":
    main()
