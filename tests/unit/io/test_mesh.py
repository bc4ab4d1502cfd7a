from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from boltpose.errors import ConfigError, InputFileError, UnitError
from boltpose.io import MESH_SUFFIXES, MeshPart, read_mesh, write_ply


def signed_volume(part: MeshPart) -> float:
    """Positive where faces wind counter-clockwise seen from outside."""
    a, b, c = (part.vertices[part.faces[:, i]] for i in range(3))
    return float(np.einsum("ni,ni->n", a, np.cross(b, c)).sum() / 6)


def box(size: tuple[float, float, float] = (100, 80, 60)) -> trimesh.Trimesh:
    return trimesh.creation.box(size)


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "ply", "obj"])
def test_one_body_becomes_one_part_named_like_the_file(tmp_path: Path, kind: str) -> None:
    path = tmp_path / f"motor.{kind.removesuffix('_ascii')}"
    data: Any = box().export(file_type=kind)
    path.write_bytes(data if isinstance(data, bytes) else data.encode())

    (part,) = read_mesh(path)

    if kind in ("stl", "ply"):
        assert part.name == "motor"
    assert part.faces.shape == (12, 3)
    np.testing.assert_allclose(part.vertices.min(axis=0), (-50, -40, -30))
    np.testing.assert_allclose(part.vertices.max(axis=0), (50, 40, 30))
    assert signed_volume(part) == pytest.approx(100 * 80 * 60)


def test_units_scale_and_are_guarded(tmp_path: Path) -> None:
    box((0.1, 0.08, 0.06)).export(tmp_path / "a.stl")

    with pytest.raises(UnitError, match=r"a\.stl.* 0\.1 mm .*looks like m: set --unit m"):
        read_mesh(tmp_path / "a.stl")
    (part,) = read_mesh(tmp_path / "a.stl", unit="m")
    np.testing.assert_allclose(part.vertices.max(axis=0), (50, 40, 30), rtol=1e-6)
    with pytest.raises(ConfigError, match="unknown unit"):
        read_mesh(tmp_path / "a.stl", unit="ell")


def write_glb(path: Path, scale: float = 0.001) -> np.ndarray:
    """A housing with a bolt and its mirror image below a turned and shifted node."""
    model_from_bolt = np.eye(4)
    model_from_bolt[:3, :3] = Rotation.from_euler("y", 90, degrees=True).as_matrix()
    model_from_bolt[:3, 3] = (70, 0, 0)
    mirror = np.diag([1.0, -1.0, 1.0, 1.0])
    bolt = trimesh.creation.cylinder(radius=5, height=8)
    bolt.apply_translation((0, 20, 0))
    scene = trimesh.Scene()
    scene.add_geometry(box(), node_name="housing", geom_name="body")
    scene.add_geometry(bolt, node_name="bolt_1", geom_name="bolt", transform=model_from_bolt)
    scene.add_geometry(
        bolt, node_name="bolt_2", geom_name="bolt", transform=model_from_bolt @ mirror
    )
    scene.apply_scale(scale)
    path.write_bytes(scene.export(file_type="glb"))
    return model_from_bolt


def test_glb_is_in_metres_and_its_nodes_are_put_in_place(tmp_path: Path) -> None:
    write_glb(tmp_path / "a.glb")

    parts = {part.name: part for part in read_mesh(tmp_path / "a.glb")}

    assert list(parts) == ["bolt_1", "bolt_2", "housing"]
    for name, centre_y in (("bolt_1", 20), ("bolt_2", -20)):
        vertices = parts[name].vertices
        np.testing.assert_allclose(vertices.min(axis=0), (66, centre_y - 5, -5), atol=1e-4)
        np.testing.assert_allclose(vertices.max(axis=0), (74, centre_y + 5, 5), atol=1e-4)
        # also the mirrored one has its faces outwards
        assert signed_volume(parts[name]) == pytest.approx(np.pi * 25 * 8, rel=0.02)


def test_glb_in_millimetres_is_noticed(tmp_path: Path) -> None:
    write_glb(tmp_path / "a.glb", scale=1.0)
    with pytest.raises(UnitError, match="looks like mm: set --unit mm"):
        read_mesh(tmp_path / "a.glb")
    assert len(read_mesh(tmp_path / "a.glb", unit="mm")) == 3


OBJ = """mtllib missing.mtl
{0} housing
usemtl steel
v 0 0 0
v 100 0 0
v 0 100 0
f 1 2 3
{0} bolt_ä
v 0 0 5
v 10 0 5
v 0 10 5
f 4 5 6
"""


@pytest.mark.parametrize("keyword", ["o", "g"])
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_objects_or_groups_of_an_obj_are_parts(tmp_path: Path, keyword: str, encoding: str) -> None:
    (tmp_path / "a.obj").write_text(OBJ.format(keyword), encoding=encoding)

    parts = read_mesh(tmp_path / "a.obj")

    assert [part.name for part in parts] == ["bolt_ä", "housing"]
    np.testing.assert_allclose(parts[0].vertices[parts[0].faces[0]][:, 2], 5)


def test_solids_of_an_ascii_stl_are_parts(tmp_path: Path) -> None:
    def solid(name: str, z: float) -> str:
        corners = "".join(f"vertex {x} {y} {z}\n" for x, y in ((0, 0), (90, 0), (0, 90)))
        facet = f"facet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\n"
        return f"solid {name}\n{facet}endsolid {name}\n"

    (tmp_path / "a.stl").write_text(solid("nut", 1) + solid("bolt", 2))

    assert [part.name for part in read_mesh(tmp_path / "a.stl")] == ["bolt", "nut"]


def test_parts_cannot_be_written(tmp_path: Path) -> None:
    box().export(tmp_path / "a.stl")
    with pytest.raises(ValueError, match="read-only"):
        read_mesh(tmp_path / "a.stl")[0].vertices[0] = 0


def stl(cut: int | None) -> bytes:
    data = box().export(file_type="stl")
    assert isinstance(data, bytes)
    return data[:cut]


BROKEN: dict[str, tuple[bytes, str]] = {
    "cut.stl": (stl(-1), "683 bytes for 12 triangles, wanted 684"),
    "header.stl": (stl(40), "40 bytes"),
    "cut ascii.stl": (b"solid x\nfacet normal 0 0 1\nouter loop\n", "without 'endsolid'"),
    "no faces.stl": (b"\0" * 84, "no triangles"),
    "words.obj": (b"hello\nworld\n", "no triangles"),
    "index.obj": (b"v 0 0 0\nv 90 0 0\nv 0 90 0\nf 1 2 9\n", r"found"),
    "nan.obj": (b"v 0 0 0\nv nan 0 0\nv 0 90 0\nf 1 2 3\n", "not finite"),
    "words.glb": (b"glTF" + bytes(100), "found"),
    "words.ply": (b"ply\nhello\n", "found"),
    "a.step": (b"ISO-10303-21;", r"the suffix '\.step', wanted a triangle mesh, one of \.stl"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_files_are_refused_in_one_line(tmp_path: Path, name: str) -> None:
    content, reason = BROKEN[name]
    (tmp_path / name).write_bytes(content)

    with pytest.raises(InputFileError, match=reason) as caught:
        read_mesh(tmp_path / name)

    assert "\n" not in str(caught.value)


def test_a_point_cloud_is_no_mesh(tmp_path: Path) -> None:
    write_ply(tmp_path / "a.ply", np.random.default_rng(0).uniform(-99, 99, (50, 3)))
    with pytest.raises(InputFileError, match="no triangles"):
        read_mesh(tmp_path / "a.ply")


@pytest.mark.parametrize("suffix", MESH_SUFFIXES)
def test_missing_and_empty_are_named(tmp_path: Path, suffix: str) -> None:
    (tmp_path / f"empty{suffix}").touch()
    with pytest.raises(InputFileError, match="no such file"):
        read_mesh(tmp_path / f"no{suffix}")
    with pytest.raises(InputFileError, match="an empty file"):
        read_mesh(tmp_path / f"empty{suffix}")
