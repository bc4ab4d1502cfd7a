"""What `docs/formats.md` says of a review is what is written, key by key."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import get_args

import pytest

from boltpose.prior.file import read_prior, write_prior
from boltpose.prior.review import ReviewSession
from boltpose.prior.review_edits import (
    AddBolt,
    ConfirmBolt,
    Edit,
    FlipBolt,
    NameBolt,
    RemoveBolt,
    SetOrders,
    SetTool,
    edit_to_json,
)
from boltpose.prior.review_journal import FORMAT, ReviewJournal
from tests.support import records

DOCS = (Path(__file__).parents[3] / "docs" / "formats.md").read_text(encoding="utf-8")
EDITS: tuple[Edit, ...] = (
    AddBolt(position_mm=(1.0, 2.0, 3.0)),
    RemoveBolt(bolt="T1"),
    ConfirmBolt(bolt="T1"),
    FlipBolt(bolt="T1"),
    NameBolt(bolt="T1", name="nose upper"),
    SetTool(bolts=("T1",), tool="hex 8"),
    SetOrders(orders=(("T1", 1),)),
)


def rows(table: str) -> list[list[str]]:
    """The words in `code` of every row of a marked table: of the first cell, then of the second."""
    text = DOCS.split(f"<!-- {table}:start -->")[1].split(f"<!-- {table}:end -->")[0]
    lines = [line for line in text.strip().splitlines()[2:] if line.startswith("|")]
    return [re.findall(r"`(\w+)`", line) for line in lines]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_prior(tmp_path / "m.prior.npz", records.prior())
    return tmp_path / "m.prior.npz"


def test_every_edit_is_documented_with_its_keys() -> None:
    assert {type(edit) for edit in EDITS} == set(get_args(Edit))
    written = {data.pop("edit"): set(data) for data in map(edit_to_json, EDITS)}
    assert {name: set(keys) for name, *keys in rows("edits")} == written


def test_every_line_of_the_journal_is_documented(path: Path) -> None:
    seen: set[str] = set()
    with ReviewSession.open(path) as session:
        session.do(SetTool(bolts=("T1",), tool="hex 8"))
        session.undo()
        session.redo()
        session.do(AddBolt(position_mm=tuple(session.prior.points[7].tolist())))
        session.save(output=path.with_name("other.npz"))
        session._journal.append({"saving": "0"})
        lines = [json.loads(x) for x in ReviewJournal.path_of(path).read_bytes().splitlines()]
        for number, line in enumerate(lines[1:], start=1):
            assert line.pop("n") == number
            seen |= set(line)
            seen |= set(line.get("made", {}))
        session.save()
    assert set(lines[0]) == {"format", "prior_sha256", "version"}
    assert f"`format` (`{FORMAT}`)" in DOCS
    assert {key for keys in rows("acts") for key in keys} == seen
    assert ReviewJournal.path_of("m.prior.npz").name == "m.prior.npz.review.jsonl"


def test_every_key_of_a_review_is_documented(path: Path) -> None:
    with ReviewSession.open(path) as session:
        session.do(ConfirmBolt(bolt="B1"))
        session.save(by="A. Technician", date="2026-11-23")
    (entry,) = read_prior(path).provenance["reviews"]
    section = DOCS.split("`provenance.reviews` is a list")[1].split("Each edit;")[0]
    told = {key for line in re.findall(r"^\| (`.*?) \|", section, re.M) for key in
            re.findall(r"`(\w+)(?:\[\])?`", line)}  # fmt: skip
    assert told == set(entry)
