"""A motor as Blender objects, and Blender objects as a motor again.

Blender counts metres (times the scene's unit scale), the factory mm: meshes and empties are
scaled on the way in and out, objects themselves keep scale 1.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.blender.api import bpy, mathutils
from boltpose.errors import ConfigError
from boltpose.factory.looks import LOOKS, PART_COLORS
from boltpose.factory.model import Material, MotorModel, SolidPart, TrueBolt
from boltpose.factory.spec import MotorSpec
from boltpose.factory.spec_fasteners import BoltSpec
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part, Side

SPEC_KEY = "boltpose_spec"
"""On the motor's empty: its `MotorSpec` as JSON."""
CLASS_KEY = "boltpose_class"
"""On a part: the number of its class, a `Part`."""
NAME_KEY = "boltpose_name"
"""On a part: its name in the model; Blender appends `.001` to names that are taken."""
MATERIAL_KEY = "boltpose_material"
BOLT_ID_KEY = "boltpose_bolt"
"""On a bolt's empty, and on the part that is its head and shank."""
BOLT_SPEC_KEY = "boltpose_bolt_spec"
SIDE_KEY = "boltpose_side"
ACROSS_KEY = "boltpose_across_mm"
DIAMETER_KEY = "boltpose_head_diameter_mm"
HEIGHT_KEY = "boltpose_head_height_mm"
ORDER_KEY = "boltpose_order"
"""Blender sorts objects by name; this is their order in the model."""

_SMOOTH_BELOW_RAD = math.radians(30)


def units_per_mm(scene: Any) -> float:
    """How many Blender units a millimetre is: 0.001 unless the scene's unit scale is changed."""
    return 0.001 / float(scene.unit_settings.scale_length)


def add_motor(context: Any, model: MotorModel) -> Any:
    """Add a motor at the 3D cursor and select it.

    Args:
        context: Blender's context.
        model: What to add.

    Returns:
        The empty that stands for frame `motor`; parts and bolts are its children.
    """
    made: list[Any] = []
    materials = set(bpy.data.materials.keys())
    try:
        return _add_motor(context, model, made)
    except BaseException:
        # a motor that is not whole must not stay in the scene
        _remove(made)
        for name in set(bpy.data.materials.keys()) - materials:
            bpy.data.materials.remove(bpy.data.materials[name])
        raise


def _add_motor(context: Any, model: MotorModel, made: list[Any]) -> Any:
    """As above; notes every object in `made` before it can fail."""
    scale = units_per_mm(context.scene)
    longest = max(float(np.ptp(solid.vertices, axis=0).max()) for solid in model.parts)
    motor = _empty(context, made, model.spec.name, "PLAIN_AXES", 0.5 * longest * scale)
    motor.location = context.scene.cursor.location
    motor[SPEC_KEY] = model.spec.model_dump_json()
    for solid in model.parts:
        _add_part(context, made, solid, motor, scale)
    for bolt in model.bolts:
        empty = _empty(context, made, bolt.id, "SINGLE_ARROW", 3 * bolt.head_height_mm * scale)
        empty.parent = motor
        matrix = bolt.motor_from_bolt.matrix.copy()
        matrix[:3, 3] *= scale
        empty.matrix_local = mathutils.Matrix(matrix.tolist())
        empty[BOLT_ID_KEY] = bolt.id
        empty[SIDE_KEY] = str(bolt.side)
        empty[ACROSS_KEY] = bolt.across_mm
        empty[DIAMETER_KEY] = bolt.head_diameter_mm
        empty[HEIGHT_KEY] = bolt.head_height_mm
        empty[BOLT_SPEC_KEY] = bolt.spec.model_dump_json()
    for order, item in enumerate(made[1:]):
        item[ORDER_KEY] = order
    for other in context.view_layer.objects:
        other.select_set(other is motor)
    context.view_layer.objects.active = motor
    return motor


def _empty(context: Any, made: list[Any], name: str, display: str, size: float) -> Any:
    """An empty in the current collection."""
    empty = bpy.data.objects.new(name, None)
    made.append(empty)
    empty.empty_display_type = display
    empty.empty_display_size = size
    context.collection.objects.link(empty)
    return empty


def _add_part(context: Any, made: list[Any], solid: SolidPart, motor: Any, scale: float) -> None:
    """A mesh object for one solid."""
    mesh = bpy.data.meshes.new(solid.name)
    part = bpy.data.objects.new(solid.name, mesh)
    made.append(part)
    mesh.vertices.add(len(solid.vertices))
    mesh.vertices.foreach_set("co", (solid.vertices * scale).astype(np.float32).ravel())
    mesh.loops.add(solid.faces.size)
    mesh.loops.foreach_set("vertex_index", solid.faces.astype(np.int32).ravel())
    mesh.polygons.add(len(solid.faces))
    starts = 3 * np.arange(len(solid.faces), dtype=np.int32)
    mesh.polygons.foreach_set("loop_start", starts)
    mesh.polygons.foreach_set("use_smooth", np.ones(len(solid.faces), dtype=np.bool_))
    mesh.update(calc_edges=True)
    mesh.set_sharp_from_angle(angle=_SMOOTH_BELOW_RAD)
    mesh.materials.append(_material(solid.material))
    part[NAME_KEY] = solid.name
    part[CLASS_KEY] = int(solid.part)
    part[MATERIAL_KEY] = str(solid.material)
    if solid.bolt_id is not None:
        part[BOLT_ID_KEY] = solid.bolt_id
    part.color = (*PART_COLORS[solid.part], 1.0)
    part.parent = motor
    context.collection.objects.link(part)


def _material(material: Material) -> Any:
    """Blender's material of that name, made on first use."""
    name = f"boltpose {str(material).replace('_', ' ')}"
    known = bpy.data.materials.get(name)
    if known is not None:
        return known
    look = LOOKS[material]
    result = bpy.data.materials.new(name)
    result.use_nodes = True
    result.diffuse_color = (*look.color, 1.0)
    result.metallic = look.metallic
    result.roughness = look.roughness
    shader = result.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*look.color, 1.0)
    shader.inputs["Metallic"].default_value = look.metallic
    shader.inputs["Roughness"].default_value = look.roughness
    return result


def _remove(objects: list[Any]) -> None:
    """Take objects and their meshes out of the file."""
    for item in reversed(objects):
        mesh = item.data
        bpy.data.objects.remove(item)
        if mesh is not None and mesh.users == 0:
            bpy.data.meshes.remove(mesh)


def motor_of(item: Any | None) -> Any | None:
    """The motor's empty that an object belongs to; None if it belongs to none."""
    while item is not None and SPEC_KEY not in item:
        item = item.parent
    return item


def model_from(context: Any, motor: Any) -> MotorModel:
    """Read a motor back, as it stands in the scene now, modifiers applied.

    Args:
        context: Blender's context.
        motor: The motor's empty.

    Returns:
        The motor in frame `motor`, mm; vertices carry Blender's float32 rounding.

    Raises:
        ConfigError: Its parts are gone, or a bolt's empty was scaled or sheared.
    """
    scale = units_per_mm(context.scene)
    graph = context.evaluated_depsgraph_get()  # brings the matrices below up to date
    motor_from_world = np.linalg.inv(np.array(motor.matrix_world, dtype=np.float64))
    parts: list[SolidPart] = []
    bolts: list[TrueBolt] = []
    taken: set[str] = set()
    for child in sorted(_family_of(motor), key=lambda item: int(item.get(ORDER_KEY, 0))):
        local = motor_from_world @ np.array(child.matrix_world, dtype=np.float64)
        if child.type == "MESH" and CLASS_KEY in child:
            solid = _solid_from(child, local, graph, scale)
            parts.append(replace(solid, name=_free_name(solid.name, taken)))
        elif BOLT_SPEC_KEY in child:
            bolt = _bolt_from(child, local, scale)
            bolts.append(replace(bolt, id=_free_name(bolt.id, taken)))
    if not parts:
        raise ConfigError(f"'{motor.name}' has no parts with a class any more")
    return MotorModel(
        spec=MotorSpec.model_validate_json(motor[SPEC_KEY]),
        parts=tuple(parts),
        bolts=tuple(bolts),
    )


def _family_of(motor: Any) -> Iterator[Any]:
    """Children and their children."""
    for child in motor.children:
        yield child
        yield from _family_of(child)


def _free_name(name: str, taken: set[str]) -> str:
    """The name, or one with a number: objects that a person duplicated keep their names."""
    free, number = name, 2
    while free in taken:
        free, number = f"{name}_{number}", number + 1
    taken.add(free)
    return free


def _solid_from(item: Any, motor_from_item: FloatArray, graph: Any, scale: float) -> SolidPart:
    """One mesh object as a solid."""
    evaluated = item.evaluated_get(graph)
    mesh = evaluated.to_mesh()
    mesh.calc_loop_triangles()
    vertices = np.zeros(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", vertices)
    faces = np.zeros(3 * len(mesh.loop_triangles), dtype=np.int32)
    mesh.loop_triangles.foreach_get("vertices", faces)
    evaluated.to_mesh_clear()
    points = vertices.reshape(-1, 3).astype(np.float64) @ motor_from_item[:3, :3].T
    triangles = faces.reshape(-1, 3)
    if np.linalg.det(motor_from_item[:3, :3]) < 0:
        triangles = triangles[:, ::-1]  # a mirror turns the winding inside out
    return SolidPart(
        name=str(item[NAME_KEY]),
        part=Part(int(item[CLASS_KEY])),
        material=Material(str(item[MATERIAL_KEY])),
        vertices=(points + motor_from_item[:3, 3]) / scale,
        faces=triangles.astype(np.int64),
        bolt_id=str(item[BOLT_ID_KEY]) if BOLT_ID_KEY in item else None,
    )


def _bolt_from(empty: Any, motor_from_empty: FloatArray, scale: float) -> TrueBolt:
    """One bolt's empty as a true bolt."""
    matrix = motor_from_empty.copy()
    matrix[:3, 3] /= scale
    matrix[3] = (0, 0, 0, 1)
    return TrueBolt(
        id=str(empty[BOLT_ID_KEY]),
        spec=BoltSpec.model_validate_json(empty[BOLT_SPEC_KEY]),
        side=Side(str(empty[SIDE_KEY])),
        motor_from_bolt=Transform("motor", "bolt", matrix),
        across_mm=float(empty[ACROSS_KEY]),
        head_diameter_mm=float(empty[DIAMETER_KEY]),
        head_height_mm=float(empty[HEIGHT_KEY]),
    )
