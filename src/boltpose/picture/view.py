"""From where a picture looks at points, and where each lands on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.errors import DegenerateGeometryError
from boltpose.geometry.transforms import Transform


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class View:
    """A pinhole or parallel projection; frame `view` is x right, y down, z away from the viewer."""

    view_from_scene: Transform
    scale: float
    """Pixels per mm (parallel) or the focal length in pixels (pinhole)."""
    centre: tuple[float, float]
    """Where view x = y = 0 lands: column and row, pixels."""
    width: int
    """Pixels."""
    height: int
    """Pixels."""
    is_pinhole: bool
    focus_mm: float
    """Distance of the subject's middle; lengths measured there are true to scale."""

    def project(self, points: FloatArray) -> FloatArray:
        """Map points of the scene to the picture.

        Args:
            points: Shape (N, 3), mm, the frame `view_from_scene` starts from.

        Returns:
            Shape (N, 3): column and row in pixels, distance along the viewing direction in mm.
        """
        seen = self.view_from_scene.apply(points)
        depth = seen[:, 2:3]
        plane = seen[:, :2] / np.maximum(depth, 1e-6) if self.is_pinhole else seen[:, :2]
        return np.hstack([plane * self.scale + self.centre, depth])

    @property
    def pixels_per_mm(self) -> float:
        """Scale at the subject's middle."""
        return self.scale / self.focus_mm if self.is_pinhole else self.scale


def frame_subject(
    view_from_scene: Transform,
    subject: FloatArray,
    *,
    width: int,
    height: int,
    margin: float = 0.06,
    is_pinhole: bool = False,
) -> View:
    """Choose scale and centre so that the subject fills the picture.

    Args:
        view_from_scene: Where the viewer stands.
        subject: Shape (N, 3), N >= 1, mm, the points that must be in the picture.
        width: Pixels.
        height: Pixels.
        margin: Empty border on every side, as a share of the picture.
        is_pinhole: A camera's perspective; the subject must lie in front of it.

    Returns:
        The view.

    Raises:
        DegenerateGeometryError: A pinhole cannot see the subject because it lies behind it.
    """
    seen = view_from_scene.apply(subject)
    focus_mm = float(np.median(seen[:, 2]))
    if is_pinhole:
        if not focus_mm > 0:
            raise DegenerateGeometryError(
                f"the subject must lie in front of the camera, its middle is at z = {focus_mm:.1f}"
            )
        plane = seen[seen[:, 2] > 0.1 * focus_mm]
        plane = plane[:, :2] / plane[:, 2:3]
    else:
        plane = seen[:, :2]
    low, high = plane.min(axis=0), plane.max(axis=0)
    # one point has no extent: show a decimetre around it
    smallest = 100.0 / focus_mm if is_pinhole else 100.0
    extent = np.where(high - low > 1e-6, high - low, smallest)
    usable = np.array([width, height]) * (1 - 2 * margin)
    scale = float((usable / extent).min())
    middle = (low + high) / 2
    return View(
        view_from_scene=view_from_scene,
        scale=scale,
        centre=(width / 2 - scale * float(middle[0]), height / 2 - scale * float(middle[1])),
        width=width,
        height=height,
        is_pinhole=is_pinhole,
        focus_mm=focus_mm,
    )


def look_along(
    direction: FloatArray, up: FloatArray, target: FloatArray, scene: str, distance_mm: float
) -> Transform:
    """Stand off a target and look at it.

    Args:
        direction: Shape (3,), from the viewer to the target, frame `scene`, any length.
        up: Shape (3,), what shall be up in the picture; when parallel to `direction` another
            upright is chosen.
        target: Shape (3,), mm, frame `scene`.
        scene: Name of the frame the three are given in.
        distance_mm: From the viewer to the target.

    Returns:
        `view_from_<scene>`.
    """
    forward = direction / np.linalg.norm(direction)
    right = np.cross(forward, up)
    if np.linalg.norm(right) < 1e-3 * np.linalg.norm(up):
        right = np.cross(forward, np.eye(3)[int(np.argmin(np.abs(forward)))])
    right = right / np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    return Transform.from_parts(
        "view", scene, rotation, -rotation @ (target - distance_mm * forward)
    )
