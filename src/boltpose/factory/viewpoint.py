"""From where a camera looks at a clamped motor."""

from __future__ import annotations

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.errors import ConfigError
from boltpose.factory.model import SceneModel, bounds_mm
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part

LEAN_DEG = 22.0
"""How far the preferred direction leans from straight up, away from what stands high."""

_SURROUNDINGS = ("background_base", "background_table", "background_clutter")


def preferred_direction(scene: SceneModel) -> FloatArray:
    """Unit vector, shape (3,), frame `table`, from the motor to where its mount leaves it free.

    That is up, leaning away from the pieces of the clamp that stand higher than the motor's
    middle.
    """
    low, high = bounds_mm([solid for solid in scene.solids if solid.part != Part.BACKGROUND])
    middle = 0.5 * (low + high)
    lean = np.zeros(2)
    for solid in scene.solids:
        if solid.part == Part.BACKGROUND and not solid.name.startswith(_SURROUNDINGS):
            above = solid.vertices[solid.vertices[:, 2] > middle[2]]
            if len(above):
                extent = np.ptp(above, axis=0)
                offset = 0.5 * (above.max(axis=0) + above.min(axis=0)) - middle
                lean -= offset[:2] * extent.max() * max(float(offset[2]), 1.0)
    norm = float(np.linalg.norm(lean))
    angle = np.radians(LEAN_DEG) if norm > 1 else 0.0
    sideways = lean / norm if norm > 1 else np.zeros(2)
    return np.array([*(np.sin(angle) * sideways), np.cos(angle)])


def suggest_camera(
    scene: SceneModel,
    rng: np.random.Generator,
    *,
    distance_mm: tuple[float, float] = (550.0, 850.0),
    spread_deg: float = 30.0,
    wander_mm: float = 20.0,
) -> Transform:
    """Draw a pose of a camera that looks at the motor.

    Args:
        scene: The clamped motor.
        rng: Source of the choice.
        distance_mm: Least and largest distance of the camera from the motor's middle.
        spread_deg: Largest angle between viewing direction and `preferred_direction`; directions
            are even on the sphere within it.
        wander_mm: How far beside the motor's middle the optical axis may pass.

    Returns:
        `table_from_camera`; frame `camera` has x right, y down, z forward, turned at random about
        the optical axis.

    Raises:
        ConfigError: A range is empty or negative.
    """
    nearest, furthest = distance_mm
    if not 0 < nearest <= furthest:
        raise ConfigError(f"distance_mm must be 0 < least <= largest, got {distance_mm}")
    if not 0 <= spread_deg <= 90:
        raise ConfigError(f"spread_deg must be 0 to 90, got {spread_deg}")
    low, high = bounds_mm([solid for solid in scene.solids if solid.part != Part.BACKGROUND])
    target = 0.5 * (low + high) + rng.uniform(-wander_mm, wander_mm, size=3)
    preferred = preferred_direction(scene)
    polar = np.arccos(rng.uniform(np.cos(np.radians(spread_deg)), 1.0))
    around = rng.uniform(0, 2 * np.pi)
    first = _perpendicular(preferred)
    second = np.cross(preferred, first)
    outward = np.cos(polar) * preferred + np.sin(polar) * (
        np.cos(around) * first + np.sin(around) * second
    )
    forward = -outward
    roll = rng.uniform(0, 2 * np.pi)
    across = _perpendicular(forward)
    right = np.cos(roll) * across + np.sin(roll) * np.cross(forward, across)
    rotation = np.stack([right, np.cross(forward, right), forward], axis=1)
    return Transform.from_parts(
        "table", "camera", rotation, target + outward * rng.uniform(nearest, furthest)
    )


def _perpendicular(direction: FloatArray) -> FloatArray:
    """Any unit vector perpendicular to a unit vector."""
    helper = np.eye(3)[int(np.argmin(np.abs(direction)))]
    result = np.cross(direction, helper)
    return np.asarray(result / np.linalg.norm(result), dtype=np.float64)
