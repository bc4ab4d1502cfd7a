from __future__ import annotations

import pytest

from boltpose.cli.exit_codes import ExitCode
from boltpose.prior.file import read_prior
from boltpose.prior.review import ReviewSession
from boltpose.prior.review_edits import ConfirmBolt
from boltpose.schema import Side
from tests.unit.cli.conftest import Cell, Run


def test_names_tools_turns_and_sides_are_written(run: Run, cell: Cell) -> None:
    outcome = run(
        "prior", "edit", cell.prior, "--name", "T1=solenoid upper", "--tool", "T1=hex 8",
        "--order", "T1=2", "--order", "T2=1", "--flip", "B1", "--by", "A. B.", "--date", "today",
    )  # fmt: skip

    assert outcome.code == ExitCode.OK, outcome.err
    edited = read_prior(cell.prior)
    assert [(bolt.id, bolt.side) for bolt in edited.bolts] == [
        ("T1", Side.TOP), ("T2", Side.TOP), ("T3", Side.TOP),
    ]  # fmt: skip
    first = edited.bolt("T1")
    assert (first.name, first.tool, first.order) == ("solenoid upper", "hex 8", 2)
    assert edited.bolt("T2").order == 1
    assert not edited.bolt("T3").is_sure
    (review,) = edited.provenance["reviews"]
    assert (review["by"], review["date"]) == ("A. B.", "today")
    assert [entry["edit"] for entry in review["edits"]] == ["name", "tool", "order", "flip"]


def test_an_empty_value_takes_words_and_turn_away(run: Run, cell: Cell) -> None:
    run("prior", "edit", cell.prior, "--name", "T1=a", "--tool", "T1=b", "--order", "T1=1")
    run("prior", "edit", cell.prior, "--name", "T1=", "--tool", "T1=", "--order", "T1=")
    bolt = read_prior(cell.prior).bolt("T1")
    assert (bolt.name, bolt.tool, bolt.order) == ("", "", None)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--name", "T1"), "--name wants ID=..., for example T1=..., got 'T1'"),
        (("--tool", "=x"), "--tool wants ID=..."),
        (("--order", "T1=first"), "--order wants a number from 1, got 'first'"),
        (("--order", "T1=0"), "the turn of T1 must be 1 to 999, got 0"),
        (("--order", "T1=1", "--order", "T2=1"), "T1 and T2 would both have turn 1"),
        (("--order", "T1=1", "--order", "T1=2"), "--order is given twice for bolt 'T1'"),
        (("--name", "T1=a", "--name", "T2=A"), "bolt T1 is already called 'a'"),
        (("--name", "T1=a\tb"), "a name must hold printable characters only"),
        (("--flip", "T9"), "no bolt 'T9'"),
        (("--remove", "T1", "--by", "x\ny"), "--by must hold printable characters only"),
    ],
)
def test_what_cannot_be_done_changes_nothing(
    run: Run, cell: Cell, options: tuple[str, ...], says: str
) -> None:
    before = cell.prior.read_bytes()
    outcome = run("prior", "edit", cell.prior, *options)
    assert outcome.code == ExitCode.BAD_INPUT
    assert says in outcome.err
    assert outcome.err.count("\n") == 1
    assert cell.prior.read_bytes() == before


def test_a_prior_under_review_is_not_replaced(run: Run, cell: Cell) -> None:
    with ReviewSession.open(cell.prior) as session:
        outcome = run("prior", "edit", cell.prior, "--remove", "T1")
        assert outcome.code == ExitCode.BAD_INPUT
        assert "another open review of this prior" in outcome.err
        session.do(ConfirmBolt(bolt="B1"))
    outcome = run("prior", "edit", cell.prior, "--remove", "T1")
    assert outcome.code == ExitCode.BAD_INPUT
    assert "edits of a review that were not saved" in outcome.err
    assert run("prior", "edit", cell.prior, "--remove", "T1", "-o", cell.folder / "n.npz").code == 0
    with ReviewSession.open(cell.prior) as session:
        assert session.resumed_edits == 1
