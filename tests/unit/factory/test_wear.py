from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree

from boltpose.arrays import FloatArray
from boltpose.factory.model import Material, MotorModel, SolidPart
from boltpose.factory.relief import make_field, patches, vertex_normals
from boltpose.factory.solids import box, cylinder, mesh_arrays, solid_part
from boltpose.factory.wear import refine, wear_motor, wear_solids
from boltpose.factory.wear_spec import NEW, WearSpec, sample_wear
from boltpose.schema import Part
from tests.unit.factory.small_motor import is_closed, small_motor, volume_mm3

COARSE = 4.0
OLD = WearSpec(
    warp_mm=0.1,
    rust_mm=0.3,
    rust_share=0.6,
    dirt_mm=0.8,
    dirt_share=0.3,
    dents=3,
    dent_mm=1.2,
    chips=6,
    chip_mm=3,
    grease=3,
    clogged_share=1,
    clogged=1,
    corner_wear=0.5,
    edge_mm=COARSE,
)


def cube() -> SolidPart:
    return solid_part(
        box((60, 60, 60)), "main_housing_cube", Part.MAIN_HOUSING, Material.PAINTED_STEEL
    )


def same(one: MotorModel, other: MotorModel) -> bool:
    return len(one.parts) == len(other.parts) and all(
        a.vertices.tobytes() == b.vertices.tobytes() and a.faces.tobytes() == b.faces.tobytes()
        for a, b in zip(one.parts, other.parts, strict=True)
    )


@given(seed=st.integers(0, 2**32 - 1), wavelength=st.floats(1, 100))
@settings(max_examples=30, deadline=None)
def test_fields_are_bounded_smooth_and_repeatable(seed: int, wavelength: float) -> None:
    field = make_field(wavelength, np.random.default_rng(seed), channels=2)
    again = make_field(wavelength, np.random.default_rng(seed), channels=2)
    points = np.random.default_rng(seed + 1).uniform(-200, 200, size=(500, 3))
    values = field.at(points)
    assert np.abs(values).max() <= 1
    np.testing.assert_array_equal(values, again.at(points))
    # between two lattice points a value changes by 2 at most, at 1.875 times the mean slope
    step = 1e-4 * wavelength
    slope = np.abs(field.at(points + [step, 0, 0]) - values) / step
    assert slope.max() <= 3 * 2 * 1.875 * 2 / wavelength * 1.01


def test_a_field_asked_in_pieces_gives_the_same_bits() -> None:
    field = make_field(7.0, np.random.default_rng(1))
    points = np.random.default_rng(2).uniform(-50, 50, size=(1000, 3))
    pieces = np.concatenate([field.at(part) for part in np.array_split(points, 7)])
    np.testing.assert_array_equal(field.at(points), pieces)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.3, 0.6, 1.0])
def test_patches_cover_about_their_share(share: float) -> None:
    field = make_field(5.0, np.random.default_rng(3))
    points = np.random.default_rng(4).uniform(-60, 60, size=(20000, 3))
    assert patches(field, points, share).mean() == pytest.approx(share, abs=0.1)


def test_normals_of_a_cylinder_point_out_of_it() -> None:
    body = cylinder(20, -10, 10).refine_to_length(2)
    vertices, faces = mesh_arrays(body)
    normals = vertex_normals(vertices, faces)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)
    on_mantle = (np.hypot(vertices[:, 0], vertices[:, 1]) > 19.9) & (np.abs(vertices[:, 2]) < 8)
    outward = vertices[on_mantle] * [1, 1, 0] / 20
    np.testing.assert_allclose((normals[on_mantle] * outward).sum(axis=1), 1, atol=0.01)


@given(seed=st.integers(0, 10**6), dents=st.integers(0, 3))
@settings(max_examples=12, deadline=None)
def test_no_vertex_of_a_body_moves_further_than_the_bound(seed: int, dents: int) -> None:
    wear = OLD.model_copy(update={"dents": dents})
    before, _ = refine(cube(), COARSE)
    (after,) = wear_solids([cube()], wear, seed)
    moved = np.linalg.norm(after.vertices - before, axis=1)
    assert 0 < moved.max() <= wear.bound_mm
    assert is_closed(after.faces)


def test_without_wear_the_surface_stays_bit_for_bit() -> None:
    new = wear_motor(small_motor(), NEW.model_copy(update={"edge_mm": COARSE}), 5)
    assert [part.name for part in new.parts] == [part.name for part in small_motor().parts]
    for part, built in zip(new.parts, small_motor().parts, strict=True):
        assert volume_mm3(part) == pytest.approx(volume_mm3(built), rel=1e-9)


def test_the_same_seed_gives_the_same_bits_and_another_seed_another_motor() -> None:
    one, two, other = (wear_motor(small_motor(), OLD, seed) for seed in (7, 7, 8))
    assert same(one, two)
    assert not same(one, other)


def test_worn_parts_are_closed_and_bolts_stay_true() -> None:
    model = small_motor()
    worn = wear_motor(model, OLD, 11)
    assert worn.bolts == model.bolts
    names = [part.name for part in worn.parts]
    assert names[: len(model.parts)] == [part.name for part in model.parts]
    assert len(set(names)) == len(names)
    for part in worn.parts:
        assert is_closed(part.faces), part.name
        assert volume_mm3(part) > 0, part.name
    for part in worn.parts[len(model.parts) :]:
        assert part.material is Material.GREASE
        assert part.name.startswith(part.part.name.lower())


def head_axis(model: MotorModel, bolt_id: str) -> FloatArray:
    """Middle of a head's mantle in frame `bolt`: where a fit would find the axis."""
    (bolt,) = (bolt for bolt in model.bolts if bolt.id == bolt_id)
    (solid,) = (part for part in model.parts if part.bolt_id == bolt_id)
    corners = bolt.motor_from_bolt.inverse().apply(solid.vertices)[solid.faces]
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = 0.5 * np.linalg.norm(crosses, axis=1)
    centres = corners.mean(axis=1)
    is_mantle = (np.abs(crosses[:, 2]) < 0.3 * 2 * areas) & (centres[:, 2] > -bolt.head_height_mm)
    weights = areas[is_mantle, None]
    return (weights * centres[is_mantle]).sum(axis=0)[:2] / weights.sum()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_flank_of_a_worn_head_still_stands_around_its_axis(seed: int) -> None:
    wear = OLD.model_copy(update={"clogged_share": 0.0})
    worn = wear_motor(small_motor(), wear, seed)
    for bolt in worn.bolts:
        limit = wear.bolt_bound_mm if bolt.spec.rusty else wear.bolt_share * wear.rust_mm + 0.02
        assert np.linalg.norm(head_axis(worn, bolt.id)) < 0.6 * limit


def test_bodies_keep_off_the_heads() -> None:
    dirty = OLD.model_copy(update={"dents": 0, "warp_mm": 0.0, "chips": 0, "dirt_share": 1.0})
    model = small_motor()
    worn = wear_motor(model, dirty, 3)
    for bolt in model.bolts:
        for part, built in zip(worn.parts, model.parts, strict=False):
            if part.bolt_id is not None:
                continue
            start, _ = refine(built, COARSE)
            if len(start) != len(part.vertices):
                continue  # chipped
            local = bolt.motor_from_bolt.inverse().apply(start)
            near = (np.hypot(local[:, 0], local[:, 1]) < 0.5 * bolt.head_diameter_mm + 0.5) & (
                local[:, 2] < 3
            )
            np.testing.assert_array_equal(part.vertices[near], start[near])


def test_neighbours_move_alike_so_that_joints_stay_shut() -> None:
    lower = solid_part(
        box((40, 40, 20), (0, 0, -10)), "main_housing_a", Part.MAIN_HOUSING, Material.CAST_IRON
    )
    upper = solid_part(
        box((40, 40, 20), (0, 0, 10)), "connector_b", Part.CONNECTOR, Material.CAST_IRON
    )
    wear = WearSpec(warp_mm=0.2, roughness_mm=0, rust_mm=0.3, rust_share=1, dents=0, edge_mm=COARSE)
    low, high = wear_solids([lower, upper], wear, 4)
    face_low = low.vertices[np.abs(refine(lower, COARSE)[0][:, 2]) < 1e-9]
    face_high = high.vertices[np.abs(refine(upper, COARSE)[0][:, 2]) < 1e-9]
    _, partner = KDTree(face_low[:, :2]).query(face_high[:, :2])
    # crust only grows outwards, so the faces meet or cross, and never gape
    assert (face_high[:, 2] - face_low[partner, 2]).max() < 0.02


def test_a_full_drive_is_flush() -> None:
    bare = OLD.model_copy(update={"clogged_share": 0.0})
    open_, full = wear_motor(small_motor(), bare, 2), wear_motor(small_motor(), OLD, 2)

    def torx(model: MotorModel) -> float:
        (bolt,) = (b for b in model.bolts if b.spec.head == "torx_pan")
        return next(volume_mm3(part) for part in model.parts if part.bolt_id == bolt.id)

    assert torx(full) > torx(open_) + 3


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=50, deadline=None)
def test_a_drawn_wear_survives_json(seed: int) -> None:
    wear = sample_wear(np.random.default_rng(seed))
    assert WearSpec.model_validate_json(wear.model_dump_json()) == wear
