"""The main job where the motor is not known: which of many priors is in the clamp, and where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import boltpose
from boltpose.arrays import BoolArray, FloatArray
from boltpose.errors import ConfigError, DegenerateGeometryError, FrameError
from boltpose.geometry.sampling import voxel_downsample
from boltpose.geometry.transforms import Transform
from boltpose.locate_config import LocateConfig
from boltpose.registration.icp import refine_pose
from boltpose.registration.library import PriorLibrary
from boltpose.registration.register import rank_pose
from boltpose.registration.relabel import relabel
from boltpose.registration.shortlist import ViewSketch, align_all, rank_by_pairs, sketch_view
from boltpose.registration.verify import verify
from boltpose.schema import (
    Check,
    LocatedBolt,
    LocateResult,
    Prior,
    Registration,
    Scan,
    Status,
    VariantScore,
    Verdict,
)
from boltpose.segmentation.predictor import ScenePredictor
from boltpose.stages import OnStage, StageClock
from boltpose.view import View, place_bolts, register_again, register_view, see


@dataclass(frozen=True, slots=True, kw_only=True)
class VariantConfig:
    """When one of many motors counts as recognised."""

    full_tries: int = 5
    """So many priors are registered in full before the motor counts as unknown. The right one was
    the third at the latest in the views of reman18 (simulated), among 18 to 106 priors."""
    rank_again: tuple[int, ...] = (0, 3)
    """Tries for which the prior is chosen by point pairs alone: the first, when no pose is known,
    and a later one, when the poses found so far may all be wrong."""
    look_alikes: int = 3
    """So many of the nearest other motors are refined from the pose found and compared."""
    min_lead: float = 0.05
    """Score, 0 to 1, that the motor must be ahead of every other one tried. The next sizes of the
    same families on reman18 (simulated) lie far below; see docs/results.md."""

    def __post_init__(self) -> None:
        for name in ("full_tries", "look_alikes"):
            if not getattr(self, name) >= 1:
                raise ConfigError(f"{name} must be >= 1, got {getattr(self, name)}")
        if not 0 < self.min_lead < 1:
            raise ConfigError(f"min_lead must be in (0, 1), got {self.min_lead}")


def locate_variant(
    scan: Scan,
    priors: PriorLibrary | Sequence[Prior],
    base_from_camera: Transform | None,
    predictor: ScenePredictor,
    config: LocateConfig | None = None,
    variants: VariantConfig | None = None,
    *,
    provenance: Mapping[str, Any] | None = None,
    on_stage: OnStage | None = None,
) -> LocateResult:
    """Tell which of the known motors is clamped and find its bolts; refuse all others.

    The motor that looks most alike by its point pairs is registered first. With its axes all
    others are laid into the view at once and ranked; the best goes through the same registration
    and verdict as in `locate`, until one is accepted. Then the nearest look-alikes are refined
    from its pose: the same family in another size must fit clearly worse.

    Args:
        scan: One view, mm, frame `camera` (camera at the origin, +z forward).
        priors: All motors that may be clamped: a library opened once, or priors in memory.
        base_from_camera: Hand-eye matrix; None leaves the poses in frame `camera`.
        predictor: Scene segmentation (`load_models().scene`).
        config: Settings of every stage; defaults if left out.
        variants: When a motor counts as recognised.
        provenance: Kept in the result beside version and settings, JSON-ready.
        on_stage: Told each stage's name and wall time.

    Returns:
        All bolts of the motor recognised, `variants` telling how the others fit, or no bolts and
        the reasons. `prior_name` and `registration` are then of the best one tried, for diagnosis.

    Raises:
        ConfigError: There is no prior, or a name comes twice.
        FrameError: `base_from_camera` does not map `camera` to `base`.
        InputFileError: A prior's file cannot be read.
    """
    config = config or LocateConfig()
    variants = variants or VariantConfig()
    frame = _check_frame(base_from_camera)
    stages = StageClock(on_stage)
    # one BLAS thread: sums in another order give other bits
    with threadpool_limits(1, user_api="blas"):
        library = priors if isinstance(priors, PriorLibrary) else PriorLibrary.from_priors(priors)
        stages.done("priors")
        view = see(scan, predictor, config)
        stages.done("segmentation")
        search = _Search(view, library, config, variants)
        search.run()
        stages.done("registration")
        search.try_look_alikes()
        stages.done("look-alikes")
        best, verdict = search.decide()
        bolts: tuple[LocatedBolt, ...] = ()
        motor_mask: BoolArray | None = None
        if best.registration is not None and verdict.status is Status.OK:
            prepared = library.prepared(best.row)
            bolts = place_bolts(best.registration, view, prepared, base_from_camera, config)
            if config.label_scan:
                motor_mask = relabel(
                    prepared,
                    best.registration.camera_from_prior,
                    scan.points,
                    threshold_mm=config.relabel_mm or LocateConfig().relabel_mm,
                )
        stages.done("bolts")
    return LocateResult(
        verdict=verdict,
        frame=frame,
        bolts=bolts,
        registration=best.registration,
        prior_name=library.names[best.row],
        base_from_camera=base_from_camera,
        motor_mask=motor_mask,
        variants=search.scores(best),
        provenance={
            "version": boltpose.__version__,
            "config": asdict(config),
            "variants": {"priors": len(library), **asdict(variants)},
            **(provenance or {}),
        },
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Try:
    """One prior that was registered in the view."""

    row: int
    registration: Registration | None
    verdict: Verdict
    score: float
    """Of `rank_pose` on the same points for all; -inf without a pose."""


class _Search:
    """Best-first search over the priors of a library."""

    def __init__(
        self, view: View, library: PriorLibrary, config: LocateConfig, variants: VariantConfig
    ) -> None:
        self._view = view
        self._library = library
        self._config = config
        self._variants = variants
        self._tries: dict[int, _Try] = {}
        self._agreement = np.full(len(library), -1.0)
        self._start: dict[int, Transform] = {}
        motor_points = view.motor_points
        self._sketch: ViewSketch | None = sketch_view(motor_points, library.config)
        self._sample = self._ranking_sample(motor_points)

    def run(self) -> None:
        """Register priors in full, the most promising first, until one is accepted."""
        library = self._library
        by_pairs = np.arange(len(library))
        if self._sketch is not None:
            by_pairs = rank_by_pairs(library.index, self._sketch)
        for step in range(min(self._variants.full_tries, len(library))):
            by_agreement = np.argsort(-self._agreement, kind="stable")
            order = by_pairs if step in self._variants.rank_again else by_agreement
            row = next(int(row) for row in order if int(row) not in self._tries)
            tried = self._try_fully(row)
            self._tries[row] = tried
            if tried.registration is None:
                return  # too few motor points: no other prior would do better
            self._align_all(tried.registration, row)
            if tried.verdict.status is Status.OK:
                return

    def try_look_alikes(self) -> None:
        """Refine the motors nearest to the accepted one from where they were laid."""
        accepted = self._accepted()
        if accepted is None:
            return
        order = np.argsort(-self._agreement, kind="stable")
        nearest = [int(row) for row in order if int(row) != accepted.row]
        for row in nearest[: self._variants.look_alikes]:
            if row in self._tries:
                continue
            tried = self._refine(row, self._start[row])
            if tried.score > accepted.score - self._variants.min_lead:
                # too near to be told by a pose borrowed from another motor
                again = self._try_fully(row)
                tried = again if again.score > tried.score else tried
            self._tries[row] = tried

    def decide(self) -> tuple[_Try, Verdict]:
        """Choose the motor; refuse it unless it is accepted and clearly ahead of all others."""
        accepted = self._accepted()
        ranked = sorted(self._tries.values(), key=lambda tried: -tried.score)
        if accepted is None:
            best = ranked[0]
            if best.registration is None:
                return best, best.verdict
            return best, _refused(best.verdict, self._unknown(ranked))
        others = [tried for tried in ranked if tried.row != accepted.row]
        if not others:
            return accepted, accepted.verdict
        lead = accepted.score - others[0].score
        wanted = self._variants.min_lead
        verdict = replace(
            accepted.verdict,
            scores={**accepted.verdict.scores, "variant_lead": lead},
            thresholds={**accepted.verdict.thresholds, "variant_lead": wanted},
        )
        likelier = [o for o in others if o.verdict.p_correct > accepted.verdict.p_correct]
        if lead >= wanted and not likelier:
            return accepted, verdict
        name = self._library.names
        rival = others[0] if lead < wanted else likelier[0]
        sentence = (
            f"{name[accepted.row]} and {name[rival.row]} cannot be told apart: "
            f"scores {accepted.score:.3f} and {rival.score:.3f}, wanted {wanted:.3g} between them"
        )
        return accepted, _refused(verdict, sentence)

    def scores(self, best: _Try) -> tuple[VariantScore, ...]:
        """All priors tried: the chosen one, then the others by score."""
        others = sorted(
            (tried for tried in self._tries.values() if tried is not best),
            key=lambda tried: -tried.score,
        )
        return tuple(
            VariantScore(
                name=self._library.names[tried.row],
                status=tried.verdict.status,
                p_correct=tried.verdict.p_correct,
                score=tried.score,
            )
            for tried in (best, *others)
        )

    def _accepted(self) -> _Try | None:
        """The best of those whose verdict is ok."""
        accepted = [t for t in self._tries.values() if t.verdict.status is Status.OK]
        return max(accepted, key=lambda tried: tried.score, default=None)

    def _unknown(self, ranked: list[_Try]) -> str:
        named = ", ".join(
            f"{self._library.names[tried.row]} ({', '.join(map(str, tried.verdict.failed))})"
            for tried in ranked[:3]
        )
        return f"none of {len(self._library)} known motors fits; nearest: {named}"

    def _try_fully(self, row: int) -> _Try:
        prepared = self._library.prepared(row)
        best = register_view(self._view, prepared, self._config).best
        if best is not None:
            best = register_again(best, self._view, prepared, self._config)
        return self._judge(row, best)

    def _refine(self, row: int, start: Transform) -> _Try:
        prepared = self._library.prepared(row)
        try:
            fine = refine_pose(
                start, self._view.motor_points, prepared, self._config.registration.fine
            )
        except DegenerateGeometryError:
            return self._judge(row, None)
        score = self._score(row, fine.camera_from_prior)
        registration = Registration(
            camera_from_prior=fine.camera_from_prior,
            converged=fine.converged,
            rms_mm=fine.rms_mm,
            inlier_ratio=fine.inlier_ratio,
            covariance=fine.covariance,
            centre_mm=fine.centre_mm,
            runner_up_score=0.0,
            score=score,
        )
        return self._judge(row, registration)

    def _judge(self, row: int, registration: Registration | None) -> _Try:
        verdict = verify(
            registration,
            self._library.prepared(row),
            self._view.scene,
            self._view.motor_points,
            self._config.verification,
        )
        score = -np.inf
        if registration is not None:
            score = self._score(row, registration.camera_from_prior)
        return _Try(row, registration, verdict, float(score))

    def _score(self, row: int, camera_from_prior: Transform) -> float:
        return rank_pose(
            camera_from_prior,
            self._sample,
            self._library.prepared(row),
            self._config.registration,
            self._view.scene,
        )

    def _align_all(self, registration: Registration, row: int) -> None:
        if self._sketch is None:
            return
        index = self._library.index
        camera_from_motor = registration.camera_from_prior @ index.sketches[row].prior_from_motor
        for aligned in align_all(index, self._sketch, camera_from_motor, self._library.config):
            if aligned.agreement > self._agreement[aligned.row]:
                self._agreement[aligned.row] = aligned.agreement
                self._start[aligned.row] = aligned.camera_from_prior

    def _ranking_sample(self, motor_points: FloatArray) -> FloatArray:
        if not len(motor_points):
            return motor_points
        thinned = voxel_downsample(motor_points, 2.0)
        order = np.random.default_rng(self._config.registration.coarse.seed).permutation(
            len(thinned)
        )
        return thinned[order[: self._config.registration.ranking_points]]


def _refused(verdict: Verdict, sentence: str) -> Verdict:
    return replace(
        verdict,
        status=Status.REFUSED,
        failed=(Check.UNKNOWN_MOTOR, *verdict.failed),
        reasons=(sentence, *verdict.reasons),
    )


def _check_frame(base_from_camera: Transform | None) -> str:
    if base_from_camera is None:
        return "camera"
    if (base_from_camera.target, base_from_camera.source) != ("base", "camera"):
        raise FrameError(
            f"hand-eye must be base_from_camera, got "
            f"{base_from_camera.target}_from_{base_from_camera.source}"
        )
    return "base"
