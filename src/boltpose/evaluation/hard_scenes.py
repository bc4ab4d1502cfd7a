"""Views made hard on purpose: hidden, cut, thinned, mirrored, doubled, or without their motor."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from PIL import Image
from scipy.ndimage import gaussian_filter

from boltpose.arrays import BoolArray, Float32Array, FloatArray
from boltpose.errors import EmptyScanError, InputFileError
from boltpose.evaluation.decoys import NOISE_MM, pixel_rays
from boltpose.evaluation.reman18 import TrueView, read_label_image
from boltpose.geometry.transforms import Transform
from boltpose.schema import Scan

_PLATE_AHEAD_MM = 30.0
"""How far before the motor's nearest point the plate hangs that hides it."""
_BLOB_PX = 12.0
"""Width of the blobs in which a scan loses depth."""
_APART_MM = 25.0
"""Gap between two motors in one view."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class HardScene:
    """A view as a depth image, and what the segmentation says about its pixels."""

    name: str
    depth_mm: FloatArray
    """Shape (H, W), along z; 0 where nothing was measured."""
    is_motor: BoolArray
    """Shape (H, W): taken for the motor, rightly or not."""
    camera_matrix: FloatArray
    """Shape (3, 3), pixels."""
    camera_from_prior: Transform | None
    """The truth; None if the prior's motor is not in view, so that every pose is wrong."""
    unit_mm: float = 1.0
    """What the scan's numbers are multiplied by before anyone sees them: a wrong unit."""

    def scan(self) -> Scan:
        """Unproject the image; row by row, with pixels.

        Raises:
            EmptyScanError: The image has no depth.
        """
        pixels = np.argwhere(self.depth_mm > 0)
        if not len(pixels):
            raise EmptyScanError(f"scene {self.name} has no depth")
        rays = pixel_rays(pixels, self.camera_matrix)
        depth = self.depth_mm[pixels[:, 0], pixels[:, 1]] * self.unit_mm
        return Scan(
            points=rays * depth[:, None],
            pixels=pixels,
            grid_shape=(self.depth_mm.shape[0], self.depth_mm.shape[1]),
            source=self.name,
        )

    @property
    def predictor(self) -> ImagePredictor:
        """What stands in for the network."""
        return ImagePredictor(self.is_motor, self.camera_matrix)


@dataclass(frozen=True, slots=True, eq=False)
class ImagePredictor:
    """Scene segmentation that looks its answer up in a mask image, in any order of points."""

    is_motor: BoolArray
    camera_matrix: FloatArray

    def predict(self, points_camera: npt.ArrayLike) -> Float32Array:
        """1 where a point's pixel is the motor's, else 0; shape (N,)."""
        points = np.asarray(points_camera, dtype=np.float64)
        image = points @ self.camera_matrix.T
        column, row = np.rint(image[:, :2] / image[:, 2:]).astype(np.int64).T
        return self.is_motor[row, column].astype(np.float32)


def read_scene(view: TrueView) -> HardScene:
    """Read a view with its true mask.

    Raises:
        InputFileError: An image cannot be read.
    """
    try:
        with Image.open(view.depth_path) as image:
            depth = np.asarray(image, dtype=np.float64) * view.depth_scale_mm
    except (OSError, ValueError) as error:
        raise InputFileError(view.depth_path, str(error), "a 16-bit PNG") from error
    return HardScene(
        name=f"{view.motor}/{view.index}",
        depth_mm=depth,
        is_motor=(read_label_image(view) > 0) & (depth > 0),
        camera_matrix=view.camera_matrix,
        camera_from_prior=view.camera_from_prior,
    )


def hide(scene: HardScene, share: float, rng: np.random.Generator) -> HardScene:
    """Hang a plate before the motor that hides a share of its pixels, from a random side."""
    angle = rng.uniform(0, 2 * np.pi)
    direction = np.array([np.cos(angle), np.sin(angle)])
    height = np.argwhere(scene.is_motor) @ direction
    edge = np.quantile(height, 1 - share)
    rows, columns = np.indices(scene.depth_mm.shape, dtype=np.float64)
    grid = rows * direction[0] + columns * direction[1]
    plate = scene.depth_mm[scene.is_motor].min() - _PLATE_AHEAD_MM
    # only around the motor: a plate over the whole image would be another median depth
    near = grid < height.max() + 40
    covered = (grid > edge) & near & (scene.depth_mm > plate)
    depth = scene.depth_mm.copy()
    depth[covered] = plate + rng.normal(0, NOISE_MM, int(covered.sum()))
    return replace(
        scene,
        name=f"{scene.name}#hidden",
        depth_mm=depth,
        is_motor=scene.is_motor & ~(grid > edge),
    )


def cut_at_border(scene: HardScene, share: float, rng: np.random.Generator) -> HardScene:
    """Let the image end in the middle of the motor; `share` of its pixels stay in the picture."""
    axis = int(rng.integers(2))
    is_low = bool(rng.integers(2))
    place = np.indices(scene.depth_mm.shape)[axis]
    edge = np.quantile(place[scene.is_motor], share if is_low else 1 - share)
    inside = place <= edge if is_low else place >= edge
    return replace(
        scene,
        name=f"{scene.name}#cut",
        depth_mm=np.where(inside, scene.depth_mm, 0.0),
        is_motor=scene.is_motor & inside,
    )


def drop_out(scene: HardScene, share: float, rng: np.random.Generator) -> HardScene:
    """Lose a share of all depth in blobs, as glare and soot do."""
    field = gaussian_filter(rng.normal(size=scene.depth_mm.shape), _BLOB_PX)
    lost = field < np.quantile(field, share)
    return replace(
        scene,
        name=f"{scene.name}#dropout",
        depth_mm=np.where(lost, 0.0, scene.depth_mm),
        is_motor=scene.is_motor & ~lost,
    )


def take_motor_out(scene: HardScene, rng: np.random.Generator) -> HardScene:
    """Empty the clamp; a patch of the clamp as big as half the motor is taken for the motor."""
    depth = np.where(scene.is_motor, 0.0, scene.depth_mm)
    mask = _patch(depth, int(scene.is_motor.sum()) // 2, scene.camera_matrix, rng)
    return replace(
        scene,
        name=f"{scene.name}#absent",
        depth_mm=depth,
        is_motor=mask,
        camera_from_prior=None,
    )


def mirror(scene: HardScene) -> HardScene:
    """Mirror a view left to right: a motor that no pose of the prior can be."""
    camera_matrix = scene.camera_matrix.copy()
    camera_matrix[0, 2] = scene.depth_mm.shape[1] - 1 - camera_matrix[0, 2]
    return replace(
        scene,
        name=f"{scene.name}#mirrored",
        depth_mm=scene.depth_mm[:, ::-1].copy(),
        is_motor=scene.is_motor[:, ::-1].copy(),
        camera_matrix=camera_matrix,
        camera_from_prior=None,
    )


def add_motor(scene: HardScene, other: HardScene) -> HardScene:
    """Put the motor of another view beside that of this one; both are taken for the motor.

    It stands to the right or, where the picture ends there, to the left.
    """
    pixels = np.argwhere(other.is_motor & (other.depth_mm > 0))
    points = pixel_rays(pixels, other.camera_matrix)
    points *= other.depth_mm[pixels[:, 0], pixels[:, 1]][:, None]
    own = np.argwhere(scene.is_motor)
    own_points = pixel_rays(own, scene.camera_matrix)
    own_points *= scene.depth_mm[own[:, 0], own[:, 1]][:, None]
    points += np.median(own_points, axis=0) - np.median(points, axis=0)
    width = scene.depth_mm.shape[1]
    has_room = own[:, 1].max() < width - own[:, 1].min()
    if has_room:
        points[:, 0] += own_points[:, 0].max() - points[:, 0].min() + _APART_MM
    else:
        points[:, 0] += own_points[:, 0].min() - points[:, 0].max() - _APART_MM
    image = points @ scene.camera_matrix.T
    column, row = np.rint(image[:, :2] / image[:, 2:]).astype(np.int64).T
    inside = (row >= 0) & (row < scene.depth_mm.shape[0]) & (column >= 0) & (column < width)
    row, column, near = row[inside], column[inside], points[inside, 2]
    order = np.argsort(-near, kind="stable")  # the nearest is written last
    depth = scene.depth_mm.copy()
    mask = scene.is_motor.copy()
    depth[row[order], column[order]] = near[order]
    mask[row, column] = True
    return replace(scene, name=f"{scene.name}#two", depth_mm=depth, is_motor=mask)


def spoil_mask(scene: HardScene, clamp_share: float, rng: np.random.Generator) -> HardScene:
    """Let a patch of the clamp be taken for the motor, until it is that share of the mask."""
    count = int(scene.is_motor.sum() * clamp_share / (1 - clamp_share))
    others = np.where(scene.is_motor, 0.0, scene.depth_mm)
    patch = _patch(others, count, scene.camera_matrix, rng)
    return replace(scene, name=f"{scene.name}#mask", is_motor=scene.is_motor | patch)


def shrink_mask(scene: HardScene, share: float, rng: np.random.Generator) -> HardScene:
    """Let a share of the motor, from one side, be taken for the clamp."""
    pixels = np.argwhere(scene.is_motor)
    height = pixels @ rng.normal(size=2)
    lost = pixels[height <= np.quantile(height, share)]
    mask = scene.is_motor.copy()
    mask[lost[:, 0], lost[:, 1]] = False
    return replace(scene, name=f"{scene.name}#mask", is_motor=mask)


def _patch(
    depth_mm: FloatArray, count: int, camera_matrix: FloatArray, rng: np.random.Generator
) -> BoolArray:
    """The `count` pixels nearest in space to a random one; all there are if there are fewer."""
    pixels = np.argwhere(depth_mm > 0)
    mask = np.zeros(depth_mm.shape, dtype=np.bool_)
    if not len(pixels) or count < 1:
        return mask
    points = pixel_rays(pixels, camera_matrix) * depth_mm[pixels[:, 0], pixels[:, 1]][:, None]
    seed = points[int(rng.integers(len(points)))]
    distance = np.square(points - seed).sum(axis=1)
    count = min(count, len(pixels))
    chosen = pixels[distance <= np.partition(distance, count - 1)[count - 1]]
    mask[chosen[:, 0], chosen[:, 1]] = True
    return mask
