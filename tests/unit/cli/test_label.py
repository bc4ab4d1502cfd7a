from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from plyfile import PlyData, PlyElement
from pypcd4 import PointCloud

import boltpose.segmentation.models
from boltpose.arrays import Float32Array
from boltpose.cli.label import _SUFFIXES  # pyright: ignore[reportPrivateUsage]
from boltpose.io.label_files import LABEL_SUFFIXES, PLY_LABEL, read_labelled_scan
from boltpose.io.palette import colors_of_labels
from boltpose.schema import Part
from boltpose.segmentation.predictor import PARTS, PartProbabilities
from tests.support.toy_motor import toy_motor
from tests.unit.cli.conftest import Run

TOY = toy_motor(density=0.15)
COUNT = len(TOY.points)
RNG = np.random.default_rng(0)
GREY = RNG.integers(100, 103, (COUNT, 3)).astype(np.uint8)


class HeightParts:
    """Which part, and how surely, follows from where a point is: any mix-up of rows shows."""

    def predict(self, points_prior: npt.ArrayLike, normals: npt.ArrayLike) -> PartProbabilities:
        del normals
        return PartProbabilities(probabilities=parts_at(np.asarray(points_prior)))


class HeightScene:
    def predict(self, points_camera: npt.ArrayLike) -> Float32Array:
        return (np.asarray(points_camera)[:, 2] / 200 + 0.5).astype(np.float32)


def parts_at(points: np.ndarray) -> Float32Array:
    share = np.clip((points.astype(np.float32)[:, 2] + 70) / 160, 0, 0.999)
    rows = np.repeat(((1 - share) / 12)[:, None], 6, axis=1)
    rows[np.arange(len(rows)), (share * 6).astype(int)] += 1 - rows.sum(axis=1)
    return rows.astype(np.float32)


class Stubs:
    parts = HeightParts()
    scene = HeightScene()


@pytest.fixture(autouse=True)
def _stubs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(boltpose.segmentation.models, "load_models", lambda folder=None: Stubs())


def put(path: Path, points: np.ndarray = TOY.points, **fields: np.ndarray) -> Path:
    columns = dict(zip("xyz", points.astype(np.float32).T, strict=True)) | fields
    rows = np.zeros(len(points), dtype=[(name, data.dtype) for name, data in columns.items()])
    for name, data in columns.items():
        rows[name] = data
    PlyData([PlyElement.describe(rows, "vertex")]).write(path)
    return path


def rgb_fields(colors: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip(("red", "green", "blue"), colors.T, strict=True))


def vertices(path: Path) -> np.ndarray:
    return PlyData.read(path)["vertex"].data


def xyz(rows: np.ndarray) -> np.ndarray:
    return np.stack([rows[name] for name in "xyz"], axis=1)


def rgb(rows: np.ndarray) -> np.ndarray:
    return np.stack([rows[name] for name in ("red", "green", "blue")], axis=1)


@pytest.mark.parametrize(("unit", "mm"), [("mm", 1.0), ("m", 1000.0)])
def test_rows_and_coordinates_are_the_inputs_with_their_label_paint_and_confidence(
    run: Run, tmp_path: Path, unit: str, mm: float
) -> None:
    scan = put(tmp_path / "a.ply", TOY.points[RNG.permutation(COUNT)] / mm, **rgb_fields(GREY))
    before = xyz(vertices(scan))

    outcome = run("label", scan, "--scan-unit", unit)

    assert outcome.code == 0, outcome.err
    rows = vertices(tmp_path / "a_labelled.ply")
    np.testing.assert_array_equal(xyz(rows), before)
    expected = parts_at((before.astype(np.float64) * mm).astype(np.float32))
    labels = rows[PLY_LABEL]
    # float32 metres and millimetres differ in the last bit, which may tip a point at a border
    assert (labels == expected.argmax(axis=1) + 1).mean() > 0.999
    np.testing.assert_allclose(rows["scalar_confidence"], expected.max(axis=1), atol=1e-4)
    np.testing.assert_array_equal(rgb(rows), colors_of_labels(labels))
    assert (
        f"comment boltpose, labelled, {unit}\n".encode()
        in (tmp_path / "a_labelled.ply").read_bytes()
    )
    counts = {int(line.split()[0]): int(re.findall(r"(\d+) +[\d.]+%", line)[0])
              for line in outcome.out.splitlines() if "%" in line}  # fmt: skip
    assert counts == {part: int((labels == part).sum()) for part in PARTS if part in labels}


def test_holes_keep_their_rows(run: Run, tmp_path: Path) -> None:
    points = TOY.points.copy()
    points[[2, 50]] = 0.0
    points[7] = np.nan
    scan = put(tmp_path / "a.ply", points)
    assert run("label", scan, "-o", tmp_path / "b.ply").code == 0
    rows = vertices(tmp_path / "b.ply")
    np.testing.assert_array_equal(xyz(rows), points.astype(np.float32))
    hole = np.isin(np.arange(COUNT), [2, 7, 50])
    assert not rows[PLY_LABEL][hole].any()
    assert not rows["scalar_confidence"][hole].any()
    assert rows[PLY_LABEL][~hole].all()


def test_without_colours_the_scans_own_stay(run: Run, tmp_path: Path) -> None:
    scan = put(tmp_path / "a.ply", **rgb_fields(GREY))
    assert run("label", scan, "--no-colours", "-o", tmp_path / "b.ply").code == 0
    np.testing.assert_array_equal(rgb(vertices(tmp_path / "b.ply")), GREY)
    bare = put(tmp_path / "c.ply")
    assert run("label", bare, "--no-colours", "-o", tmp_path / "d.ply").code == 0
    assert "red" not in (vertices(tmp_path / "d.ply").dtype.names or ())


@pytest.mark.parametrize("suffix", [".ply", ".pcd"])
def test_every_probability_on_request(run: Run, tmp_path: Path, suffix: str) -> None:
    scan = put(tmp_path / "a.ply")
    out = tmp_path / f"b{suffix}"
    assert run("label", scan, "--probability", "-o", out).code == 0
    rows = vertices(out) if suffix == ".ply" else PointCloud.from_path(out).pc_data
    prefix = "scalar_" if suffix == ".ply" else ""
    given = np.stack([rows[f"{prefix}p_{part.name.lower()}"] for part in PARTS], axis=1)
    np.testing.assert_allclose(given, parts_at(TOY.points), atol=1e-4)
    np.testing.assert_array_equal(given.max(axis=1), rows[f"{prefix}confidence"])


def test_a_view_is_told_from_its_surroundings(run: Run, tmp_path: Path) -> None:
    view = put(tmp_path / "a.ply")
    outcome = run("label", "--scene", "--probability", view, "-o", tmp_path / "b.pcd")
    assert outcome.code == 0, outcome.err
    rows = PointCloud.from_path(tmp_path / "b.pcd").pc_data
    on_motor = HeightScene().predict(TOY.points.astype(np.float32))
    np.testing.assert_array_equal(rows["label"], on_motor > 0.5)
    np.testing.assert_allclose(rows["p_motor"], on_motor, atol=1e-6)
    np.testing.assert_allclose(rows["confidence"], np.maximum(on_motor, 1 - on_motor), atol=1e-6)
    assert "motor" in outcome.out
    assert "main housing" not in outcome.out


@pytest.mark.parametrize("suffix", [".ply", ".pcd"])
def test_colours_to_labels_and_back(run: Run, tmp_path: Path, suffix: str) -> None:
    """What the paper's group has, through our labels, edited as CloudCompare does, and back."""
    painted = put(tmp_path / "painted.ply", **rgb_fields(colors_of_labels(TOY.labels)))
    labelled, again = tmp_path / f"labelled{suffix}", tmp_path / "again.ply"
    assert run("label", "--from-colours", painted, "-o", labelled).code == 0
    scan = read_labelled_scan(labelled)
    np.testing.assert_array_equal(scan.labels, TOY.labels)
    np.testing.assert_array_equal(scan.points, TOY.points.astype(np.float32))
    # the field is edited, the paint is not
    edited = TOY.labels.copy()
    edited[:9] = Part.GEAR
    put(
        tmp_path / "edited.ply",
        scalar_Classification=edited.astype("f4"),
        **rgb_fields(colors_of_labels(TOY.labels)),
    )
    assert run("label", "--to-colours", tmp_path / "edited.ply", "-o", again).code == 0
    np.testing.assert_array_equal(rgb(vertices(again)), colors_of_labels(edited))
    np.testing.assert_array_equal(vertices(again)[PLY_LABEL], edited)


def test_corrected_labels_make_a_prior_without_networks(run: Run, tmp_path: Path) -> None:
    rows = {"scalar_Classification": TOY.labels.astype("f4")}
    scan = put(tmp_path / "a.ply", **rows)
    outcome = run("prior", "build", scan, "--use-labels", "-o", tmp_path / "a.prior.npz")
    assert outcome.code == 0, outcome.err
    bare = put(tmp_path / "b.ply")
    outcome = run("prior", "build", bare, "--use-labels", "-o", tmp_path / "b.prior.npz")
    assert outcome.code == 2
    assert "found no labels, wanted a field `label`" in outcome.err


def test_suffixes_are_those_of_the_writer() -> None:
    assert _SUFFIXES == LABEL_SUFFIXES


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["nothing.ply"], "nothing.ply: found no such file"),
        (["a.ply", "-o", "b.las"], "b.las: found the ending '.las' for an output"),
        (["a.ply", "-o", "a.ply"], "an input file given as output"),
        (["a.ply", "-o", "gone/b.ply"], "no folder 'gone'"),
        (["a.ply", "--scan-unit", "m"], "an extent of"),
        (["few.ply"], "few.ply: found 40 points"),
        (["a.ply", "--from-colours"], "a.ply: found no colours"),
        (["a.ply", "--to-colours"], "a.ply: found no labels"),
        (["grey.ply", "--from-colours"], "grey.ply: found the colour (10"),
        (["nan.ply", "--to-colours"], "label nan on 1 of"),
        (["a.ply", "--from-colours", "--to-colours"], "exclude each other"),
        (["a.ply", "--from-colours", "--scene"], "--scene is about networks"),
        (["a.ply", "--to-colours", "--probability"], "--probability is about networks"),
        (["a.ply", "--to-colours", "--models", "m"], "--models is about networks"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], says: str
) -> None:
    monkeypatch.chdir(tmp_path)
    put(Path("a.ply"))
    put(Path("few.ply"), TOY.points[::200][:40])
    put(Path("grey.ply"), **rgb_fields(GREY))
    labels = TOY.labels.astype("f4")
    labels[4] = np.nan
    put(Path("nan.ply"), label=labels)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    outcome = run("label", *arguments)

    assert outcome.code == 2
    assert outcome.err.startswith("boltpose: ")
    assert outcome.err.count("\n") == 1
    assert says in outcome.err
    assert outcome.out == ""
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
