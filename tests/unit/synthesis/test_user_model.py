from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from boltpose.errors import BoltposeError, ConfigError, InputFileError
from boltpose.factory.spec import MotorSpec
from boltpose.io.mesh import read_mesh
from boltpose.io.part_names import match_part_names, read_part_names
from boltpose.io.scan import read_scan
from boltpose.prior.file import read_prior
from boltpose.synthesis.user_model import example_spec, read_spec, write_model, write_spec

BOLT = {"site": "rear_cap", "radius_mm": 30, "angle_deg": 0}


def test_an_example_can_be_written_read_and_built(tmp_path: Path) -> None:
    spec = example_spec("motorcycle", 4)
    write_spec(tmp_path / "mine.json", spec)
    assert read_spec(tmp_path / "mine.json") == spec

    written = write_model(spec, tmp_path / "model")

    assert {path.suffix for path in written.files} == {
        *(".stl", ".glb", ".yaml", ".json", ".ply", ".npz")
    }
    assert sorted(written.files) == sorted((tmp_path / "model").iterdir())
    prior = read_prior(written.prior)
    assert len(prior.bolts) == written.bolt_count > 0
    # all that was written tells the same motor
    truth = json.loads((tmp_path / "model" / f"{spec.name}.bolts.json").read_text())["bolts"]
    assert [bolt["id"] for bolt in truth] == [bolt.id for bolt in prior.bolts]
    for bolt, known in zip(truth, prior.bolts, strict=True):
        np.testing.assert_allclose(bolt["head_top"], known.prior_from_bolt.translation_mm)
    parts = read_mesh(tmp_path / "model" / f"{spec.name}.glb")
    assert len(parts) == written.part_count
    patterns = read_part_names(tmp_path / "model" / f"{spec.name}.parts.yaml")
    match_part_names([part.name for part in parts], patterns)
    cloud = read_scan(tmp_path / "model" / f"{spec.name}.ply")
    np.testing.assert_allclose(cloud.points, prior.points, atol=1e-4)
    np.testing.assert_array_equal(cloud.labels, prior.labels)


@pytest.mark.parametrize(
    ("document", "text"),
    [
        ({"housing": {"radius": 3}}, r"unknown field housing\.radius, wanted one of radius_mm"),
        ({"housing": {"radius_mm": "x"}}, r'found housing\.radius_mm = "x", wanted a valid number'),
        ({"housing": {"radius_mm": -1}}, r"housing\.radius_mm = -1, wanted greater than 15"),
        ({"bolts": [BOLT, {**BOLT, "head": "hexx"}]}, r'bolts\[1\]\.head = "hexx", wanted .*hex'),
        ({"bolts": [{"site": "rear_cap"}]}, r"no bolts\[0\]\.radius_mm"),
        ({"rear_cap": {"style": "round"}}, r"rear_cap\.style = .*'flat'"),
        ({"bracket": {"nose": {"styl": 1}}}, r"unknown field bracket\.nose\.styl"),
        ({"name": "a/b"}, "name = "),
        ([1], r"the document = \[1\]"),
    ],
)
def test_a_broken_specification_is_one_line_that_names_the_field(
    tmp_path: Path, document: Any, text: str
) -> None:
    path = tmp_path / "spec.json"
    path.write_text(json.dumps(document))
    with pytest.raises(InputFileError, match=text) as error:
        read_spec(path)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 500


@pytest.mark.parametrize("text", [" ", "{", "\x00\xff"])
def test_what_is_no_json_is_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "spec.json"
    path.write_text(text, encoding="latin-1")
    with pytest.raises(InputFileError, match="no readable JSON"):
        read_spec(path)


def test_a_motor_that_cannot_be_built_leaves_nothing(tmp_path: Path) -> None:
    # a bolt on a solenoid that is not there
    spec = MotorSpec.model_validate(
        {"solenoid": None, "bolts": [{"site": "solenoid_cap", "radius_mm": 9, "angle_deg": 0}]}
    )
    with pytest.raises(BoltposeError, match=r"bolts\[0\]"):
        write_model(spec, tmp_path / "model")
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_family_is_refused_with_those_there_are() -> None:
    with pytest.raises(ConfigError, match=r"one of direct_closed, .*; got 'tractor'"):
        example_spec("tractor", 0)
