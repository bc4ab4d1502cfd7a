"""Several views of one clamping -> one pose, and every bolt in the robot's frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from threadpoolctl import threadpool_limits

import boltpose
from boltpose.errors import ConfigError, FrameError
from boltpose.joint_pose import (
    JudgedShot,
    SeenShot,
    Shot,
    choose_pose,
    describe_joint_pose,
    fuse_shots,
    judge_pose,
    look_at,
    sort_by_content,
)
from boltpose.joint_verdict import decide_jointly
from boltpose.locate import locate
from boltpose.locate_config import LocateConfig
from boltpose.registration.joint import JointConfig
from boltpose.registration.prepare import PreparedPrior, prepare_prior
from boltpose.registration.verify import refuse_without_pose
from boltpose.schema import LocateResult, Prior, Registration, Status
from boltpose.seen_bolts import Found, join_views, look_at_heads, move_heads, place_bolts
from boltpose.segmentation.predictor import ScenePredictor
from boltpose.stages import OnStage, StageClock
from boltpose.view import see

__all__ = ["JointConfig", "Shot", "locate_views"]


def locate_views(
    shots: Sequence[Shot],
    prior: Prior | PreparedPrior,
    predictor: ScenePredictor,
    config: LocateConfig | None = None,
    joint: JointConfig | None = None,
    *,
    provenance: Mapping[str, Any] | None = None,
    on_stage: OnStage | None = None,
) -> LocateResult:
    """Find every bolt of a clamped motor in the robot's frame, from several scans of it.

    Every view is registered alone. The pose that suits all views best is refined in each; views
    that see too little alone are helped by the others. The refined poses are averaged by what
    each view knows: views from several sides cancel much of the camera's depth bias. Views that
    put the motor in different places, and a view in which the motor cannot be where the others
    have it, lead to a refusal.

    Args:
        shots: At least one. Their order does not matter. One alone is `locate`.
        prior: The motor's prior, or what `prepare_prior` made of it.
        predictor: Scene segmentation.
        config: Settings of every stage.
        joint: Settings of what is joint.
        provenance: Kept in the result beside version and settings, JSON-ready.
        on_stage: Told each stage's name and wall time.

    Returns:
        As `locate`, frame `base`. `registration` and `base_from_camera` are those of one of the
        views, named in `provenance["reference_view"]`, and together the joint pose; a bolt's
        visibility is the best over all views.

    Raises:
        FrameError: A shot's camera pose does not map `camera` to `base`.
        ConfigError: There is no shot, or one was given twice: it would pass for two.
        MissingExtraError: The configured method needs a package that is not installed.
    """
    config, joint = config or LocateConfig(), joint or JointConfig()
    _check_shots(shots)
    if len(shots) == 1:
        return locate(
            shots[0].scan,
            prior,
            shots[0].base_from_camera,
            predictor,
            config,
            hand_eye_error=shots[0].hand_eye_error,
            provenance=provenance,
            on_stage=on_stage,
        )
    stages = StageClock(on_stage)
    # one BLAS thread: sums in another order give other bits
    with threadpool_limits(1, user_api="blas"):
        prepared = prior if isinstance(prior, PreparedPrior) else prepare_prior(prior)
        stages.done("prepare prior")
        views = [see(shot.scan, predictor, config) for shot in shots]
        stages.done("segmentation")
        seen = sort_by_content(
            [look_at(shot, view, prepared, config) for shot, view in zip(shots, views, strict=True)]
        )
        stages.done("registration")
        chosen = choose_pose(seen, prepared, config)
        if chosen is None:
            points = sum(len(one.view.motor_points) for one in seen)
            verdict = refuse_without_pose(points, config.verification)
            reference, registration, found = seen[0], None, Found()
        else:
            hypothesis, score, runner_up = chosen
            judged = [judge_pose(one, hypothesis, prepared, config) for one in seen]
            stages.done("relabelling")
            fusion = fuse_shots(judged, prepared, config, joint)
            reference = fusion.used[0].seen if fusion.used else seen[0]
            registration = describe_joint_pose(
                fusion, reference, hypothesis, score, runner_up, prepared
            )
            verdict = decide_jointly(judged, fusion, registration, prepared, config, joint)
            stages.done("verification")
            found = (
                _find(judged, registration, reference, prepared, config)
                if verdict.status is Status.OK
                else Found()
            )
            stages.done("bolts")
    return LocateResult(
        verdict=verdict,
        frame="base",
        bolts=found.bolts,
        registration=registration,
        prior_name=prepared.prior.name,
        base_from_camera=reference.shot.base_from_camera,
        extra_heads=found.extra_heads,
        provenance={
            "version": boltpose.__version__,
            "config": asdict(config),
            "joint": asdict(joint),
            "views": [one.shot.scan.source for one in seen],
            "reference_view": reference.shot.scan.source,
            **(provenance or {}),
        },
    )


def _check_shots(shots: Sequence[Shot]) -> None:
    if not shots:
        raise ConfigError("shots must hold at least one scan, got none")
    for shot in shots:
        pose = shot.base_from_camera
        if (pose.target, pose.source) != ("base", "camera"):
            raise FrameError(
                f"the camera pose of {shot.scan.source} must be base_from_camera, got "
                f"{pose.target}_from_{pose.source}"
            )


def _find(
    judged: list[JudgedShot],
    registration: Registration,
    reference: SeenShot,
    prepared: PreparedPrior,
    config: LocateConfig,
) -> Found:
    seen = [
        look_at_heads(one.seen.view, prepared, one.pose.camera_from_prior, config) for one in judged
    ]
    base_from_reference = reference.shot.base_from_camera
    # what one view shows another may, too: the view with the most tells of extra heads
    most = max(range(len(seen)), key=lambda row: len(seen[row].extra))
    return Found(
        bolts=place_bolts(
            registration,
            join_views([view.bolts for view in seen]),
            prepared,
            base_from_reference,
            config,
        ),
        extra_heads=move_heads(seen[most].extra, judged[most].seen.shot.base_from_camera),
    )
