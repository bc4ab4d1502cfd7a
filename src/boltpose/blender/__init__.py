"""Blender add-on: starter motors with named parts, materials and true bolt frames.

Importing this package imports neither Blender nor the factory; `register` does.
"""

from __future__ import annotations

bl_info = {
    "name": "boltpose: starter motors",
    "author": "boltpose developers",
    "version": (0, 1, 0),
    "blender": (4, 2, 0),
    "location": "View3D > Add > Mesh > Starter Motor; sidebar, tab boltpose",
    "description": "Parametric starter motors with labels and the true pose of every bolt",
    "category": "Add Mesh",
}
"""What Blender's preferences show; Blender reads it without running the file."""


def register() -> None:
    """Add the operators, the menu entry and the sidebar panel to Blender.

    Raises:
        MissingExtraError: Blender's Python lacks manifold3d.
        ImportError: This Python is not Blender's.
    """
    from boltpose.blender import registration

    registration.register()


def unregister() -> None:
    """Take everything out again that `register` added."""
    from boltpose.blender import registration

    registration.unregister()
