"""Which of many priors are worth a full registration: all of them tried coarsely, at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from boltpose.arrays import Float32Array, FloatArray, IntArray, freeze
from boltpose.errors import ConfigError
from boltpose.geometry.normals import estimate_normals, orient_towards
from boltpose.geometry.point_pairs import pair_histogram
from boltpose.geometry.sampling import voxel_downsample, voxel_representatives
from boltpose.geometry.transforms import Transform
from boltpose.prior.sketch import SKETCH_SPACING_MM, PriorSketch
from boltpose.registration.align_many import AlignRound, Surfaces, join_surfaces, settle
from boltpose.registration.batch import PoseBatch, join_batches
from boltpose.schema import Prior


@dataclass(frozen=True, slots=True, kw_only=True)
class ShortlistConfig:
    """Settings of the shortlist."""

    pair_points: int = 800
    """Motor points whose pairs are counted."""
    neighbours: int = 16
    """Points, 2 mm apart, that make the normal of one of them."""
    unknown_share: float = 0.2
    """Share of the pairs taken to be of anything, clamp and noise, and not of the motor."""
    first: AlignRound = field(
        default_factory=lambda: AlignRound(
            points=120, steps=5, distance_mm=(15.0, 6.0), tolerance_mm=2.0
        )
    )
    """Every prior goes through it."""
    kept: int = 12
    """Priors that go on."""
    second: AlignRound = field(
        default_factory=lambda: AlignRound(
            points=600, steps=6, distance_mm=(8.0, 4.0), tolerance_mm=1.0
        )
    )
    third: AlignRound = field(
        default_factory=lambda: AlignRound(
            points=1500, steps=8, distance_mm=(4.0, 1.0), tolerance_mm=0.5
        )
    )
    """The best few go through it, on their full surface, and are compared by it. 0.5 mm: the right
    motor fits within the measuring error, the next size does not."""
    voxel_mm: float = 1.5
    """Spacing of that surface."""
    min_facing: float = 0.5
    """Cosine that the normals of a pair must reach."""
    seed: int = 0
    """Of the choice of motor points."""

    def __post_init__(self) -> None:
        for name in ("pair_points", "neighbours", "kept"):
            if not getattr(self, name) >= 1:
                raise ConfigError(f"{name} must be >= 1, got {getattr(self, name)}")
        if not self.voxel_mm > 0:
            raise ConfigError(f"voxel_mm must be > 0, got {self.voxel_mm}")
        for name in ("unknown_share", "min_facing"):
            if not 0 < getattr(self, name) < 1:
                raise ConfigError(f"{name} must be in (0, 1), got {getattr(self, name)}")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ShortlistIndex:
    """The sketches of all priors, ready to be searched."""

    sketches: tuple[PriorSketch, ...]
    log_pairs: Float32Array
    """Shape (P, W): logarithm of each prior's share of pair words."""
    surfaces: Surfaces
    """Of the sketches."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ViewSketch:
    """A sample of the motor's surface in a view."""

    points: FloatArray
    """Shape (N, 3), mm, frame `camera`, in random order."""
    normals: FloatArray
    """Shape (N, 3), unit, towards the camera."""
    pairs: Float32Array
    """Shape (W,), sums to 1."""

    @property
    def surface(self) -> tuple[FloatArray, FloatArray]:
        """Points and normals."""
        return self.points, self.normals


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AlignedPrior:
    """How well a prior's sketch fits a view."""

    row: int
    """Of the index."""
    agreement: float
    """0 to 1: mean agreement of the motor points with the aligned sketch."""
    camera_from_prior: Transform


def build_shortlist_index(
    sketches: Sequence[PriorSketch], config: ShortlistConfig | None = None
) -> ShortlistIndex:
    """Put the sketches of all priors together.

    Raises:
        ValueError: There is no sketch.
    """
    if not sketches:
        raise ValueError("an index needs at least one sketch, got none")
    config = config or ShortlistConfig()
    pairs = np.stack([sketch.pairs for sketch in sketches])
    # pairs that no prior has, of the clamp, must not decide between them
    known = (1.0 - config.unknown_share) * pairs + config.unknown_share * pairs.mean(axis=0)
    return ShortlistIndex(
        sketches=tuple(sketches),
        log_pairs=freeze(np.log(known + 1e-7).astype(np.float32)),
        surfaces=join_surfaces(
            [sketch.points for sketch in sketches],
            [sketch.normals for sketch in sketches],
            SKETCH_SPACING_MM,
        ),
    )


def sketch_view(motor_points: FloatArray, config: ShortlistConfig) -> ViewSketch | None:
    """Describe the motor points of a view.

    Args:
        motor_points: Shape (N, 3), mm, frame `camera`.
        config: Settings.

    Returns:
        The sketch; None of fewer points, on 2 mm voxels, than make a normal.
    """
    thinned = voxel_downsample(motor_points, 2.0) if len(motor_points) else motor_points
    if len(thinned) < config.neighbours:
        return None
    rounds = (config.first, config.second, config.third)
    wanted = max(config.pair_points, *(step.points for step in rounds))
    chosen = np.random.default_rng(config.seed).permutation(len(thinned))[:wanted]
    points = thinned[chosen]
    normals = estimate_normals(thinned, config.neighbours, at=chosen)
    normals = orient_towards(points, normals, np.zeros(3))
    few = slice(0, config.pair_points)
    pairs = pair_histogram(points[few], normals[few])
    return ViewSketch(points=points, normals=normals, pairs=pairs.astype(np.float32))


def rank_by_pairs(index: ShortlistIndex, view: ViewSketch) -> IntArray:
    """Order the priors by how likely their pairs make those of the view; rows, best first.

    It knows no pose and no visibility: the right prior comes first in 4 of 10 views of reman18
    (simulated). Good enough to choose a motor that is built alike.
    """
    likelihood = index.log_pairs @ view.pairs
    return np.argsort(-likelihood, kind="stable").astype(np.int64)


def align_all(
    index: ShortlistIndex,
    view: ViewSketch,
    camera_from_motor: Sequence[Transform],
    config: ShortlistConfig | None = None,
) -> tuple[AlignedPrior, ...]:
    """Lay every prior where another motor was found, settle it and see how well it fits.

    Motors are built alike: with their axes on each other, the pose of one is a good start for all
    others. The cost per prior is that of some hundred nearest-point searches, below 1 ms.

    Args:
        index: All priors.
        view: What was seen.
        camera_from_motor: Guesses of the motor's axes in the view, at least one, from registering
            some prior, not necessarily the right one.
        config: Settings.

    Returns:
        All priors, best first; those beyond `config.kept` in the order of the first round.
    """
    config = config or ShortlistConfig()
    count = len(index.sketches)
    everyone = np.arange(count)
    guesses = [guess.inverse() for guess in camera_from_motor]
    # guess by guess, in each all priors
    poses = PoseBatch(
        np.repeat([guess.rotation for guess in guesses], count, axis=0),
        np.repeat([guess.translation_mm for guess in guesses], count, axis=0),
    )
    owners = np.tile(everyone, len(guesses))
    poses, tried = settle(
        index.surfaces, owners, poses, view.surface, config.first, config.min_facing
    )
    best = tried.reshape(len(guesses), count).argmax(axis=0) * count + everyone
    poses, agreement = poses[best], tried[best]
    order = np.argsort(-agreement, kind="stable")
    kept, rest = order[: config.kept], order[config.kept :]
    closer, better = settle(
        index.surfaces, kept, poses[kept], view.surface, config.second, config.min_facing
    )
    again = np.argsort(-better, kind="stable")
    rows = np.concatenate([kept[again], rest])
    poses = join_batches([closer[again], poses[rest]])
    # the rounds measure by different tolerances: nobody left behind may seem to be ahead
    scores = np.concatenate([better[again], np.minimum(agreement[rest], better.min())])
    return tuple(
        AlignedPrior(
            row=int(row),
            agreement=float(score),
            camera_from_prior=Transform.from_parts("motor", "camera", rotation, shift).inverse()
            @ index.sketches[int(row)].prior_from_motor.inverse(),
        )
        for row, score, rotation, shift in zip(
            rows, scores, poses.rotations, poses.translations_mm, strict=True
        )
    )


def compare_closely(
    priors: Sequence[Prior],
    starts: Sequence[Transform],
    view: ViewSketch,
    config: ShortlistConfig | None = None,
) -> FloatArray:
    """Settle a few priors on their full surface and measure all on the same points.

    Args:
        priors: At least one.
        starts: `camera_from_prior` of each, off by a few millimetres at most.
        view: What was seen.
        config: Settings.

    Returns:
        Shape (P,), 0 to 1: mean agreement of the motor points with each.
    """
    config = config or ShortlistConfig()
    thinned = [voxel_representatives(prior.points, config.voxel_mm) for prior in priors]
    surfaces = join_surfaces(
        [p.points[rows].astype(np.float32) for p, rows in zip(priors, thinned, strict=True)],
        [p.normals[rows].astype(np.float32) for p, rows in zip(priors, thinned, strict=True)],
        config.voxel_mm,
    )
    inverses = [start.inverse() for start in starts]
    poses = PoseBatch(
        np.stack([inverse.rotation for inverse in inverses]),
        np.stack([inverse.translation_mm for inverse in inverses]),
    )
    rows = np.arange(len(priors))
    _, agreement = settle(surfaces, rows, poses, view.surface, config.third, config.min_facing)
    return agreement
