"""The add-on in headless Blender: what it adds, what it writes, what it leaves behind."""

from __future__ import annotations

import json
from pathlib import Path

import bpy
import numpy as np
import pytest
import yaml

import boltpose.blender
from boltpose.blender import scene_objects as keys
from boltpose.blender.extension import pack_extension
from boltpose.blender.panel import PanelValues, model_of
from boltpose.factory.families import FAMILIES
from boltpose.factory.model import MotorModel, bounds_mm
from boltpose.factory.spec import MotorSpec
from boltpose.io.mesh import read_mesh
from boltpose.schema import Part

FAMILY = FAMILIES[0]
METRES_PER_MM = 0.001


def add(**settings: object) -> bpy.types.Object:
    """Run the operator as the menu does; the empty of the new motor."""
    assert bpy.ops.mesh.boltpose_starter_motor_add(**settings) == {"FINISHED"}
    return bpy.context.object


def parts_of(motor: bpy.types.Object) -> dict[str, bpy.types.Object]:
    return {child[keys.NAME_KEY]: child for child in motor.children if keys.CLASS_KEY in child}


def bolts_of(motor: bpy.types.Object) -> dict[str, bpy.types.Object]:
    return {
        child[keys.BOLT_ID_KEY]: child for child in motor.children if keys.BOLT_SPEC_KEY in child
    }


def vertices_mm(item: bpy.types.Object) -> np.ndarray:
    flat = np.zeros(3 * len(item.data.vertices), dtype=np.float32)
    item.data.vertices.foreach_get("co", flat)
    return flat.reshape(-1, 3).astype(np.float64) / METRES_PER_MM


def census() -> dict[str, int]:
    """How many data blocks of each kind the file holds."""
    kinds = ("objects", "meshes", "materials", "collections", "node_groups", "images")
    return {kind: len(getattr(bpy.data, kind)) for kind in kinds}


def registered() -> set[str]:
    return {name for name in dir(bpy.types) if "boltpose" in name.lower()}


def test_importing_the_package_imports_nothing_heavy() -> None:
    import subprocess
    import sys

    code = (
        "import sys, boltpose.blender as b; assert b.bl_info['blender'] >= (4, 2, 0)\n"
        "heavy = {'bpy', 'numpy', 'manifold3d', 'pydantic', 'trimesh'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_register_and_unregister_leave_nothing_and_can_be_repeated(empty_scene: None) -> None:
    before = census(), registered()
    menus = [bpy.types.VIEW3D_MT_mesh_add, bpy.types.TOPBAR_MT_file_export]
    draws = [len(menu._dyn_ui_initialize()) for menu in menus]
    for _ in range(2):
        boltpose.blender.register()
        assert len(registered()) == len(before[1]) + 3
        assert hasattr(bpy.types, "VIEW3D_PT_boltpose")
        boltpose.blender.unregister()
    assert (census(), registered()) == before
    assert [len(menu._dyn_ui_initialize()) for menu in menus] == draws


def test_blender_enables_and_disables_it_as_an_add_on(empty_scene: None) -> None:
    import addon_utils  # there is none before bpy

    module = addon_utils.enable("boltpose.blender")
    assert module is boltpose.blender
    assert addon_utils.check("boltpose.blender")[1]
    addon_utils.disable("boltpose.blender")
    assert not hasattr(bpy.types, "VIEW3D_PT_boltpose")


def assert_shows(motor: bpy.types.Object, model: MotorModel) -> None:
    """Objects, meshes and frames are the model's."""
    parts, bolts = parts_of(motor), bolts_of(motor)
    assert sorted(parts) == sorted(solid.name for solid in model.parts)
    assert sorted(bolts) == sorted(bolt.id for bolt in model.bolts)
    assert len(motor.children) == len(model.parts) + len(model.bolts)
    for solid in model.parts:
        item = parts[solid.name]
        assert item[keys.CLASS_KEY] == solid.part
        assert [slot.name for slot in item.data.materials] == [
            f"boltpose {str(solid.material).replace('_', ' ')}"
        ]
        np.testing.assert_allclose(vertices_mm(item), solid.vertices, atol=2e-5)
        faces = [tuple(polygon.vertices) for polygon in item.data.polygons]
        np.testing.assert_array_equal(faces, solid.faces)
        assert not item.data.validate(), f"{solid.name}: Blender had to repair the mesh"
    for bolt in model.bolts:
        matrix = np.array(bolts[bolt.id].matrix_local)
        wanted = bolt.motor_from_bolt.matrix.copy()
        wanted[:3, 3] *= METRES_PER_MM
        np.testing.assert_allclose(matrix, wanted, atol=1e-6)


@pytest.mark.parametrize("family", FAMILIES)
def test_the_operator_adds_the_motor_that_the_factory_builds(addon: None, family: str) -> None:
    motor = add(family=family, seed=3)
    model = model_of(PanelValues(family=family, seed=3))

    assert motor.type == "EMPTY"
    assert MotorSpec.model_validate_json(motor[keys.SPEC_KEY]) == model.spec
    assert_shows(motor, model)
    size = max(max(item.dimensions) for item in parts_of(motor).values())
    assert 0.05 < size < 0.5, "metres"


def test_a_bolts_arrow_points_out_of_its_head(addon: None) -> None:
    motor = add(family=FAMILY, seed=0)
    bpy.context.view_layer.update()
    parts, bolts = parts_of(motor), bolts_of(motor)
    assert bolts
    for name, item in parts.items():
        if item[keys.CLASS_KEY] != Part.BOLT:
            continue
        empty = bolts[item[keys.BOLT_ID_KEY]]
        assert empty.empty_display_type == "SINGLE_ARROW"
        bolt_from_motor = np.linalg.inv(np.array(empty.matrix_local))
        seen = vertices_mm(item) * METRES_PER_MM @ bolt_from_motor[:3, :3].T
        heights = seen[:, 2] + bolt_from_motor[2, 3]
        assert abs(heights.max()) < 1e-6, f"{name}: nothing of a bolt is above its head_top"


def test_other_settings_give_another_mesh_and_the_same_ones_the_same(addon: None) -> None:
    first = add(family=FAMILY, seed=0)
    again = add(family=FAMILY, seed=0)
    other = add(family=FAMILY, seed=1)
    same = [
        np.array_equal(vertices_mm(item), vertices_mm(parts_of(again)[name]))
        for name, item in parts_of(first).items()
    ]
    assert all(same)
    names = set(parts_of(first)) & set(parts_of(other))
    assert any(
        vertices_mm(parts_of(first)[name]).shape != vertices_mm(parts_of(other)[name]).shape
        or not np.array_equal(
            vertices_mm(parts_of(first)[name]), vertices_mm(parts_of(other)[name])
        )
        for name in names
    )
    assert again.name == f"{first.name}.001"
    assert again[keys.SPEC_KEY] == first[keys.SPEC_KEY]


def test_own_dimensions_count_only_when_switched_on(addon: None) -> None:
    drawn = add(family="plain", yoke_length_mm=150)
    own = add(family="plain", yoke_length_mm=150, by_hand=True)

    def length(motor: bpy.types.Object) -> float:
        return float(MotorSpec.model_validate_json(motor[keys.SPEC_KEY]).housing.length_mm)

    assert (length(drawn), length(own)) == (95, 150)
    assert max(item.dimensions.z for item in parts_of(own).values()) > 0.14


def test_wear_changes_the_surface_and_not_the_bolt_frames(addon: None) -> None:
    new, worn = add(family=FAMILY), add(family=FAMILY, worn=True)
    assert_shows(worn, model_of(PanelValues(family=FAMILY, worn=True)))
    for name, empty in bolts_of(worn).items():
        before = bolts_of(new).get(name)
        if before is not None:
            np.testing.assert_allclose(
                np.array(empty.matrix_local), np.array(before.matrix_local), atol=1e-6
            )


def test_a_motor_from_a_file(addon: None, tmp_path: Path) -> None:
    spec = MotorSpec(name="bench_7")
    path = tmp_path / "motor.json"
    path.write_text(spec.model_dump_json())
    motor = add(spec_file=str(path), family=FAMILY, seed=9)
    assert motor.name == "bench_7"
    assert MotorSpec.model_validate_json(motor[keys.SPEC_KEY]) == spec


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"family": "plain", "by_hand": True, "yoke_radius_mm": 80, "solenoid_offset_mm": 21},
            "solenoid",
        ),
        ({"spec_file": "/nowhere/motor.json"}, "/nowhere/motor.json: found"),
    ],
)
def test_an_impossible_motor_is_refused_in_one_line_and_nothing_is_added(
    addon: None, settings: dict[str, object], message: str
) -> None:
    before = census()
    with pytest.raises(RuntimeError, match=message) as refusal:
        bpy.ops.mesh.boltpose_starter_motor_add(**settings)
    assert str(refusal.value).strip().startswith("Error: ")
    assert len(str(refusal.value).strip().splitlines()) == 1
    assert census() == before


def test_a_failure_half_way_leaves_nothing(addon: None, monkeypatch: pytest.MonkeyPatch) -> None:
    from boltpose.blender import operators

    model = model_of(PanelValues(family=FAMILY))
    broken = list(model.parts)
    broken[-1] = "not a solid"  # type: ignore[call-overload]
    before = census()

    class Half:
        spec, parts, bolts = model.spec, tuple(broken), model.bolts

    with pytest.raises(AttributeError):
        operators.add_motor(bpy.context, Half)
    assert census() == before


def test_the_scenes_unit_scale_is_honoured(addon: None) -> None:
    metres = max(item.dimensions.z for item in parts_of(add(family="plain")).values())
    bpy.context.scene.unit_settings.scale_length = 0.001
    millimetres = max(item.dimensions.z for item in parts_of(add(family="plain")).values())
    assert millimetres == pytest.approx(1000 * metres, rel=1e-5)


@pytest.mark.parametrize("moved", [False, True])
def test_a_motor_read_back_is_the_one_that_was_added(addon: None, moved: bool) -> None:
    motor = add(family=FAMILY, seed=2)
    if moved:
        motor.location = (1.0, -2.0, 0.5)
        motor.rotation_euler = (0.3, 1.1, -0.7)
    model = model_of(PanelValues(family=FAMILY, seed=2))
    read = keys.model_from(bpy.context, motor)

    assert read.spec == model.spec
    for mine, wanted in zip(read.parts, model.parts, strict=True):
        assert (mine.name, mine.part, mine.material, mine.bolt_id) == (
            wanted.name, wanted.part, wanted.material, wanted.bolt_id,
        )  # fmt: skip
        np.testing.assert_array_equal(mine.faces, wanted.faces)
        # float32 metres, two metres from the origin
        np.testing.assert_allclose(mine.vertices, wanted.vertices, atol=2e-3 if moved else 2e-5)
    for mine, wanted in zip(read.bolts, model.bolts, strict=True):
        assert (mine.id, mine.side, mine.spec) == (wanted.id, wanted.side, wanted.spec)
        np.testing.assert_allclose(
            mine.motor_from_bolt.matrix, wanted.motor_from_bolt.matrix, atol=2e-3
        )


def test_what_a_person_moved_is_exported_where_it_is(addon: None) -> None:
    motor = add(family=FAMILY, seed=2)
    item = next(iter(parts_of(motor).values()))
    before = keys.model_from(bpy.context, motor)
    item.location.x += 0.005
    after = keys.model_from(bpy.context, motor)
    shifts = {
        new.name: (new.vertices - old.vertices).mean(axis=0)
        for new, old in zip(after.parts, before.parts, strict=True)
    }
    np.testing.assert_allclose(shifts.pop(item[keys.NAME_KEY]), (5, 0, 0), atol=1e-3)
    assert all(np.abs(shift).max() == 0 for shift in shifts.values())


def test_export_writes_meshes_names_and_bolts(addon: None, tmp_path: Path) -> None:
    motor = add(family=FAMILY, seed=2)
    model = model_of(PanelValues(family=FAMILY, seed=2))
    assert bpy.ops.export_scene.boltpose_motor(directory=str(tmp_path / "out")) == {"FINISHED"}

    def path(suffix: str) -> Path:
        return tmp_path / "out" / f"{model.spec.name}{suffix}"

    assert MotorSpec.model_validate_json(path(".spec.json").read_text()) == model.spec
    classes = yaml.safe_load(path(".parts.yaml").read_text())
    assert classes == {solid.name: solid.part.name.lower() for solid in model.parts}
    bolts = json.loads(path(".bolts.json").read_text())["bolts"]
    assert [bolt["id"] for bolt in bolts] == [bolt.id for bolt in model.bolts]
    for written, bolt in zip(bolts, model.bolts, strict=True):
        frame = np.array(written["motor_from_bolt"])
        np.testing.assert_allclose(frame, bolt.motor_from_bolt.matrix, atol=1e-4)
    meshes = {mesh.name: mesh for mesh in read_mesh(path(".glb"))}
    assert set(meshes) == {solid.name for solid in model.parts}
    for solid in model.parts:
        low, high = meshes[solid.name].vertices.min(axis=0), meshes[solid.name].vertices.max(axis=0)
        np.testing.assert_allclose([low, high], bounds_mm([solid]), atol=1e-3)
    (whole,) = read_mesh(path(".stl"))
    corners = [whole.vertices.min(axis=0), whole.vertices.max(axis=0)]
    np.testing.assert_allclose(corners, bounds_mm(model.parts), atol=1e-3)
    assert motor.name in bpy.data.objects


def test_a_folder_that_cannot_be_written_is_refused_in_one_line(
    addon: None, tmp_path: Path
) -> None:
    add(family=FAMILY)
    (tmp_path / "file").write_text("not a folder")
    with pytest.raises(RuntimeError, match="file"):
        bpy.ops.export_scene.boltpose_motor(directory=str(tmp_path / "file"))


def test_export_needs_a_motor(addon: None) -> None:
    assert not bpy.ops.export_scene.boltpose_motor.poll()
    motor = add(family=FAMILY)
    bpy.context.view_layer.objects.active = motor.children[0]
    assert bpy.ops.export_scene.boltpose_motor.poll()


def test_the_sidebar_says_what_is_selected(addon: None) -> None:
    from boltpose.blender.sidebar import description

    assert description(None) == ("No motor is selected",)
    motor = add(family=FAMILY)
    bolt = next(item for item in motor.children if item.get(keys.CLASS_KEY) == int(Part.BOLT))
    lines = description(bolt)
    assert lines[0] == f"Motor: {motor.name}"
    assert lines[1] == f"Bolts: {len(bolts_of(motor))}"
    assert lines[2] == "Class: bolt"


def test_blender_installs_the_extension(empty_scene: None, tmp_path: Path) -> None:
    import addon_utils  # there is none before bpy

    target = tmp_path / "boltpose.zip"
    pack_extension(target)
    repo = bpy.context.preferences.extensions.repos.new(
        name="test", module="boltpose_test", custom_directory=str(tmp_path / "repo")
    )
    try:
        done = bpy.ops.extensions.package_install_files(
            filepath=str(target), repo=repo.module, enable_on_install=True
        )
        assert done == {"FINISHED"}
        assert hasattr(bpy.types, "VIEW3D_PT_boltpose")
        assert add(family="plain").name.startswith("motor")
        addon_utils.disable(f"bl_ext.{repo.module}.boltpose")
        assert not hasattr(bpy.types, "VIEW3D_PT_boltpose")
    finally:
        bpy.context.preferences.extensions.repos.remove(repo)
