"""The second viewpoint: where the bolts can be seen that the camera could not see."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from boltpose.arrays import BoolArray, FloatArray
from boltpose.geometry.normals import fibonacci_directions
from boltpose.picture.bolt_marks import BoltMark
from boltpose.picture.raster import rasterise
from boltpose.picture.view import View, frame_subject, look_along

_DIRECTIONS = 40
_SIZE_PX = 120
_CLEARANCE_MM = 4.0
"""A head nearer to the viewer than the surface in its pixel plus this is in sight."""


def choose_direction(motor_camera: FloatArray, marks: list[BoltMark]) -> FloatArray:
    """Find the viewing direction that shows most of some bolts, arrows from the side.

    Args:
        motor_camera: Shape (N, 3), mm, the registered prior.
        marks: Bolts in the same frame; without any, the far side of the motor is shown.

    Returns:
        Shape (3,), unit, from the viewer to the motor, frame `camera`.
    """
    middle = motor_camera.mean(axis=0)
    if not marks:
        return -middle / np.linalg.norm(middle)
    axes = np.array([mark.scene_from_bolt.z_axis for mark in marks])
    thin = motor_camera[:: max(1, len(motor_camera) // 15_000)]
    best, best_score = np.array([0.0, 0.0, -1.0]), -np.inf
    for forward in fibonacci_directions(_DIRECTIONS):
        view_from_camera = look_along(forward, np.array([0.0, -1.0, 0.0]), middle, "camera", 2000.0)
        view = frame_subject(view_from_camera, thin, width=_SIZE_PX, height=_SIZE_PX)
        towards = -(axes @ forward)
        # an arrow at 45 deg to the line of sight shows both the head and its direction
        legible = np.where(heads_in_sight(view, thin, marks), 1 - np.abs(towards - 0.65), 0.0)
        score = float(legible.sum()) - 0.1 * float(forward @ (middle / np.linalg.norm(middle)))
        if score > best_score:
            best, best_score = forward, score
    return np.asarray(best)


def heads_in_sight(view: View, points: FloatArray, marks: list[BoltMark]) -> BoolArray:
    """Tell which heads face the viewer with nothing of the motor in front.

    Args:
        view: From where.
        points: Shape (N, 3), mm, the motor.
        marks: Bolts in the same frame.

    Returns:
        Shape (len(marks),).
    """
    if not marks:
        return np.zeros(0, dtype=np.bool_)
    coarse = replace(
        view,
        scale=view.scale * _SIZE_PX / view.width,
        centre=(view.centre[0] * _SIZE_PX / view.width, view.centre[1] * _SIZE_PX / view.width),
        width=_SIZE_PX,
        height=max(1, round(view.height * _SIZE_PX / view.width)),
    )
    depth = rasterise(coarse, points, 3.0).depth
    # a little above the head: its own top face must not hide it
    place = coarse.project(
        np.vstack([mark.scene_from_bolt.apply(np.array([0.0, 0.0, 1.0])) for mark in marks])
    )
    column = np.clip(place[:, 0].astype(np.int64), 0, coarse.width - 1)
    row = np.clip(place[:, 1].astype(np.int64), 0, coarse.height - 1)
    forward_scene = view.view_from_scene.inverse().z_axis
    facing = np.array([-float(mark.scene_from_bolt.z_axis @ forward_scene) for mark in marks])
    return (place[:, 2] < depth[row, column] + _CLEARANCE_MM) & (facing > 0)
