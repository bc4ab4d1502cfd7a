"""The tab `boltpose` in the 3D view's sidebar."""

from __future__ import annotations

from typing import Any

from boltpose.blender.api import bpy
from boltpose.blender.operators import AddStarterMotor, ExportStarterMotor
from boltpose.blender.scene_objects import BOLT_SPEC_KEY, CLASS_KEY, motor_of
from boltpose.schema import Part


class StarterMotorPanel(bpy.types.Panel):
    """Add and export motors; what the active object is."""

    bl_idname = "VIEW3D_PT_boltpose"
    bl_label = "Starter motor"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "boltpose"

    def draw(self, context: Any) -> None:
        """Lay out the tab."""
        layout = self.layout
        layout.operator(AddStarterMotor.bl_idname, icon="ADD")
        layout.operator(ExportStarterMotor.bl_idname, icon="EXPORT")
        for line in description(context.object):
            layout.label(text=line)


def description(item: Any | None) -> tuple[str, ...]:
    """What the tab says about an object."""
    motor = motor_of(item)
    if item is None or motor is None:
        return ("No motor is selected",)
    bolts = sum(BOLT_SPEC_KEY in child for child in motor.children)
    lines = [f"Motor: {motor.name}", f"Bolts: {bolts}"]
    if CLASS_KEY in item:
        lines.append(f"Class: {Part(int(item[CLASS_KEY])).name.lower()}")
    return tuple(lines)
