"""Round upright things of a head's size, found without labels: a second opinion on the bolts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from boltpose.arrays import FloatArray, IntArray
from boltpose.errors import ConfigError
from boltpose.prior.heads import MotorCloud

_SECTORS = 12
_FACING = 0.8


@dataclass(frozen=True, slots=True, kw_only=True)
class HoughConfig:
    """Votes of outward normals for the axes they could belong to."""

    radii_mm: tuple[float, ...] = (3.0, 3.5, 4.0, 4.5, 5.0, 5.5, 6.0, 6.5)
    """Half the spanner sizes of M4 to M8 heads."""
    cell_mm: float = 1.2
    """Votes are counted in cells of this width across the axis."""
    layer_mm: float = 3.0
    """Votes are counted in layers of this height: the lowest heads are 3 mm high."""
    min_sectors: int = 5
    """Sectors of 30 deg from which a cell must be voted for; a plane votes from one."""
    separation_mm: float = 4.0
    """Of two cells nearer than this the one with fewer sectors is dropped."""
    min_face_points: int = 12
    """Points of a face that must close the top; a head of 7 mm has 38."""
    max_candidates: int = 60
    """Most candidates kept, best first."""

    def __post_init__(self) -> None:
        if not self.radii_mm or min(self.radii_mm) <= 0:
            raise ConfigError(f"radii_mm must be positive, got {self.radii_mm}")
        for name in ("cell_mm", "layer_mm", "separation_mm"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be > 0, got {getattr(self, name)}")
        if not 1 <= self.min_sectors <= _SECTORS:
            raise ConfigError(f"min_sectors must be 1 to {_SECTORS}, got {self.min_sectors}")
        if self.min_face_points < 1 or self.max_candidates < 0:
            raise ConfigError("min_face_points must be >= 1 and max_candidates >= 0")


def propose_heads(cloud: MotorCloud, config: HoughConfig) -> tuple[IntArray, ...]:
    """Find faces that stand on a round or hexagonal flank, whatever their labels.

    Every flank point votes, for each radius, for the axis that its outward normal points away
    from; a cell counts the directions it is voted for from, not the points.

    Args:
        cloud: The full scan, frame `motor`.
        config: Settings.

    Returns:
        Per candidate the indices of its face's points, for `measure_head`; best first.

    Source:
        Duda and Hart, Comm. ACM 15(1), 1972, with the gradient's direction known.
    """
    centres = _voted_centres(cloud, config)
    faces: list[IntArray] = []
    for x, y, z, radius in centres:
        column = np.array(cloud.columns.query_ball_point((x, y), 0.9 * radius), dtype=np.int64)
        column = np.sort(column)
        for sign in (1.0, -1.0):
            above = sign * (cloud.points[column, 2] - z)
            face = column[(sign * cloud.normals[column, 2] > _FACING) & (above > 0) & (above < 7)]
            if len(face) >= config.min_face_points:
                faces.append(face)
    return tuple(faces)


def _voted_centres(cloud: MotorCloud, config: HoughConfig) -> FloatArray:
    """Rows of x, y, z and radius, shape (M, 4), mm, frame `motor`, most sectors first."""
    level = np.linalg.norm(cloud.normals[:, :2], axis=1)
    flank = np.flatnonzero(level > 0.92)
    u = cloud.normals[flank, :2] / level[flank, None]
    points = cloud.points[flank]
    sector = np.floor((np.arctan2(u[:, 1], u[:, 0]) / np.pi + 1) * (_SECTORS / 2)).astype(np.int64)
    low = cloud.points.min(axis=0) - max(config.radii_mm) - config.cell_mm
    size = np.array([config.cell_mm, config.cell_mm, config.layer_mm])
    shape = np.ceil((cloud.points.max(axis=0) + max(config.radii_mm) - low) / size).astype(int) + 2
    rows: list[FloatArray] = []
    for radius in config.radii_mm:
        voted = points.copy()
        voted[:, :2] -= radius * u
        cell = np.floor((voted - low) / size).astype(np.int64)
        key = (cell[:, 0] * shape[1] + cell[:, 1]) * shape[2] + cell[:, 2]
        directions = np.unique(key * _SECTORS + sector % _SECTORS) // _SECTORS
        cells, count = np.unique(directions, return_counts=True)
        cells, count = cells[count >= config.min_sectors], count[count >= config.min_sectors]
        index = np.stack(np.unravel_index(cells, tuple(shape)), axis=1)
        middle = low + (index + 0.5) * size
        rows.append(np.column_stack([middle, np.full(len(cells), radius), count]))
    found = np.concatenate(rows)
    # place breaks ties, so that the order of the points does not
    found = found[np.lexsort((found[:, 3], found[:, 2], found[:, 1], found[:, 0], -found[:, 4]))]
    kept: list[FloatArray] = []
    for row in found:
        if len(kept) >= config.max_candidates:
            break
        if all(np.linalg.norm(row[:3] - other[:3]) > config.separation_mm for other in kept):
            kept.append(row)
    return np.array(kept).reshape(-1, 5)[:, :4]
