"""What the camera saw, as a depth buffer, and how a posed surface stands against it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import numpy.typing as npt
from scipy.ndimage import maximum_filter, minimum_filter

from boltpose.arrays import BoolArray, FloatArray, IntArray, as_points, freeze
from boltpose.geometry.sampling import canonical_rows
from boltpose.geometry.transforms import Transform
from boltpose.registration.config import SceneConfig
from boltpose.registration.prepare import PreparedPrior

_MAX_CELLS = 4000
"""Along either side of the buffer; a view of 60 degrees from 700 mm has 300."""


class Standing(IntEnum):
    """How a point of a posed prior stands against the measured depth."""

    NOT_FACING = 0
    """Turned away from the camera, or behind other parts of the motor."""
    UNMEASURED = 1
    """The camera measured nothing in that direction."""
    OCCLUDED = 2
    """Something was measured clearly in front of it."""
    CONFIRMED = 3
    """The measured surface is where the point is."""
    VIOLATING = 4
    """The camera saw through it: the measured surface lies clearly behind."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Scene:
    """A whole scan, thinned, with the nearest and farthest depth around every direction."""

    points: FloatArray
    """Shape (N, 3), mm, frame `camera`."""
    cell_rad: float
    """Size of a cell in x / z and y / z."""
    origin_cell: IntArray
    """Shape (2,): cell number of the buffer's first row and column."""
    is_measured: BoolArray
    """Shape (U, V): whether anything was measured in the cell."""
    nearest_mm: FloatArray
    """Shape (U, V): smallest z in the cell and its eight neighbours, infinite without any."""
    farthest_mm: FloatArray
    """Shape (U, V): largest z in the same cells, minus infinity without any."""

    def cells(self, points_camera: FloatArray) -> tuple[IntArray, IntArray, BoolArray]:
        """Return row, column and whether the buffer covers them, shape (N,) each."""
        depth = np.where(points_camera[:, 2] > 0, points_camera[:, 2], np.inf)
        cell = np.floor(points_camera[:, :2] / depth[:, None] / self.cell_rad)
        row, column = (cell - self.origin_cell).astype(np.int64).T
        rows, columns = self.nearest_mm.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        inside &= points_camera[:, 2] > 0
        return np.where(inside, row, 0), np.where(inside, column, 0), inside


def build_scene(points_camera: npt.ArrayLike, config: SceneConfig | None = None) -> Scene:
    """Sort a scan, organised or not, into a depth buffer.

    Args:
        points_camera: Shape (N, 3), mm, frame `camera`; points behind the camera are dropped.
        config: Settings.

    Returns:
        The scene. No point in front of the camera leaves an empty buffer.

    Raises:
        ShapeError: `points_camera` is not (N, 3) and finite.
    """
    config = config or SceneConfig()
    cloud = as_points(points_camera, "points_camera", at_least=0)
    if len(cloud) > config.max_points:
        cloud = cloud[canonical_rows(cloud, config.max_points)]
    ahead = is_ahead(cloud)
    cloud = cloud if ahead.all() else cloud[ahead]
    direction = cloud[:, :2] / cloud[:, 2:]
    cell_rad = 1.0
    if len(cloud):
        widest = float(np.ptp(direction, axis=0).max())
        # a scan in a wrong unit, a kilometre away, must not ask for a buffer of gigabytes
        cell_rad = max(config.cell_mm / float(np.median(cloud[:, 2])), widest / _MAX_CELLS)
    cell = np.floor(direction / cell_rad).astype(np.int64)
    if len(cell):
        origin = cell.min(axis=0) - 1
        shape = cell.max(axis=0) - origin + 2
    else:
        origin, shape = np.zeros(2, dtype=np.int64), np.array([1, 1])
    flat = (cell[:, 0] - origin[0]) * shape[1] + (cell[:, 1] - origin[1])
    nearest = np.full(int(shape.prod()), np.inf)
    farthest = np.full(int(shape.prod()), -np.inf)
    np.minimum.at(nearest, flat, cloud[:, 2])
    np.maximum.at(farthest, flat, cloud[:, 2])
    nearest, farthest = nearest.reshape(shape), farthest.reshape(shape)
    return Scene(
        points=freeze(cloud),
        cell_rad=cell_rad,
        origin_cell=freeze(origin),
        is_measured=freeze(np.isfinite(nearest)),
        nearest_mm=freeze(minimum_filter(nearest, size=3, mode="constant", cval=np.inf)),
        farthest_mm=freeze(maximum_filter(farthest, size=3, mode="constant", cval=-np.inf)),
    )


def judge_surface(
    scene: Scene,
    camera_from_prior: Transform,
    prepared: PreparedPrior,
    *,
    tolerance_mm: float,
    min_facing: float = 0.2,
) -> IntArray:
    """Tell for every coarse point of a posed prior how it stands against the scan.

    The neighbouring cells are asked too, in favour of the pose: a point is VIOLATING only if no
    neighbour saw anything as near, OCCLUDED only if none saw anything as far.

    Args:
        scene: What the camera saw.
        camera_from_prior: The pose to judge.
        prepared: The prior; its coarse points (1.5 mm) are judged.
        tolerance_mm: Depth difference that counts as agreement.
        min_facing: Cosine of the steepest incidence looked at.

    Returns:
        Shape (M,), `Standing` numbers.
    """
    points = camera_from_prior.apply(prepared.coarse_points)
    normals = camera_from_prior.rotate(prepared.coarse_normals)
    cosine = -np.einsum("ni,ni->n", points, normals) / np.linalg.norm(points, axis=1)
    standing = np.full(len(points), int(Standing.NOT_FACING), dtype=np.int64)
    candidates = np.flatnonzero((cosine > 0) & is_ahead(points))
    if not len(candidates):
        return standing
    points, cosine = points[candidates], cosine[candidates]
    depth = points[:, 2]
    # across a neighbouring cell the depth of a slanted surface changes by its slope
    slope = np.sqrt(np.maximum(1.0 - cosine**2, 0.0)) / np.maximum(cosine, min_facing)
    allowance = tolerance_mm + 1.5 * scene.cell_rad * depth * slope
    is_front = depth <= _own_front(points, scene.cell_rad) + allowance
    is_front &= cosine > min_facing
    row, column, inside = scene.cells(points)
    near = scene.nearest_mm[row, column]
    far = scene.farthest_mm[row, column]
    judged = is_front & inside & scene.is_measured[row, column]
    verdict = np.full(len(points), int(Standing.NOT_FACING), dtype=np.int64)
    verdict[is_front] = Standing.UNMEASURED
    verdict[judged] = Standing.CONFIRMED
    verdict[judged & (depth > far + tolerance_mm)] = Standing.OCCLUDED
    verdict[judged & (depth < near - tolerance_mm)] = Standing.VIOLATING
    standing[candidates] = verdict
    return standing


def is_ahead(points_camera: FloatArray) -> BoolArray:
    """Tell which points, (N, 3), lie in front of the camera, at most 72 degrees to a side.

    Farther to the side z is no depth any more, and one stray point would blow up a buffer.
    """
    x, y, depth = points_camera.T
    reach = 3.0 * depth
    return (depth > 0) & (np.abs(x) < reach) & (np.abs(y) < reach)


def _own_front(points: FloatArray, cell_rad: float) -> FloatArray:
    """Smallest depth, shape (N,), of the points themselves around each point's cell."""
    cell = np.floor(points[:, :2] / points[:, 2:] / cell_rad).astype(np.int64)
    cell -= cell.min(axis=0)
    rows, columns = cell.max(axis=0) + 1
    flat = cell[:, 0] * columns + cell[:, 1]
    front = np.full(int(rows * columns), np.inf)
    np.minimum.at(front, flat, points[:, 2])
    front = minimum_filter(front.reshape(rows, columns), size=3, mode="constant", cval=np.inf)
    return np.asarray(front.reshape(-1)[flat])


def free_space_violation(standing: IntArray) -> float:
    """Share, 0 to 1, of the judged surface that the camera saw through; 0 if nothing is judged."""
    violating = int(np.sum(standing == Standing.VIOLATING))
    confirmed = int(np.sum(standing == Standing.CONFIRMED))
    return violating / max(violating + confirmed, 1)


def measured_share(standing: IntArray) -> float:
    """Share, 0 to 1, of the surface in free view in whose direction anything was measured."""
    judged = np.isin(standing, (Standing.CONFIRMED, Standing.VIOLATING))
    unmeasured = int(np.sum(standing == Standing.UNMEASURED))
    return float(judged.sum()) / max(int(judged.sum()) + unmeasured, 1)
