"""A small made-up motor and what a camera sees of it, from closed formulas."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.geometry.transforms import Transform
from boltpose.registration.prepare import PreparedPrior, prepare_prior
from boltpose.schema import Alignment, Part, Prior, PriorBolt, Side

Surface = tuple[np.ndarray, np.ndarray]

BOLTS = {
    "T1": ((22.0, 12.0, 54.0), (0.0, 0.0, 1.0)),
    "T2": ((-20.0, -14.0, 54.0), (0.0, 0.0, 1.0)),
    "B1": ((10.0, -22.0, -54.0), (0.0, 0.0, -1.0)),
}
HEAD_RADIUS_MM = 5.0
HEAD_HEIGHT_MM = 4.0


def cylinder(radius: float, z: tuple[float, float], centre: tuple[float, float], step: float):
    around = np.arange(0, 2 * np.pi, step / radius)
    along = np.arange(z[0] + step / 2, z[1], step)
    angle, height = (grid.ravel() for grid in np.meshgrid(around, along))
    side = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    points = side * radius + np.stack([0 * height, 0 * height, height], axis=1)
    grid = np.arange(-radius, radius, step) + step / 2
    x, y = (part.ravel() for part in np.meshgrid(grid, grid))
    inside = np.hypot(x, y) < radius
    caps = [np.stack([x[inside], y[inside], np.full(inside.sum(), level)], axis=1) for level in z]
    normals = [np.tile([0.0, 0.0, sign], (inside.sum(), 1)) for sign in (-1, 1)]
    shift = np.array([*centre, 0.0])
    return np.vstack([points, *caps]) + shift, np.vstack([side, *normals])


def box(low: tuple[float, float, float], high: tuple[float, float, float], step: float) -> Surface:
    points, normals = [], []
    for axis in range(3):
        first, second = (other for other in range(3) if other != axis)
        a, b = (
            part.ravel()
            for part in np.meshgrid(
                np.arange(low[first] + step / 2, high[first], step),
                np.arange(low[second] + step / 2, high[second], step),
            )
        )
        for level, sign in ((low[axis], -1.0), (high[axis], 1.0)):
            face = np.zeros((len(a), 3))
            face[:, first], face[:, second], face[:, axis] = a, b, level
            normal = np.zeros((len(a), 3))
            normal[:, axis] = sign
            points.append(face)
            normals.append(normal)
    return np.vstack(points), np.vstack(normals)


@cache
def surface(step: float, scale: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, normals and labels of the motor; `scale` makes another size of it."""
    parts = [
        (Part.MAIN_HOUSING, cylinder(30.0 * scale, (-50.0, 50.0), (0.0, 0.0), step)),
        (Part.SOLENOID, cylinder(14.0, (-30.0, 25.0), (0.0, 46.0 * scale), step)),
        (Part.CONNECTOR, box((24.0, -12.0, 20.0), (48.0, 12.0, 44.0), step)),
        (Part.CONNECTOR, box((-44.0, -20.0, -45.0), (-24.0, 4.0, -20.0), step)),
        (Part.GEAR, cylinder(9.0, (50.0, 72.0 * scale), (0.0, -3.0), step)),
    ]
    for (x, y, top), (_, _, sign) in BOLTS.values():
        z = sorted((top, top - sign * HEAD_HEIGHT_MM))
        parts.append((Part.BOLT, cylinder(HEAD_RADIUS_MM, (z[0], z[1]), (x, y), step)))
    points = np.vstack([part[0] for _, part in parts])
    normals = np.vstack([part[1] for _, part in parts])
    labels = np.concatenate([np.full(len(part[0]), int(label)) for label, part in parts])
    # what lies inside the housing is no surface
    inside = (np.hypot(points[:, 0], points[:, 1]) < 30.0 * scale - 1e-6) & (
        np.abs(points[:, 2]) < 50.0 - 1e-6
    )
    return points[~inside], normals[~inside], labels[~inside].astype(np.uint8)


@cache
def motor_prior(scale: float = 1.0) -> Prior:
    points, normals, labels = surface(1.0, scale)
    bolts = []
    for name, (top, axis) in BOLTS.items():
        rotation = np.eye(3) if axis[2] > 0 else np.diag([1.0, -1.0, -1.0])
        bolts.append(
            PriorBolt(
                id=name,
                side=Side.TOP if axis[2] > 0 else Side.BOTTOM,
                prior_from_bolt=Transform.from_parts("prior", "bolt", rotation, top),
                cluster_centre=np.array(top),
                head_diameter_mm=2 * HEAD_RADIUS_MM,
                head_height_mm=HEAD_HEIGHT_MM,
                point_count=150,
                class_probability=1.0,
                head_fit_support=50.0,
                sigma_lateral_mm=0.05,
                sigma_axial_mm=0.05,
                is_sure=True,
            )
        )
    return Prior(
        name=f"made up, scale {scale}",
        points=points,
        normals=normals,
        labels=labels,
        bolts=tuple(bolts),
        alignment=Alignment(
            prior_from_motor=Transform.identity("prior", "motor"),
            axis_spread_rad=0.01,
            axis_sigma_rad=0.001,
            normal_count=1000,
            inlier_ratio=1.0,
            has_solenoid=True,
        ),
    )


@cache
def prepared_motor(scale: float = 1.0) -> PreparedPrior:
    return prepare_prior(motor_prior(scale))


def pose(*, turn: tuple[float, float, float], depth_mm: float = 600.0) -> Transform:
    """A pose in front of the camera; `turn` is a rotation vector in rad."""
    rotation = Rotation.from_rotvec(turn).as_matrix()
    return Transform.from_parts("camera", "prior", rotation, (12.0, -7.0, depth_mm))


def visible_points(
    camera_from_prior: Transform, *, noise_mm: float = 0.05, step: float = 0.7, seed: int = 0
) -> np.ndarray:
    """The motor's points a camera at the origin sees, with noise along the ray."""
    points, normals, _ = surface(step)
    points = camera_from_prior.apply(points)
    normals = camera_from_prior.rotate(normals)
    points = points[np.einsum("ni,ni->n", points, normals) < 0]
    cell = np.floor(points[:, :2] / points[:, 2:] / 0.003).astype(np.int64)
    cell -= cell.min(axis=0)
    flat = cell[:, 0] * (cell[:, 1].max() + 1) + cell[:, 1]
    front = np.full(flat.max() + 1, np.inf)
    np.minimum.at(front, flat, points[:, 2])
    seen = points[points[:, 2] < front[flat] + 4.0]
    noise = np.random.default_rng(seed).normal(scale=noise_mm, size=len(seen))
    return seen * (1 + noise / np.linalg.norm(seen, axis=1))[:, None]


def back_wall(depth_mm: float = 800.0) -> np.ndarray:
    """A plane behind the motor, 2 mm between points."""
    grid = np.arange(-200.0, 200.0, 2.0)
    x, y = (part.ravel() for part in np.meshgrid(grid, grid))
    return np.stack([x, y, np.full_like(x, depth_mm)], axis=1)


def view(camera_from_prior: Transform, **kwargs: float) -> tuple[np.ndarray, np.ndarray]:
    """Scan (motor, then the wall around it) and the mask of the motor."""
    motor = visible_points(camera_from_prior, **kwargs)
    wall = back_wall()
    # the motor's shadow on the wall: a wall point is seen if no motor point is near its ray
    cells = {tuple(cell) for cell in np.floor(motor[:, :2] / motor[:, 2:] / 0.006).astype(int)}
    wall_cells = np.floor(wall[:, :2] / wall[:, 2:] / 0.006).astype(int)
    wall = wall[[tuple(cell) not in cells for cell in wall_cells]]
    scan = np.vstack([motor, wall])
    return scan, np.arange(len(scan)) < len(motor)


def pose_error(found: Transform, truth: Transform) -> float:
    """Largest displacement, mm, of a bolt."""
    heads = np.array([top for top, _ in BOLTS.values()])
    return float(np.linalg.norm(found.apply(heads) - truth.apply(heads), axis=1).max())
