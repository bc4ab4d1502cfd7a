import functools
from dataclasses import replace

import numpy as np
import pytest

from boltpose.errors import ConfigError, DegenerateGeometryError
from boltpose.factory.build import build_motor
from boltpose.factory.families import sample_motor
from boltpose.factory.model import MotorModel, SceneModel, SolidPart
from boltpose.factory.scene import (
    CLAMPS,
    MAX_INTERPENETRATION_MM,
    interpenetration_mm,
    place_motor,
    preferred_direction,
    suggest_camera,
)
from boltpose.factory.solids import manifold_of
from boltpose.schema import Part

SEEDS = (0, 3)


@functools.cache
def motor(seed: int) -> MotorModel:
    return build_motor(sample_motor(np.random.default_rng(seed)))


@functools.cache
def scene(clamp: str, seed: int) -> SceneModel:
    return place_motor(motor(seed), np.random.default_rng(seed), clamp)


def of_clamp(model: SceneModel) -> list[SolidPart]:
    around = ("background_base", "background_table", "background_clutter")
    return [
        solid
        for solid in model.solids
        if solid.part == Part.BACKGROUND and not solid.name.startswith(around)
    ]


def of_motor(model: SceneModel) -> list[SolidPart]:
    return [solid for solid in model.solids if solid.part != Part.BACKGROUND]


every_scene = pytest.mark.parametrize(
    ("clamp", "seed"), [(clamp, seed) for clamp in CLAMPS for seed in SEEDS]
)


def test_there_are_at_least_eight_clamps() -> None:
    assert len(set(CLAMPS)) == len(CLAMPS) >= 8


@every_scene
def test_no_clamp_goes_into_the_motor(clamp: str, seed: int) -> None:
    assert interpenetration_mm(scene(clamp, seed)) <= MAX_INTERPENETRATION_MM


@every_scene
def test_at_least_two_pieces_of_the_clamp_touch_the_motor(clamp: str, seed: int) -> None:
    model = scene(clamp, seed)
    parts = [manifold_of(solid) for solid in of_motor(model)]
    touching = [
        solid.name
        for solid in of_clamp(model)
        if min(manifold_of(solid).min_gap(part, 1.0) for part in parts) < 0.05
    ]
    assert len(touching) >= 2


@every_scene
def test_the_motor_is_unchanged_and_stands_clear_of_the_plate(clamp: str, seed: int) -> None:
    model = scene(clamp, seed)
    expected = [part.moved(model.table_from_motor) for part in motor(seed).parts]
    for found, wanted in zip(of_motor(model), expected, strict=True):
        assert (found.name, found.part, found.bolt_id) == (wanted.name, wanted.part, wanted.bolt_id)
        np.testing.assert_array_equal(found.vertices, wanted.vertices)
        np.testing.assert_array_equal(found.faces, wanted.faces)
        assert found.vertices[:, 2].min() > 0


@every_scene
def test_every_solid_is_closed_and_named_once(clamp: str, seed: int) -> None:
    model = scene(clamp, seed)
    names = [solid.name for solid in model.solids]
    assert len(set(names)) == len(names)
    for solid in model.solids:
        if solid.part == Part.BACKGROUND:
            assert solid.bolt_id is None
            edges = solid.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
            directed = {tuple(edge) for edge in edges.tolist()}
            assert len(directed) == len(edges), solid.name
            assert directed == {(end, start) for start, end in directed}, solid.name
            corners = solid.vertices[solid.faces]
            volume = np.linalg.det(corners).sum() / 6
            assert volume > 0, solid.name


@pytest.mark.parametrize("clamp", CLAMPS)
def test_same_rng_gives_the_same_bits(clamp: str) -> None:
    again = place_motor(motor(0), np.random.default_rng(0), clamp)
    once = scene(clamp, 0)
    assert len(again.solids) == len(once.solids)
    for one, other in zip(again.solids, once.solids, strict=True):
        assert one.name == other.name
        assert one.material == other.material
        np.testing.assert_array_equal(one.vertices, other.vertices)
        np.testing.assert_array_equal(one.faces, other.faces)


def test_another_rng_gives_another_pose() -> None:
    first = scene("v_blocks", 0)
    second = place_motor(motor(0), np.random.default_rng(99), "v_blocks")
    assert np.abs(first.table_from_motor.matrix - second.table_from_motor.matrix).max() > 1e-3


def test_clutter_touches_neither_clamp_nor_motor() -> None:
    for clamp in CLAMPS[:4]:
        model = scene(clamp, 0)
        standing = [manifold_of(solid) for solid in (*of_clamp(model), *of_motor(model))]
        for solid in model.solids:
            if solid.name.startswith("background_clutter"):
                body = manifold_of(solid)
                assert all(body.min_gap(other, 2.0) > 1.0 for other in standing), solid.name


def test_interpenetration_is_the_depth_by_which_a_part_was_pushed_in() -> None:
    model = scene("centres", 0)
    plunger = next(solid for solid in model.solids if solid.name == "background_plunger_0")
    middle = np.mean([solid.vertices.mean(axis=0) for solid in of_motor(model)], axis=0)
    inward = model.table_from_motor.z_axis * np.sign(
        (middle - plunger.vertices.mean(axis=0)) @ model.table_from_motor.z_axis
    )
    for depth in (0.2, 1.5):
        pushed = replace(plunger, vertices=plunger.vertices + depth * inward)
        changed = replace(
            model,
            solids=tuple(pushed if solid is plunger else solid for solid in model.solids),
        )
        assert interpenetration_mm(changed) == pytest.approx(depth, abs=0.15)


def test_an_unknown_clamp_is_refused() -> None:
    with pytest.raises(ConfigError, match="no clamp 'glue', there are v_blocks"):
        place_motor(motor(0), np.random.default_rng(0), "glue")


def test_a_motor_that_fits_no_clamp_is_refused() -> None:
    model = motor(0)

    bare = replace(model, parts=model.parts_of(Part.BOLT))
    with pytest.raises(DegenerateGeometryError, match="main housing and connector"):
        place_motor(bare, np.random.default_rng(0))


@pytest.mark.parametrize("seed", range(5))
def test_cameras_look_at_the_motor_from_where_it_is_free(seed: int) -> None:
    model = scene("v_blocks", 0)
    camera = suggest_camera(
        model, np.random.default_rng(seed), distance_mm=(500, 600), spread_deg=25, wander_mm=0
    )
    points = np.concatenate([solid.vertices for solid in of_motor(model)])
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    offset = camera.translation_mm - middle
    distance = np.linalg.norm(offset)
    assert 500 <= distance <= 600
    np.testing.assert_allclose(camera.z_axis, -offset / distance, atol=1e-9)
    cosine = preferred_direction(model) @ offset / distance
    assert cosine >= np.cos(np.radians(25)) - 1e-9
    assert (camera.inverse().apply(points)[:, 2] > 0).all()


def test_a_camera_without_distance_is_refused() -> None:
    with pytest.raises(ConfigError, match="distance_mm"):
        suggest_camera(scene("v_blocks", 0), np.random.default_rng(0), distance_mm=(0, 100))
    with pytest.raises(ConfigError, match="spread_deg"):
        suggest_camera(scene("v_blocks", 0), np.random.default_rng(0), spread_deg=-1)
