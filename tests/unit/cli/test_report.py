from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from boltpose.io.digest import sha256_of
from boltpose.report import render_report
from boltpose.results import write_poses
from boltpose.saved_result import open_saved_result
from tests.support import results
from tests.unit.cli.conftest import Cell, Run


@pytest.fixture(autouse=True)
def _coarse_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("boltpose.report.pictures._DOTS_PER_PX", 1)


@pytest.fixture
def poses(cell: Cell) -> Path:
    """A saved result of the cell's files."""
    path = cell.folder / "poses.json"
    provenance = {
        "version": "0",
        "scan": cell.scan.name,
        "scan_sha256": sha256_of(cell.scan),
        "prior_sha256": sha256_of(cell.prior),
        "inputs": {
            "scans": [str(cell.scan)],
            "scan_unit": "mm",
            "camera": None,
            "prior": str(cell.prior),
        },
    }
    result = replace(results.located(cell.known), provenance=provenance)
    write_poses(path, result, {"registration": 12.3})
    return path


def test_the_page_is_that_of_the_saved_result(run: Run, cell: Cell, poses: Path) -> None:
    page = cell.folder / "out.html"
    outcome = run("report", poses, "-o", page)

    assert outcome.code == 0, outcome.err
    assert outcome.out == ""
    assert f"wrote {page}" in outcome.err.replace("\n", "")
    saved = open_saved_result(poses)
    wanted = render_report(saved.result, saved.scan, saved.prior, saved.timings_ms)
    assert page.read_text("utf-8") == wanted


def test_the_page_stands_beside_the_result_by_default(run: Run, poses: Path) -> None:
    assert run("report", poses).code == 0
    assert poses.with_suffix(".html").read_text("utf-8").startswith("<!doctype html>")


def test_json_says_where_the_page_is_and_what_it_says(run: Run, cell: Cell, poses: Path) -> None:
    outcome = run("report", poses, "-o", cell.folder / "out.html", "--json")

    assert json.loads(outcome.out) == {"page": str(cell.folder / "out.html"), "status": "ok"}
    assert outcome.err == ""


def test_another_scan_under_a_result_is_refused_and_leaves_no_old_page(
    run: Run, cell: Cell, poses: Path
) -> None:
    page = cell.folder / "out.html"
    page.write_text("an older page")
    cell.scan.write_bytes(cell.scan.read_bytes() + b"0 0 0\n")

    outcome = run("report", poses, "-o", page)

    assert outcome.code == 2
    assert "another file" in outcome.err
    assert not page.exists()


@pytest.mark.parametrize("name", ["out.pdf", "missing/out.html"])
def test_a_page_that_cannot_be_written_is_told_before_the_work(
    run: Run, cell: Cell, poses: Path, name: str
) -> None:
    outcome = run("report", poses, "-o", cell.folder / name)

    assert outcome.code == 2
    assert outcome.err.startswith("boltpose: ")
    assert len(outcome.err.splitlines()) == 1


def test_a_missing_result_is_named(run: Run, cell: Cell) -> None:
    outcome = run("report", cell.folder / "none.json")

    assert outcome.code == 2
    assert "no such file" in outcome.err
    assert "boltpose locate -o" in outcome.err
