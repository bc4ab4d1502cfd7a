"""Smooth random fields in space, and the mesh arithmetic that lays them on surfaces.

Fields are tables of random numbers interpolated between lattice points: additions and products
alone, so the same seed gives the same bits on every machine and with any number of threads.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from boltpose.arrays import FloatArray, IntArray

_CELLS = 24
"""Lattice points per side of a field's table; it repeats after that many wavelengths."""
_QUANTILE_SAMPLES = 4096


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """A smooth field in space with values between -1 and 1."""

    table: FloatArray
    """Shape (n, n, n, C), between -1 and 1."""
    lattice_from_point: FloatArray
    """Shape (3, 3), a rotation over the wavelength: lattices along the motor's axes would show."""
    offset: FloatArray
    """Shape (3,), lattice units."""

    def at(self, points: FloatArray) -> FloatArray:
        """Sample the field.

        Args:
            points: Shape (N, 3), mm.

        Returns:
            Shape (N, C).

        Source:
            Value noise with the quintic fade of Perlin, ACM Trans. Graphics 21(3), 2002.
        """
        # products written out: a matrix product may round differently with its thread count
        lattice = np.empty_like(points)
        for row in range(3):
            a, b, c = self.lattice_from_point[row]
            lattice[:, row] = (
                points[:, 0] * a + points[:, 1] * b + points[:, 2] * c + self.offset[row]
            )
        low = np.floor(lattice)
        share = lattice - low
        share = share * share * share * (share * (share * 6 - 15) + 10)
        size = len(self.table)
        first = low.astype(np.int64) % size
        second = (first + 1) % size
        flat = self.table.reshape(-1, self.table.shape[3])
        x = (first[:, 0] * size * size, second[:, 0] * size * size)
        y = (first[:, 1] * size, second[:, 1] * size)
        z = (first[:, 2], second[:, 2])
        sx, sy, sz = (share[:, axis, None] for axis in range(3))

        def along_z(plane: IntArray) -> FloatArray:
            here = flat[plane + z[0]]
            return here + sz * (flat[plane + z[1]] - here)

        def along_y(slab: IntArray) -> FloatArray:
            here = along_z(slab + y[0])
            return here + sy * (along_z(slab + y[1]) - here)

        start = along_y(x[0])
        return start + sx * (along_y(x[1]) - start)

    def quantile(self, share: float) -> float:
        """Value that the first channel exceeds on `share` of space."""
        rng = np.random.default_rng(20)
        extent = _CELLS * float(np.linalg.norm(self.lattice_from_point[:, 0])) ** -1
        values = self.at(rng.uniform(0, extent, size=(_QUANTILE_SAMPLES, 3)))[:, 0]
        return float(np.sort(values)[min(_QUANTILE_SAMPLES - 1, int((1 - share) * len(values)))])


def make_field(wavelength_mm: float, rng: np.random.Generator, *, channels: int = 1) -> Field:
    """Draw a field.

    Args:
        wavelength_mm: From one bump to the next; lattice points stand half of that apart.
        rng: The source of randomness.
        channels: Independent values per point.
    """
    table = rng.uniform(-1, 1, size=(_CELLS, _CELLS, _CELLS, channels))
    rotation = _random_rotation(rng)
    return Field(
        table=table,
        lattice_from_point=rotation * (2 / wavelength_mm),
        offset=rng.uniform(0, _CELLS, size=3),
    )


def _random_rotation(rng: np.random.Generator) -> FloatArray:
    """Rotation from a random quaternion, shape (3, 3)."""
    w, x, y, z = rng.normal(size=4)
    s = 2 / (w * w + x * x + y * y + z * z)
    return np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
        ]
    )


def patches(
    field: Field, points: FloatArray, share: float, *, softness: float = 0.25
) -> FloatArray:
    """Mask of patches, shape (N,), 0 to 1, that cover about `share` of space."""
    if share <= 0:
        return np.zeros(len(points))
    level = field.quantile(min(share, 1.0))
    ramp = np.clip((field.at(points)[:, 0] - level) / softness + 0.5, 0, 1)
    return ramp * ramp * (3 - 2 * ramp)


def face_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Normals of shape (F, 3) that are as long as twice the faces' areas."""
    corner = vertices[faces[:, 0]]
    return np.cross(vertices[faces[:, 1]] - corner, vertices[faces[:, 2]] - corner)


def vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Unit normals of the vertices, shape (V, 3), weighted by the faces' areas.

    Where the faces cancel out, the normal is zero and the vertex stays where it is.
    """
    areas = face_normals(vertices, faces)
    corners = faces.reshape(-1)
    sums = np.stack(
        [
            np.bincount(corners, np.repeat(areas[:, axis], 3), minlength=len(vertices))
            for axis in range(3)
        ],
        axis=1,
    )
    lengths = np.sqrt((sums * sums).sum(axis=1, keepdims=True))
    return np.where(lengths > 1e-12, sums / np.maximum(lengths, 1e-12), 0.0)
