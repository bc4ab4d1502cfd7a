"""A plate with bolt heads on both faces, as a scan with 1 mm spacing sees it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from boltpose.arrays import FloatArray, UInt8Array
from boltpose.geometry.transforms import Transform
from boltpose.schema import Alignment, Part, Side

PLATE_MM = 20.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ToyHead:
    """One head on the plate; frame `motor`, top face of the plate at z = +10, bottom at -10."""

    x: float
    y: float
    side: Side = Side.TOP
    radius: float = 5.0
    """Half the spanner size."""
    height: float = 4.0
    corners: int = 6
    """6: hexagon; 0: round."""
    seen_from_deg: float = 0.0
    seen_deg: float = 360.0
    """The flank is seen over this much of the turn only."""
    part: Part = Part.BOLT
    sunk: float = 0.0
    """Depth of a counterbore 2 mm wider than the head."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ToyPlate:
    points: FloatArray
    normals: FloatArray
    labels: UInt8Array

    def probabilities(self) -> FloatArray:
        """One-hot, shape (N, 6)."""
        return (self.labels[:, None] == np.arange(1, 7)).astype(np.float64)


def toy_plate(
    heads: Sequence[ToyHead], *, seed: int = 0, noise_mm: float = 0.03, size_mm: float = 60.0
) -> ToyPlate:
    """Scan a plate with heads; noise along the normal, one random point per cell."""
    rng = np.random.default_rng(seed)
    points, normals, labels = [], [], []
    for side in Side:
        x, y = _cells(rng, size_mm)
        free = np.ones(len(x), dtype=bool)
        for head in heads:
            if head.side is side:
                free &= np.hypot(x - head.x, y - head.y) > head.radius * 1.16 + 2 * (head.sunk > 0)
        face = np.column_stack([x, y, np.full(len(x), PLATE_MM / 2)])[free]
        parts = [(face, np.tile([0.0, 0.0, 1.0], (len(face), 1)), Part.CONNECTOR)]
        parts += [piece for head in heads if head.side is side for piece in _head(rng, head)]
        for p, n, part in parts:
            turn = np.array([1.0, 1.0, 1.0 if side is Side.TOP else -1.0])
            points.append((p + rng.normal(scale=noise_mm, size=(len(p), 1)) * n) * turn)
            normals.append(n * turn)
            labels.append(np.full(len(p), int(part), dtype=np.uint8))
    return ToyPlate(
        points=np.concatenate(points),
        normals=np.concatenate(normals),
        labels=np.concatenate(labels),
    )


def true_alignment(motor_to_prior: Transform | None = None) -> Alignment:
    """The frame the plate is built in, moved along with it."""
    return Alignment(
        prior_from_motor=motor_to_prior or Transform.identity("prior", "motor"),
        axis_spread_rad=0.02,
        axis_sigma_rad=1e-3,
        normal_count=1000,
        inlier_ratio=0.7,
        has_solenoid=True,
    )


def _cells(rng: np.random.Generator, size: float) -> tuple[FloatArray, FloatArray]:
    grid = np.arange(-size / 2, size / 2)
    x, y = (axis.ravel() for axis in np.meshgrid(grid, grid))
    return x + rng.uniform(0, 1, x.shape), y + rng.uniform(0, 1, y.shape)


def _outline(angle: FloatArray, head: ToyHead) -> tuple[FloatArray, FloatArray]:
    """Radius and direction of the normal at an angle."""
    if head.corners == 0:
        return np.full(len(angle), head.radius), angle
    sector = 2 * np.pi / head.corners
    normal = np.round(angle / sector) * sector
    return head.radius / np.cos(angle - normal), normal


def _head(rng: np.random.Generator, head: ToyHead) -> list[tuple[FloatArray, FloatArray, Part]]:
    base = PLATE_MM / 2 - head.sunk
    count = int(2 * np.pi * head.radius * head.height)
    angle = rng.uniform(0, 2 * np.pi, count)
    seen = np.rad2deg(angle - np.deg2rad(head.seen_from_deg)) % 360 <= head.seen_deg
    angle = angle[seen]
    r, normal = _outline(angle, head)
    z = rng.uniform(base, base + head.height, len(angle))
    flank = np.column_stack([r * np.cos(angle) + head.x, r * np.sin(angle) + head.y, z])
    flank_normals = np.column_stack([np.cos(normal), np.sin(normal), np.zeros(len(angle))])
    x, y = _cells(rng, 2.4 * head.radius)
    r, _ = _outline(np.arctan2(y, x), head)
    inside = np.hypot(x, y) < r
    face = np.column_stack([x + head.x, y + head.y, np.full(len(x), base + head.height)])[inside]
    pieces = [
        (flank, flank_normals, head.part),
        (face, np.tile([0.0, 0.0, 1.0], (len(face), 1)), head.part),
    ]
    if head.sunk > 0:
        wall = head.radius * 1.16 + 2.0
        angle = rng.uniform(0, 2 * np.pi, int(2 * np.pi * wall * head.sunk))
        around = np.column_stack([np.cos(angle), np.sin(angle)])
        z = rng.uniform(base, PLATE_MM / 2, len(angle))
        pieces.append(
            (
                np.column_stack([around * wall + (head.x, head.y), z]),
                np.column_stack([-around, np.zeros(len(angle))]),
                Part.CONNECTOR,
            )
        )
    return pieces
