"""Evaluate one motor: its prior, its views, its must-be-refused set."""

from __future__ import annotations

import resource
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Generic

from boltpose.errors import BoltposeError
from boltpose.evaluation.bolts import BoltMatching, match_bolts
from boltpose.evaluation.fingerprint import describe_environment
from boltpose.evaluation.masks import MaskCounts, count_mask
from boltpose.evaluation.negatives import CROPS, Case, list_cases, make_scan
from boltpose.evaluation.pipeline import CallClock, Models, Pipeline
from boltpose.evaluation.poses import PoseRecord, compare_with_truth, measure_pose_error
from boltpose.evaluation.records import (
    FORMAT,
    CallTime,
    CaseRecord,
    MotorRecord,
    Outcome,
    PriorRecord,
    ViewRecord,
)
from boltpose.evaluation.reman18 import TrueMotor, TrueView
from boltpose.geometry.transforms import Transform, angle_between_rad
from boltpose.schema import LocateResult, Prior, Scan, Side, Status


class MotorEvaluation(Generic[Models]):
    """Runs the pipeline on one motor and compares with the truth.

    `models_of` returns networks that have seen no motor of the family asked for. A prior is built
    and its own views are segmented with those of its family, a foreign scene with those of the
    scene's family.
    """

    def __init__(
        self,
        pipeline: Pipeline[Models],
        models_of: Callable[[str], Models],
        motor: TrueMotor,
        motors: Mapping[str, TrueMotor],
        on_step: Callable[[str], None],
    ) -> None:
        self._pipeline = pipeline
        self._models_of = models_of
        self._motor = motor
        self._motors = motors
        self._on_step = on_step

    def run(
        self, fingerprint: str, *, views: Sequence[int] | None, with_negatives: bool
    ) -> MotorRecord:
        """Measure everything.

        Args:
            fingerprint: Goes into the record.
            views: Which views; None for all. Without all, the must-be-refused set shrinks to
                cases of these views.
            with_negatives: Whether to run the must-be-refused set.

        Returns:
            The record.

        Raises:
            InputFileError: A file of the data set cannot be read.
        """
        prior, prior_record = self.build_prior()
        chosen = [v for v in self._motor.views if views is None or v.index in views]
        view_records = tuple(
            self._evaluate_view(view, prior, prior_record.bolts) for view in chosen
        )
        peak_memory_mb = peak_memory()
        cases: list[CaseRecord] = []
        if with_negatives and prior is not None:
            prepared = self._pipeline.prepare(prior)
            wanted = list_cases(self._motor, list(self._motors.values()))
            # by family: networks are loaded once for all scenes of one
            for case in sorted(wanted, key=lambda case: case.scene_family):
                if views is None or case.view in views:
                    cases.append(self._evaluate_case(case, prepared))
        return MotorRecord(
            format=FORMAT,
            fingerprint=fingerprint,
            motor=self._motor.name,
            family=self._motor.family,
            true_bolts=len(self._motor.bolts),
            true_tilts_rad=_tilts(self._motor),
            prior=prior_record,
            views=view_records,
            cases=tuple(cases),
            peak_memory_mb=peak_memory_mb,
            peak_memory_all_mb=peak_memory(),
            environment=describe_environment(),
        )

    def build_prior(self) -> tuple[Prior | None, PriorRecord]:
        """Build the prior from the scan alone; None and why, if it cannot be.

        Raises:
            InputFileError: The scan or the networks cannot be read.
        """
        self._on_step("prior")
        scan = self._pipeline.read_scan(self._motor.scan_path)
        # the labels in the file are the truth: nothing may look at them
        scan = Scan(points=scan.points, source=scan.source)
        models = self._models_of(self._motor.family)
        clock = CallClock()
        try:
            prior = self._pipeline.build_prior(scan, models, self._motor.name, clock.on_stage)
        except BoltposeError as error:
            return None, self._failed_prior(scan, error, clock.stop())
        time = clock.stop()
        found = prior.alignment.prior_from_motor.rotation
        truth = self._motor.prior_from_motor.rotation
        return prior, PriorRecord(
            problem="",
            scan_points=len(scan),
            bolts=match_bolts(prior.bolts, self._motor.bolts),
            axis_error_rad=float(angle_between_rad(found[:, 2], truth[:, 2])),
            roll_error_rad=float(angle_between_rad(found[:, 1], truth[:, 1])),
            axis_sigma_rad=prior.alignment.axis_sigma_rad,
            time=time,
        )

    def _failed_prior(self, scan: Scan, error: BoltposeError, time: CallTime) -> PriorRecord:
        return PriorRecord(
            problem=f"{type(error).__name__}: {error}",
            scan_points=len(scan),
            bolts=match_bolts((), self._motor.bolts),
            axis_error_rad=None,
            roll_error_rad=None,
            axis_sigma_rad=None,
            time=time,
        )

    def _evaluate_view(
        self, view: TrueView, prior: Prior | None, bolts: BoltMatching
    ) -> ViewRecord:
        self._on_step(f"view {view.index}")
        clock = CallClock()
        scan = self._pipeline.read_scan(view.depth_path)
        base_from_camera = self._pipeline.read_hand_eye(view.hand_eye_path)
        read_s = clock.stop().wall_s
        truth = self._motor.bolts
        missed = tuple(sorted(bolt.id for bolt in truth))
        mask: MaskCounts | None = None
        if prior is None:
            result = _no_result("no_prior", "no prior could be built", missed)
            time = CallTime(wall_s=0.0, cpu_s=0.0, stages=())
        else:
            answer, time = self._locate(scan, prior, base_from_camera, self._motor.family)
            if isinstance(answer, BoltposeError):
                result = _no_result(type(answer).__name__, str(answer), missed)
            else:
                result = compare_with_truth(answer, view, truth, bolts.true_id_of)
                if answer.motor_mask is not None:
                    mask = count_mask(answer.motor_mask, view.depth_path, view.label_path)
        return ViewRecord(
            view=view.index,
            clamp=view.clamp,
            points=len(scan),
            result=result,
            mask=mask,
            read_s=read_s,
            time=time,
        )

    def _evaluate_case(self, case: Case, prior: Any) -> CaseRecord:
        self._on_step(f"{case.kind} {case.scene_motor}/{case.view}")
        scene = self._motors[case.scene_motor]
        view = next(view for view in scene.views if view.index == case.view)
        scan = make_scan(case, scene, self._pipeline.read_scan)
        answer, time = self._locate(scan, prior, view.base_from_camera, case.scene_family)
        if isinstance(answer, BoltposeError):
            outcome, pose = Outcome.REFUSED, None
            failed: tuple[str, ...] = (type(answer).__name__,)
            reasons: tuple[str, ...] = (str(answer),)
            scores: dict[str, float] = {}
        else:
            pose = None
            if case.kind in CROPS and answer.registration is not None:
                pose = measure_pose_error(
                    answer.registration.camera_from_prior,
                    view.camera_from_prior,
                    self._motor.bolts,
                )
            if not answer.is_ok:
                outcome = Outcome.REFUSED
            elif pose is not None and not pose.is_wrong:
                outcome = Outcome.RIGHT
            else:
                outcome = Outcome.WRONG
            failed = tuple(str(check) for check in answer.verdict.failed)
            reasons = answer.verdict.reasons
            scores = {name: float(value) for name, value in answer.verdict.scores.items()}
        return CaseRecord(
            kind=case.kind,
            expectation=case.expectation,
            scene_motor=case.scene_motor,
            view=case.view,
            points=len(scan),
            outcome=outcome,
            failed=failed,
            reasons=reasons,
            scores=scores,
            pose=pose,
            time=time,
        )

    def _locate(
        self, scan: Scan, prior: Any, base_from_camera: Transform, family: str
    ) -> tuple[LocateResult | BoltposeError, CallTime]:
        """The answer, or the error raised instead of one: a refusal, too, for the robot."""
        models = self._models_of(family)
        clock = CallClock()
        try:
            answer: LocateResult | BoltposeError = self._pipeline.locate(
                scan, prior, base_from_camera, models, clock.on_stage
            )
        except BoltposeError as error:
            answer = error
        return answer, clock.stop()


def peak_memory() -> float:
    """High-water mark of this process' resident memory, in MB (10^6 bytes)."""
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def _tilts(motor: TrueMotor) -> tuple[float, ...]:
    z_axis = motor.prior_from_motor.z_axis
    return tuple(
        float(angle_between_rad(z_axis if bolt.side is Side.TOP else -z_axis, bolt.axis))
        for bolt in motor.bolts
    )


def _no_result(failed: str, reason: str, missed: tuple[int, ...]) -> PoseRecord:
    return PoseRecord(
        status=Status.REFUSED,
        failed=(failed,),
        reasons=(reason,),
        scores={},
        pose=None,
        bolts=(),
        missed=missed,
        false=(),
    )
