"""Whole clouds through networks that see a few thousand points at a time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from boltpose.arrays import IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class VotingConfig:
    """How a whole cloud is labelled by a network that sees a few thousand points at a time."""

    passes: int = 1
    """Times every point is labelled, each time in other company; votes are averaged."""
    seed: int = 0

    def __post_init__(self) -> None:
        if self.passes < 1:
            raise ValueError(f"passes must be >= 1, got {self.passes}")


def split_randomly(count: int, size: int, rng: np.random.Generator) -> list[IntArray]:
    """Split 0 to `count` - 1 into random disjoint groups of about `size`."""
    groups = max(1, round(count / size))
    return [group.astype(np.int64) for group in np.array_split(rng.permutation(count), groups)]
