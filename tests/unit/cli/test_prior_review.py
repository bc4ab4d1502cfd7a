from __future__ import annotations

import json

import pytest

pytest.importorskip("viser", reason="the page needs the extra `viewer`")

from boltpose.cli.exit_codes import ExitCode
from boltpose.prior.file import read_prior
from boltpose.prior.review import ReviewSession
from boltpose.prior.review_edits import ConfirmBolt
from boltpose.viewer.page import Page
from tests.unit.cli.conftest import Cell, Run


def ends_with_ctrl_c(_: Page) -> None:
    raise KeyboardInterrupt


def test_an_ended_review_says_what_is_saved_and_what_is_not(
    run: Run, cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = cell.prior.read_bytes()
    with ReviewSession.open(cell.prior) as session:
        session.do(ConfirmBolt(bolt="B1"))
    monkeypatch.setattr(Page, "wait", ends_with_ctrl_c)

    outcome = run("prior", "review", cell.prior, "--port", "0", "--no-browser", "--json")

    assert outcome.code == ExitCode.OK
    assert json.loads(outcome.out) == {"prior": str(cell.prior), "saved": [], "unsaved_edits": 1}
    assert "edits of an earlier review taken up: 1" in outcome.err
    assert "http://127.0.0.1:" in outcome.err
    assert cell.prior.read_bytes() == before
    outcome = run("prior", "review", cell.prior, "--port", "0", "--no-browser", "--discard")
    assert "not saved" not in outcome.err
    assert not read_prior(cell.prior).bolt("B1").is_sure


def test_show_tells_of_the_reviews_of_a_prior(run: Run, cell: Cell) -> None:
    assert "reviewed" not in run("prior", "show", cell.prior).out
    with ReviewSession.open(cell.prior) as session:
        session.do(ConfirmBolt(bolt="B1"))
        session.save(by="A. Technician", date="2026-11-23")

    assert "reviewed by A. Technician, 2026-11-23: 1 edit" in run("prior", "show", cell.prior).out
    told = json.loads(run("prior", "show", cell.prior, "--json").out)
    assert told["provenance"]["reviews"][0]["edits"] == [{"edit": "confirm", "bolt": "B1"}]


def test_what_cannot_be_reviewed_is_said_in_one_line(run: Run, cell: Cell) -> None:
    for arguments, says in (
        ((cell.folder / "none.prior.npz",), "no such file"),
        ((cell.scan,), "for an output"),
        ((cell.prior, "-o", cell.folder / "x.json"), "the ending '.json'"),
        ((cell.prior, "--port", "70000"), "port must be 0 to 65535"),
    ):
        outcome = run("prior", "review", *arguments, "--no-browser")
        assert outcome.code == ExitCode.BAD_INPUT
        assert says in outcome.err
        assert outcome.err.count("\n") == 1
    with ReviewSession.open(cell.prior):
        outcome = run("prior", "review", cell.prior, "--no-browser")
        assert "another open review of this prior" in outcome.err
