"""Whether a pose may be used: every check, every number, every reason."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from boltpose.arrays import as_points
from boltpose.registration.config import VerifyConfig
from boltpose.registration.evidence import EVIDENCE_NAMES, Evidence, gather_evidence
from boltpose.registration.prepare import PreparedPrior
from boltpose.registration.probability import probability_correct
from boltpose.registration.scene import Scene
from boltpose.schema import Check, Registration, Status, Verdict


@dataclass(frozen=True, slots=True)
class _Rule:
    check: Check
    name: str
    found: float
    wanted: float
    is_met: bool
    sentence: str


def verify(
    registration: Registration | None,
    prepared: PreparedPrior,
    scene: Scene,
    motor_points: npt.ArrayLike,
    config: VerifyConfig | None = None,
) -> Verdict:
    """Check a pose against what the camera saw.

    Args:
        registration: The pose, or None if registration found none.
        prepared: The prior.
        scene: The whole scan.
        motor_points: Shape (N, 3), mm, frame `camera`: what was taken for the motor *before* any
            relabelling by this pose, or else they agree with it by construction.
        config: Thresholds.

    Returns:
        `ok` if every check is met, otherwise `refused` with one sentence per failed check; either
        way with the probability that the pose is right.

    Raises:
        ShapeError: `motor_points` is not (N, 3) and finite.
    """
    config = config or VerifyConfig()
    points = as_points(motor_points, "motor_points", at_least=0)
    if registration is None:
        return refuse_without_pose(len(points), config)
    evidence = gather_evidence(registration, prepared, scene, points, config.evidence)
    return decide(evidence, config)


def refuse_without_pose(motor_points: int, config: VerifyConfig) -> Verdict:
    """Refuse where registration found no pose at all.

    Args:
        motor_points: How many scan points were taken for the motor.
        config: Thresholds.
    """
    # a tenth of what registration needs is noise in the labels, not part of a motor
    has_some = motor_points >= 0.1 * config.min_motor_points
    return _verdict(
        [
            _Rule(
                Check.TOO_FEW_POINTS if has_some else Check.NO_MOTOR,
                "motor_points",
                float(motor_points),
                float(config.min_motor_points),
                False,
                f"no pose was found for {motor_points} motor points",
            )
        ],
        p_correct=0.0,
    )


def decide(evidence: Evidence, config: VerifyConfig) -> Verdict:
    """Hold the numbers of a pose against the thresholds, each alone and all together."""
    p_correct = probability_correct(evidence, config.probability)
    rules = _rules(evidence, config)
    # where a single number already says why, that all together say so too helps nobody
    is_told = not all(rule.is_met for rule in rules)
    rules.append(
        _Rule(
            Check.UNLIKELY,
            "p_correct",
            p_correct,
            config.min_p_correct,
            is_told or p_correct >= config.min_p_correct,
            f"probability that the pose is right, from all numbers together: {p_correct:.3g}, "
            f"wanted at least {config.min_p_correct:.3g}",
        )
    )
    return _verdict(rules, p_correct=p_correct, evidence=evidence)


def _rules(evidence: Evidence, config: VerifyConfig) -> list[_Rule]:
    def at_least(check: Check, name: str, wanted: float, text: str) -> _Rule:
        found = float(getattr(evidence, name))
        sentence = f"{text}: {found:.3g}, wanted at least {wanted:.3g}"
        return _Rule(check, name, found, float(wanted), bool(found >= wanted), sentence)

    def at_most(check: Check, name: str, wanted: float, text: str) -> _Rule:
        found = float(getattr(evidence, name))
        sentence = f"{text}: {found:.3g}, wanted at most {wanted:.3g}"
        return _Rule(check, name, found, float(wanted), bool(found <= wanted), sentence)

    return [
        at_least(
            Check.TOO_FEW_POINTS,
            "motor_points",
            config.min_motor_points,
            "motor points on 2 mm voxels",
        ),
        at_most(
            Check.FREE_SPACE,
            "free_space_violation",
            config.max_free_space_violation,
            "share of the motor's surface the camera saw through",
        ),
        at_least(
            Check.EXPLAINED,
            "explained",
            config.min_explained,
            "share of the motor points that lie on the prior",
        ),
        at_least(
            Check.FIT,
            "tight",
            config.min_tight,
            "share of the motor points near the prior that lie on it to the measuring error",
        ),
        at_least(
            Check.COVERAGE,
            "coverage",
            config.min_coverage,
            "share of the prior's surface in free view that was measured there",
        ),
        at_least(
            Check.COVERAGE,
            "judged_points",
            config.min_judged_points,
            "prior points (1.5 mm apart) in free view",
        ),
        at_least(
            Check.COVERAGE,
            "measured",
            config.min_measured,
            "share of the prior's surface in free view in whose direction anything was measured",
        ),
        at_least(
            Check.AMBIGUOUS,
            "margin",
            config.min_margin,
            "score ahead of the best different pose",
        ),
        at_most(
            Check.UNCONSTRAINED,
            "bolt_sigma_mm",
            config.max_bolt_sigma_mm,
            "largest 1 sigma of a bolt's position in mm",
        ),
        at_least(Check.UNCONSTRAINED, "converged", 1.0, "refinement converged (1) or not (0)"),
    ]


def _verdict(rules: list[_Rule], *, p_correct: float, evidence: Evidence | None = None) -> Verdict:
    failed = [rule for rule in rules if not rule.is_met]
    scores = {rule.name: rule.found for rule in rules}
    if evidence is not None:
        # numbers without a threshold of their own count in p_correct
        every = {name: float(getattr(evidence, name)) for name in EVIDENCE_NAMES}
        scores = {**every, **scores}
    return Verdict(
        status=Status.REFUSED if failed else Status.OK,
        failed=tuple(dict.fromkeys(rule.check for rule in failed)),
        reasons=tuple(rule.sentence for rule in failed),
        scores={name: found for name, found in scores.items() if np.isfinite(found)},
        thresholds={rule.name: rule.wanted for rule in rules},
        p_correct=p_correct,
    )
