"""CAD meshes as named parts."""

from __future__ import annotations

import io
import logging
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from boltpose.arrays import FloatArray, IntArray, freeze
from boltpose.errors import InputFileError
from boltpose.io.guard import MAX_POINTS, refusing, require_file
from boltpose.io.units import Unit, as_unit, check_extent

if TYPE_CHECKING:
    import trimesh

MESH_SUFFIXES = (".stl", ".obj", ".ply", ".glb")
"""Suffixes that `read_mesh` knows."""

_WANTED = f"a triangle mesh, one of {', '.join(MESH_SUFFIXES)}"
_UNNAMED = "geometry_0"
_SILENT = logging.NullHandler()


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MeshPart:
    """One named part of a CAD model, in place."""

    name: str
    vertices: FloatArray
    """Shape (V, 3), float64, mm, frame of the model."""
    faces: IntArray
    """Shape (F, 3), indices of vertices, counter-clockwise seen from outside."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", freeze(self.vertices))
        object.__setattr__(self, "faces", freeze(self.faces))


def read_mesh(path: str | Path, *, unit: str | None = None) -> tuple[MeshPart, ...]:
    """Read a CAD mesh with the names of its parts.

    Args:
        path: A `.stl`, `.obj`, `.ply` or `.glb` file. Parts are the nodes of a GLB scene, the
            objects of an OBJ (its groups where it has no objects), the solids of an ascii STL.
            Materials, textures and files beside it are not read.
        unit: The unit of length in the file, a `Unit`. By default metres for GLB, as its standard
            says, and mm for the others.

    Returns:
        The parts, sorted by name, scene transforms applied. A file without names gives one part
        named like the file.

    Raises:
        ConfigError: There is no such unit.
        InputFileError: The file is missing, of another kind, broken or holds no triangles.
        UnitError: The size of the model does not fit the unit.
    """
    file = Path(path)
    suffix = file.suffix.lower()
    length_unit = as_unit(unit or (Unit.M if suffix == ".glb" else Unit.MM))
    require_file(file, _WANTED)
    if suffix not in MESH_SUFFIXES:
        raise InputFileError(file, f"the suffix '{file.suffix}'", _WANTED)
    with refusing(file, _WANTED):
        data = file.read_bytes()
        _check_stl(file, suffix, data)
        parts = _read_parts(file, suffix, data)
        corners = np.concatenate([part.vertices[part.faces].reshape(-1, 3) for part in parts])
        with np.errstate(over="ignore"):  # infinite is refused like any other extent
            extent = float(np.ptp(corners, axis=0).max())
        check_extent(file, extent, length_unit, option="--unit")
    return tuple(
        MeshPart(name=part.name, vertices=part.vertices * length_unit.mm, faces=part.faces)
        for part in parts
    )


def _check_stl(path: Path, suffix: str, data: bytes) -> None:
    """Refuse STL files that were cut off: trimesh reads what is left without a word."""
    if suffix != ".stl":
        return
    if _is_ascii_stl(data):
        if b"endsolid" not in data[-1000:]:
            raise InputFileError(path, "an ascii STL without 'endsolid'", _WANTED)
        return
    count = int.from_bytes(data[80:84], "little")
    if len(data) < 84 or len(data) != 84 + 50 * count:
        found = f"{len(data)} bytes for {count} triangles"
        raise InputFileError(path, found, f"{84 + 50 * count} bytes of binary STL")


def _is_ascii_stl(data: bytes) -> bool:
    """Tell ascii from binary; there are binary files that start with `solid`."""
    return data[:5].lower() == b"solid" and b"facet" in data[:1000]


def _read_parts(path: Path, suffix: str, data: bytes) -> list[MeshPart]:
    """Parse the file and put every part in place, in the file's unit."""
    # half a second that only those with a CAD mesh should wait
    import trimesh

    # trimesh logs what it also raises; without any handler Python would print that
    logging.getLogger("trimesh").addHandler(_SILENT)
    options: dict[str, Any] = {}
    if suffix == ".obj" or (suffix == ".stl" and _is_ascii_stl(data)):
        # for other encodings trimesh asks for a package that we do not need
        data = _decode(data).encode("utf-8")
    if suffix == ".obj":
        has_objects = re.search(rb"^o\s", data, re.MULTILINE) is not None
        options = {"split_objects": True, "split_groups": not has_objects, "group_material": False}
    with np.errstate(all="ignore"):  # what is not finite is refused below
        scene = trimesh.load_scene(
            io.BytesIO(data),  # no path, so no file beside it is opened
            file_type=suffix.removeprefix("."),
            process=False,
            skip_materials=True,
            **options,
        )
    parts: list[MeshPart] = []
    for node in sorted(scene.graph.nodes_geometry):
        model_from_node, geometry_name = scene.graph[node]
        geometry = scene.geometry[geometry_name]
        if not isinstance(geometry, trimesh.Trimesh) or len(geometry.faces) == 0:
            continue
        parts.append(_place(path, str(node), geometry, np.asarray(model_from_node)))
    if not parts:
        raise InputFileError(path, "no triangles", _WANTED)
    if len(parts) == 1 and parts[0].name == _UNNAMED:
        only = parts[0]
        return [MeshPart(name=path.stem, vertices=only.vertices, faces=only.faces)]
    return parts


def _decode(data: bytes) -> str:
    """Decode text that is utf-8 nowadays and was latin-1 in older CAD programs."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _place(
    path: Path, name: str, geometry: trimesh.Trimesh, model_from_node: FloatArray
) -> MeshPart:
    """Apply a node's transform, which may scale and mirror, so it is no `Transform`."""
    vertices = np.asarray(geometry.vertices, dtype=np.float64)
    faces = np.array(geometry.faces, dtype=np.int64)
    if len(faces) > MAX_POINTS:
        raise InputFileError(path, f"{len(faces)} triangles", f"at most {MAX_POINTS}")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputFileError(path, f"part '{name}' with vertex {faces.max()}", "existing vertices")
    linear = model_from_node[:3, :3]
    with np.errstate(all="ignore"):
        placed = vertices @ linear.T + model_from_node[:3, 3]
    if not np.isfinite(placed[faces]).all():
        raise InputFileError(path, f"part '{name}' with values that are not finite", _WANTED)
    if np.linalg.det(linear) < 0:
        faces = faces[:, ::-1]  # a mirror turns the winding inside out
    return MeshPart(name=name, vertices=placed, faces=faces)
