"""Small solids, camera poses and an independent distance to a mesh."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold
from scipy.spatial.transform import Rotation

from boltpose.arrays import FloatArray
from boltpose.factory.model import Material, SolidPart
from boltpose.factory.solids import box, prism, regular_polygon, solid_part
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part
from boltpose.sensor.camera import PinholeCamera
from boltpose.sensor.reflectance import Finish

SMALL = PinholeCamera(width=180, height=140, focal_px=200.0)
CLEAN = Finish(spread=0, stains=0, rust_share=0)


def rod(radius_mm: float, low_mm: float, high_mm: float) -> Manifold:
    """A coarse cylinder: few triangles, so that brute force is fast."""
    return Manifold.cylinder(high_mm - low_mm, radius_mm, radius_mm, 20).translate((0, 0, low_mm))


def toy_motor() -> tuple[SolidPart, ...]:
    """A housing, a connector with a slot, a gear in a tube and two bolt heads; overlapping."""
    bodies = [
        (rod(37, -60, 20), "main_housing", Part.MAIN_HOUSING, Material.PAINTED_STEEL),
        (
            rod(42, 20, 60) - rod(20, 19, 61) - box((30, 30, 90), (0, -35, 60)),
            "connector",
            Part.CONNECTOR,
            Material.CAST_ALUMINIUM,
        ),
        (rod(15, 15, 55), "gear", Part.GEAR, Material.BARE_STEEL),
        (
            prism(regular_polygon(6, 10), 58, 66).translate((31, 0, 0)),
            "bolt_T1",
            Part.BOLT,
            Material.ZINC,
        ),
        (
            prism(regular_polygon(6, 10), -66, -59).translate((0, 25, 0)),
            "bolt_B1",
            Part.BOLT,
            Material.ZINC,
        ),
        (rod(20, -60, 0).translate((0, 55, 0)), "solenoid", Part.SOLENOID, Material.ZINC),
    ]
    return tuple(solid_part(*body) for body in bodies)


def slab(
    material: Material = Material.GREY_PLASTIC,
    *,
    size_mm: float = 1500,
    tilt_deg: float = 0,
) -> SolidPart:
    """A wall whose front face contains the origin and looks along +z, turned about x."""
    body = box((size_mm, size_mm, 20), (0, 0, -10)).rotate((tilt_deg, 0, 0))
    return as_solid(body, material=material)


def as_solid(
    body: Manifold, *, part: Part = Part.CONNECTOR, material: Material = Material.GREY_PLASTIC
) -> SolidPart:
    return solid_part(body, "body", part, material)


def camera_at(eye_mm: tuple[float, float, float], roll_rad: float = 0) -> Transform:
    """A camera that looks at the origin of frame `table`."""
    eye = np.asarray(eye_mm, dtype=np.float64)
    forward = -eye / np.linalg.norm(eye)
    right = np.cross(forward, np.eye(3)[np.argmin(np.abs(forward))])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward], axis=1)
    roll = Rotation.from_euler("z", roll_rad).as_matrix()
    return Transform.from_parts("table", "camera", rotation @ roll, eye)


def anywhere(seed: int, distance_mm: float = 600) -> Transform:
    """A camera somewhere on a sphere around the origin."""
    rng = np.random.default_rng(seed)
    x, y, z = rng.standard_normal(3)
    scale = distance_mm / np.sqrt(x * x + y * y + z * z)
    return camera_at((x * scale, y * scale, z * scale), rng.uniform(0, 6))


def distance_to_solids(points: FloatArray, solids: tuple[SolidPart, ...]) -> FloatArray:
    """Shape (solids, N): distance of each point to each surface, mm, by brute force.

    Ericson, Real-Time Collision Detection, 2005: the nearest point of a triangle is inside it or
    on one of its edges.
    """
    pieces = np.array_split(points, max(1, len(points) // 50))
    return np.stack(
        [np.concatenate([_distance_to_mesh(piece, solid) for piece in pieces]) for solid in solids]
    )


def _distance_to_mesh(points: FloatArray, solid: SolidPart) -> FloatArray:
    corners = solid.vertices[solid.faces]
    edges = np.roll(corners, -1, axis=1) - corners
    normals = np.cross(edges[:, 0], edges[:, 1])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    # axes: points, triangles, corners, coordinates
    offset = points[:, None, None] - corners
    inward = np.cross(normals[:, None], edges)
    inside = (np.einsum("pfcx,fcx->pfc", offset, inward) >= 0).all(axis=2)
    height = np.abs(np.einsum("pfx,fx->pf", offset[:, :, 0], normals))
    part = np.einsum("pfcx,fcx->pfc", offset, edges) / np.einsum("fcx,fcx->fc", edges, edges)
    gap = np.linalg.norm(offset - np.clip(part, 0, 1)[..., None] * edges, axis=3).min(axis=2)
    return np.where(inside, np.minimum(height, gap), gap).min(axis=1)
