"""Best-first search for the one of many motors that is in a view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from boltpose.arrays import FloatArray, IntArray
from boltpose.errors import ConfigError
from boltpose.geometry.sampling import voxel_downsample
from boltpose.geometry.transforms import Transform
from boltpose.locate_config import LocateConfig
from boltpose.registration.coarse import register_coarsely
from boltpose.registration.library import PriorLibrary
from boltpose.registration.shortlist import (
    ViewSketch,
    align_all,
    compare_closely,
    rank_by_pairs,
    sketch_view,
)
from boltpose.registration.verify import verify
from boltpose.schema import Check, Registration, Status, VariantScore, Verdict
from boltpose.view import View, register_again, register_view


@dataclass(frozen=True, slots=True, kw_only=True)
class VariantConfig:
    """When one of many motors counts as recognised."""

    full_tries: int = 3
    """So many priors are registered and judged in full before the motor counts as unknown. In the
    views of reman18 (simulated) the first was the right one, among 18 and among 144."""
    scouts: int = 4
    """So many priors, chosen by their point pairs, are at most registered coarsely to learn where
    the motor is: a wrong motor may be laid down upside down."""
    scout_agreement: float = 0.5
    """Once some prior, laid there, agrees with so many of the motor points, 0 to 1, no other scout
    is sent."""
    min_agreement: float = 0.5
    """After the first try only priors that agree with so many of the motor points, settled on
    their full surface, are worth another. Right ones reach 0.8 on reman18 (simulated), of which
    clamp points in the mask take their share; other motors stay below 0.55."""
    scout_poses: int = 4
    """Of a coarse registration so many poses go on."""
    look_alikes: int = 3
    """So many of the nearest other motors are settled from the pose found and compared."""
    min_lead: float = 0.1
    """Agreement, 0 to 1, that the motor must be ahead of every other one compared. On reman18
    (simulated) a copy of the right prior grown by 1 % falls behind by 0.14 to 0.24, by 0.5 % by
    0.04 to 0.07: motors nearer than that are refused as not to be told apart."""

    def __post_init__(self) -> None:
        for name in ("full_tries", "scouts", "scout_poses", "look_alikes"):
            if not getattr(self, name) >= 1:
                raise ConfigError(f"{name} must be >= 1, got {getattr(self, name)}")
        for name in ("scout_agreement", "min_agreement", "min_lead"):
            if not 0 < getattr(self, name) < 1:
                raise ConfigError(f"{name} must be in (0, 1), got {getattr(self, name)}")


@dataclass(frozen=True, slots=True, eq=False)
class VariantTry:
    """One prior that was registered in full, judged when somebody asks."""

    row: int
    registration: Registration | None
    verdict: Verdict | None = None


class VariantSearch:
    """Best-first search over the priors of a library."""

    def __init__(
        self, view: View, library: PriorLibrary, config: LocateConfig, variants: VariantConfig
    ) -> None:
        self._view = view
        self._library = library
        self._config = config
        self._variants = variants
        self._scouted: list[int] = []
        self._tries: dict[int, VariantTry] = {}
        self._agreement = np.full(len(library), -1.0)
        self._start: dict[int, Transform] = {}
        self._scores: dict[int, float] = {}
        self._sketch: ViewSketch | None = sketch_view(view.motor_points, library.config)

    def run(self) -> None:
        """Register priors in full, the most promising first, until one is accepted."""
        count = len(self._library)
        if self._sketch is None:
            self._register(0)  # too few motor points for any prior: it will say so
            return
        if count > 1:
            self._send_scouts()
        for step in range(min(self._variants.full_tries, count)):
            row = self._next(is_first=step == 0)
            if row is None:
                return
            registration = self._register(row)
            if registration is None:
                return
            self._align_all([registration.camera_from_prior], row)
            if self._verdict(row).status is Status.OK:
                return

    def _next(self, *, is_first: bool) -> int | None:
        """The most promising prior that was not tried yet; None if none is worth it."""
        rows = [int(row) for row in self._by_agreement() if int(row) not in self._tries]
        if is_first:
            return rows[0]
        rows = rows[: self._variants.look_alikes]
        closely = self._closely(rows)
        best = int(closely.argmax())
        return rows[best] if closely[best] >= self._variants.min_agreement else None

    def compare(self) -> None:
        """Measure all that were tried, and the nearest look-alikes, on the same points.

        A look-alike that comes near the accepted motor is registered and judged in full.
        """
        if not self._start:
            return  # too few motor points to find any
        accepted = self._accepted()
        if accepted is None:
            # also those that were not worth a try: a refusal names the nearest
            rows = self._by_agreement()[: self._variants.look_alikes]
            self._measure(list(dict.fromkeys([*self._tries, *map(int, rows)])))
            return
        nearest = [int(row) for row in self._by_agreement() if int(row) != accepted.row]
        look_alikes = nearest[: self._variants.look_alikes]
        compared = list(dict.fromkeys([*self._tries, *look_alikes]))
        self._measure(compared)
        limit = self._scores[accepted.row] - self._variants.min_lead
        near = [r for r in look_alikes if self._scores[r] > limit and r not in self._tries]
        for row in near:
            self._register(row)
            self._verdict(row)
        if near:
            self._measure(compared)  # from their own poses

    def decide(self) -> tuple[VariantTry, Verdict]:
        """Choose the motor; refuse it unless it is accepted and clearly ahead of all others."""
        accepted = self._accepted()
        if accepted is None:
            rows = sorted(self._tries, key=lambda row: -self._scores.get(row, -np.inf))
            verdict = self._verdict(rows[0])
            best = self._tries[rows[0]]
            if best.registration is None:
                return best, verdict
            nearest = sorted(self._scores, key=lambda row: -self._scores[row])[:3]
            named = ", ".join(
                f"{self._library.names[row]} (agreement {self._scores[row]:.2f})" for row in nearest
            )
            sentence = f"none of {len(self._library)} known motors fits; nearest: {named}"
            return best, _refused(verdict, sentence)
        verdict = self._verdict(accepted.row)
        score = self._scores[accepted.row]
        others = sorted(
            (row for row in self._scores if row != accepted.row), key=lambda r: -self._scores[r]
        )
        if not others:
            return accepted, verdict
        lead = score - self._scores[others[0]]
        wanted = self._variants.min_lead
        verdict = replace(
            verdict,
            scores={**verdict.scores, "variant_lead": lead},
            thresholds={**verdict.thresholds, "variant_lead": wanted},
        )
        likelier = [row for row in others if self._p_correct(row) > verdict.p_correct]
        if lead >= wanted and not likelier:
            return accepted, verdict
        rival = others[0] if lead < wanted else likelier[0]
        names = self._library.names
        sentence = (
            f"{names[accepted.row]} and {names[rival]} cannot be told apart: agreement "
            f"{score:.3f} and {self._scores[rival]:.3f}, wanted {wanted:.3g} between them"
        )
        return accepted, _refused(verdict, sentence)

    def scores(self, best: VariantTry) -> tuple[VariantScore, ...]:
        """All priors compared: the chosen one, then the others by score."""
        if best.row not in self._scores:
            return ()  # too few motor points to compare by
        others = sorted(
            (row for row in self._scores if row != best.row), key=lambda r: -self._scores[r]
        )
        return tuple(
            VariantScore(
                name=self._library.names[row],
                status=self._verdict(row).status if row in self._tries else Status.REFUSED,
                p_correct=self._p_correct(row),
                score=self._scores[row],
            )
            for row in (best.row, *others)
        )

    def names(self) -> dict[str, list[str]]:
        """Which priors were registered, in this order; for the result's provenance."""
        names = self._library.names
        return {
            "scouted": [names[row] for row in self._scouted],
            "registered": [names[row] for row in self._tries],
        }

    def _by_agreement(self) -> IntArray:
        return np.argsort(-self._agreement, kind="stable").astype(np.int64)

    def _accepted(self) -> VariantTry | None:
        """The nearest of those judged ok."""
        accepted = [
            tried
            for tried in self._tries.values()
            if tried.verdict is not None and tried.verdict.status is Status.OK
        ]
        return max(
            accepted,
            key=lambda tried: (self._scores.get(tried.row, 0.0), self._agreement[tried.row]),
            default=None,
        )

    def _verdict(self, row: int) -> Verdict:
        tried = self._tries[row]
        if tried.verdict is not None:
            return tried.verdict
        view, prepared, config = self._view, self._library.prepared(row), self._config
        best = tried.registration
        if best is not None:
            best = register_again(best, view, prepared, config)
        verdict = verify(best, prepared, view.scene, view.motor_points, config.verification)
        self._tries[row] = VariantTry(row, best, verdict)
        return verdict

    def _p_correct(self, row: int) -> float:
        return self._verdict(row).p_correct if row in self._tries else 0.0

    def _send_scouts(self) -> None:
        assert self._sketch is not None
        by_pairs = rank_by_pairs(self._library.index, self._sketch)
        for row in map(int, by_pairs[: self._variants.scouts]):
            self._scouted.append(row)
            self._scout(row)
            if self._agreement.max() >= self._variants.scout_agreement:
                return

    def _scout(self, row: int) -> None:
        """Lay all motors where a coarse registration, without a second chance, puts this one."""
        coarse = replace(self._config.registration.coarse, convincing_score=0.0)
        points = voxel_downsample(self._view.motor_points, 2.0)
        poses = register_coarsely(self._library.prepared(row), points, coarse).poses
        self._align_all(poses[: self._variants.scout_poses].transforms(), row)

    def _register(self, row: int) -> Registration | None:
        best = register_view(self._view, self._library.prepared(row), self._config).best
        self._tries[row] = VariantTry(row, best)
        return best

    def _align_all(self, camera_from_prior: Sequence[Transform], row: int) -> None:
        assert self._sketch is not None
        index = self._library.index
        prior_from_motor = index.sketches[row].prior_from_motor
        guesses = [pose @ prior_from_motor for pose in camera_from_prior]
        for aligned in align_all(index, self._sketch, guesses, self._library.config):
            if aligned.agreement > self._agreement[aligned.row]:
                self._agreement[aligned.row] = aligned.agreement
                self._start[aligned.row] = aligned.camera_from_prior

    def _measure(self, rows: list[int]) -> None:
        if rows:
            self._scores = dict(zip(rows, map(float, self._closely(rows)), strict=True))

    def _closely(self, rows: Sequence[int]) -> FloatArray:
        assert self._sketch is not None
        priors = [self._library.prior(row) for row in rows]
        starts = [self._pose(row) for row in rows]
        return compare_closely(priors, starts, self._sketch, self._library.config)

    def _pose(self, row: int) -> Transform:
        tried = self._tries.get(row)
        if tried is not None and tried.registration is not None:
            return tried.registration.camera_from_prior
        return self._start[row]


def _refused(verdict: Verdict, sentence: str) -> Verdict:
    return replace(
        verdict,
        status=Status.REFUSED,
        failed=(Check.UNKNOWN_MOTOR, *verdict.failed),
        reasons=(sentence, *verdict.reasons),
    )
