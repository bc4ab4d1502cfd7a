"""What the add-on puts into Blender, and takes out again."""

from __future__ import annotations

from boltpose.blender.api import bpy
from boltpose.blender.operators import (
    AddStarterMotor,
    ExportStarterMotor,
    draw_add_menu,
    draw_export_menu,
)
from boltpose.blender.sidebar import StarterMotorPanel

CLASSES = (AddStarterMotor, ExportStarterMotor, StarterMotorPanel)
"""In the order in which they are registered."""


def register() -> None:
    """Add classes, then the menu entries that name them."""
    for kind in CLASSES:
        bpy.utils.register_class(kind)
    bpy.types.VIEW3D_MT_mesh_add.append(draw_add_menu)
    bpy.types.TOPBAR_MT_file_export.append(draw_export_menu)


def unregister() -> None:
    """Take out all that `register` added, last first."""
    bpy.types.TOPBAR_MT_file_export.remove(draw_export_menu)
    bpy.types.VIEW3D_MT_mesh_add.remove(draw_add_menu)
    for kind in reversed(CLASSES):
        bpy.utils.unregister_class(kind)
