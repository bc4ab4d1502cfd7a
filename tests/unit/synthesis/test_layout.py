"""A data set of ours is read, unchanged, by everything that reads reman18."""

from __future__ import annotations

import importlib.util
import json
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from PIL import Image
from scipy.spatial import KDTree

from boltpose.datasets.reman18 import Reman18
from boltpose.evaluation.reman18 import list_motors, read_label_image, read_motor
from boltpose.io.hand_eye import read_hand_eye
from boltpose.io.scan import read_scan
from boltpose.schema import Part
from tests.support import reman18

MOTOR = "motor_00000"
THEIRS = reman18.ROOT / "motor_000"
NUMBER = re.compile(r"-?\d+\.(\d+)")


def load_json(path: Path) -> Any:
    return json.loads(path.read_text())


def shape_of(value: Any) -> Any:
    """Keys and types; a list is what its first element is."""
    if isinstance(value, dict):
        return {key: shape_of(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [shape_of(value[0])] if value else []
    return type(value).__name__


def assert_has_all_of(ours: Any, theirs: Any, at: str) -> None:
    if isinstance(theirs, dict):
        assert isinstance(ours, dict), at
        missing = theirs.keys() - ours.keys()
        assert not missing, f"{at} lacks {missing}"
        # in the same order, own keys behind
        assert list(ours)[: len(theirs)] == list(theirs), at
        for key in theirs:
            assert_has_all_of(ours[key], theirs[key], f"{at}/{key}")
    elif isinstance(theirs, list):
        assert isinstance(ours, list), at
        assert_has_all_of(ours[0], theirs[0], f"{at}[]")
    else:
        assert ours == theirs, at


def two_views(name: str, document: Any) -> Any:
    """Of their four views the first two, to compare with ours."""
    return document if name == "prior_gt.json" else {key: document[key] for key in ("0", "1")}


@pytest.mark.parametrize(
    "name", ["prior_gt.json", "scene_camera.json", "scene_gt.json", "bolts.json"]
)
def test_json_files_have_the_keys_types_and_order_of_reman18(scenes: Path, name: str) -> None:
    ours = load_json(scenes / MOTOR / name)
    theirs = two_views(name, load_json(THEIRS / name))
    assert_has_all_of(shape_of(ours), shape_of(theirs), name)


@pytest.mark.parametrize(
    "name", ["prior_gt.json", "scene_camera.json", "scene_gt.json", "bolts.json"]
)
def test_numbers_have_no_more_decimals_than_there(scenes: Path, name: str) -> None:
    ours, theirs = (
        max(len(match) for match in NUMBER.findall((folder / name).read_text()))
        for folder in (scenes / MOTOR, THEIRS)
    )
    assert ours <= theirs


def test_every_file_of_reman18_has_its_partner(scenes: Path) -> None:
    def names(folder: Path, views: int) -> set[str]:
        found = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
        return {name for name in found if not re.search(rf"0000[0-9][{views}-9]\.", name)}

    assert names(scenes / MOTOR, 2) == names(THEIRS, 2) | {"spec.json", "wear.json"}


def test_headers_of_binary_files_are_the_same(scenes: Path) -> None:
    for name in ("depth/000000.png", "label/000000.png"):
        with Image.open(scenes / MOTOR / name) as ours, Image.open(THEIRS / name) as theirs:
            assert (ours.format, ours.mode) == (theirs.format, theirs.mode)
    ours, theirs = (
        (folder / "prior.ply").read_bytes().split(b"end_header\n")[0].split(b"\n")
        for folder in (scenes / MOTOR, THEIRS)
    )
    assert [line for line in ours if b"vertex" not in line] == [
        line for line in theirs if b"vertex" not in line
    ]
    ours, theirs = (
        re.sub(r"-?[\d.]+(e-?\d+)?", "#", (folder / "hand_eye/000000.yaml").read_text())
        for folder in (scenes / MOTOR, THEIRS)
    )
    assert ours == theirs


@pytest.fixture(scope="module")
def their_loader() -> ModuleType:
    spec = importlib.util.spec_from_file_location("reman18_load", reman18.ROOT / "load.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_the_loader_of_reman18_reads_it(scenes: Path, their_loader: ModuleType) -> None:
    data = their_loader.Dataset(str(scenes))
    assert data.motors == [MOTOR]
    points, labels = data.prior(MOTOR)
    assert len(points) == len(labels) == data.prior_gt(MOTOR)["n_points"]
    assert set(np.unique(labels)) == {*range(1, 7)} - {Part.SOLENOID}  # this family has none
    assert data.n_views(MOTOR) == 2
    for number in range(2):
        view = data.view(MOTOR, number)
        assert view["xyz"].shape == (512, 612, 3)
        assert view["valid"].sum() > 50_000
        assert (view["label"][~view["valid"]] == 0).all()


def test_our_own_readers_read_it(scenes: Path) -> None:
    data = Reman18(root=scenes)
    assert data.families == ("motorcycle",)
    assert data.view_count(MOTOR) == 2
    truth = read_motor(scenes, list_motors(scenes)[0])
    assert truth.number == 0
    for number, view in enumerate(truth.views):
        scan = read_scan(scenes / MOTOR / "depth" / f"{number:06d}.png")
        same = data.view(MOTOR, number)
        np.testing.assert_allclose(scan.points, same.points, atol=1e-9)
        np.testing.assert_array_equal(
            read_label_image(view)[scan.pixels[:, 0], scan.pixels[:, 1]], same.labels
        )
        found = read_hand_eye(view.hand_eye_path).transform
        np.testing.assert_allclose(found.matrix, view.base_from_camera.matrix, atol=1e-5)
        assert data.camera_from_prior(MOTOR, number)[:3, 3] == pytest.approx(
            view.camera_from_prior.translation_mm, abs=1e-6
        )


@pytest.mark.parametrize("number", [0, 1])
def test_the_true_pose_lays_the_full_scan_onto_the_view(scenes: Path, number: int) -> None:
    data = Reman18(root=scenes)
    pose = data.camera_from_prior(MOTOR, number)
    scan = data.full_scan(MOTOR)
    view = data.view(MOTOR, number)
    on_motor = view.labels != Part.BACKGROUND
    distance, nearest = KDTree(scan.points @ pose[:3, :3].T + pose[:3, 3]).query(
        view.points[on_motor]
    )
    # a point per mm, scaled by up to a thousandth, and a cable that was pushed aside
    assert np.median(distance) < 0.8
    assert np.quantile(distance, 0.9) < 2.0
    close = distance < 1.0
    assert np.mean(scan.labels[nearest][close] == view.labels[on_motor][close]) > 0.97


@pytest.mark.parametrize("number", [0, 1])
def test_the_poses_of_a_bolt_agree_in_all_frames(scenes: Path, number: int) -> None:
    folder = scenes / MOTOR
    scene = load_json(folder / "scene_gt.json")[str(number)][0]
    camera_from_prior, base_from_camera = np.array(scene["T_C_to_B"]), np.array(scene["T_B_to_A"])
    prior = load_json(folder / "prior_gt.json")
    prior_from_motor = np.array(prior["T_M_to_C"])
    for bolt in load_json(folder / "bolts.json")[str(number)]["bolts"]:
        for key in ("position", "head_top", "head_centre", "head_centroid"):
            in_camera = camera_from_prior @ [*bolt["C"][key], 1]
            np.testing.assert_allclose(in_camera[:3], bolt["B"][key], atol=1e-4)
            in_base = base_from_camera @ [*bolt["B"][key], 1]
            np.testing.assert_allclose(in_base[:3], bolt["A"][key], atol=1e-4)
        top, centre, axis = (np.array(bolt["C"][key]) for key in ("head_top", "position", "axis"))
        np.testing.assert_allclose(top - centre, bolt["head_height"] / 2 * axis, atol=1e-4)
    for bolt in prior["bolts"]:
        moved = prior_from_motor @ [*bolt["motor"]["position"], 1]
        np.testing.assert_allclose(moved[:3], bolt["C"]["position"], atol=1e-3)
        assert bolt["motor"]["axis"][2] == pytest.approx(1 if bolt["side"] == "top" else -1)


def test_a_bolt_is_where_the_points_of_its_label_are(scenes: Path) -> None:
    scan = Reman18(root=scenes).full_scan(MOTOR)
    tree = KDTree(scan.points[scan.labels == Part.BOLT])
    for bolt in load_json(scenes / MOTOR / "prior_gt.json")["bolts"]:
        near = len(tree.query_ball_point(bolt["C"]["position"], bolt["head_diameter"]))
        assert near > 0.3 * bolt["scan_points"]
        assert bolt["scan_points"] > 20


def test_visible_means_what_the_pixels_say(scenes: Path) -> None:
    data = Reman18(root=scenes)
    for number, truth in load_json(scenes / MOTOR / "bolts.json").items():
        view = data.view(MOTOR, int(number))
        tree = KDTree(view.points[view.labels == Part.BOLT])
        assert truth["valid_pixels"] == len(view.points)
        assert truth["motor_pixels"] == np.count_nonzero(view.labels)
        for bolt in truth["bolts"]:
            expected = bolt["visible_fraction"] >= 0.10 and bolt["n_pixels"] >= 30
            assert bolt["visible"] == expected
            near = len(tree.query_ball_point(bolt["B"]["position"], 20))
            assert bolt["n_pixels"] <= len(view.points[view.labels == Part.BOLT])
            assert (bolt["visible_fraction"] > 0.02) <= (near > 0)
