"""May the pose be used that several views have found together?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from boltpose.joint_pose import Fusion, JudgedShot, is_near
from boltpose.locate_config import LocateConfig
from boltpose.registration.evidence import bolt_sigma_mm, gather_evidence
from boltpose.registration.joint import JointConfig
from boltpose.registration.pooled import pool_evidence
from boltpose.registration.prepare import PreparedPrior
from boltpose.registration.verify import decide
from boltpose.schema import Check, Registration, Status, Verdict
from boltpose.view import register_again


def decide_jointly(
    judged: Sequence[JudgedShot],
    fusion: Fusion,
    registration: Registration,
    prepared: PreparedPrior,
    config: LocateConfig,
    joint: JointConfig,
) -> Verdict:
    """Hold the numbers of all views together against the thresholds, and ask each for a veto.

    A view that sees too little to say anything has none.

    Args:
        judged: What every view says of the pose.
        fusion: How the pose came about.
        registration: The joint pose.
        prepared: The prior.
        config: Thresholds for one view, which hold for all together too.
        joint: How far apart views may put the motor.

    Returns:
        The verdict. `views_apart_sigmas` is the distance of the two views that agree least.
    """
    evidence = pool_evidence(
        [one.pose for one in fusion.used or judged],
        prepared,
        margin=registration.score - registration.runner_up_score,
        bolt_sigma_mm=bolt_sigma_mm(_without_hand_eye(registration, fusion), prepared),
        free_space_mm=config.verification.evidence.free_space_mm,
    )
    verdict = decide(evidence, config.verification)
    scores, thresholds = dict(verdict.scores), dict(verdict.thresholds)
    found = _judge_distances(fusion, joint)
    p_correct = verdict.p_correct
    if fusion.fused is not None and fusion.fused.worst is not None:
        scores["views_apart_sigmas"] = fusion.fused.worst.distance_sigmas
        thresholds["views_apart_sigmas"] = joint.max_distance_sigmas
    for one in judged:
        against = [
            *_what_contradicts(one, config, joint),
            *_stands_elsewhere(one, prepared, config),
        ]
        source = one.seen.shot.scan.source
        found += [(check, f"{source}: {sentence}") for check, sentence in against]
        if against:
            p_correct = min(p_correct, one.verdict.p_correct)
    # the most telling first: where the motor is in two places, no view fits the pose either
    found.sort(key=lambda pair: pair[0] is not Check.VIEWS_DISAGREE)
    if found and found[0][0] is Check.VIEWS_DISAGREE:
        p_correct = 0.0
    return replace(
        verdict,
        status=Status.REFUSED if found else verdict.status,
        failed=tuple(dict.fromkeys([*(check for check, _ in found), *verdict.failed])),
        reasons=(*(sentence for _, sentence in found), *verdict.reasons),
        scores=scores,
        thresholds=thresholds,
        p_correct=p_correct,
    )


def _without_hand_eye(registration: Registration, fusion: Fusion) -> Registration:
    """The joint pose with the errors of its points alone, which is what one view is judged by.

    A hand-eye known to a millimetre makes every bolt uncertain and says so; it is no sign that
    the points leave the pose free to slide.
    """
    if fusion.points_covariance is None:
        return registration
    turn = np.kron(np.eye(2), fusion.used[0].seen.camera_from_base.rotation)
    return replace(registration, covariance=turn @ fusion.points_covariance @ turn.T)


def _judge_distances(fusion: Fusion, joint: JointConfig) -> list[tuple[Check, str]]:
    worst = None if fusion.fused is None else fusion.fused.worst
    if worst is None or worst.distance_sigmas <= joint.max_distance_sigmas:
        return []
    first, second = (fusion.used[row].seen.shot.scan.source for row in (worst.first, worst.second))
    return [
        (
            Check.VIEWS_DISAGREE,
            f"{first} and {second} put the motor {worst.shift_mm:.2f} mm and "
            f"{np.degrees(worst.turn_rad):.2f} degrees apart: {worst.distance_sigmas:.3g} sigma, "
            f"wanted at most {joint.max_distance_sigmas:.3g}; it moved, or a camera pose is wrong",
        )
    ]


def _what_contradicts(
    one: JudgedShot, config: LocateConfig, joint: JointConfig
) -> list[tuple[Check, str]]:
    """Why the motor cannot be there, says a view that sees enough of it."""
    if not one.has_say:
        return []
    wanted, evidence = config.verification, one.pose.evidence
    found: list[tuple[Check, str]] = []
    most = joint.veto_factor * wanted.max_free_space_violation
    if evidence.free_space_violation > most:
        found.append(
            (
                Check.FREE_SPACE,
                "share of the motor's surface the camera saw through: "
                f"{evidence.free_space_violation:.3g}, wanted at most {most:.3g}",
            )
        )
    at_least = (
        (Check.EXPLAINED, "motor points that lie on the prior", "explained", wanted.min_explained),
        (
            Check.FIT,
            "motor points near the prior that lie on it to the measuring error",
            "tight",
            wanted.min_tight,
        ),
        (
            Check.COVERAGE,
            "prior's surface in free view that was measured there",
            "coverage",
            wanted.min_coverage,
        ),
    )
    for check, what, name, wanted_of_one in at_least:
        threshold = 1.0 - joint.veto_factor * (1.0 - wanted_of_one)
        value = float(getattr(evidence, name))
        if not value >= threshold:
            sentence = f"share of the {what}: {value:.3g}, wanted at least {threshold:.3g}"
            found.append((check, sentence))
    return found


def _stands_elsewhere(
    one: JudgedShot, prepared: PreparedPrior, config: LocateConfig
) -> list[tuple[Check, str]]:
    """A view that alone would be sure of quite another pose."""
    pose = one.pose.camera_from_prior
    if not one.seen.candidates:
        return []
    best = one.seen.candidates[0]
    if is_near(best.camera_from_prior, pose, prepared, config):
        return []
    best = register_again(best, one.seen.view, prepared, config)
    evidence = gather_evidence(
        best,
        prepared,
        one.seen.view.scene,
        one.seen.view.motor_points,
        config.verification.evidence,
    )
    if decide(evidence, config.verification).status is not Status.OK:
        return []
    shift_mm = float(np.linalg.norm(best.centre_mm - pose.apply(prepared.centre_mm)))
    return [
        (
            Check.VIEWS_DISAGREE,
            f"alone it has the motor {shift_mm:.1f} mm away from where the others have it; it "
            "moved, or a camera pose is wrong",
        )
    ]
