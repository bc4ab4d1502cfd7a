"""The renderer draws what is there, and the pictures show the errors that are there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from boltpose.errors import ConfigError
from boltpose.factory.looks import LOOKS, PART_COLORS
from boltpose.factory.model import Material, SolidPart
from boltpose.factory.solids import box, cylinder, solid_part
from boltpose.geometry.transforms import Transform
from boltpose.picture.paint import PART_COLORS as PAINTED
from boltpose.schema import Part
from boltpose.sensor.raycast import RayCaster
from boltpose.sensor.structured_light import capture_view
from boltpose.synthesis.pictures import PICTURES, write_pictures
from boltpose.synthesis.render import RenderConfig, focal_px, look_at, render_solids
from boltpose.synthesis.sensor_pictures import (
    camera_effects,
    draw_effect,
    error_map,
    ideal_camera,
    shade_depth,
)
from boltpose.synthesis.surface_error import signed_errors_mm
from boltpose.synthesis.tiles import Tile, sheet, write_jpeg

SMALL = RenderConfig(size_px=(120, 90), supersampling=1, ambient_rays=2)
FROM_ABOVE = Transform.from_parts("frame", "camera", np.diag([1.0, -1.0, -1.0]), (0, 0, 300))


def cube(
    side: float = 20, *, at: tuple[float, float, float] = (0, 0, 0), part: Part = Part.BOLT
) -> SolidPart:
    return solid_part(box((side,) * 3, at), "cube", part, Material.CAST_ALUMINIUM)


def drawn(image: np.ndarray) -> np.ndarray:
    return (image != 255).any(axis=-1)


def test_every_material_and_class_has_a_look() -> None:
    assert set(LOOKS) == set(Material)
    assert set(PART_COLORS) == set(Part)
    for look in LOOKS.values():
        assert all(0 <= value <= 1 for value in (*look.color, look.metallic, look.roughness))


def test_classes_have_the_colours_of_all_other_pictures() -> None:
    for part, color in PAINTED.items():
        encoded = np.array(color)
        linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
        np.testing.assert_allclose(PART_COLORS[part], linear, atol=6e-4)


def test_the_picture_covers_exactly_what_the_camera_sees() -> None:
    image = render_solids([cube()], FROM_ABOVE, config=replace(SMALL, field_of_view_deg=10))
    rows, columns = np.nonzero(drawn(image))
    # the top face is 290 mm away
    wide = 20 / 290 * focal_px(replace(SMALL, field_of_view_deg=10))
    assert np.ptp(columns) + 1 == pytest.approx(wide, abs=1.5)
    assert np.ptp(rows) + 1 == pytest.approx(wide, abs=1.5)


def test_what_is_nearer_hides_what_is_behind() -> None:
    near = cube(at=(0, 0, 30), part=Part.SOLENOID)
    alone = render_solids([near], FROM_ABOVE, config=SMALL, color_by="part")
    both = render_solids([cube(), near], FROM_ABOVE, config=SMALL, color_by="part")
    middle = np.s_[44:47, 58:62]
    np.testing.assert_array_equal(alone[middle], both[middle])


def test_the_same_input_gives_the_same_bits() -> None:
    first, second = (render_solids([cube()], config=SMALL) for _ in range(2))
    assert first.tobytes() == second.tobytes()
    assert first.shape == (90, 120, 3)
    assert first.dtype == np.uint8


@pytest.mark.parametrize("direction", [(1, 0, 0), (-1, 2, 0.5), (0.2, -0.1, -1)])
def test_look_at_fits_and_centres_the_solids(direction: tuple[float, float, float]) -> None:
    solids = [cube(), cube(at=(90, 10, -30))]
    pose = look_at(solids, direction, config=SMALL)
    seen = pose.inverse().apply(np.concatenate([solid.vertices for solid in solids]))
    flat = seen[:, :2] / seen[:, 2:] * focal_px(SMALL)
    assert (seen[:, 2] > 0).all()
    assert (np.abs(flat) <= (60, 45)).all()
    np.testing.assert_allclose(flat.max(axis=0) + flat.min(axis=0), 0, atol=1.5)
    fill = np.abs(flat).max(axis=0) / (60, 45)
    assert fill.max() > 0.85
    np.testing.assert_allclose(pose.rotation[:, 2] @ direction, -np.linalg.norm(direction))


def test_settings_out_of_range_are_refused() -> None:
    with pytest.raises(ConfigError, match="parallel"):
        look_at([cube()], (0, 0, 1))
    with pytest.raises(ConfigError, match="size_px"):
        RenderConfig(size_px=(0, 10))
    with pytest.raises(ConfigError, match="supersampling"):
        RenderConfig(supersampling=0)
    with pytest.raises(ConfigError, match="ambient_rays"):
        RenderConfig(ambient_rays=-1)
    with pytest.raises(ConfigError, match="field_of_view_deg"):
        RenderConfig(field_of_view_deg=0)


def test_errors_are_distances_along_the_normal() -> None:
    solid = solid_part(cylinder(20, 0, 50), "main_housing", Part.MAIN_HOUSING, Material.ZINC)
    rng = np.random.default_rng(0)
    turn, height = rng.uniform(0, 2 * np.pi, 300), rng.uniform(5, 45, 300)
    error = rng.uniform(-0.4, 0.4, 300)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1) * (20 + error)[:, None]
    found = signed_errors_mm(np.column_stack([ring, height]), [solid])
    # facets lie up to 0.02 mm inside the circle
    np.testing.assert_allclose(found, error, atol=0.03)
    far = signed_errors_mm(np.array([[0.0, 0, 60], [0, 0, 25.0]]), [solid])
    assert far[0] == pytest.approx(10, abs=0.3)
    assert far[1] < -15


def test_an_error_map_shows_signs_and_holes() -> None:
    config = ideal_camera((64, 64))
    plate = cube(60, at=(0, 0, 0))
    near = cube(60, at=(0, 0, 0.1))
    rng = np.random.default_rng(0)
    before = capture_view([plate], FROM_ABOVE, config, rng)
    after = capture_view([near], FROM_ABOVE, config, rng)
    same, nearer = error_map(before, before, 0.1), error_map(after, before, 0.1)
    middle = (32, 32)
    assert np.ptp(same[middle].astype(int)) == 0, "no error is grey"
    assert nearer[middle][2] > nearer[middle][0] + 50, "too near is blue"
    assert tuple(same[0, 0]) == tuple(shade_depth(before)[0, 0]), "nothing measured"


@pytest.mark.parametrize("effect", camera_effects(), ids=lambda effect: effect.name)
def test_every_effect_changes_its_picture(effect: object) -> None:
    assert effect in camera_effects()
    small = [
        replace(config, camera=replace(config.camera, width=150, height=130))
        for config in (effect.without, effect.with_it)  # type: ignore[attr-defined]
    ]
    shrunk = replace(effect, without=small[0], with_it=small[1])  # type: ignore[type-var]
    body = solid_part(
        cylinder(25, -40, 40).rotate((90, 0, 20)), "solenoid", Part.SOLENOID, Material.BARE_STEEL
    )
    table = solid_part(
        box((300, 300, 10), (0, 0, -40)), "background", Part.BACKGROUND, Material.BLACK_PLASTIC
    )
    post = cube(14, at=(45, 0, -20))
    pose = Transform.from_parts("frame", "camera", np.diag([1.0, -1.0, -1.0]), (0, 0, 700))
    left, right = draw_effect(shrunk, RayCaster([table, body, post]), pose, 0)
    assert left.image.shape == right.image.shape == (130, 150, 3)
    assert (left.image != right.image).any()


def test_a_sheet_keeps_every_tile_and_is_written_as_jpeg(tmp_path: Path) -> None:
    colors = [(200, 0, 0), (0, 200, 0), (0, 0, 200)]
    tiles = [Tile(np.full((30, 40, 3), color, dtype=np.uint8), "name") for color in colors]
    image = sheet(tiles, 2)
    assert image.shape[1] == 2 * 40 + 8
    for color in colors:
        assert (image == color).all(axis=-1).sum() == 30 * 40
    path = write_jpeg(tmp_path / "sheet.jpg", image)
    with Image.open(path) as picture:
        assert picture.format == "JPEG"
        assert picture.size == image.shape[1::-1]


def test_unknown_pictures_are_refused_before_anything_is_made(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="picture must be one of families"):
        write_pictures(tmp_path / "new", only=["making", "portraits"])
    assert not (tmp_path / "new").exists()


def test_one_picture_is_drawn_and_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(
        PICTURES,
        "making",
        lambda folder, seed: [write_jpeg(folder / f"making_{seed}.jpg", sheet([TILE], 1))],
    )
    seen: list[Path] = []
    written = write_pictures(tmp_path / "new", only=["making"], seed=7, report=seen.append)
    assert list(written) == seen == [tmp_path / "new" / "making_7.jpg"]


TILE = Tile(np.zeros((10, 10, 3), dtype=np.uint8), "x")
