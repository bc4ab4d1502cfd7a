"""A view of solids as a structured-light camera delivers it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from boltpose.arrays import Float32Array, FloatArray, IntArray, UInt8Array, freeze
from boltpose.factory.model import SolidPart
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part
from boltpose.sensor.depth_errors import disturb
from boltpose.sensor.exposure import Exposure
from boltpose.sensor.raycast import RayCaster
from boltpose.sensor.structured_light_config import StructuredLightConfig

_RAYS_AT_ONCE = 1 << 16
"""Keeps intermediate arrays in the processor's cache: twice as fast as all at once."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CapturedView:
    """One capture. Frame `camera`: z along the optical axis, x right, y down."""

    depth_mm: FloatArray
    """Shape (H, W), along the optical axis; 0 where nothing was measured."""
    labels: UInt8Array
    """Shape (H, W), `Part` numbers; 0 where nothing was measured."""
    solid_index: npt.NDArray[np.int32]
    """Shape (H, W), row of the solids; -1 where nothing was measured."""
    camera_matrix: FloatArray
    """Shape (3, 3), pinhole."""

    def __post_init__(self) -> None:
        for name in ("depth_mm", "labels", "solid_index", "camera_matrix"):
            object.__setattr__(self, name, freeze(getattr(self, name)))

    @property
    def pixels(self) -> IntArray:
        """Shape (N,), row * width + column of every measured pixel, ascending."""
        return np.flatnonzero(self.depth_mm)

    def points(self) -> FloatArray:
        """Shape (N, 3), mm, frame `camera`: the measured points in the order of `pixels`."""
        pixels = self.pixels
        rows, columns = np.divmod(pixels, self.depth_mm.shape[1])
        depth = self.depth_mm.reshape(-1)[pixels]
        matrix = self.camera_matrix
        return np.stack(
            [
                (columns - matrix[0, 2]) / matrix[0, 0] * depth,
                (rows - matrix[1, 2]) / matrix[1, 1] * depth,
                depth,
            ],
            axis=1,
        )


def capture_view(
    solids: Sequence[SolidPart] | RayCaster,
    frame_from_camera: Transform,
    config: StructuredLightConfig,
    rng: np.random.Generator,
    *,
    lasting_rng: np.random.Generator | None = None,
) -> CapturedView:
    """Look at solids once.

    Args:
        solids: What stands before the camera, in one frame; a `RayCaster` saves building it anew
            for further views of the same scene.
        frame_from_camera: Pose of the camera in the frame of the solids.
        config: The camera and its errors.
        rng: Draws the errors; not used by an ideal camera.
        lasting_rng: Draws what two shots of one camera at one scene share: the solids' finish and
            the camera's ripple, lumps and warp. A generator in the state in which `rng` was for
            the first shot repeats that shot's; left out, everything is drawn from `rng`.

    Returns:
        The capture. A pixel exists only if camera and projector both see the point and enough,
        but not too much, light comes back. Depth is not quantised: that is left to the writer.

    Raises:
        ShapeError: There are no solids.
    """
    caster = solids if isinstance(solids, RayCaster) else RayCaster(solids)
    exposure = _expose(caster, frame_from_camera, config)
    camera = config.camera
    if config.is_ideal:
        depth_mm = np.zeros(camera.width * camera.height)
        depth_mm[exposure.pixels] = exposure.depth_mm
        depth_mm = depth_mm.reshape(camera.height, camera.width)
    else:
        depth_mm = disturb(exposure, caster.solids, config, rng, lasting_rng)
    measured = depth_mm.reshape(-1)[exposure.pixels] > 0
    kept, solid = exposure.pixels[measured], exposure.solid_index[measured]
    labels = np.full(depth_mm.size, int(Part.BACKGROUND), dtype=np.uint8)
    labels[kept] = caster.labels[solid]
    solid_index = np.full(depth_mm.size, -1, dtype=np.int32)
    solid_index[kept] = solid
    return CapturedView(
        depth_mm=depth_mm,
        labels=labels.reshape(depth_mm.shape),
        solid_index=solid_index.reshape(depth_mm.shape),
        camera_matrix=camera.matrix,
    )


def _expose(
    caster: RayCaster, frame_from_camera: Transform, config: StructuredLightConfig
) -> Exposure:
    """Cast the rays of all pixels, some rows at a time, and keep what the projector lights."""
    camera = config.camera
    rotation = frame_from_camera.rotation
    eye = frame_from_camera.translation_mm
    lamp = frame_from_camera.apply((config.baseline_mm, 0.0, 0.0))
    pieces: list[Exposure] = []
    count = camera.width * camera.height
    for start in range(0, count, _RAYS_AT_ONCE):
        pixels = np.arange(start, min(start + _RAYS_AT_ONCE, count))
        across, down = camera.slopes(pixels)
        forward = 1 / np.sqrt(across * across + down * down + 1)
        # term by term, not a product of BLAS, whose bits may depend on its threads
        directions = forward[:, None] * (
            across[:, None] * rotation[:, 0] + down[:, None] * rotation[:, 1] + rotation[:, 2]
        )
        hits = caster.first_hits(eye[None], directions)
        faces_eye = -np.einsum("ij,ij->i", hits.normals, directions)
        rows = np.flatnonzero(faces_eye > 0)
        points, normals = hits.points[rows], hits.normals[rows]
        to_lamp = lamp - points
        reach = np.sqrt(np.einsum("ij,ij->i", to_lamp, to_lamp))
        to_lamp /= reach[:, None]
        faces_lamp = np.einsum("ij,ij->i", normals, to_lamp)
        lit = np.flatnonzero(faces_lamp > 0)
        lit = lit[~caster.is_blocked(lamp[None], points[lit])]
        rows = rows[lit]
        half = to_lamp[lit] - directions[rows]
        half /= np.sqrt(np.einsum("ij,ij->i", half, half))[:, None]
        pieces.append(
            Exposure(
                pixels=pixels[rows],
                depth_mm=hits.distance_mm[rows] * forward[rows],
                solid_index=hits.solid_index[rows],
                points=points[lit].astype(np.float32),
                cos_eye=_single(faces_eye[rows]),
                cos_lamp=_single(faces_lamp[lit]),
                cos_half=_single(np.einsum("ij,ij->i", half, normals[lit])),
                lamp_distance_mm=_single(reach[lit]),
            )
        )
    return Exposure.joined(pieces)


def _single(values: FloatArray) -> Float32Array:
    return values.astype(np.float32)
