"""Laws of the whole factory, for motors of any family and seed."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from boltpose.arrays import FloatArray
from boltpose.factory.build import build_motor
from boltpose.factory.families import FAMILIES, sample_motor
from boltpose.factory.model import MotorModel, SolidPart, TrueBolt, bounds_mm
from boltpose.factory.solids import Manifold, manifold_of
from boltpose.factory.spec import MotorSpec
from boltpose.factory.wear import wear_motor
from boltpose.factory.wear_spec import sample_wear
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part, Side
from boltpose.sensor.camera import PinholeCamera
from boltpose.sensor.raycast import RayCaster
from boltpose.sensor.structured_light import capture_view
from boltpose.sensor.structured_light_config import StructuredLightConfig

POOL = tuple((family, number) for number, family in enumerate(FAMILIES[::3]))
"""Built once for all tests; `make test-all` draws any family and seed."""
MOTORS = st.sampled_from(POOL)
TOUCH_MM3 = 0.02
"""Bodies that touch overlap by this much where their facets differ."""
PREFIXES = {
    Part.MAIN_HOUSING: "main_housing",
    Part.CONNECTOR: "connector",
    Part.SOLENOID: "solenoid",
    Part.ELECTRICAL_CONNECTOR: "electrical_connector",
    Part.GEAR: "gear",
    Part.BOLT: "bolt_",
}


def spec_of(family: str, seed: int) -> MotorSpec:
    return sample_motor(np.random.default_rng(seed), family)


@lru_cache(maxsize=40)
def motor(family: str, seed: int) -> MotorModel:
    return build_motor(spec_of(family, seed))


def solid_of(model: MotorModel, bolt: TrueBolt) -> SolidPart:
    (solid,) = [part for part in model.parts if part.bolt_id == bolt.id]
    return solid


def seen_from_bolt(model: MotorModel, bolt: TrueBolt) -> FloatArray:
    return bolt.motor_from_bolt.inverse().apply(solid_of(model, bolt).vertices)


def test_there_are_enough_topologies() -> None:
    assert len(FAMILIES) >= 12
    assert len(set(FAMILIES)) == len(FAMILIES)


def law_every_part_is_a_watertight_solid(model: MotorModel) -> None:
    for solid in model.parts:
        edges = np.sort(solid.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        _, counts = np.unique(edges, axis=0, return_counts=True)
        # an edge that two shells share has four faces; odd numbers are gaps
        assert (counts % 2 == 0).all(), solid.name
        directed = solid.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        forth, n_forth = np.unique(directed, axis=0, return_counts=True)
        back, n_back = np.unique(directed[:, ::-1], axis=0, return_counts=True)
        np.testing.assert_array_equal(forth, back, err_msg=solid.name)
        np.testing.assert_array_equal(n_forth, n_back, err_msg=solid.name)
        a, b, c = np.moveaxis(solid.vertices[solid.faces], 1, 0)
        volume = float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6
        assert volume > 1, f"{solid.name} is empty or inside out"
        body = manifold_of(solid)
        # Manifold straightens slivers as it reads a mesh, which moves next to nothing
        assert body.volume() == pytest.approx(volume, rel=1e-3), solid.name


def law_names_classes_and_bolts_agree(model: MotorModel) -> None:
    names = [solid.name for solid in model.parts]
    assert len(set(names)) == len(names)
    for solid in model.parts:
        assert solid.part != Part.BACKGROUND
        assert solid.name.startswith(PREFIXES[solid.part]), solid.name
        assert (solid.bolt_id is not None) == (solid.part == Part.BOLT)
        if solid.bolt_id is not None:
            assert solid.name == f"bolt_{solid.bolt_id}"
    assert sorted(bolt.id for bolt in model.bolts) == sorted(
        solid.bolt_id for solid in model.parts if solid.bolt_id is not None
    )
    present = [bolt for bolt in model.spec.bolts if bolt.state == "present"]
    assert len(model.bolts) == len(present)
    assert {part for part in Part if part != Part.BACKGROUND} - {
        solid.part for solid in model.parts
    } <= {Part.SOLENOID, Part.ELECTRICAL_CONNECTOR}


def law_a_true_bolt_is_where_its_head_is(model: MotorModel) -> None:
    for bolt in model.bolts:
        points = seen_from_bolt(model, bolt)
        # nothing is above head_top, and what is there is the rim of the top face
        assert abs(points[:, 2].max()) < 1e-6, bolt.id
        top = points[points[:, 2] > -1e-6]
        head = points[points[:, 2] > -bolt.head_height_mm - 1e-6]
        for ring in (top, head):
            low, high = ring[:, :2].min(axis=0), ring[:, :2].max(axis=0)
            # across corners and across flats differ, but both are centred on the axis
            np.testing.assert_allclose(low + high, 0, atol=0.02, err_msg=bolt.id)
        reach = np.hypot(*head[:, :2].T).max()
        assert reach == pytest.approx(0.5 * bolt.head_diameter_mm, abs=0.1), bolt.id
        assert points[:, 2].min() < -bolt.head_height_mm, f"{bolt.id} has no shank"


def law_the_heads_volume_is_balanced_about_the_axis(model: MotorModel) -> None:
    for bolt in model.bolts:
        body = manifold_of(solid_of(model, bolt).moved(bolt.motor_from_bolt.inverse()))
        head = body.trim_by_plane((0, 0, 1), -bolt.head_height_mm)
        centre = centroid(head)
        np.testing.assert_allclose(centre[:2], 0, atol=0.05, err_msg=bolt.id)
        assert -bolt.head_height_mm < centre[2] < 0


def centroid(body: Manifold) -> FloatArray:
    mesh = body.to_mesh64()
    corners = np.asarray(mesh.vert_properties)[np.asarray(mesh.tri_verts, dtype=np.int64), :3]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    return (volume[:, None] * corners.sum(axis=1) / 4).sum(axis=0) / volume.sum()


def law_bolts_are_parallel_to_z_and_their_side_says_which_way(model: MotorModel) -> None:
    for bolt in model.bolts:
        sign = 1.0 if bolt.side is Side.TOP else -1.0
        np.testing.assert_allclose(bolt.axis, (0, 0, sign), atol=1e-12)
        assert bolt.motor_from_bolt.target == "motor"
        assert bolt.motor_from_bolt.source == "bolt"
        if bolt.spec.id is None:
            assert bolt.id.startswith("T" if bolt.side is Side.TOP else "B")


def law_no_two_solids_are_in_the_same_place(model: MotorModel) -> None:
    boxes = [bounds_mm([solid]) for solid in model.parts]
    bodies = [manifold_of(solid) for solid in model.parts]
    for i in range(len(bodies)):
        for j in range(i):
            if (boxes[i][0] < boxes[j][1]).all() and (boxes[j][0] < boxes[i][1]).all():
                shared = (bodies[i] ^ bodies[j]).volume()
                assert shared < TOUCH_MM3, (
                    f"{model.parts[i].name} and {model.parts[j].name}: {shared:.3f} mm3"
                )


def law_some_of_every_head_can_be_seen(model: MotorModel) -> None:
    """A head under which something else fills the counterbore would be no bolt for anyone."""
    caster = RayCaster(model.parts)
    index = {solid.bolt_id: row for row, solid in enumerate(model.parts)}
    for bolt in model.bolts:
        # a ring of rays from a little above the head down onto its rim
        angles = np.radians(np.arange(0, 360, 30))
        ring = 0.42 * bolt.across_mm * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        above = np.column_stack([ring, np.full(len(ring), 2.0)])
        down = np.tile(-bolt.axis, (len(ring), 1))
        hits = caster.first_hits(bolt.motor_from_bolt.apply(above), down)
        assert (hits.solid_index == index[bolt.id]).all(), bolt.id


def law_the_frame_is_the_motors(model: MotorModel) -> None:
    # bolts and what looks like them stand out by studs and heads: the bodies alone are measured
    bare = build_motor(model.spec.model_copy(update={"bolts": (), "distractors": ()}))
    outside = (Part.ELECTRICAL_CONNECTOR, Part.BOLT)
    low, high = bounds_mm([solid for solid in bare.parts if solid.part not in outside])
    # the drawing's length counts, and rounded hubs end a little before it
    assert abs(low[2] + high[2]) <= 1, "the origin is half way along"
    housing = bounds_mm(model.parts_of(Part.MAIN_HOUSING))
    connector = bounds_mm(model.parts_of(Part.CONNECTOR))
    assert housing.mean(axis=0)[2] < connector.mean(axis=0)[2], "z goes towards the connector"
    if model.spec.solenoid is not None:
        can = bounds_mm(model.parts_of(Part.SOLENOID)).mean(axis=0)
        assert can[1] > 0.8 * model.spec.solenoid.offset_mm
        assert abs(can[0]) < 0.1 * can[1]


def law_a_specification_survives_json_and_builds_the_same_motor(first: MotorModel) -> None:
    again = MotorSpec.model_validate_json(first.spec.model_dump_json())
    assert again == first.spec
    second = build_motor(again)
    assert [solid.name for solid in first.parts] == [solid.name for solid in second.parts]
    for one, two in zip(first.parts, second.parts, strict=True):
        assert one.vertices.tobytes() == two.vertices.tobytes(), one.name
        assert one.faces.tobytes() == two.faces.tobytes(), one.name
    for here, there in zip(first.bolts, second.bolts, strict=True):
        assert here.motor_from_bolt.matrix.tobytes() == there.motor_from_bolt.matrix.tobytes()


LAWS = (
    law_every_part_is_a_watertight_solid,
    law_names_classes_and_bolts_agree,
    law_a_true_bolt_is_where_its_head_is,
    law_the_heads_volume_is_balanced_about_the_axis,
    law_bolts_are_parallel_to_z_and_their_side_says_which_way,
    law_no_two_solids_are_in_the_same_place,
    law_some_of_every_head_can_be_seen,
    law_the_frame_is_the_motors,
    law_a_specification_survives_json_and_builds_the_same_motor,
)


@pytest.mark.parametrize("drawn", POOL, ids=lambda drawn: drawn[0])
@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__.removeprefix("law_"))
def test_laws(law: Callable[[MotorModel], None], drawn: tuple[str, int]) -> None:
    law(motor(*drawn))


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 2**31 - 1))
def test_laws_for_any_seed(family: str, seed: int) -> None:
    model = build_motor(spec_of(family, seed))
    for law in LAWS:
        law(model)


@settings(max_examples=2, deadline=None)
@given(drawn=MOTORS, seed=st.integers(0, 99))
def test_wear_is_shallow_watertight_and_leaves_the_truth(drawn: tuple[str, int], seed: int) -> None:
    new = motor(*drawn)
    worn = wear_motor(new, sample_wear(np.random.default_rng(seed)), seed)
    again = wear_motor(new, sample_wear(np.random.default_rng(seed)), seed)
    for one, two in zip(worn.parts, again.parts, strict=True):
        assert one.vertices.tobytes() == two.vertices.tobytes(), one.name
    for before, after in zip(new.parts, worn.parts, strict=False):
        assert (before.name, before.part, before.bolt_id) == (after.name, after.part, after.bolt_id)
        # crust, dirt and grease lumps of their own: no part grows by more than that
        np.testing.assert_allclose(
            bounds_mm([after]), bounds_mm([before]), atol=2.5, err_msg=before.name
        )
    frames = {bolt.id: bolt.motor_from_bolt.matrix for bolt in new.bolts}
    for bolt in worn.bolts:
        np.testing.assert_array_equal(bolt.motor_from_bolt.matrix, frames[bolt.id])
    for solid in worn.parts:
        directed = solid.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        forth = np.unique(directed, axis=0)
        np.testing.assert_array_equal(forth, np.unique(directed[:, ::-1], axis=0), solid.name)


@settings(max_examples=3, deadline=None)
@given(drawn=MOTORS, seed=st.integers(0, 99))
def test_labels_of_a_view_are_those_of_the_nearest_surface(
    drawn: tuple[str, int], seed: int
) -> None:
    model = motor(*drawn)
    rng = np.random.default_rng(seed)
    outward = rng.normal(size=3)
    outward /= np.linalg.norm(outward)
    right = np.cross(-outward, rng.normal(size=3))
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(-outward, right), -outward], axis=1)
    motor_from_camera = Transform.from_parts("motor", "camera", rotation, 600 * outward)
    config = StructuredLightConfig(camera=PinholeCamera(width=120, height=120, focal_px=240))

    view = capture_view(model.parts, motor_from_camera, config.noiseless(), rng)

    assert len(view.pixels) > 300
    some = rng.permutation(len(view.pixels))[:100]
    points = motor_from_camera.apply(view.points()[some])
    labels = view.labels.reshape(-1)[view.pixels[some]]
    distances = np.stack([distance_mm(points, solid) for solid in model.parts], axis=1)
    nearest = distances.min(axis=1)
    assert nearest.max() < 1e-3, "with all noise off the cloud lies on the mesh within 1 um"
    of_class = np.array([int(solid.part) for solid in model.parts])
    own = np.where(of_class[None] == labels[:, None], distances, np.inf).min(axis=1)
    # where two classes touch both are nearest
    assert (own - nearest).max() < 1e-3


def distance_mm(points: FloatArray, solid: SolidPart) -> FloatArray:
    """Exact distances (N,) to a mesh, 1e3 beyond a few mm; written apart from what is tested."""
    result = np.full(len(points), 1e3)
    low, high = bounds_mm([solid])
    near = np.flatnonzero(((points > low - 1) & (points < high + 1)).all(axis=1))
    corners = solid.vertices[solid.faces]
    for chunk in np.array_split(near, max(1, len(near) // 200)):
        if len(chunk):
            result[chunk] = _triangle_distance(points[chunk, None], corners[None]).min(axis=1)
    return result


def _triangle_distance(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Distance of every point (P, 1, 3) to every triangle (1, T, 3, 3), shape (P, T)."""
    a, b, c = corners[..., 0, :], corners[..., 1, :], corners[..., 2, :]
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=-1)
    height = np.einsum("ptk,ptk->pt", points - a, np.broadcast_to(normal, (1, *normal.shape[1:])))
    inside = np.ones(height.shape, dtype=np.bool_)
    best = np.full(height.shape, np.inf)
    for one, two in pairwise((a, b, c, a)):
        edge = two - one
        inside &= np.einsum("ptk,ptk->pt", np.cross(edge, points - one), normal + 0 * points) >= 0
        along = np.einsum("ptk,ptk->pt", points - one, edge + 0 * points)
        share = np.clip(along / np.maximum((edge**2).sum(-1), 1e-18), 0, 1)
        best = np.minimum(best, np.linalg.norm(points - one - share[..., None] * edge, axis=-1))
    return np.where(inside & (length > 1e-9), np.abs(height) / np.maximum(length, 1e-9), best)
