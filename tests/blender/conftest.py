"""These tests run inside Blender, by `make test-blender`; elsewhere they are not collected."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator

import pytest

if importlib.util.find_spec("bpy") is None:
    collect_ignore_glob = ["test_*.py"]


@pytest.fixture
def empty_scene() -> None:
    """Blender's file with nothing in it; add-ons are left as they are."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


@pytest.fixture
def addon(empty_scene: None) -> Iterator[None]:
    """The add-on, registered for one test."""
    import boltpose.blender

    boltpose.blender.register()
    yield
    boltpose.blender.unregister()
