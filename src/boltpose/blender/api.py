"""The one door to Blender's Python module.

Blender brings `bpy` with itself and no types, so it is `Any` here and nowhere else is it imported:
what does not need it (`panel`, `fields`) is checked and tested without Blender.
"""

from __future__ import annotations

import importlib
from typing import Any

bpy: Any = importlib.import_module("bpy")
"""Blender's module `bpy`."""

mathutils: Any = importlib.import_module("mathutils")
"""Blender's vectors and matrices; comes with `bpy`."""
