"""Every random choice has a generator of its own, named by what it is for."""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Purpose(IntEnum):
    """What a generator is for; the numbers enter the seeds, so they never change."""

    SPEC = 0
    WEAR = 1
    SCAN = 2
    SCAN_FRAME = 3
    CHANGES = 4
    CLAMP = 5
    CAMERA = 6
    SENSOR = 7
    BASE = 8
    WEAR_RELIEF = 9
    REGION = 10


def generator(
    dataset_seed: int,
    sample: int,
    purpose: Purpose,
    *,
    view: int = 0,
    attempt: int = 0,
    angle: int = 0,
) -> np.random.Generator:
    """Make the generator of one choice, independent of all others.

    Because each choice has its own, one that draws more numbers than before (another clamp, a
    second attempt) does not move what comes after it.

    Args:
        dataset_seed: Of the whole data set, >= 0.
        sample: Number of the motor in the data set, >= 0.
        purpose: What is drawn.
        view: Number of the view; 0 for what belongs to the motor.
        attempt: 0 first; more after a draw that could not be built.
        angle: Number of the camera's place round one clamping; 0 for what belongs to the view.

    Returns:
        A generator; the same arguments give the same numbers on every machine.
    """
    key = (dataset_seed, sample, int(purpose), view, attempt)
    # angle 0 is the view as it was before there were angles
    return np.random.default_rng(np.random.SeedSequence(key + ((angle,) if angle else ())))


def seed_of(
    dataset_seed: int, sample: int, purpose: Purpose, *, view: int = 0, attempt: int = 0
) -> int:
    """A seed of 32 bits, for functions that take a number instead of a generator."""
    chosen = generator(dataset_seed, sample, purpose, view=view, attempt=attempt)
    return int(chosen.integers(0, 2**32))
