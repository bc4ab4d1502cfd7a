"""The hard cases of one view: scenes spoiled on purpose, and right and wrong poses in them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from boltpose.errors import DegenerateGeometryError, UnitError
from boltpose.evaluation import hard_scenes
from boltpose.evaluation.hard_poses import (
    NearMiss,
    list_few_misses,
    list_lookalikes,
    list_mirror_poses,
    list_near_misses,
)
from boltpose.evaluation.hard_records import HardCase
from boltpose.evaluation.hard_scenes import HardScene
from boltpose.evaluation.poses import measure_pose_error
from boltpose.evaluation.reman18 import TrueBolt
from boltpose.geometry.sampling import voxel_downsample
from boltpose.geometry.transforms import Transform
from boltpose.io.units import Unit, check_extent, robust_extent
from boltpose.locate_config import LocateConfig
from boltpose.registration.evidence import gather_evidence
from boltpose.registration.icp import refine_pose
from boltpose.registration.prepare import PreparedPrior
from boltpose.registration.register import rank_pose
from boltpose.schema import Registration
from boltpose.segmentation.predictor import ScenePredictor
from boltpose.view import View, register_again, register_view, see

SEED = 5_202_612
"""Every random number follows from it, the motor's number and the view."""
UNITS = {"m": 0.001, "inch": 1.0 / 25.4, "mm as m": 1000.0, "mm as inch": 25.4}
HIDDEN = (0.80, 0.90, 0.95)
CUT = (0.5, 0.2)
"""Shares of the motor left in the picture."""
LOST = (0.5, 0.75)
CLAMP_IN_MASK = (0.05, 0.10, 0.20)
_RANKING_POINTS = 2000


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class HardView:
    """One view and everything that may stand in it."""

    number: int
    """The motor's, for seeds."""
    view: int
    scene: HardScene
    true_bolts: tuple[TrueBolt, ...]
    prepared: PreparedPrior
    prior_from_motor: Transform
    other_sizes: Mapping[str, PreparedPrior]
    """Priors of the same family."""
    strangers: Mapping[str, PreparedPrior]
    """Priors of other families."""
    neighbour: HardScene | None
    """A view of another motor of the family, to stand beside this one."""
    network: ScenePredictor | None
    """Segmentation that has never seen this family; None leaves its cases out."""
    config: LocateConfig = field(default_factory=LocateConfig)


def list_hard_cases(hard: HardView, *, is_thorough: bool) -> Iterator[HardCase]:
    """Make and measure the cases of a view, in a fixed order.

    Args:
        hard: The view.
        is_thorough: False keeps what the masks, the near misses and the wrong priors give and
            leaves hidden, cut, thinned, doubled and empty scenes out.

    Yields:
        Cases, each with its truth and evidence.
    """
    yield from _cases_of_masks(hard)
    yield from _cases_of_other_priors(hard)
    yield from _cases_of_mirrored_motor(hard)
    if is_thorough:
        yield from _cases_of_little_motor(hard)
        yield from _cases_without_motor(hard)


def _rng(hard: HardView, *numbers: int) -> np.random.Generator:
    return np.random.default_rng((SEED, hard.number, hard.view, *numbers))


def _cases_of_masks(hard: HardView) -> Iterator[HardCase]:
    judge = _Judge(hard, "as it is", hard.scene)
    yield from judge.located()
    yield from judge.misses(list_near_misses(judge.truth, hard.prepared, _rng(hard, 0)))
    if hard.network is not None:
        yield from _Judge(hard, "mask by network", hard.scene, hard.network).located()
    for share in CLAMP_IN_MASK:
        spoiled = hard_scenes.spoil_mask(hard.scene, share, _rng(hard, 1, round(100 * share)))
        judge = _Judge(hard, f"{share:.0%} clamp in mask", spoiled)
        yield from judge.located()
    yield from judge.misses(list_few_misses(judge.truth, hard.prepared, _rng(hard, 2)))
    shrunk = hard_scenes.shrink_mask(hard.scene, 0.3, _rng(hard, 3))
    yield from _Judge(hard, "30% of motor not in mask", shrunk).located()


def _cases_of_little_motor(hard: HardView) -> Iterator[HardCase]:
    scenes: list[tuple[str, HardScene]] = []
    for share in HIDDEN:
        rng = _rng(hard, 4, round(100 * share))
        scenes.append((f"hidden {share:.0%}", hard_scenes.hide(hard.scene, share, rng)))
    for share in CUT:
        rng = _rng(hard, 5, round(100 * share))
        cut = hard_scenes.cut_at_border(hard.scene, share, rng)
        scenes.append((f"cut to {share:.0%}", cut))
    for share in LOST:
        rng = _rng(hard, 6, round(100 * share))
        scenes.append((f"dropout {share:.0%}", hard_scenes.drop_out(hard.scene, share, rng)))
    for number, (name, scene) in enumerate(scenes):
        judge = _Judge(hard, name, scene)
        yield from judge.located()
        yield from judge.misses(list_few_misses(judge.truth, hard.prepared, _rng(hard, 7, number)))
    if hard.neighbour is not None:
        two = hard_scenes.add_motor(hard.scene, hard.neighbour)
        yield from _Judge(hard, "two motors", two).located()


def _cases_of_other_priors(hard: HardView) -> Iterator[HardCase]:
    for kind, priors in (("other size", hard.other_sizes), ("other family", hard.strangers)):
        for prepared in priors.values():
            other = replace(hard, prepared=prepared)
            judge = _Judge(other, kind, replace(hard.scene, camera_from_prior=None))
            yield from judge.located()
            # motor frames laid on each other: the best guess of someone who took the wrong prior
            motor_from_other = prepared.prior.alignment.prior_from_motor.inverse()
            aligned = judge.pose_of(hard.scene) @ hard.prior_from_motor @ motor_from_other
            starts = [
                NearMiss(kind="aligned", size=0.0, is_refined=True, camera_from_prior=aligned)
            ]
            if kind == "other size":
                misses = list_lookalikes(aligned, prepared)
                starts += [miss for miss in misses if miss.kind != "rolled" or miss.size <= 15]
            yield from judge.misses(starts)


def _cases_of_mirrored_motor(hard: HardView) -> Iterator[HardCase]:
    judge = _Judge(hard, "mirrored", hard_scenes.mirror(hard.scene))
    yield from judge.located()
    yield from judge.misses(list_mirror_poses(judge.pose_of(hard.scene), hard.prior_from_motor))


def _cases_without_motor(hard: HardView) -> Iterator[HardCase]:
    empty = hard_scenes.take_motor_out(hard.scene, _rng(hard, 8))
    judge = _Judge(hard, "motor absent", empty)
    yield from judge.located()
    truth = judge.pose_of(hard.scene)
    yield from judge.misses(
        [NearMiss(kind="where it was", size=0.0, is_refined=False, camera_from_prior=truth)]
    )
    for name, factor in UNITS.items():
        scaled = replace(hard.scene, unit_mm=factor, camera_from_prior=None)
        name = f"wrong unit: {name}"
        if _is_refused_by_reader(scaled):
            yield HardCase(
                scene=name,
                pose="located",
                size=0.0,
                is_settled=True,
                view=hard.view,
                prior=hard.prepared.prior.name,
                worst_bolt_mm=math.inf,
                rotation_deg=math.inf,
                evidence=None,
            )
        else:
            yield from _Judge(hard, name, scaled).located()


def _is_refused_by_reader(scene: HardScene) -> bool:
    """Whether reading such a file ends in an error already, as `read_scan` does it."""
    try:
        check_extent(scene.name, robust_extent(scene.scan().points), Unit.MM, option="--unit")
    except UnitError:
        return True
    return False


class _Judge:
    """Poses of one prior in one scene, measured as `locate` measures them."""

    def __init__(
        self, hard: HardView, name: str, scene: HardScene, network: ScenePredictor | None = None
    ) -> None:
        self._hard = hard
        self._name = name
        self._truth = scene.camera_from_prior
        self._view: View = see(scene.scan(), network or scene.predictor, hard.config)
        self._found: Registration | None = None

    @property
    def truth(self) -> Transform:
        """The true pose."""
        assert self._truth is not None
        return self._truth

    def pose_of(self, scene: HardScene) -> Transform:
        """The true pose in another scene of the same view."""
        assert scene.camera_from_prior is not None
        return scene.camera_from_prior

    def located(self) -> Iterator[HardCase]:
        """Yield the pose that `locate` would hand to its verdict."""
        hard = self._hard
        best = register_view(self._view, hard.prepared, hard.config).best
        if best is not None:
            best = register_again(best, self._view, hard.prepared, hard.config)
        self._found = best
        yield self._case("located", 0.0, best, is_settled=True)

    def misses(self, misses: Iterable[NearMiss]) -> Iterator[HardCase]:
        """Yield poses put where they are, dressed up as `locate` would dress up its own.

        The runner-up stays that of the located pose: the margin gets no help from the poses'
        being wrong. A raw pose keeps the located one's covariance too.
        """
        if self._found is None:
            return
        hard, points = self._hard, self._view.motor_points
        sample = voxel_downsample(points, 2.0)
        order = np.random.default_rng(0).permutation(len(sample))
        sample = sample[order[:_RANKING_POINTS]]
        for miss in misses:
            candidate = replace(self._found, camera_from_prior=miss.camera_from_prior)
            if miss.is_refined:
                try:
                    candidate = self._refined(candidate)
                except DegenerateGeometryError:
                    continue  # nothing near: registration would not have handed it on
            score = rank_pose(
                candidate.camera_from_prior,
                sample,
                hard.prepared,
                hard.config.registration,
                self._view.scene,
            )
            candidate = replace(candidate, score=score)
            is_settled = miss.is_refined and candidate.converged
            pose = f"{miss.kind}, {'refined' if miss.is_refined else 'raw'}"
            yield self._case(pose, miss.size, candidate, is_settled=is_settled)

    def _refined(self, candidate: Registration) -> Registration:
        hard = self._hard
        pose = candidate.camera_from_prior
        fine = refine_pose(
            pose, self._view.motor_points, hard.prepared, hard.config.registration.fine
        )
        return replace(
            candidate,
            camera_from_prior=fine.camera_from_prior,
            converged=fine.converged,
            covariance=fine.covariance,
            centre_mm=fine.centre_mm,
        )

    def _case(
        self, pose: str, size: float, registration: Registration | None, *, is_settled: bool
    ) -> HardCase:
        hard = self._hard
        worst, turn = math.inf, math.inf
        evidence = None
        if registration is not None:
            if self._truth is not None:
                found = registration.camera_from_prior
                error = measure_pose_error(found, self._truth, hard.true_bolts)
                worst, turn = error.worst_bolt_mm, math.degrees(error.rotation_rad)
            evidence = gather_evidence(
                registration,
                hard.prepared,
                self._view.scene,
                self._view.motor_points,
                hard.config.verification.evidence,
            )
        return HardCase(
            scene=self._name,
            pose=pose,
            size=size,
            is_settled=is_settled,
            view=hard.view,
            prior=hard.prepared.prior.name,
            worst_bolt_mm=worst,
            rotation_deg=turn,
            evidence=evidence,
        )
