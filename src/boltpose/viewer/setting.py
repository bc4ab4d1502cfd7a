"""What stands around the motor: robot base, camera, and heads that the prior does not know."""

from __future__ import annotations

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.geometry.transforms import Transform
from boltpose.schema import ExtraHead, Scan
from boltpose.viewer.page import Page
from boltpose.viewer.web import viser

_AXIS_MM = 120.0
_HINT = (255, 212, 0)


class Setting:
    """Frames of the robot and the camera, and hints; all can be hidden."""

    def __init__(self, page: Page) -> None:
        """Nothing yet."""
        self._scene = page.server.scene
        self._base = self._scene.add_frame("/base", show_axes=False, visible=True)
        self._camera = self._scene.add_frame("/camera", show_axes=False, visible=True)
        self._nodes: list[viser.SceneNodeHandle] = []

    def clear(self) -> None:
        """Show nothing."""
        for node in self._nodes:
            node.remove()
        self._nodes = []

    def show(
        self,
        scan: Scan,
        page_from_camera: Transform,
        *,
        has_base: bool,
        extra_heads: tuple[ExtraHead, ...] = (),
    ) -> None:
        """Show where things stand.

        Args:
            scan: Its outline gives the camera's field of view.
            page_from_camera: The camera.
            has_base: True if the frame of the page is the robot's base.
            extra_heads: In the frame of the page.
        """
        self.clear()
        scene = self._scene
        if has_base:
            self._nodes += [
                scene.add_frame(
                    "/base/axes", axes_length=_AXIS_MM, axes_radius=3.0, origin_radius=8.0
                ),
                scene.add_label(
                    "/base/name", "robot base", position=(0, 0, -14), anchor="top-center"
                ),
            ]
        fov_rad, aspect = _field_of_view(scan.points)
        self._nodes += [
            scene.add_camera_frustum(
                "/camera/view",
                fov=fov_rad,
                aspect=aspect,
                scale=70.0,
                color=(40, 60, 90),
                cast_shadow=False,
                receive_shadow=False,
                wxyz=page_from_camera.quaternion_wxyz,
                position=page_from_camera.translation_mm,
            ),
            scene.add_frame(
                "/camera/axes",
                axes_length=0.5 * _AXIS_MM,
                axes_radius=2.0,
                origin_radius=4.0,
                wxyz=page_from_camera.quaternion_wxyz,
                position=page_from_camera.translation_mm,
            ),
            scene.add_label(
                "/camera/name",
                "camera",
                position=page_from_camera.translation_mm,
                anchor="bottom-center",
            ),
        ]
        for row, head in enumerate(extra_heads):
            self._nodes += [
                scene.add_icosphere(
                    f"/hints/{row}",
                    radius=0.6 * head.diameter_mm,
                    color=_HINT,
                    opacity=0.6,
                    cast_shadow=False,
                    receive_shadow=False,
                    position=head.head_top_mm,
                ),
                scene.add_label(
                    f"/hints/{row}/name",
                    "? not in the prior",
                    position=(0.0, 0.0, 0.0),
                    anchor="bottom-center",
                ),
            ]

    def set_base(self, is_visible: bool) -> None:
        """Show or hide the robot's base."""
        self._base.visible = is_visible

    def set_camera(self, is_visible: bool) -> None:
        """Show or hide the camera."""
        self._camera.visible = is_visible


def viewpoint(
    target_mm: FloatArray, radius_mm: float, up: FloatArray, towards: FloatArray, turn_rad: float
) -> FloatArray:
    """Where to stand to see a thing well: from a side, but obliquely, never straight from above.

    Args:
        target_mm: Shape (3,), the middle of the thing.
        radius_mm: Its size.
        up: Shape (3,), unit.
        towards: Shape (3,): the side to see it from.
        turn_rad: Turned so far about `up`.

    Returns:
        Shape (3,), mm.
    """
    level = towards - (towards @ up) * up
    if float(np.linalg.norm(level)) < 1e-6 * float(np.linalg.norm(towards)):
        axis = np.eye(3)[int(np.argmin(np.abs(up)))]
        level = axis - (axis @ up) * up
    level /= np.linalg.norm(level)
    height = float(np.arctan2(towards @ up, np.linalg.norm(towards - (towards @ up) * up)))
    height = float(np.clip(height, np.radians(20), np.radians(55)))
    side = np.cross(up, level)
    flat = np.cos(turn_rad) * level + np.sin(turn_rad) * side
    return target_mm + 3.7 * radius_mm * (np.cos(height) * flat + np.sin(height) * up)


def _field_of_view(points_camera: FloatArray) -> tuple[float, float]:
    """Vertical angle, rad, and width by height of the picture that the points fill."""
    front = points_camera[points_camera[:, 2] > 1e-6]
    if len(front) == 0:
        return float(np.radians(40)), 1.3
    slope = (
        np.abs(front[:: max(1, len(front) // 20_000), :2])
        / front[:: max(1, len(front) // 20_000), 2:]
    )
    wide, high = np.quantile(slope, 0.99, axis=0)
    high = float(np.clip(high, 0.05, 1.5))
    return 2 * float(np.arctan(high)), float(np.clip(wide / high, 0.3, 3.0))
