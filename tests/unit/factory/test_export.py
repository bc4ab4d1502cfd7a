from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from boltpose.factory.export import export_model, model_prior
from boltpose.factory.spec import MotorSpec
from boltpose.geometry.transforms import Transform
from boltpose.io.mesh import read_mesh
from boltpose.io.part_names import match_part_names, read_part_names
from boltpose.prior.file import prior_to_json, read_prior, write_prior
from boltpose.schema import Part, Prior
from tests.unit.factory.small_motor import small_motor


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("export")
    files = export_model(small_motor(), made)
    assert sorted(files) == sorted(made.iterdir())
    return made


def test_a_glb_comes_back_in_mm_with_its_names(folder: Path) -> None:
    parts = {part.name: part for part in read_mesh(folder / "small.glb")}
    assert sorted(parts) == sorted(solid.name for solid in small_motor().parts)
    for solid in small_motor().parts:
        read = parts[solid.name]
        np.testing.assert_array_equal(read.faces, solid.faces)
        np.testing.assert_allclose(read.vertices, solid.vertices, atol=1e-4)


def test_an_stl_comes_back_in_mm(folder: Path) -> None:
    (read,) = read_mesh(folder / "small.stl")
    built = np.concatenate([solid.vertices[solid.faces] for solid in small_motor().parts])
    np.testing.assert_allclose(read.vertices[read.faces], built, atol=1e-4)


def test_the_class_of_every_part_is_in_the_parts_file(folder: Path) -> None:
    classes = read_part_names(folder / "small.parts.yaml")
    solids = small_motor().parts
    assert match_part_names([solid.name for solid in solids], classes) == tuple(
        solid.part for solid in solids
    )


def test_the_specification_comes_back_whole(folder: Path) -> None:
    text = (folder / "small.spec.json").read_text()
    assert MotorSpec.model_validate_json(text) == small_motor().spec


def test_bolts_are_written_as_they_were_built(folder: Path) -> None:
    written = json.loads((folder / "small.bolts.json").read_text())
    assert (written["unit"], written["frame"]) == ("mm", "motor")
    for entry, bolt in zip(written["bolts"], small_motor().bolts, strict=True):
        assert (entry["id"], entry["side"]) == (bolt.id, bolt.side)
        assert (entry["head"], entry["thread"]) == (bolt.spec.head, f"M{bolt.spec.thread_mm}")
        pose = Transform("motor", "bolt", np.array(entry["motor_from_bolt"]))
        np.testing.assert_array_equal(pose.matrix, bolt.motor_from_bolt.matrix)
        np.testing.assert_allclose(entry["head_top"], bolt.head_top)
        np.testing.assert_allclose(entry["head_centre"], bolt.head_centre)


def test_the_same_motor_gives_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    export_model(small_motor(), tmp_path)
    for file in folder.iterdir():
        assert (tmp_path / file.name).read_bytes() == file.read_bytes()


@pytest.fixture(scope="module")
def prior() -> Prior:
    return model_prior(small_motor(), spacing_mm=2.5)


def test_the_prior_knows_every_bolt_exactly(prior: Prior) -> None:
    model = small_motor()
    assert [bolt.id for bolt in prior.bolts] == [bolt.id for bolt in model.bolts]
    for known, true in zip(prior.bolts, model.bolts, strict=True):
        np.testing.assert_array_equal(known.prior_from_bolt.matrix, true.motor_from_bolt.matrix)
        assert known.side is true.side
        assert (known.head_diameter_mm, known.head_height_mm) == (
            true.across_mm,
            true.head_height_mm,
        )
        assert known.point_count > 3
        assert known.confidence == 1
        assert np.linalg.norm(known.cluster_centre - true.head_centre) < true.head_height_mm
    assert set(np.unique(prior.labels)) == {int(solid.part) for solid in model.parts}
    assert int(Part.BACKGROUND) not in prior.labels
    np.testing.assert_allclose(np.linalg.norm(prior.normals, axis=1), 1, atol=1e-6)


def test_the_prior_survives_its_file(prior: Prior, tmp_path: Path) -> None:
    write_prior(tmp_path / "small.prior.npz", prior)
    again = read_prior(tmp_path / "small.prior.npz")
    np.testing.assert_array_equal(again.points, prior.points)
    np.testing.assert_array_equal(again.normals, prior.normals)
    assert prior_to_json(again) == json.loads(json.dumps(prior_to_json(prior)))
