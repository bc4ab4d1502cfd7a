"""The pictures of `docs/factory.md`: families, clamps, wear and sensors, all by one command."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from boltpose.errors import ConfigError, DegenerateGeometryError
from boltpose.factory.build import build_motor
from boltpose.factory.families import FAMILIES, sample_motor
from boltpose.factory.model import MotorModel, SceneModel, SolidPart
from boltpose.factory.scene import CLAMPS, place_motor
from boltpose.factory.viewpoint import suggest_camera
from boltpose.factory.wear import wear_motor
from boltpose.factory.wear_spec import WearSpec
from boltpose.geometry.transforms import Transform
from boltpose.picture.paint import part_tints
from boltpose.schema import Part
from boltpose.sensor.hand_held import scan_motor
from boltpose.sensor.hand_held_config import HandHeldConfig
from boltpose.sensor.raycast import RayCaster
from boltpose.sensor.structured_light import capture_view
from boltpose.synthesis.render import RenderConfig, look_at, render_solids
from boltpose.synthesis.sensor_pictures import (
    camera_effects,
    draw_cloud,
    draw_effect,
    error_map,
    hand_held_tiles,
    ideal_camera,
)
from boltpose.synthesis.tiles import Tile, sheet, write_jpeg

_TILE_PX = (420, 360)
_FRONT = (-1.2, 0.5, 0.9)
_REAR = (-1.2, 0.6, -1.0)
_CLAMP_VIEW = (0.9, -1.1, 1.0)
_PER_SHEET = 6
_SURROUNDINGS = ("background_base", "background_table", "background_clutter")
_DISTANCE_MM = 700.0
_MAKING_FAMILY = "direct_open"
"""Its pinion can be seen."""
_WORST = WearSpec(
    roughness_mm=0.04,
    rust_mm=0.26,
    rust_share=0.75,
    dirt_mm=0.8,
    dirt_share=0.3,
    dents=5,
    dent_mm=1.5,
    dent_radius_mm=14,
    chips=8,
    chip_mm=3.5,
    grease=4,
    grease_mm=9,
    clogged_share=0.7,
    clogged=1,
    corner_wear=0.45,
)
"""The upper ends of what `sample_wear` draws."""
_RELIEF_MM = 0.5
_ATTEMPTS = 12
"""Motors tried for a clamp; not every motor fits every clamp."""


def write_pictures(
    folder: Path,
    *,
    seed: int = 0,
    only: Sequence[str] = (),
    report: Callable[[Path], None] | None = None,
) -> tuple[Path, ...]:
    """Draw the pictures of the documentation.

    Args:
        folder: Where they go; made if missing.
        seed: Draws the motors, clamps and errors.
        only: Names from `PICTURES`; none for all.
        report: Called with every file once it is written.

    Returns:
        The files.

    Raises:
        ConfigError: There is no such picture.
        OSError: The folder is not writable.
    """
    for name in only:
        if name not in PICTURES:
            raise ConfigError(f"picture must be one of {', '.join(PICTURES)}, got '{name}'")
    folder.mkdir(parents=True, exist_ok=True)
    written: list[Path] = []
    for name in only or PICTURES:
        for path in PICTURES[name](folder, seed):
            written.append(path)
            if report is not None:
                report(path)
    return tuple(written)


def _motor(family: str, seed: int) -> MotorModel:
    return build_motor(sample_motor(np.random.default_rng(seed), family))


def _draw(
    solids: Sequence[SolidPart],
    caption: str,
    direction: Sequence[float] = _FRONT,
    *,
    by_class: bool = False,
    up: Sequence[float] = (0, 0, 1),
    frame_from_camera: Transform | None = None,
) -> Tile:
    """One rendered tile."""
    image = render_solids(
        solids,
        frame_from_camera,
        direction=direction,
        up=up,
        size_px=_TILE_PX,
        color_by="part" if by_class else "material",
    )
    return Tile(image, caption)


def _families(folder: Path, seed: int) -> list[Path]:
    """Every family from the front, from behind and by class."""
    written: list[Path] = []
    for number, start in enumerate(range(0, len(FAMILIES), _PER_SHEET), start=1):
        tiles: list[Tile] = []
        for family in FAMILIES[start : start + _PER_SHEET]:
            parts = _motor(family, seed).parts
            tiles += [
                _draw(parts, family),
                _draw(parts, "from behind", _REAR),
                _draw(parts, "classes", by_class=True, direction=_REAR),
            ]
        written.append(write_jpeg(folder / f"families_{number}.jpg", sheet(tiles, 3), quality=80))
    return written


def _variation(folder: Path, seed: int) -> list[Path]:
    """One family, other seeds."""
    tiles = [_draw(_motor(FAMILIES[0], seed + i).parts, f"seed {seed + i}") for i in range(4)]
    return [write_jpeg(folder / "variation.jpg", sheet(tiles, 4))]


def _making(folder: Path, seed: int) -> list[Path]:
    """Class by class, all from one place."""
    model = _motor(_MAKING_FAMILY, seed)
    pose = look_at(model.parts, _FRONT, config=RenderConfig(size_px=_TILE_PX))
    shown: list[SolidPart] = []
    tiles: list[Tile] = []
    for part in list(Part)[1:]:
        shown += model.parts_of(part)
        caption = ("+ " if tiles else "") + part.name.lower().replace("_", " ")
        tiles.append(_draw(shown, caption, by_class=True, frame_from_camera=pose))
    return [write_jpeg(folder / "making.jpg", sheet(tiles, 3))]


def _wear(folder: Path, seed: int) -> list[Path]:
    """New, as most are and as bad as it gets; and how far the surface moved."""
    new = _motor(_MAKING_FAMILY, seed)
    pose = look_at(new.parts, _FRONT, config=RenderConfig(size_px=_TILE_PX))
    config = ideal_camera(_TILE_PX)
    rng = np.random.default_rng(seed)  # an ideal camera draws nothing
    before = capture_view(new.parts, pose, config, rng)
    drawn = [_draw(new.parts, "new", frame_from_camera=pose)]
    moved = [Tile(error_map(before, before, _RELIEF_MM), f"relief, colour: ±{_RELIEF_MM:g} mm")]
    for caption, wear in (("used", WearSpec()), ("from a field", _WORST)):
        worn = wear_motor(new, wear, seed)
        drawn.append(_draw(worn.parts, caption, frame_from_camera=pose))
        after = capture_view(worn.parts, pose, config, rng)
        moved.append(Tile(error_map(after, before, _RELIEF_MM), "blue: grown, red: gone"))
    return [write_jpeg(folder / "wear.jpg", sheet([*drawn, *moved], 3))]


def _clamps(folder: Path, seed: int) -> list[Path]:
    """Every clamp with a motor in it."""
    tiles: list[Tile] = []
    for number, clamp in enumerate(CLAMPS):
        scene = clamped(clamp, seed + number)
        held = [solid for solid in scene.solids if not solid.name.startswith(_SURROUNDINGS)]
        pose = look_at(held, _CLAMP_VIEW, config=RenderConfig(size_px=_TILE_PX))
        tiles.append(_draw(scene.solids, clamp.replace("_", " "), frame_from_camera=pose))
    return [
        write_jpeg(folder / f"clamps_{number}.jpg", sheet(tiles[start : start + _PER_SHEET], 3))
        for number, start in enumerate(range(0, len(tiles), _PER_SHEET), start=1)
    ]


def clamped(clamp: str, seed: int) -> SceneModel:
    """A motor of some family in a clamp.

    Raises:
        DegenerateGeometryError: No motor that was tried fits.
    """
    rng = np.random.default_rng(seed)
    for _ in range(_ATTEMPTS - 1):
        model = build_motor(sample_motor(rng))
        try:
            return place_motor(model, rng, clamp)
        except DegenerateGeometryError:
            continue
    return place_motor(build_motor(sample_motor(rng)), rng, clamp)


def _camera(folder: Path, seed: int) -> list[Path]:
    """Every error of the structured-light camera."""
    scene = clamped(CLAMPS[0], seed)
    caster = RayCaster(scene.solids)
    pose = suggest_camera(
        scene,
        np.random.default_rng(seed),
        distance_mm=(_DISTANCE_MM, _DISTANCE_MM),
        spread_deg=12,
        wander_mm=0,
    )
    return [
        write_jpeg(
            folder / f"camera_{effect.name}.jpg", sheet(draw_effect(effect, caster, pose, seed), 2)
        )
        for effect in camera_effects()
    ]


def _hand_held(folder: Path, seed: int) -> list[Path]:
    """The errors of the hand-held scanner, and a scan by class."""
    model = _motor(FAMILIES[0], seed)
    tiles = hand_held_tiles(model, seed)
    scan = scan_motor(model.parts, HandHeldConfig(), np.random.default_rng(seed))
    tiles.append(Tile(draw_cloud(scan, part_tints(scan.labels)), "the labels of that scan"))
    return [write_jpeg(folder / "hand_held.jpg", sheet(tiles, 2), quality=80)]


PICTURES: dict[str, Callable[[Path, int], list[Path]]] = {
    "families": _families,
    "variation": _variation,
    "making": _making,
    "wear": _wear,
    "clamps": _clamps,
    "camera": _camera,
    "hand_held": _hand_held,
}
"""What can be drawn, by name."""
