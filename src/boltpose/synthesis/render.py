"""Shaded pictures of solids by ray casting: what people look at, never what a sensor sees.

`python -m boltpose.synthesis.render FAMILY_OR_SPEC.json out.png` draws one motor.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt
from PIL import Image

from boltpose.arrays import BoolArray, FloatArray, UInt8Array
from boltpose.errors import ConfigError
from boltpose.factory.looks import LOOKS, PART_COLORS
from boltpose.factory.model import SolidPart, bounds_mm
from boltpose.geometry.transforms import Transform
from boltpose.sensor.raycast import Hits, RayCaster

ColorBy = Literal["material", "part"]

_CENTRINGS = 6
_LAMP_MM = 3000.0
"""How far the lights are: further than anything drawn."""
_CREASE_COS = 0.6
"""Neighbouring normals further apart than 53 deg are drawn as an edge."""
_KEY_LIGHT = (-0.5, -0.75, -0.9)
_FILL_LIGHT = (0.9, -0.1, -0.6)
"""Towards the lights, in the camera's frame: x right, y down, z forward."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderConfig:
    """How a picture is drawn."""

    size_px: tuple[int, int] = (900, 700)
    """Width and height."""
    field_of_view_deg: float = 24
    """Of the wider side."""
    supersampling: int = 2
    """Rays per pixel and direction."""
    ambient_rays: int = 10
    """Per primary ray; they darken corners."""
    ambient_reach_mm: float = 45
    """What is further away darkens nothing."""
    color_by: ColorBy = "material"
    draw_edges: bool = True
    background: tuple[int, int, int] = (255, 255, 255)
    """sRGB, 0 to 255."""

    def __post_init__(self) -> None:
        if min(self.size_px) < 1:
            raise ConfigError(f"size_px must be positive, got {self.size_px}")
        if not 1 <= self.field_of_view_deg <= 120:
            raise ConfigError(f"field_of_view_deg must be 1 to 120, got {self.field_of_view_deg}")
        if not 1 <= self.supersampling <= 8:
            raise ConfigError(f"supersampling must be 1 to 8, got {self.supersampling}")
        if self.ambient_rays < 0:
            raise ConfigError(f"ambient_rays must be >= 0, got {self.ambient_rays}")


def look_at(
    solids: Sequence[SolidPart],
    direction: npt.ArrayLike = (1.0, -1.6, 0.9),
    *,
    up: npt.ArrayLike = (0, 0, 1),
    config: RenderConfig | None = None,
    margin: float = 1.05,
) -> Transform:
    """Stand where all solids just fit into the picture.

    Args:
        solids: What to look at; at least one.
        direction: Shape (3,), from the middle of the solids towards the camera.
        up: Shape (3,), what is up in the picture.
        config: Size of the picture and its field of view.
        margin: Distance over the one at which everything just fits.

    Returns:
        `frame_from_camera`: x right, y down, z forward; "frame" is the solids' frame.

    Raises:
        ConfigError: Direction and up are parallel or zero.
    """
    settings = config or RenderConfig()
    forward = -np.asarray(direction, dtype=np.float64)
    right = np.cross(forward, np.asarray(up, dtype=np.float64))
    if np.linalg.norm(right) < 1e-9 * max(1.0, float(np.linalg.norm(forward))):
        raise ConfigError(f"direction {direction} and up {up} must not be parallel or zero")
    forward /= np.linalg.norm(forward)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward], axis=1)
    eye = bounds_mm(solids).mean(axis=0)
    points = np.concatenate([solid.vertices for solid in solids])
    focal = focal_px(settings)
    half = np.array(settings.size_px) / 2
    retreat = 0.0
    for _ in range(_CENTRINGS):
        seen = (points - eye) @ rotation
        # back off until every point is inside: |x| f / z <= half
        retreat = float((np.abs(seen[:, :2]) * focal / half - seen[:, 2:3]).max()) * margin
        # what is near looks large, so the middle of the picture is not the middle of the solids
        flat = seen[:, :2] / (seen[:, 2:3] + retreat)
        eye = eye + rotation[:, :2] @ (0.5 * (flat.max(axis=0) + flat.min(axis=0)) * retreat)
    eye = eye - retreat * forward
    return Transform.from_parts("frame", "camera", rotation, eye)


def render_solids(
    solids: Sequence[SolidPart],
    frame_from_camera: Transform | None = None,
    *,
    direction: npt.ArrayLike = (1.0, -1.6, 0.9),
    up: npt.ArrayLike = (0, 0, 1),
    size_px: tuple[int, int] | None = None,
    color_by: ColorBy | None = None,
    config: RenderConfig | None = None,
) -> UInt8Array:
    """Draw solids with two lights, darkened corners and edges.

    Args:
        solids: What to draw, all in one frame; at least one.
        frame_from_camera: Camera x right, y down, z forward; None looks from `direction` at all.
        direction: Shape (3,), towards the camera; used without `frame_from_camera`.
        up: Shape (3,), what is up in the picture; used without `frame_from_camera`.
        size_px: Width and height; overrides the config's.
        color_by: By material or by class; overrides the config's.
        config: How to draw.

    Returns:
        Shape (H, W, 3), sRGB; the same bits for the same input.

    Raises:
        ConfigError: Direction and up are parallel, or a setting is out of its range.
    """
    base = config or RenderConfig()
    settings = RenderConfig(
        size_px=size_px or base.size_px,
        field_of_view_deg=base.field_of_view_deg,
        supersampling=base.supersampling,
        ambient_rays=base.ambient_rays,
        ambient_reach_mm=base.ambient_reach_mm,
        color_by=color_by or base.color_by,
        draw_edges=base.draw_edges,
        background=base.background,
    )
    pose = frame_from_camera or look_at(solids, direction, up=up, config=settings)
    caster = RayCaster(solids)
    rays = _primary_rays(settings, pose)
    hits = caster.first_hits(pose.translation_mm[None], rays)
    light = _shade(caster, settings, pose, rays, hits)
    return _develop(settings, hits, light)


def focal_px(config: RenderConfig) -> float:
    """Focal length of a picture's camera, in pixels."""
    return max(config.size_px) / 2 / math.tan(math.radians(config.field_of_view_deg) / 2)


def _primary_rays(config: RenderConfig, frame_from_camera: Transform) -> FloatArray:
    """Unit directions, shape (R, 3), of all sub-pixels in rows from the top left."""
    width, height = config.size_px
    steps = config.supersampling
    columns = (np.arange(width * steps) + 0.5) / steps - width / 2
    rows = (np.arange(height * steps) + 0.5) / steps - height / 2
    x, y = np.meshgrid(columns, rows)
    directions = np.stack([x, y, np.full_like(x, focal_px(config))], axis=-1).reshape(-1, 3)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return frame_from_camera.rotate(directions)


def _shade(
    caster: RayCaster, config: RenderConfig, pose: Transform, rays: FloatArray, hits: Hits
) -> FloatArray:
    """Linear RGB of every hit, shape (K, 3)."""
    towards_camera = -rays[hits.is_hit]
    points, solid = hits.points[hits.is_hit], hits.solid_index[hits.is_hit]
    normals = hits.normals[hits.is_hit]
    inside = np.sum(normals * towards_camera, axis=1) < 0
    normals[inside] *= -1  # the camera is inside a solid
    color, metallic, roughness = _looks(caster.solids, config.color_by)
    albedo = color[solid]
    metal, matt = metallic[solid][:, None], roughness[solid][:, None]
    # metals show what is around them: a bright sky above a dark floor
    facing = normals @ pose.rotation
    mirrored = -towards_camera @ pose.rotation
    mirrored = mirrored - 2 * np.sum(mirrored * facing, axis=1, keepdims=True) * facing
    slope = (7.5 - 6 * matt) * (mirrored[:, 1:2] - 0.05 - 0.35 * mirrored[:, 2:3])
    ambient = (1 - metal) * 0.5 + metal * (0.2 + 0.75 / (1 + np.exp(slope)))
    light = albedo * ambient * _open_sky(caster, config, points, normals)[:, None]
    shininess = 4 + 120 * (1 - matt) ** 2
    for lamp, strength, casts_shadow in ((_KEY_LIGHT, 0.8, True), (_FILL_LIGHT, 0.3, False)):
        towards = pose.rotate(np.array(lamp) / np.linalg.norm(lamp))
        cosine = np.clip(normals @ towards, 0, None)[:, None] * strength
        if casts_shadow:
            dark = caster.is_blocked(points + _LAMP_MM * towards, points)
            cosine = cosine * (1 - 0.75 * dark[:, None])
        half = towards + towards_camera
        half /= np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-9)
        glint = np.clip(np.sum(normals * half, axis=1), 0, 1)[:, None] ** shininess
        tint = metal * albedo * 1.4 + (1 - metal) * 0.12
        light = light + cosine * (albedo * (1 - 0.35 * metal) + glint * tint)
    return light


def _looks(
    solids: Sequence[SolidPart], color_by: ColorBy
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Colour (S, 3), metallic (S,) and roughness (S,) of every solid."""
    looks = [LOOKS[solid.material] for solid in solids]
    if color_by == "part":
        colors = np.array([PART_COLORS[solid.part] for solid in solids])
        return colors, np.zeros(len(solids)), np.full(len(solids), 0.7)
    return (
        np.array([look.color for look in looks]),
        np.array([look.metallic for look in looks]),
        np.array([look.roughness for look in looks]),
    )


def _open_sky(
    caster: RayCaster, config: RenderConfig, points: FloatArray, normals: FloatArray
) -> FloatArray:
    """Share (K,) of the directions off the surface that are free; near obstacles count more."""
    count = len(points)
    free = np.ones(count)
    rng = np.random.default_rng(0)
    for _ in range(config.ambient_rays if count else 0):
        # a point on the unit sphere around the tip of the normal: cosine-weighted
        height = rng.uniform(-1, 1, count)
        turn = rng.uniform(0, 2 * math.pi, count)
        ring = np.sqrt(1 - height**2)
        ball = np.stack([ring * np.cos(turn), ring * np.sin(turn), height], axis=1)
        directions = normals + 0.999 * ball
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        # an obstacle at distance d blocks with probability 1 - d / reach
        reach = config.ambient_reach_mm * rng.uniform(0.01, 1, (count, 1))
        free -= caster.is_blocked(points + reach * directions, points) / config.ambient_rays
    return free


def _edges(hits: Hits, grid: tuple[int, int]) -> BoolArray:
    """Sub-pixels (rows, columns) at an outline, a joint of two solids or a sharp crease."""
    solid = hits.solid_index.reshape(grid)
    depth = hits.distance_mm.reshape(grid)
    normal = hits.normals.reshape(*grid, 3)
    edge = np.zeros(grid, dtype=np.bool_)
    for here, there in (
        (np.s_[:, 1:], np.s_[:, :-1]),
        (np.s_[1:, :], np.s_[:-1, :]),
    ):
        differs = solid[here] != solid[there]
        both = (solid[here] >= 0) & (solid[there] >= 0)
        crease = np.sum(normal[here] * normal[there], axis=-1) < _CREASE_COS
        with np.errstate(invalid="ignore"):
            step = np.abs(depth[here] - depth[there]) > 4
        # the nearer side carries the line, so that it stays inside the outline
        marked = differs | (both & (crease | step))
        edge[here] |= marked & (depth[here] <= depth[there])
        edge[there] |= marked & (depth[there] < depth[here])
    return edge


def _develop(config: RenderConfig, hits: Hits, light: FloatArray) -> UInt8Array:
    """Put lit rays on the background, draw edges, average sub-pixels, encode as sRGB."""
    width, height = config.size_px
    steps = config.supersampling
    srgb = np.tile(np.array(config.background, dtype=np.float64) / 255, (len(hits.is_hit), 1))
    # a soft shoulder keeps highlights from clipping to flat white
    toned = 1 - np.exp(-1.15 * light)
    srgb[hits.is_hit] = np.where(
        toned <= 0.0031308, 12.92 * toned, 1.055 * np.maximum(toned, 1e-9) ** (1 / 2.4) - 0.055
    )
    picture = srgb.reshape(height * steps, width * steps, 3)
    if config.draw_edges:
        picture = np.where(_edges(hits, picture.shape[:2])[..., None], 0.35 * picture, picture)
    blocks = picture.reshape(height, steps, width, steps, 3).mean(axis=(1, 3))
    return np.clip(np.rint(255 * blocks), 0, 255).astype(np.uint8)


def _main() -> None:
    """Draw the motor that the command line names."""
    from boltpose.factory.build import build_motor
    from boltpose.factory.families import sample_motor
    from boltpose.factory.spec import MotorSpec

    if len(sys.argv) != 3:
        raise SystemExit("usage: python -m boltpose.synthesis.render FAMILY_OR_SPEC.json OUT.png")
    what, target = sys.argv[1:]
    if Path(what).suffix == ".json":
        spec = MotorSpec.model_validate_json(Path(what).read_text(encoding="utf-8"))
    else:
        spec = sample_motor(np.random.default_rng(0), what)
    parts = build_motor(spec).parts
    size = (700, 560)
    rows: tuple[tuple[ColorBy, tuple[tuple[float, float, float], ...]], ...] = (
        ("material", ((-1.2, 0.5, 1.0), (-1.2, 0.5, -1.0))),
        ("part", ((1.2, 0.2, 0.8), (1.2, -0.6, -0.5))),
    )
    views = [
        [render_solids(parts, direction=side, size_px=size, color_by=color) for side in sides]
        for color, sides in rows
    ]
    Image.fromarray(np.vstack([np.hstack(row) for row in views])).save(target)


if __name__ == "__main__":
    _main()
