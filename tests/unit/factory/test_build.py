"""Motors as solids: watertight, disjoint, named, refused where they cannot be."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pytest
import trimesh

from boltpose.errors import ConfigError
from boltpose.factory.build import build_motor
from boltpose.factory.checks import BoltPlaceError
from boltpose.factory.families import FAMILIES, sample_model
from boltpose.factory.model import MotorModel, bounds_mm
from boltpose.factory.solids import boxes_touch, manifold_of
from boltpose.factory.spec import (
    BracketSpec,
    GearboxSpec,
    GearSpec,
    MotorSpec,
    NoseSpec,
    RearCapSpec,
    SolenoidSpec,
)
from boltpose.factory.spec_fasteners import BoltSpec, Site
from boltpose.schema import Part

CAP_BOLT = BoltSpec(site=Site.REAR_CAP, radius_mm=28, angle_deg=200)


@pytest.fixture(scope="module", params=["direct_open", "offset_coaxial", "motorcycle"])
def model(request: pytest.FixtureRequest) -> MotorModel:
    return sample_model(np.random.default_rng(3), request.param)


def test_parts_are_watertight(model: MotorModel) -> None:
    for part in model.parts:
        mesh = trimesh.Trimesh(part.vertices, part.faces, process=False)
        assert mesh.is_watertight, part.name
        assert mesh.volume > 0, part.name


def test_parts_are_disjoint(model: MotorModel) -> None:
    bodies = [(part.name, manifold_of(part)) for part in model.parts]
    for (name, body), (other_name, other) in combinations(bodies, 2):
        if boxes_touch(body, other):
            assert (body ^ other).volume() < 0.01, f"{name} in {other_name}"


def test_castings_are_in_one_piece(model: MotorModel) -> None:
    for part in model.parts:
        if part.part in (Part.CONNECTOR, Part.MAIN_HOUSING):
            assert len(manifold_of(part).decompose()) == 1, part.name


def test_the_origin_is_half_way_along_the_motor(model: MotorModel) -> None:
    solids = [
        part for part in model.parts if part.part not in (Part.ELECTRICAL_CONNECTOR, Part.BOLT)
    ]
    low, high = bounds_mm(solids)[:, 2]
    # the shape of a rib or a dome may stand a little out of the stations
    assert abs(low + high) / 2 < 2.5


def test_the_same_specification_gives_the_same_bits(model: MotorModel) -> None:
    again = build_motor(MotorSpec.model_validate_json(model.spec.model_dump_json()))
    assert [part.name for part in again.parts] == [part.name for part in model.parts]
    for first, second in zip(model.parts, again.parts, strict=True):
        np.testing.assert_array_equal(first.vertices, second.vertices)
        np.testing.assert_array_equal(first.faces, second.faces)


def test_the_default_motor_has_every_class_but_bolts() -> None:
    classes = {part.part for part in build_motor(MotorSpec()).parts}
    assert classes == set(Part) - {Part.BACKGROUND, Part.BOLT}


def test_ids_count_by_side_and_angle_and_own_ids_stay() -> None:
    bolts = (
        BoltSpec(site=Site.REAR_CAP, radius_mm=28, angle_deg=300),
        BoltSpec(site=Site.REAR_CAP, radius_mm=28, angle_deg=20),
        BoltSpec(site=Site.BRACKET_FRONT, radius_mm=46, angle_deg=-40, id="B1"),
        BoltSpec(site=Site.REAR_CAP, radius_mm=28, angle_deg=140, state="missing"),
    )
    model = build_motor(MotorSpec(bolts=bolts))
    ids = {bolt.id: bolt.spec.angle_deg for bolt in model.bolts}
    assert ids == {"B1": -40, "B2": 20, "B3": 300}


def test_a_missing_bolt_leaves_its_hole() -> None:
    plain, holed = (
        build_motor(MotorSpec(bolts=(CAP_BOLT.model_copy(update={"state": state}),)))
        for state in ("present", "missing")
    )
    assert holed.bolts == ()
    cap = {part.name: part for part in plain.parts}["main_housing_rear_cap"]
    same = {part.name: part for part in holed.parts}["main_housing_rear_cap"]
    np.testing.assert_array_equal(cap.vertices, same.vertices)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"solenoid": SolenoidSpec(offset_mm=50)}, "solenoid.offset_mm"),
        ({"gear": GearSpec(module_mm=4)}, "gear.module_mm"),
        ({"gear": GearSpec(clutch_radius_mm=40)}, "gear.clutch_radius_mm"),
        ({"gear": GearSpec(width_mm=44)}, "gear.width_mm"),
        (
            {"bracket": BracketSpec(nose=NoseSpec(radius_mm=24, tip_radius_mm=30))},
            "bracket.nose.tip_radius_mm",
        ),
        ({"bracket": BracketSpec(flange_mm=29, body_length_mm=20)}, "bracket.flange_mm"),
        ({"bracket": BracketSpec(nose=NoseSpec(length_mm=9))}, "bracket.nose.length_mm"),
        (
            {"bolts": (CAP_BOLT, CAP_BOLT.model_copy(update={"angle_deg": 205}))},
            r"bolts\[1\]: .* mm beside bolts\[0\]",
        ),
        (
            {"bolts": (CAP_BOLT.model_copy(update={"id": "A"}),) * 2},
            "the id A is given twice",
        ),
        ({"bolts": (CAP_BOLT.model_copy(update={"site": Site.YOKE}),)}, r"bolts\[0\].*yoke"),
        (
            {
                "solenoid": None,
                "bolts": (CAP_BOLT.model_copy(update={"site": Site.SOLENOID_CAP}),),
            },
            r"bolts\[0\].*without solenoid",
        ),
        (
            {
                "gearbox": GearboxSpec(),
                "bolts": (BoltSpec(site=Site.GEARBOX_REAR, radius_mm=38, angle_deg=-90),),
            },
            r"bolts\[0\].*inside main_housing_yoke",
        ),
        (
            {
                "rear_cap": RearCapSpec(style="spider", openings=4),
                "bolts": (BoltSpec(site=Site.SOLENOID_CAP, radius_mm=12, angle_deg=60),),
            },
            r"bolts\[0\].*electrical_connector_stud_1",
        ),
    ],
)
def test_what_cannot_be_is_refused_with_its_field(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words) as caught:
        build_motor(MotorSpec().model_copy(update=changes))
    assert "\n" not in str(caught.value)


def test_a_nose_that_is_straight_to_its_front_wall_is_whole() -> None:
    nose = NoseSpec(straight=0.8, wall_mm=7, tip_radius_mm=27, radius_mm=30, length_mm=50)
    gear = GearSpec(width_mm=12, clutch_radius_mm=16)
    model = build_motor(MotorSpec(bracket=BracketSpec(nose=nose), gear=gear))
    low, high = bounds_mm(model.parts_of(Part.CONNECTOR))
    assert np.isfinite((low, high)).all()
    assert high[2] - low[2] > 70


def test_a_misplaced_bolt_tells_its_index() -> None:
    bolts = (CAP_BOLT, CAP_BOLT.model_copy(update={"angle_deg": 203}))
    with pytest.raises(BoltPlaceError) as caught:
        build_motor(MotorSpec(bolts=bolts))
    assert caught.value.index == 1


def test_families_are_known_to_the_command_line() -> None:
    assert len(set(FAMILIES)) >= 12
