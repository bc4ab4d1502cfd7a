"""What others do to the files of a `boltpose locate` while it is at work."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable

import pytest

from boltpose.cli.exit_codes import ExitCode
from boltpose.results import write_poses
from boltpose.schema import LocateResult
from tests.support import results
from tests.unit.cli.conftest import Cell, Run, write_matrix, write_ply

Answer = Callable[[Callable[..., LocateResult]], None]


def while_it_works(act: Callable[[], object]) -> Callable[..., LocateResult]:
    """A `locate` that accepts, and in the middle of which something happens."""

    def locate(_scan, prior, base_from_camera) -> LocateResult:
        act()
        return results.located(prior, base_from_camera)

    return locate


def next_scan(cell: Cell) -> None:
    write_ply(cell.scan, results.cube_scan(cell.known).points + [30.0, 0.0, 0.0])


def next_hand_eye(cell: Cell) -> None:
    write_matrix(cell.hand_eye, results.BASE_FROM_CAMERA.inverse().matrix)


def same_scan_under_its_name_again(cell: Cell) -> None:
    copy = cell.folder / "copy.ply"
    copy.write_bytes(cell.scan.read_bytes())
    copy.replace(cell.scan)


@pytest.mark.parametrize(
    "act",
    [
        next_scan,
        next_hand_eye,
        same_scan_under_its_name_again,
        lambda cell: cell.scan.unlink(),
        lambda cell: cell.prior.write_bytes(b"another"),
    ],
)
def test_an_input_that_changes_meanwhile_gives_no_pose(
    run: Run, cell: Cell, answer: Answer, act: Callable[[Cell], object]
) -> None:
    poses = cell.folder / "poses.json"
    answer(while_it_works(lambda: act(cell)))
    outcome = run(
        "locate", cell.scan, "--prior", cell.prior, "--hand-eye", cell.hand_eye,
        "-o", poses, "--report", cell.folder / "r.html",
    )  # fmt: skip
    assert outcome.code == ExitCode.BAD_INPUT
    assert "changed while boltpose was at work" in outcome.err
    assert not poses.exists()
    assert not (cell.folder / "r.html").exists()


def test_two_runs_into_one_file_give_none(run: Run, cell: Cell, answer: Answer) -> None:
    poses = cell.folder / "poses.json"
    answer(while_it_works(lambda: write_poses(poses, results.refused(cell.known))))
    outcome = run(
        "locate", cell.scan, "--prior", cell.prior, "--hand-eye", cell.hand_eye, "-o", poses
    )
    assert outcome.code == ExitCode.BAD_INPUT
    assert "another run wrote it meanwhile" in outcome.err
    assert not poses.exists()


def test_behind_a_link_no_older_result_stays(run: Run, cell: Cell) -> None:
    old, link = cell.folder / "cell_1.json", cell.folder / "poses.json"
    write_poses(old, results.located(cell.known))
    link.symlink_to(old)
    outcome = run("locate", cell.folder / "none.ply", "--prior", cell.prior, "-o", link)
    assert outcome.code == ExitCode.BAD_INPUT
    assert not old.exists()

    write_poses(old, results.located(cell.known))
    settings = cell.folder / "boltpose.toml"
    settings.write_text("[locate]\nnonsense = 1\n")
    assert run("locate", cell.scan, "--config", settings, "-o", link).code == ExitCode.BAD_INPUT
    assert not old.exists()


def test_of_a_folder_the_prior_that_was_found_has_its_hash(
    run: Run, cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    from boltpose.io.digest import sha256_of

    def variant(_scan, library, base_from_camera, *_rest, provenance, **_more) -> LocateResult:
        return results.located(cell.known, base_from_camera)

    monkeypatch.setattr("boltpose.variants.locate_variant", variant)
    poses = cell.folder / "poses.json"
    outcome = run(
        "locate", cell.scan, "--prior", cell.folder, "--hand-eye", cell.hand_eye, "-o", poses
    )
    assert outcome.code == ExitCode.OK
    assert json.loads(poses.read_text())["provenance"]["prior_sha256"] == sha256_of(cell.prior)


@pytest.mark.parametrize(
    ("age_s", "found"), [(100.0, "written 100 s ago"), (-100.0, "written 100 s from now")]
)
def test_an_old_scan_or_robot_pose_gives_no_pose(
    run: Run, cell: Cell, answer: Answer, age_s: float, found: str
) -> None:
    answer(while_it_works(lambda: None))
    poses, arm = cell.folder / "poses.json", cell.folder / "arm.yaml"
    write_matrix(arm, results.BASE_FROM_CAMERA.matrix)
    call = (
        "locate", cell.scan, "--prior", cell.prior, "--hand-eye", cell.hand_eye,
        "--robot-pose", arm, "-o", poses, "--max-age",
    )  # fmt: skip
    assert run(*call, "60").code == ExitCode.OK
    for path in (cell.scan, arm):
        kept = path.stat().st_mtime
        then = time.time() - age_s
        os.utime(path, (then, then))
        outcome = run(*call, "60")
        assert outcome.code == ExitCode.BAD_INPUT
        assert f"{path.name}: found a file {found}" in " ".join(outcome.err.split())
        assert not poses.exists()
        if age_s > 0:
            assert run(*call, "200").code == ExitCode.OK
        os.utime(path, (kept, kept))
    assert run(*call, "0").code == run(*call, "nan").code == ExitCode.BAD_INPUT
