"""Blender's operators: add a starter motor, export one with its labels."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from boltpose.blender.api import bpy
from boltpose.blender.fields import show_dimensions, values_from
from boltpose.blender.panel import PanelValues, model_of, showing
from boltpose.blender.properties import draw_fields, panel_properties
from boltpose.blender.scene_objects import add_motor, model_from, motor_of
from boltpose.errors import BoltposeError
from boltpose.factory.export import export_model


class AddStarterMotor(bpy.types.Operator):
    """Add a starter motor: its parts, and an empty with its frame for every bolt."""

    bl_idname = "mesh.boltpose_starter_motor_add"
    bl_label = "Starter Motor"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 - Blender wants a plain set on the class

    __annotations__ = panel_properties()

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Only in object mode: a motor is many objects."""
        return bool(context.mode == "OBJECT")

    def draw(self, context: Any) -> None:
        """Lay out the redo panel."""
        draw_fields(self.layout, self)

    def execute(self, context: Any) -> set[str]:
        """Build the whole motor first, then add it: a refusal leaves the scene as it was."""
        try:
            values = showing(_with_absolute_path(values_from(self)))
            model = model_of(values)
        except BoltposeError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        show_dimensions(values, lambda name, value: setattr(self, name, value))
        add_motor(context, model)
        return {"FINISHED"}


class ExportStarterMotor(bpy.types.Operator):
    """Write the selected motor as STL and GLB, its part names, bolts and specification."""

    bl_idname = "export_scene.boltpose_motor"
    bl_label = "Export Starter Motor"
    bl_options = {"REGISTER"}  # noqa: RUF012 - Blender wants a plain set on the class

    __annotations__ = {
        "directory": bpy.props.StringProperty(
            name="Folder", description="Where the files go", subtype="DIR_PATH"
        )
    }

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Only with a motor, or a part of one, active."""
        return motor_of(context.object) is not None

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Ask for the folder."""
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        """Write what the scene shows now."""
        folder = Path(bpy.path.abspath(self.directory))
        try:
            folder.mkdir(parents=True, exist_ok=True)
            export_model(model_from(context, motor_of(context.object)), folder)
        except (BoltposeError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"wrote {folder}")
        return {"FINISHED"}


def _with_absolute_path(values: PanelValues) -> PanelValues:
    """Blender writes `//` for the folder of the open file."""
    if not values.spec_file:
        return values
    return replace(values, spec_file=bpy.path.abspath(values.spec_file))


def draw_add_menu(menu: Any, context: Any) -> None:
    """The entry in Add > Mesh."""
    menu.layout.operator(AddStarterMotor.bl_idname, icon="MOD_SCREW")


def draw_export_menu(menu: Any, context: Any) -> None:
    """The entry in File > Export."""
    menu.layout.operator(ExportStarterMotor.bl_idname, text="Starter motor with labels (folder)")
