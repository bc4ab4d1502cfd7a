"""Results with bolts wherever a test wants them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from boltpose.geometry.transforms import Transform
from boltpose.schema import LocatedBolt, LocateResult
from tests.support import results

SCAN_SHA256 = "0123456789abcdef" * 4


def rotation_towards(axis, turn_rad: float = 0.0):
    """Any proper rotation whose third column is `axis`."""
    z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    cosine, sine = np.cos(turn_rad), np.sin(turn_rad)
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, z], axis=1)


@cache
def _accepted() -> LocateResult:
    return results.located(results.cube_prior())


def bolt(bolt_id: str = "T1", axis=(0.0, 0.0, 1.0), at=(600.0, 100.0, 300.0), **changes):
    """A confirmed, visible bolt that looks along `axis` in `base`."""
    turn_rad = changes.pop("turn_rad", 0.0)
    return replace(
        _accepted().bolts[0],
        id=bolt_id,
        frame_from_bolt=Transform.from_parts("base", "bolt", rotation_towards(axis, turn_rad), at),
        **{"confidence": 0.95, "is_sure": True, **changes},
    )


def result(*bolts: LocatedBolt) -> LocateResult:
    """An accepted result of these bolts in `base`."""
    accepted = _accepted()
    return replace(
        accepted,
        bolts=bolts,
        verdict=replace(accepted.verdict, p_correct=0.987),
        provenance={"version": "9.9", "scan_sha256": SCAN_SHA256},
    )


def of_axes(axes: Sequence) -> LocateResult:
    """One bolt per axis, at places that differ."""
    return result(
        *(
            bolt(f"T{k + 1}", axis, (400.0 + 37.5 * k, -250.0 + 11.25 * k, 300.0 + k))
            for k, axis in enumerate(axes)
        )
    )
