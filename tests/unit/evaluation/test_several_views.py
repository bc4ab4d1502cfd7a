from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from boltpose.errors import InputFileError
from boltpose.evaluation.codec import encode
from boltpose.evaluation.several_views_cases import (
    Case,
    Kind,
    hide,
    list_cases,
    make_shots,
    still_seen,
)
from boltpose.evaluation.several_views_report import PICTURE, draw_several_views, sections
from boltpose.evaluation.several_views_run import (
    FOLDER,
    CaseRecord,
    ClampingRecord,
    read_clampings,
)
from boltpose.geometry.transforms import Transform, rotation_angle_rad
from boltpose.locate_views import Shot
from boltpose.schema import Scan


def shot(number: int) -> Shot:
    rng = np.random.default_rng(number)
    points = rng.uniform((-100, -80, 600), (100, 80, 700), (5000, 3))
    camera = Transform.from_parts("base", "camera", np.eye(3), (10.0 * number, 0, 0))
    return Shot(scan=Scan(points=points), base_from_camera=camera)


SHOTS = [shot(number) for number in range(4)]
MASKS = [np.abs(one.scan.points[:, 0]) < 50 for one in SHOTS]


def test_every_clamping_is_seen_by_one_to_all_views() -> None:
    cases = list_cases(4)
    as_is = [case.views for case in cases if case.kind is Kind.AS_IS]
    assert as_is == [(0,), (1,), (2,), (3,), (0, 1), (0, 1, 2), (0, 1, 2, 3)]
    assert {case.kind for case in cases} == set(Kind)
    assert len(set(cases)) == len(cases)
    assert all(len(case.views) > 1 for case in cases if case.must_be_refused)


@pytest.mark.parametrize("kind", [kind for kind in Kind if kind is not Kind.HIDDEN])
def test_only_the_last_shot_is_wrong_and_by_what_the_case_says(kind: Kind) -> None:
    case = Case(kind=kind, views=(0, 2))
    first, last = make_shots(case, SHOTS, MASKS, 5)
    assert first is SHOTS[0]
    before, after = SHOTS[2].base_from_camera, last.base_from_camera
    shift = float(np.linalg.norm(after.translation_mm - before.translation_mm))
    turn = np.degrees(rotation_angle_rad(after.rotation.T @ before.rotation))
    moved = np.linalg.norm(last.scan.points - SHOTS[2].scan.points, axis=1)
    wanted = {Kind.SHIFT_HALF: 0.5, Kind.SHIFT_ONE: 1.0, Kind.SHIFT_TWO: 2.0}.get(kind, 0.0)
    assert shift == pytest.approx(wanted)
    assert turn == pytest.approx(0.5 if kind is Kind.TURN else 0.0)
    np.testing.assert_allclose(moved, np.where(MASKS[2], 2.0 * (kind is Kind.MOVED), 0.0))


def test_nine_tenths_of_the_motor_are_hidden_and_what_hides_them_is_measured() -> None:
    scan, mask = SHOTS[0].scan, MASKS[0]
    after = hide(scan, mask, np.random.default_rng(3))
    seen = still_seen(SHOTS[0], replace(SHOTS[0], scan=after), mask)
    assert seen.sum() == pytest.approx(0.1 * mask.sum(), abs=2)
    gone = (after.points != scan.points).any(axis=1)
    assert np.ptp(after.points[gone, 2]) < 1e-9
    assert after.points[gone, 2].max() < scan.points[:, 2].min()
    # every point stays on its pixel's ray
    np.testing.assert_allclose(
        after.points[:, :2] / after.points[:, 2:], scan.points[:, :2] / scan.points[:, 2:]
    )


def record(motor: int) -> ClampingRecord:
    def outcome(case: Case) -> CaseRecord:
        count = len(case.views)
        return CaseRecord(
            kind=str(case.kind),
            views=case.views,
            must_be_refused=case.must_be_refused,
            is_ok=not case.must_be_refused,
            failed=("views_disagree",) if case.must_be_refused else (),
            p_correct=0.0 if case.must_be_refused else 0.99,
            worst_bolt_mm=0.2 / count,
            worst_axis_deg=0.01,
            depth_mm=-0.1 / count,
            beside_mm=0.02,
            depth_sigma_mm=0.12 / count,
            bolt_sigmas=(0.5, 3.5),
            views_apart_sigmas=None if count == 1 else 20.0 if case.must_be_refused else 2.0,
        )

    return ClampingRecord(
        fingerprint="x",
        motor=f"motor_{motor:05d}",
        family="direct_closed",
        views_apart_deg=60.0,
        cases=tuple(outcome(case) for case in list_cases(4)),
    )


@pytest.fixture
def results(tmp_path: Path) -> Path:
    folder = tmp_path / "results" / FOLDER
    folder.mkdir(parents=True)
    for motor in range(2):
        text = json.dumps(encode(record(motor)))
        (folder / f"motor_{motor:05d}.json").write_text(text)
    return tmp_path / "results"


def test_records_survive_their_files(results: Path) -> None:
    assert read_clampings(results / FOLDER) == (record(0), record(1))
    (results / FOLDER / "motor_00001.json").write_text("{}")
    with pytest.raises(InputFileError, match="motor_00001"):
        read_clampings(results / FOLDER)


def test_the_report_tells_errors_by_number_of_views(results: Path, tmp_path: Path) -> None:
    text = "\n\n".join(sections(results))
    assert "simulated" in text.lower()
    assert (
        "| 1 | 8 / 8 | 0.200 / 0.200 / 0.200 | 0.100 / 0.100 / 0.100 | 0.120 | 0.83 | 50 % | 0 |"
        in text
    )
    assert (
        "| 4 | 2 / 2 | 0.050 / 0.050 / 0.050 | 0.025 / 0.025 / 0.025 | 0.030 | 0.83 | 50 % | 0 |"
        in text
    )
    assert "at most 2.0 sigma apart" in text
    assert sections(tmp_path / "nothing") == []


def test_a_missed_bolt_is_wrong_and_so_is_no_pose() -> None:
    case = record(0).cases[0]
    assert not case.is_wrong
    assert replace(case, worst_bolt_mm=2.1).is_wrong
    assert replace(case, worst_axis_deg=2.1).is_wrong
    assert replace(case, worst_bolt_mm=None).is_wrong


def test_the_picture_is_drawn_the_same_twice(results: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    report = tmp_path / "docs" / "results.md"
    assert draw_several_views(results, report)
    first = (report.parent / PICTURE).read_bytes()
    assert draw_several_views(results, report)
    assert (report.parent / PICTURE).read_bytes() == first
    assert len(first) < 200_000
    assert not draw_several_views(tmp_path / "nothing", report)
