"""Coarse registration: hundreds of start poses refined at once, the distinct best ones kept."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from boltpose.arrays import Float32Array, FloatArray, IntArray
from boltpose.geometry.sampling import voxel_downsample
from boltpose.registration.batch import (
    PoseBatch,
    join_batches,
    rotations_from_vectors,
    score_batch,
    step_batch,
)
from boltpose.registration.config import CoarseConfig
from boltpose.registration.prepare import PreparedPrior

_CHUNK = 240
"""Start poses worked on together; fixed, so that the bits do not depend on the thread count."""
_FIRST_TOLERANCE_MM = 6.0
_SECOND_TOLERANCE_MM = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class CoarseResult:
    """Distinct candidate poses, best first."""

    poses: PoseBatch
    """`prior_from_camera`, mutually farther apart than the cluster radius."""
    scores: FloatArray
    """Shape (K,), 0 to 1, falling."""
    used_offsets: bool
    """True if the first round did not convince and shifted starts were tried."""


def start_poses(prepared: PreparedPrior, centroid: FloatArray, rolls: int) -> PoseBatch:
    """Guess `prior_from_camera` for every direction and roll, with the seen centroids aligned.

    Args:
        prepared: The prior.
        centroid: Shape (3,), mm, frame `camera`: mean of the motor's surface in the view.
        rolls: Turns about each direction.

    Returns:
        One pose per direction and roll, directions outer.
    """
    directions = prepared.view_directions
    to_camera = -centroid / np.linalg.norm(centroid)
    frames_prior = np.stack([_frame_with_z(direction) for direction in directions])
    frame_camera = _frame_with_z(to_camera)
    angles = 2.0 * np.pi * np.arange(rolls) / rolls
    turns = rotations_from_vectors(np.outer(angles, (0.0, 0.0, 1.0)))
    rotations = frames_prior[:, None] @ turns[None] @ frame_camera.T
    translations = prepared.view_centroids[:, None] - rotations @ centroid
    return PoseBatch(rotations.reshape(-1, 3, 3), translations.reshape(-1, 3))


def register_coarsely(
    prepared: PreparedPrior, points_camera: FloatArray, config: CoarseConfig
) -> CoarseResult:
    """Find the distinct poses that explain the motor points best.

    Args:
        prepared: The prior.
        points_camera: Shape (N, 3), mm, frame `camera`: points of the motor, some clamp points
            among them are tolerated.
        config: Settings.

    Returns:
        At most `config.candidates` poses, best first.
    """
    thinned = voxel_downsample(points_camera, 4.0)
    order = np.random.default_rng(config.seed).permutation(len(thinned))
    first = thinned[order[: config.first_points]].astype(np.float32)
    second = thinned[order[: config.second_points]].astype(np.float32)
    centroid = thinned.mean(axis=0)
    with ThreadPoolExecutor(config.threads) as pool:
        starts = start_poses(prepared, centroid, config.rolls)
        poses, scores = _two_rounds(starts, first, second, prepared, config, pool)
        used_offsets = bool(scores[0] < config.convincing_score)
        if used_offsets:
            shifts = config.offset_mm * np.vstack([np.eye(3), -np.eye(3)])
            shifted = join_batches(
                [
                    PoseBatch(starts.rotations, starts.translations_mm + starts.rotations @ shift)
                    for shift in shifts
                ]
            )
            more, more_scores = _two_rounds(shifted, first, second, prepared, config, pool)
            poses = join_batches([poses, more])
            scores = np.concatenate([scores, more_scores])
    rows = distinct_rows(poses, scores, prepared.centre_mm, config)
    return CoarseResult(poses[rows], scores[rows], used_offsets)


def distinct_rows(
    poses: PoseBatch, scores: FloatArray, centre_prior_mm: FloatArray, config: CoarseConfig
) -> IntArray:
    """Pick the best poses that differ from all better ones; rows, best first.

    Two poses differ if one turns the motor by more than the cluster angle against the other or
    puts its centre elsewhere by more than the cluster shift.
    """
    order = np.argsort(-scores, kind="stable")
    kept: list[int] = []
    # centre of the motor in frame camera
    centres = np.einsum(
        "bji,bj->bi", poses.rotations, centre_prior_mm[None] - poses.translations_mm
    )
    for row in order:
        if len(kept) == config.candidates:
            break
        if kept:
            relative = np.einsum("bji,jk->bik", poses.rotations[kept], poses.rotations[row])
            cosine = 0.5 * (np.trace(relative, axis1=1, axis2=2) - 1.0)
            is_same_turn = cosine > np.cos(config.cluster_angle_rad)
            shift = np.linalg.norm(centres[kept] - centres[row], axis=1)
            if np.any(is_same_turn & (shift < config.cluster_shift_mm)):
                continue
        kept.append(int(row))
    return np.array(kept, dtype=np.int64)


def _two_rounds(
    starts: PoseBatch,
    first: Float32Array,
    second: Float32Array,
    prepared: PreparedPrior,
    config: CoarseConfig,
    pool: ThreadPoolExecutor,
) -> tuple[PoseBatch, FloatArray]:
    distances = np.geomspace(*config.first_distance_mm, config.first_steps)
    early, late = distances[: config.scout_steps], distances[config.scout_steps :]

    def run_scouts(part: PoseBatch) -> tuple[PoseBatch, FloatArray]:
        scouts = first[: config.scout_points]
        for distance in early:
            part = step_batch(part, scouts, prepared, float(distance))
        return part, score_batch(part, scouts, prepared, float(early[-1]))

    def run_first(part: PoseBatch) -> tuple[PoseBatch, FloatArray]:
        for distance in late:
            part = step_batch(part, first, prepared, float(distance))
        return part, score_batch(part, first, prepared, _FIRST_TOLERANCE_MM)

    def run_second(part: PoseBatch) -> tuple[PoseBatch, FloatArray]:
        for distance in np.geomspace(*config.second_distance_mm, config.second_steps):
            part = step_batch(part, second, prepared, float(distance))
        return part, score_batch(part, second, prepared, _SECOND_TOLERANCE_MM)

    poses, scores = _run_chunks(run_scouts, starts, _CHUNK, pool)
    best = np.argsort(-scores, kind="stable")[: int(config.scout_share * len(starts))]
    poses, scores = _run_chunks(run_first, poses[best], _CHUNK // 2, pool)
    best = np.argsort(-scores, kind="stable")[: config.kept]
    poses, scores = _run_chunks(run_second, poses[best], _CHUNK // 16, pool)
    order = np.argsort(-scores, kind="stable")
    return poses[order], scores[order]


def _run_chunks(
    run: Callable[[PoseBatch], tuple[PoseBatch, FloatArray]],
    poses: PoseBatch,
    size: int,
    pool: ThreadPoolExecutor,
) -> tuple[PoseBatch, FloatArray]:
    """Work on parts of a batch at once; their size, and so the bits, is not the thread count's."""
    chunks = [poses[slice(i, i + size)] for i in range(0, len(poses), size)]
    done = list(pool.map(run, chunks))
    return join_batches([part for part, _ in done]), np.concatenate([s for _, s in done])


def _frame_with_z(z_axis: FloatArray) -> FloatArray:
    """A rotation, (3, 3), whose third column is a unit vector, (3,)."""
    helper = np.eye(3)[int(np.argmin(np.abs(z_axis)))]
    x_axis = np.cross(helper, z_axis)
    x_axis /= np.linalg.norm(x_axis)
    return np.stack([x_axis, np.cross(z_axis, x_axis), z_axis], axis=1)
