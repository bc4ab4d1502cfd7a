from __future__ import annotations

import json
from pathlib import Path

import pytest

from boltpose.errors import InputFileError
from boltpose.evaluation.codec import encode
from boltpose.evaluation.table1_report import PAPER, draw_table1, render_table1
from boltpose.evaluation.table1_run import (
    CHAINS_MM,
    CURVE_MM,
    FORMAT,
    IcpFit,
    StillFit,
    Table1Motor,
    Table1View,
    read_table1,
)


def fit(chain: tuple[float, ...], *, is_plane: bool, worst_bolt_mm: float) -> IcpFit:
    return IcpFit(
        is_point_to_plane=is_plane,
        distances_mm=chain,
        rmse_mm=0.75 * chain[-1],
        matched=0.03,
        wall_s=1.5,
        worst_bolt_mm=worst_bolt_mm,
        rotation_deg=0.01,
    )


def view(number: int, worst_bolt_mm: float) -> Table1View:
    return Table1View(
        view=number,
        global_worst_bolt_mm=12.0,
        fits=tuple(
            fit(chain, is_plane=is_plane, worst_bolt_mm=worst_bolt_mm)
            for is_plane in (False, True)
            for chain in CHAINS_MM
        ),
        still=tuple(
            StillFit(
                kind=kind,
                rmse_mm=tuple(0.75 * distance for distance in CURVE_MM),
                matched=tuple(0.5 for _ in CURVE_MM),
            )
            for kind in ("true", "off")
        ),
    )


@pytest.fixture
def results(tmp_path: Path) -> Path:
    folder = tmp_path / "table1"
    folder.mkdir()
    record = Table1Motor(format=FORMAT, motor="motor_000", views=(view(0, 0.2), view(1, 55.0)))
    (folder / "motor_000.json").write_text(json.dumps(encode(record)))
    return tmp_path


def test_every_row_stands_beside_the_papers_and_failures_are_counted(results: Path) -> None:
    text = "\n".join(render_table1(results / "table1"))
    rows = [line for line in text.splitlines() if line.startswith("| point-to-")]
    assert len(rows) == len(PAPER) == 6
    for row, (rmse, seconds) in zip(rows, PAPER.values(), strict=True):
        assert f"| {rmse:g} | {seconds:.2f} |" in row
        assert "| 0.200 / 0.200 / 0.200 | 1 of 2 |" in row
    assert "| point-to-plane | 10 -> 1 -> 0.1 | 0.0762 | 6.39 | 0.075 | 1.50 | 3.0 % |" in text


def test_nothing_measured_is_no_section_and_no_picture(tmp_path: Path) -> None:
    assert render_table1(tmp_path / "table1") == []
    assert not draw_table1(tmp_path, tmp_path / "report.md")


def test_the_picture_is_drawn_beside_the_report(results: Path) -> None:
    assert draw_table1(results, results / "docs" / "report.md")
    first = (results / "docs" / "images" / "table1.png").read_bytes()
    assert draw_table1(results, results / "docs" / "report.md")
    assert (results / "docs" / "images" / "table1.png").read_bytes() == first


@pytest.mark.parametrize("text", ["{", "[]", '{"format": "other/9"}'])
def test_a_broken_record_is_named(results: Path, text: str) -> None:
    (results / "table1" / "motor_001.json").write_text(text)
    with pytest.raises(InputFileError, match="motor_001"):
        read_table1(results / "table1")
