"""The panel's logic, without Blender."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from boltpose.blender.fields import (
    PANEL_FIELDS,
    Kind,
    limits_of,
    show_dimensions,
    values_from,
)
from boltpose.blender.panel import (
    AS_DRAWN,
    PLAIN,
    Dimensions,
    PanelValues,
    dimensions_of,
    drawn_spec,
    model_of,
    showing,
    spec_of,
    with_dimensions,
)
from boltpose.errors import BoltposeError, ConfigError, InputFileError
from boltpose.factory.families import FAMILIES
from boltpose.factory.spec import GearboxSpec, HousingSpec, MotorSpec
from boltpose.factory.spec_fasteners import BoltSpec, HeadKind, Site


def test_importing_the_add_on_imports_nothing_heavy() -> None:
    code = (
        "import sys, boltpose.blender as b; assert b.bl_info['blender'] >= (4, 2, 0)\n"
        "assert not {'bpy', 'numpy', 'manifold3d', 'pydantic'} & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_every_value_has_one_field_and_every_field_one_value() -> None:
    names = [field.name for field in PANEL_FIELDS]
    wanted = {field.name for field in fields(PanelValues)} - {"dimensions"}
    wanted |= {field.name for field in fields(Dimensions)}
    assert len(set(names)) == len(names)
    assert set(names) == wanted
    for field in PANEL_FIELDS:
        assert field.description
        assert (field.kind is Kind.CHOICE) == bool(field.choices)
        if field.choices:
            assert field.default() in field.choices
        if field.limits is not None:
            assert field.limits[0] <= field.default() <= field.limits[1]
        assert field.shown_if is None or field.shown_if in names


def test_limits_are_those_of_the_specification() -> None:
    assert limits_of(HousingSpec, "radius_mm") == (15, 90)
    assert limits_of(HousingSpec, "ovality_mm") == (0, 2)


def test_values_go_through_a_holder_unchanged() -> None:
    holder = SimpleNamespace(**{field.name: field.default() for field in PANEL_FIELDS})
    assert values_from(holder) == PanelValues()
    shown = replace(PanelValues(), dimensions=Dimensions(yoke_length_mm=123, bolt_heads="hex"))
    show_dimensions(shown, lambda name, value: setattr(holder, name, value))
    assert values_from(holder) == shown


@pytest.mark.parametrize("family", [PLAIN, FAMILIES[0], "motorcycle"])
def test_own_dimensions_left_alone_give_the_drawn_motor(family: str) -> None:
    values = PanelValues(family=family, seed=5)
    drawn = drawn_spec(values)
    # as Blender's float32 hands them back
    shown = showing(values).dimensions
    rounded = replace(
        shown,
        yoke_radius_mm=shown.yoke_radius_mm + 3e-6,
        nose_length_mm=shown.nose_length_mm - 4e-6,
    )
    assert with_dimensions(drawn, shown) == drawn
    assert with_dimensions(drawn, rounded) == drawn
    assert spec_of(replace(values, dimensions=Dimensions(yoke_radius_mm=99))) == drawn


def test_dimensions_are_what_the_specification_then_says() -> None:
    wanted = Dimensions(
        yoke_radius_mm=41, yoke_length_mm=130, has_gearbox=True, gearbox_length_mm=30,
        nose_style="open", nose_length_mm=60, solenoid_radius_mm=27, solenoid_length_mm=80,
        solenoid_offset_mm=75, pinion_teeth=12,
    )  # fmt: skip
    assert dimensions_of(with_dimensions(MotorSpec(), wanted)) == wanted


def test_what_stands_around_the_yoke_moves_with_its_mantle() -> None:
    bolts = (
        BoltSpec(site=Site.REAR_CAP, radius_mm=45, angle_deg=0),
        BoltSpec(site=Site.REAR_CAP, radius_mm=10, angle_deg=0),
        BoltSpec(site=Site.SOLENOID_FRONT, radius_mm=18, angle_deg=0),
    )
    spec = MotorSpec(bolts=bolts, gearbox=GearboxSpec())
    wider = with_dimensions(spec, replace(dimensions_of(spec), yoke_radius_mm=42))
    assert [bolt.radius_mm for bolt in wider.bolts] == [50, 10, 18]
    assert wider.bracket.radius_mm == spec.bracket.radius_mm + 5
    assert [ear.reach_mm for ear in wider.bracket.ears] == [63, 63]
    assert wider.gearbox is not None
    assert wider.gearbox.radius_mm == GearboxSpec().radius_mm + 5
    assert wider.solenoid is not None
    assert wider.solenoid.offset_mm == 70


def test_without_a_solenoid_its_bolts_go_too() -> None:
    bolts = (
        BoltSpec(site=Site.SOLENOID_FRONT, radius_mm=18, angle_deg=0),
        BoltSpec(site=Site.REAR_CAP, radius_mm=25, angle_deg=90),
    )
    spec = MotorSpec(bolts=bolts)
    bare = with_dimensions(spec, replace(dimensions_of(spec), has_solenoid=False))
    assert bare.solenoid is None
    assert bare.bolts == bolts[1:]


def test_one_kind_of_head_for_all_bolts_takes_the_standards_sizes() -> None:
    bolts = (BoltSpec(site=Site.REAR_CAP, radius_mm=25, angle_deg=90, across_mm=9),)
    spec = MotorSpec(bolts=bolts)
    dimensions = dimensions_of(spec)
    assert dimensions.bolt_heads == AS_DRAWN
    changed = with_dimensions(spec, replace(dimensions, bolt_heads="torx_pan"))
    assert changed.bolts[0].head is HeadKind.TORX_PAN
    assert changed.bolts[0].across_mm is None


@pytest.mark.parametrize("family", FAMILIES[:1])
def test_a_longer_yoke_can_be_built(family: str) -> None:
    values = showing(PanelValues(family=family))
    longer = replace(values.dimensions, yoke_length_mm=values.dimensions.yoke_length_mm + 12)
    model = model_of(replace(values, by_hand=True, dimensions=longer))
    assert model.bolts


def test_what_cannot_be_is_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="radius_mm"):
        spec_of(PanelValues(by_hand=True, dimensions=Dimensions(yoke_radius_mm=500)))
    with pytest.raises(BoltposeError, match="solenoid"):
        model_of(PanelValues(by_hand=True, dimensions=Dimensions(solenoid_offset_mm=30)))
    with pytest.raises(ConfigError, match="family must be one of"):
        drawn_spec(PanelValues(family="window_lift"))
    with pytest.raises(InputFileError, match="nothing"):
        drawn_spec(PanelValues(spec_file=str(tmp_path / "nothing.json")))


def test_a_file_takes_the_place_of_family_and_seed(tmp_path: Path) -> None:
    spec = MotorSpec(name="mine")
    path = tmp_path / "mine.json"
    path.write_text(spec.model_dump_json())
    assert drawn_spec(PanelValues(spec_file=str(path), family=FAMILIES[0], seed=4)) == spec
