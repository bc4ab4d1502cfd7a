from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from boltpose.datasets.labelled_motors import LabelledMotors
from boltpose.datasets.labelled_scans import LabelledScans
from boltpose.datasets.open import cache_folder, open_data_set
from boltpose.datasets.part_clouds import PartCloudConfig, load_part_clouds
from boltpose.datasets.scene_clouds import load_scene_clouds
from boltpose.errors import ConfigError, InputFileError, UnitError
from boltpose.io.label_files import write_labelled_scan
from tests.support.toy_motor import toy_motor

TOY = toy_motor(density=0.3)
REMAN18 = Path(__file__).parents[3] / "data" / "reman18"


def put(path: Path, labels: np.ndarray = TOY.labels, *, scale: float = 1.0) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_labelled_scan(path, TOY.points * scale, labels)
    return path


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    """Two motors of one family, one of its own with two views, and things that are no scans."""
    root = tmp_path / "mine"
    put(root / "bosch" / "b1.ply")
    put(root / "bosch" / "b2.PCD")
    put(root / "valeo.ply")
    put(root / "valeo_views" / "2.pcd", np.where(TOY.labels == 6, 0, 1).astype(np.uint8))
    put(root / "valeo_views" / "1.ply")
    put(root / ".trash" / "old.ply")
    (root / "notes.txt").write_text("second scanner")
    return root


def test_layout_tells_motors_families_and_views(mine: Path) -> None:
    data = LabelledScans(root=mine)
    assert data.motors == ("b1", "b2", "valeo")
    assert data.families == ("bosch", "valeo")
    assert [data.family(motor) for motor in data.motors] == ["bosch", "bosch", "valeo"]
    assert data.motors_of("bosch") == ("b1", "b2")
    assert [data.view_count(motor) for motor in data.motors] == [0, 0, 2]
    with pytest.raises(ValueError, match=r"family must be one of .*, got 'denso'"):
        data.motors_of("denso")


def test_scans_and_views_come_with_their_labels(mine: Path) -> None:
    data: LabelledMotors = LabelledScans(root=mine)
    for motor in data.motors:
        scan = data.full_scan(motor)
        assert len(scan.points) == len(scan.labels) > 0.99 * len(TOY.points)
        # the toy's points are its own, whatever their order
        row = {tuple(point): label for point, label in zip(TOY.points, TOY.labels, strict=True)}
        found = [row[tuple(point)] for point in scan.points]
        np.testing.assert_array_equal(found, scan.labels)
    np.testing.assert_array_equal(data.view("valeo", 0).labels, TOY.labels)
    assert set(data.view("valeo", 1).labels) == {0, 1}


def test_a_full_scan_is_without_background_and_no_denser_than_the_networks_know(
    tmp_path: Path,
) -> None:
    rng = np.random.default_rng(0)
    dense = np.repeat(TOY.points, 8, axis=0) + rng.normal(scale=0.02, size=(8 * len(TOY.points), 3))
    table = np.column_stack([rng.uniform(-200, 200, (9000, 2)), np.full(9000, -90.0)])
    labels = np.r_[np.repeat(TOY.labels, 8), np.zeros(9000, dtype=np.uint8)]
    (tmp_path / "mine").mkdir()
    write_labelled_scan(tmp_path / "mine" / "a.ply", np.concatenate([dense, table]), labels)

    scan = LabelledScans(root=tmp_path / "mine").full_scan("a")

    assert scan.labels.min() == 1
    assert len(scan.points) < len(dense) / 4


def test_every_unit(tmp_path: Path) -> None:
    put(tmp_path / "a.ply", scale=0.001)
    assert np.ptp(LabelledScans(root=tmp_path, unit="m").full_scan("a").points[:, 2]) > 100  # pyright: ignore[reportArgumentType]
    with pytest.raises(UnitError, match="looks like m"):
        LabelledScans(root=tmp_path).full_scan("a")
    with pytest.raises(ConfigError, match="unknown unit 'km'"):
        open_data_set(tmp_path, unit="km")


def test_trainers_make_their_clouds_from_it(mine: Path, tmp_path: Path) -> None:
    data = open_data_set(mine)
    clouds = load_part_clouds(data, tmp_path / "cache", config=PartCloudConfig(copies=1))
    assert clouds.motors == data.motors
    assert clouds.families == ("bosch", "bosch", "valeo")
    for cloud in clouds.of_family("bosch"):
        np.testing.assert_array_equal(cloud.labels, data.full_scan(cloud.motor).labels)
    views = load_scene_clouds(data, tmp_path / "scene")
    assert [(view.motor, view.view) for view in views] == [("valeo", 0), ("valeo", 1)]


def _motors(data: LabelledMotors) -> tuple[str, ...]:
    return data.motors


def test_it_survives_the_way_to_another_process(mine: Path) -> None:
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        assert pool.submit(_motors, LabelledScans(root=mine)).result() == ("b1", "b2", "valeo")


def test_corrected_labels_are_another_data_set_to_caches(mine: Path) -> None:
    before = LabelledScans(root=mine)
    places = {cache_folder(before, Path("cache"))}
    assert cache_folder(LabelledScans(root=mine), Path("cache")) in places
    labels = TOY.labels.copy()
    labels[0] = 3
    for change in (
        lambda: put(mine / "bosch" / "b1.ply", labels),
        lambda: put(mine / "valeo_views" / "1.ply", labels),
        lambda: (mine / "bosch").rename(mine / "delco"),
        lambda: put(mine / "new.ply"),
    ):
        change()
        place = cache_folder(LabelledScans(root=mine), Path("cache"))
        assert place.parent == Path("cache")
        assert place.name.startswith("mine-")
        assert place not in places
        places.add(place)


def test_data_sets_with_the_same_motors_do_not_share_a_cache(tmp_path: Path) -> None:
    copied = tmp_path / REMAN18.name
    for motor in ("motor_000", "motor_001"):
        (copied / motor).mkdir(parents=True)
        for name in ("prior.ply", "prior_gt.json"):
            (copied / motor / name).write_bytes((REMAN18 / motor / name).read_bytes())
    places = {cache_folder(open_data_set(root), Path("cache")) for root in (REMAN18, copied)}
    assert len(places) == 2
    assert {place.parent for place in places} == {Path("cache")}


@pytest.mark.parametrize(
    ("make", "found"),
    [
        (lambda root: None, "no such folder"),
        (lambda root: root.write_text(""), "a file"),
        (lambda root: root.mkdir(), "an empty folder"),
        (
            lambda root: [
                (root / "sub").mkdir(parents=True),
                *((root / name).write_text("") for name in ("a.stl", "b.stl", "c.e57")),
            ],
            "no scan but 1 x .e57, 2 x .stl, 1 folders",
        ),
    ],
)
def test_a_folder_of_neither_layout_is_one_clear_line(tmp_path: Path, make, found: str) -> None:
    make(tmp_path / "mine")
    with pytest.raises(InputFileError) as caught:
        open_data_set(tmp_path / "mine")
    text = str(caught.value)
    assert f"found {found}, wanted labelled full scans NAME.ply" in text
    assert text.endswith("or motor_*/prior.ply as in reman18")
    assert "\n" not in text


def test_two_scans_of_one_name_are_refused(tmp_path: Path) -> None:
    put(tmp_path / "a" / "scan.ply")
    put(tmp_path / "b" / "scan.ply")
    with pytest.raises(InputFileError, match=r"b/scan\.ply: found a second scan named 'scan'"):
        open_data_set(tmp_path)


def test_views_without_their_motor_are_refused(tmp_path: Path) -> None:
    put(tmp_path / "a.ply")
    put(tmp_path / "b_views" / "1.ply")
    with pytest.raises(InputFileError, match=r"b_views: found views without a full scan"):
        open_data_set(tmp_path)
    put(tmp_path / "b_views" / "1.ply").parent.rename(tmp_path / "a_views")
    put(tmp_path / "family" / "c.ply")
    put(tmp_path / "family" / "d_views" / "1.ply")
    with pytest.raises(InputFileError, match=r"d_views: found views without a full scan"):
        open_data_set(tmp_path)


def test_a_scan_that_is_all_background_is_refused(tmp_path: Path) -> None:
    path = put(tmp_path / "a.ply", np.zeros_like(TOY.labels))
    with pytest.raises(InputFileError, match=f"{path}: found 0 of {len(TOY.labels)} points"):
        open_data_set(tmp_path).full_scan("a")
