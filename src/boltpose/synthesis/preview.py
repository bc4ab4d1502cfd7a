"""Contact sheets of a data set: what a person looks at before training on it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from boltpose.arrays import FloatArray, UInt8Array
from boltpose.datasets.reman18 import Reman18
from boltpose.errors import InputFileError
from boltpose.factory.spec import MotorSpec
from boltpose.geometry.transforms import Transform
from boltpose.io.atomic import write_atomic
from boltpose.picture.paint import PART_COLORS, paint, part_tints
from boltpose.picture.view import frame_subject, look_along
from boltpose.schema import Part

FOLDER = "preview"
MOTORS_NAME = "motors.png"
VIEWS_NAME = "views.png"
_TILE_PX = (380, 280)
_CAPTION_PX = 22
_PAIRS_PER_ROW = 2
_MAX_MOTORS = 16
_MAX_VIEWS = 16
_DIRECTION = (1.0, 0.55, 0.75)
_UP = (0.0, 1.0, 0.0)
"""Frame `motor`: from the drive end and the solenoid's side, the solenoid on top."""


def write_previews(root: Path) -> tuple[Path, ...]:
    """Draw the first motors and views of a data set into its folder `preview`.

    Motors: the model by material, rebuilt from `spec.json` where there is one, and the scan by
    class. Views: the depth image lit from the camera, and the same by class.

    Returns:
        The pictures.

    Raises:
        InputFileError: It is no data set, or a file is missing or of another form.
    """
    data = Reman18(root=root)
    folder = root / FOLDER
    folder.mkdir(exist_ok=True)
    motors = data.motors[:_MAX_MOTORS]
    tiles = [_motor_tile(data, name) for name in motors]
    written = [_write_png(folder / MOTORS_NAME, _sheet(tiles))]
    views = _choose_views(data)
    if views:
        tiles = [_view_tile(data, name, number) for name, number in views]
        written.append(_write_png(folder / VIEWS_NAME, _sheet(tiles)))
    return tuple(written)


def _choose_views(data: Reman18) -> list[tuple[str, int]]:
    """One view per motor, each time the next, so that clamps differ."""
    chosen: list[tuple[str, int]] = []
    for index, name in enumerate(data.motors[:_MAX_VIEWS]):
        if (data.root / name / "scene_camera.json").exists():
            chosen.append((name, index % data.view_count(name)))
    return chosen


def _motor_tile(data: Reman18, name: str) -> Image.Image:
    scan = data.full_scan(name)
    truth = _json(data.root / name / "prior_gt.json")
    motor_from_prior = Transform("prior", "motor", np.array(truth["T_M_to_C"])).inverse()
    points = motor_from_prior.apply(scan.points)
    direction = np.array(_DIRECTION)
    view_from_motor = look_along(
        -direction, np.array(_UP), np.median(points, axis=0), "motor", 1000.0
    )
    view = frame_subject(view_from_motor, points, width=_TILE_PX[0], height=_TILE_PX[1])
    by_class = (255 * paint(view, points, part_tints(scan.labels))).astype(np.uint8)
    spec_path = data.root / name / "spec.json"
    pictures = [by_class]
    if spec_path.exists():
        pictures.insert(0, _render_model(spec_path))
    bolts = len(truth["bolts"])
    caption = f"{name}  {truth['family_name']}  {bolts} bolts  {len(points)} points"
    return _tile(pictures, caption)


def _render_model(spec_path: Path) -> UInt8Array:
    from boltpose.factory.build import build_motor
    from boltpose.synthesis.render import render_solids

    model = build_motor(MotorSpec.model_validate_json(spec_path.read_text(encoding="utf-8")))
    return render_solids(model.parts, direction=_DIRECTION, up=_UP, size_px=_TILE_PX)


def _view_tile(data: Reman18, name: str, number: int) -> Image.Image:
    folder = data.root / name
    camera = _json(folder / "scene_camera.json")[str(number)]
    truth = _json(folder / "bolts.json")[str(number)]
    depth = np.asarray(Image.open(folder / "depth" / f"{number:06d}.png"), dtype=np.float64)
    labels = np.asarray(Image.open(folder / "label" / f"{number:06d}.png"))
    step = max(1, min(depth.shape[1] // _TILE_PX[0], depth.shape[0] // _TILE_PX[1]))
    depth, labels = depth[::step, ::step] * camera["depth_scale"], labels[::step, ::step]
    focal_px = camera["cam_K"][0] / step
    light = shade_depth(depth, focal_px)
    table = np.array([PART_COLORS[part] for part in Part])
    grey = np.repeat(light[..., None], 3, axis=2)
    tint = table[labels] * (0.3 + 0.7 * light[..., None])
    tint[depth <= 0] = 0
    visible = sum(bool(bolt["visible"]) for bolt in truth["bolts"])
    caption = f"{name} view {number}  {truth['clamp_name']}  {visible} of {len(truth['bolts'])}"
    return _tile([(255 * image).astype(np.uint8) for image in (grey, tint)], f"{caption} visible")


def shade_depth(depth_mm: FloatArray, focal_px: float) -> FloatArray:
    """Light a depth image by a lamp at the camera.

    Args:
        depth_mm: Shape (H, W), along the optical axis; 0 where nothing was measured.
        focal_px: Focal length, pixels of this image.

    Returns:
        Shape (H, W), 0 to 1; 0 where nothing was measured.
    """
    depth = np.where(depth_mm > 0, depth_mm, np.nan)
    # mm per pixel grow with the distance; the slope of the surface is dz over those
    with np.errstate(invalid="ignore"):
        down, right = np.gradient(depth)
        pitch = depth / focal_px
        facing = 1 / np.sqrt(1 + (right / pitch) ** 2 + (down / pitch) ** 2)
    # a pixel beside a hole has no slope but was measured: as dark as a steep one
    return np.where(depth_mm > 0, 0.15 + 0.85 * np.nan_to_num(facing, nan=0.1), 0.0)


def _tile(pictures: Sequence[UInt8Array], caption: str) -> Image.Image:
    width, height = _TILE_PX
    tile = Image.new("RGB", (width * len(pictures), height + _CAPTION_PX), "white")
    for index, picture in enumerate(pictures):
        image = Image.fromarray(np.ascontiguousarray(picture))
        image.thumbnail(_TILE_PX)
        tile.paste(image, (index * width + (width - image.width) // 2, 0))
    draw = ImageDraw.Draw(tile)
    draw.text((8, height + 3), caption, fill="black", font=ImageFont.load_default(13))
    return tile


def _sheet(tiles: Sequence[Image.Image]) -> Image.Image:
    width, height = max(tile.width for tile in tiles), tiles[0].height
    rows = -(-len(tiles) // _PAIRS_PER_ROW)
    columns = min(_PAIRS_PER_ROW, len(tiles))
    sheet = Image.new("RGB", (width * columns, height * rows), "white")
    for index, tile in enumerate(tiles):
        row, column = divmod(index, columns)
        sheet.paste(tile, (column * width, row * height))
    return sheet


def _write_png(path: Path, image: Image.Image) -> Path:
    def write(stream: BinaryIO) -> None:
        image.save(stream, format="PNG", compress_level=6)

    write_atomic(path, write)
    return path


def _json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputFileError(path, str(error), "a JSON file as in reman18") from error
