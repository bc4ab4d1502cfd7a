"""Every bad input ends in exit 2 with one line that names it, and leaves nothing behind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.support import results
from tests.unit.cli.conftest import Cell, Run, write_matrix, write_ply


def check(run: Run, cell: Cell, names: str | Path, *arguments: str | Path) -> None:
    before = {path: path.read_bytes() for path in cell.folder.rglob("*") if path.is_file()}

    outcome = run(*arguments)

    assert outcome.code == 2
    assert outcome.out == ""
    assert outcome.err.startswith("boltpose: ")
    assert outcome.err.count("\n") == 1, outcome.err
    assert str(names) in outcome.err
    after = {path: path.read_bytes() for path in cell.folder.rglob("*") if path.is_file()}
    assert after == before


def locate(cell: Cell, **changed: Path) -> list[str | Path]:
    files = {"scan": cell.scan, "prior": cell.prior, "hand_eye": cell.hand_eye} | changed
    return [
        "locate", files["scan"], "--prior", files["prior"], "--hand-eye", files["hand_eye"],
        "-o", cell.folder / "poses.json",
    ]  # fmt: skip


@pytest.mark.parametrize("which", ["scan", "prior", "hand_eye"])
def test_missing_file(run: Run, cell: Cell, which: str) -> None:
    missing = cell.folder / f"missing{getattr(cell, which).suffix}"
    check(run, cell, missing, *locate(cell, **{which: missing}))


@pytest.mark.parametrize("which", ["scan", "prior", "hand_eye"])
def test_empty_file(run: Run, cell: Cell, which: str) -> None:
    getattr(cell, which).write_bytes(b"")
    check(run, cell, getattr(cell, which), *locate(cell))


@pytest.mark.parametrize("which", ["scan", "prior", "hand_eye"])
def test_folder_instead_of_a_file(run: Run, cell: Cell, which: str) -> None:
    folder = cell.folder / f"folder{getattr(cell, which).suffix}"
    folder.mkdir()
    check(run, cell, folder, *locate(cell, **{which: folder}))


@pytest.mark.parametrize("which", ["scan", "prior", "hand_eye"])
def test_noise_instead_of_a_file(run: Run, cell: Cell, which: str) -> None:
    getattr(cell, which).write_bytes(np.random.default_rng(0).bytes(5000))
    check(run, cell, getattr(cell, which), *locate(cell))


def test_scan_of_unknown_suffix(run: Run, cell: Cell) -> None:
    scan = cell.scan.rename(cell.folder / "scan.xyz")
    check(run, cell, scan, *locate(cell, scan=scan))


def test_scan_in_metres(run: Run, cell: Cell) -> None:
    write_ply(cell.scan, results.cube_scan(cell.known).points / 1000)
    check(run, cell, "--scan-unit", *locate(cell))


def test_full_scan_in_metres(run: Run, cell: Cell) -> None:
    write_ply(cell.scan, cell.known.points / 1000)
    check(run, cell, cell.scan, "prior", "build", cell.scan, "-o", cell.folder / "new.prior.npz")


def test_hand_eye_in_metres(run: Run, cell: Cell) -> None:
    matrix = results.BASE_FROM_CAMERA.matrix.copy()
    matrix[:3, 3] /= 1000
    write_matrix(cell.hand_eye, matrix)
    check(run, cell, "--hand-eye-unit", *locate(cell))


@pytest.mark.parametrize("change", ["mirrored", "sheared", "transposed", "nan"])
def test_hand_eye_that_is_no_rigid_motion(run: Run, cell: Cell, change: str) -> None:
    matrix = results.BASE_FROM_CAMERA.matrix.copy()
    if change == "mirrored":
        matrix[:3, 0] *= -1
    elif change == "sheared":
        matrix[0, 1] += 0.1
    elif change == "transposed":
        matrix = matrix.T
    else:
        matrix[0, 0] = np.nan
    write_matrix(cell.hand_eye, matrix)
    check(run, cell, cell.hand_eye, *locate(cell))


def test_prior_that_is_another_archive(run: Run, cell: Cell) -> None:
    np.savez(cell.prior, points=cell.known.points)
    check(run, cell, cell.prior, *locate(cell))
    check(run, cell, cell.prior, "prior", "show", cell.prior)


def test_prior_with_a_pickle_in_it_is_not_opened(run: Run, cell: Cell) -> None:
    np.savez(cell.prior, header=np.array([{"a": 1}], dtype=object))
    check(run, cell, cell.prior, *locate(cell))


def test_mesh_where_a_scan_is_wanted(run: Run, cell: Cell) -> None:
    mesh = cell.folder / "motor.stl"
    mesh.write_text("solid x\nendsolid x\n")
    check(run, cell, mesh, *locate(cell, scan=mesh))


def test_parts_for_a_scan(run: Run, cell: Cell) -> None:
    names = cell.folder / "names.yaml"
    names.write_text("'*': bolt\n")
    check(
        run, cell, "--parts", "prior", "build", cell.scan,
        "--parts", names, "-o", cell.folder / "new.prior.npz",
    )  # fmt: skip


def test_robot_pose_without_hand_eye(run: Run, cell: Cell) -> None:
    check(
        run, cell, "--hand-eye", "locate", cell.scan, "--prior", cell.prior,
        "--robot-pose", cell.hand_eye,
    )  # fmt: skip


def test_models_folder_without_networks(run: Run, cell: Cell) -> None:
    empty = cell.folder / "empty"
    empty.mkdir()
    check(run, cell, empty, *locate(cell), "--models", empty)


@pytest.mark.parametrize(
    ("option", "name", "says"),
    [
        ("-o", "nowhere/poses.json", "no folder"),
        ("-o", "poses.txt", "'.txt'"),
        ("-o", "taken.json", "a folder"),
        ("--picture", "nowhere/p.png", "no folder"),
        ("--picture", "p.bmp", "'.bmp'"),
        ("-o", "scan.ply/poses.json", "no folder"),
    ],
)
def test_output_that_cannot_be_written(
    run: Run, cell: Cell, option: str, name: str, says: str
) -> None:
    (cell.folder / "taken.json").mkdir()
    check(
        run, cell, cell.folder / name, "locate", cell.scan, "--prior", cell.prior,
        option, cell.folder / name,
    )  # fmt: skip
    check(run, cell, says, "locate", cell.scan, "--prior", cell.prior, option, cell.folder / name)


def test_output_over_an_input(run: Run, cell: Cell) -> None:
    hand_eye = cell.hand_eye.rename(cell.folder / "hand_eye.json")
    check(
        run, cell, hand_eye, "locate", cell.scan, "--prior", cell.prior,
        "--hand-eye", hand_eye, "-o", cell.folder / "." / "hand_eye.json",
    )  # fmt: skip


def test_prior_over_its_own_scan(run: Run, cell: Cell) -> None:
    scan = cell.folder / "scan.npz"
    np.savez(scan, points=cell.known.points)
    check(run, cell, scan, "prior", "build", scan, "-o", scan)


@pytest.mark.parametrize("point", ["1,2", "a,b,c", "1;2;3", "1,2,nan", ""])
def test_point_to_add_that_is_none(run: Run, cell: Cell, point: str) -> None:
    check(run, cell, f"'{point}'", "prior", "edit", cell.prior, "--add", point)


def test_bolt_to_remove_that_does_not_exist(run: Run, cell: Cell) -> None:
    check(run, cell, "'T9'", "prior", "edit", cell.prior, "--remove", "T1", "--remove", "T9")


def test_nothing_to_edit(run: Run, cell: Cell) -> None:
    check(run, cell, "--add", "prior", "edit", cell.prior)


def test_demo_into_a_file(run: Run, cell: Cell) -> None:
    check(run, cell, cell.scan, "demo", "-o", cell.scan)
