"""A motor of plain cylinders with outward normals, labelled, to test on without any scan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from boltpose.arrays import FloatArray, UInt8Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ToyMotor:
    """Frame `toy`: z along the main axis towards the drive end, y towards the solenoid."""

    points: FloatArray
    normals: FloatArray
    labels: UInt8Array


def _tube(
    rng: np.random.Generator,
    density: float,
    centre: tuple[float, float],
    radius: float,
    z_range: tuple[float, float],
) -> tuple[FloatArray, FloatArray]:
    """Wall and both ends of a cylinder along z."""
    low, high = z_range
    count = int(density * 2 * np.pi * radius * (high - low))
    angle = rng.uniform(0, 2 * np.pi, count)
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    wall = np.column_stack([around * radius + centre, rng.uniform(low, high, count)])
    wall_normals = np.column_stack([around, np.zeros(count)])
    count = int(density * np.pi * radius**2)
    points, normals = [wall], [wall_normals]
    for z, sign in ((low, -1.0), (high, 1.0)):
        angle = rng.uniform(0, 2 * np.pi, count)
        r = radius * np.sqrt(rng.uniform(0, 1, count))
        points.append(
            np.column_stack(
                [r * np.cos(angle) + centre[0], r * np.sin(angle) + centre[1], np.full(count, z)]
            )
        )
        normals.append(np.tile([0.0, 0.0, sign], (count, 1)))
    return np.concatenate(points), np.concatenate(normals)


def toy_motor(
    *, seed: int = 0, density: float = 0.25, with_solenoid: bool = True, noise_mm: float = 0.03
) -> ToyMotor:
    """Build a motor: housing, bracket, solenoid, stud, pinion and four bolt heads."""
    rng = np.random.default_rng(seed)
    pieces: list[tuple[tuple[float, float], float, tuple[float, float], int]] = [
        ((0.0, 0.0), 38.0, (-60.0, 20.0), 1),
        ((0.0, 0.0), 30.0, (20.0, 55.0), 2),
        ((0.0, 0.0), 9.0, (55.0, 85.0), 5),
        ((20.0, 20.0), 6.0, (55.0, 61.0), 6),
        ((-20.0, 20.0), 6.0, (55.0, 61.0), 6),
        ((20.0, -20.0), 6.0, (-66.0, -60.0), 6),
        ((-20.0, -20.0), 6.0, (-66.0, -60.0), 6),
    ]
    if with_solenoid:
        pieces += [((0.0, 68.0), 26.0, (-45.0, 30.0), 3), ((0.0, 68.0), 5.0, (-60.0, -45.0), 4)]
    points, normals, labels = [], [], []
    for centre, radius, z_range, label in pieces:
        p, n = _tube(rng, density, centre, radius, z_range)
        points.append(p)
        normals.append(n)
        labels.append(np.full(len(p), label, dtype=np.uint8))
    cloud, outward = np.concatenate(points), np.concatenate(normals)
    cloud = cloud + rng.normal(scale=noise_mm, size=(len(cloud), 1)) * outward
    return ToyMotor(points=cloud, normals=outward, labels=np.concatenate(labels))
