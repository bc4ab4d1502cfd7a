"""Poses a little or cleverly wrong, made from a true one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.arrays import FloatArray
from boltpose.geometry.transforms import Transform
from boltpose.registration.prepare import PreparedPrior

RAW_SIZES = (1.0, 1.5, 2.05, 2.5, 3.0, 5.0, 10.0)
"""mm or degrees by which a pose is moved; 2 is the limit."""
SLIDES_MM = (-10.0, -5.0, -3.0, -2.1, 2.1, 3.0, 5.0, 10.0)
ROLLS_DEG = (-10.0, -5.0, -3.0, -2.1, 2.1, 3.0, 5.0, 10.0)
REFINED_SLIDES_MM = (-20.0, -10.0, -5.0, 5.0, 10.0, 20.0)
REFINED_ROLLS_DEG = (10, 15, 30, 45, 60, 90, 120, 180, 240, 270, 300, 330, 345)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class NearMiss:
    """A pose to be judged."""

    kind: str
    """`moved`, `turned`, `slid`, `rolled`, `flipped`."""
    size: float
    """mm or degrees."""
    is_refined: bool
    """Refine it before it is judged; it may then be right again."""
    camera_from_prior: Transform


def list_near_misses(
    truth: Transform, prepared: PreparedPrior, rng: np.random.Generator
) -> Iterator[NearMiss]:
    """Yield wrong poses around a true one: raw, and as starts of a refinement.

    Turns are about the middle of the motor. Slides and rolls go along and about its axis, which
    is where a motor looks most like itself.
    """
    axis = prepared.prior.alignment.prior_from_motor.z_axis
    mover = _Mover(truth, prepared.centre_mm)
    for size in RAW_SIZES:
        for _ in range(2):
            yield mover.miss("moved", size, shift=size * _direction(rng))
            yield mover.miss("turned", size, turn_deg=size * _direction(rng))
    for size in SLIDES_MM:
        yield mover.miss("slid", size, shift=size * axis)
    for size in ROLLS_DEG:
        yield mover.miss("rolled", size, turn_deg=size * axis)
    yield from list_lookalikes(truth, prepared)


def list_lookalikes(truth: Transform, prepared: PreparedPrior) -> Iterator[NearMiss]:
    """Yield starts from which refinement may settle where the motor looks like itself."""
    axis = prepared.prior.alignment.prior_from_motor.z_axis
    mover = _Mover(truth, prepared.centre_mm)
    for size in REFINED_SLIDES_MM:
        yield mover.miss("slid", size, shift=size * axis, is_refined=True)
    for size in REFINED_ROLLS_DEG:
        yield mover.miss("rolled", float(size), turn_deg=size * axis, is_refined=True)
    # half turns about two directions across the axis, as its own frame gives them
    rotation = prepared.prior.alignment.prior_from_motor.rotation
    for flip in (rotation[:, 0], rotation[:, 1]):
        yield mover.miss("flipped", 180.0, turn_deg=180.0 * flip, is_refined=True)


def list_few_misses(
    truth: Transform, prepared: PreparedPrior, rng: np.random.Generator
) -> Iterator[NearMiss]:
    """Yield the near misses that matter where little of the motor is in view."""
    axis = prepared.prior.alignment.prior_from_motor.z_axis
    mover = _Mover(truth, prepared.centre_mm)
    for size in (2.1, 4.0):
        yield mover.miss("moved", size, shift=size * _direction(rng))
        yield mover.miss("turned", size, turn_deg=size * _direction(rng))
        for sign in (-1.0, 1.0):
            yield mover.miss("slid", sign * size, shift=sign * size * axis)
            yield mover.miss("rolled", sign * size, turn_deg=sign * size * axis)
    yield mover.miss("slid", 10.0, shift=10.0 * axis, is_refined=True)
    for size in (10.0, 120.0):
        yield mover.miss("rolled", size, turn_deg=size * axis, is_refined=True)


def list_mirror_poses(truth: Transform, prior_from_motor: Transform) -> Iterator[NearMiss]:
    """Yield where a mirrored motor looks most like the prior: turned as if it had been symmetric.

    The view is mirrored left to right, and the motor once more in each plane of its own frame;
    two mirrors are a motion again. A motor that is symmetric in that plane would fit perfectly.
    """
    across_view = np.diag([-1.0, 1.0, 1.0])
    origin = prior_from_motor.translation_mm
    for number, name in enumerate("xyz"):
        normal = prior_from_motor.rotation[:, number]
        reflection = np.eye(3) - 2.0 * np.outer(normal, normal)
        rotation = across_view @ truth.rotation @ reflection
        shift = truth.rotation @ (2.0 * float(normal @ origin) * normal) + truth.translation_mm
        yield NearMiss(
            kind=f"mirrored in {name}",
            size=0.0,
            is_refined=True,
            camera_from_prior=Transform.from_parts(
                "camera", "prior", rotation, across_view @ shift
            ),
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Mover:
    truth: Transform
    centre_mm: FloatArray

    def miss(
        self,
        kind: str,
        size: float,
        *,
        turn_deg: FloatArray | None = None,
        shift: FloatArray | None = None,
        is_refined: bool = False,
    ) -> NearMiss:
        rotation = np.eye(3)
        if turn_deg is not None:
            rotation = Rotation.from_rotvec(np.radians(turn_deg)).as_matrix()
        translation = self.centre_mm - rotation @ self.centre_mm
        if shift is not None:
            translation = translation + shift
        moved = Transform.from_parts("prior", "prior", rotation, translation)
        return NearMiss(
            kind=kind,
            size=size,
            is_refined=is_refined,
            camera_from_prior=self.truth @ moved,
        )


def _direction(rng: np.random.Generator) -> FloatArray:
    direction = rng.normal(size=3)
    return direction / np.linalg.norm(direction)
