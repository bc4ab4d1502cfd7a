from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from boltpose.errors import ConfigError, InputFileError
from boltpose.io.digest import sha256_of
from boltpose.prior.file import prior_to_json, read_prior, write_prior
from boltpose.prior.review import ReviewSession, review_order
from boltpose.prior.review_edits import (
    AddBolt,
    ConfirmBolt,
    Edit,
    FlipBolt,
    NameBolt,
    RemoveBolt,
    SetOrders,
    SetTool,
    edit_from_json,
    edit_to_json,
)
from boltpose.prior.review_journal import ReviewJournal
from boltpose.prior.review_notes import PastReview, past_reviews
from boltpose.schema import Prior
from tests.support import records

PRIOR = records.prior()
IDS = ("T1", "T2", "B1", "B2", "nobody")


def edits() -> st.SearchStrategy[Edit]:
    ids = st.sampled_from(IDS)
    words = st.text(max_size=8)
    rows = st.integers(0, len(PRIOR.points) - 1)
    return st.one_of(
        rows.map(lambda row: AddBolt(position_mm=tuple(PRIOR.points[row].tolist()))),
        st.builds(RemoveBolt, bolt=ids),
        st.builds(ConfirmBolt, bolt=ids),
        st.builds(FlipBolt, bolt=ids),
        st.builds(NameBolt, bolt=ids, name=words),
        st.builds(SetTool, bolts=st.lists(ids, max_size=3).map(tuple), tool=words),
        st.dictionaries(ids, st.none() | st.integers(-1, 4), min_size=1, max_size=3).map(
            lambda orders: SetOrders(orders=tuple(orders.items()))
        ),
    )


ACTS = st.lists(edits() | st.sampled_from(["undo", "redo"]), max_size=14)


def bits(prior: Prior) -> tuple[str, bytes]:
    text = json.dumps(prior_to_json(prior), sort_keys=True)
    return text, prior.points.tobytes() + prior.normals.tobytes() + prior.labels.tobytes()


def perform(session: ReviewSession, acts: list[Edit | str]) -> None:
    """Do what can be done, as a person who tries this and that."""
    for act in acts:
        try:
            if act == "undo":
                session.undo()
            elif act == "redo":
                session.redo()
            else:
                assert not isinstance(act, str)
                session.do(act)
        except ConfigError:
            continue


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_prior(tmp_path / "m.prior.npz", PRIOR)
    return tmp_path / "m.prior.npz"


SLOW_FIXTURE = settings(
    max_examples=40,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


@SLOW_FIXTURE
@given(acts=ACTS)
def test_undoing_everything_gives_the_prior_back_bit_for_bit(path: Path, acts: list) -> None:
    with ReviewSession.open(path, discard=True) as session:
        before = bits(session.prior)
        perform(session, acts)
        while session.can_undo:
            session.undo()
        assert bits(session.prior) == before


@SLOW_FIXTURE
@given(acts=ACTS)
def test_redoing_everything_gives_the_edited_prior_back(path: Path, acts: list) -> None:
    with ReviewSession.open(path, discard=True) as session:
        perform(session, acts)
        edited, count = bits(session.prior), len(session.edits)
        for _ in range(count):
            session.undo()
        for _ in range(count):
            session.redo()
        assert bits(session.prior) == edited


@SLOW_FIXTURE
@given(acts=ACTS)
def test_a_reopened_review_is_the_one_that_was_closed(path: Path, acts: list) -> None:
    with ReviewSession.open(path, discard=True) as session:
        perform(session, acts)
        was = bits(session.prior), session.edits, session.can_redo
    with ReviewSession.open(path) as again:
        assert (bits(again.prior), again.edits, again.can_redo) == was
        assert again.resumed_edits == len(was[1])


@SLOW_FIXTURE
@given(acts=ACTS, cut=st.integers(1, 400))
def test_a_journal_cut_off_anywhere_loses_the_last_acts_only(
    path: Path, acts: list, cut: int
) -> None:
    journal = ReviewJournal.path_of(path)
    with ReviewSession.open(path, discard=True) as session:
        perform(session, acts)
        # keep something unsaved, or closing removes the journal
        for bolt in session.prior.bolts[:1]:
            session.do(SetTool(bolts=(bolt.id,), tool="last"))
    if not journal.exists():
        return
    whole = journal.read_bytes()
    journal.write_bytes(whole[: max(len(whole) - cut, 0)])
    kept = journal.read_bytes().count(b"\n")

    with ReviewSession.open(path, discard=False) as again:
        expected = [json.loads(line) for line in whole.splitlines()[1:kept]]
        lengths = 0
        for act in expected:
            lengths += -1 if "undo" in act else 1
        assert len(again.edits) == lengths


@given(edit=edits())
def test_edits_survive_json(edit: Edit) -> None:
    assert edit_from_json(json.loads(json.dumps(edit_to_json(edit)))) == edit


@pytest.mark.parametrize(
    "data",
    [
        None,
        {},
        {"edit": "explode", "bolt": "T1"},
        {"edit": "remove"},
        {"edit": "remove", "bolt": 3},
        {"edit": "add", "position_mm": [1, 2]},
        {"edit": "add", "position_mm": [1, 2, float("nan")]},
        {"edit": "order", "orders": {"T1": 1.5}},
        {"edit": "order", "orders": {"T1": True}},
    ],
)
def test_what_is_no_edit_is_refused(data: object) -> None:
    with pytest.raises(ConfigError, match="no edit of a prior"):
        edit_from_json(data)


def test_a_new_edit_ends_what_could_be_redone(path: Path) -> None:
    with ReviewSession.open(path) as session:
        session.do(ConfirmBolt(bolt="B1"))
        session.undo()
        session.do(SetTool(bolts=("T1",), tool="hex 8"))
        assert not session.can_redo
        with pytest.raises(ConfigError, match="nothing to redo"):
            session.redo()


def test_a_refused_edit_leaves_no_trace(path: Path) -> None:
    with ReviewSession.open(path) as session:
        size = ReviewJournal.path_of(path).stat().st_size
        with pytest.raises(ConfigError, match="no bolt 'X9'"):
            session.do(RemoveBolt(bolt="X9"))
        assert not session.can_undo
        assert ReviewJournal.path_of(path).stat().st_size == size


def test_saving_writes_the_prior_and_empties_the_journal(path: Path) -> None:
    base = sha256_of(path)
    with ReviewSession.open(path) as session:
        session.do(NameBolt(bolt="T1", name="nose upper"))
        session.do(ConfirmBolt(bolt="B1"))
        assert sha256_of(path) == base, "the prior is not touched before it is saved"
        session.save(by="A. Technician")
        assert not session.has_unsaved
        assert not session.can_undo
        assert bits(session.prior) == bits(read_prior(path))
    assert not ReviewJournal.path_of(path).exists()
    saved = read_prior(path)
    assert saved.bolt("T1").name == "nose upper"
    assert saved.bolt("B1").is_sure
    (entry,) = saved.provenance["reviews"]
    assert entry["by"] == "A. Technician"
    assert "date" not in entry
    assert entry["prior_sha256"] == base
    assert [edit["edit"] for edit in entry["edits"]] == ["name", "confirm"]
    assert saved.provenance["source"] == PRIOR.provenance["source"]


def test_a_second_review_adds_to_the_first(path: Path) -> None:
    for tool in ("hex 8", "hex 10"):
        with ReviewSession.open(path) as session:
            session.do(SetTool(bolts=("T1",), tool=tool))
            session.save(date="2026-11-23")
    reviews = read_prior(path).provenance["reviews"]
    assert [entry["edits"][0]["tool"] for entry in reviews] == ["hex 8", "hex 10"]
    assert [entry["date"] for entry in reviews] == ["2026-11-23"] * 2


def test_the_same_edits_give_the_same_bytes(path: Path) -> None:
    outputs = [path.with_name("a.npz"), path.with_name("b.npz")]
    for output in outputs:
        with ReviewSession.open(path, discard=True) as session:
            session.do(ConfirmBolt(bolt="B1"))
            session.save(output=output)
    assert outputs[0].read_bytes() == outputs[1].read_bytes()


def test_saved_under_another_name_all_edits_go_into_the_next_file_too(path: Path) -> None:
    base, output = sha256_of(path), path.with_name("other.npz")
    with ReviewSession.open(path) as session:
        session.do(ConfirmBolt(bolt="B1"))
        session.save(output=output)
        session.do(SetTool(bolts=("T1",), tool="hex 8"))
        assert session.has_unsaved
        session.save(output=output)
    assert sha256_of(path) == base
    assert read_prior(output).bolt("B1").is_sure
    assert read_prior(output).bolt("T1").tool == "hex 8"
    assert not ReviewJournal.path_of(path).exists()


def test_a_prior_changed_by_someone_else_is_never_overwritten(path: Path) -> None:
    with ReviewSession.open(path) as session:
        session.do(ConfirmBolt(bolt="B1"))
        write_prior(path, records.prior(records.prior_bolt("T9")))
        theirs = sha256_of(path)
        with pytest.raises(InputFileError, match="another content than when this review began"):
            session.save()
        assert sha256_of(path) == theirs
        assert list(path.parent.glob("*.tmp")) == []
        # what they did is safe, and so is what we did
        session.save(output=path.with_name("mine.npz"))
    assert read_prior(path.with_name("mine.npz")).bolt("B1").is_sure


def test_edits_of_another_version_are_not_taken_up(path: Path) -> None:
    with ReviewSession.open(path) as session:
        session.do(ConfirmBolt(bolt="B1"))
    write_prior(path, records.prior(records.prior_bolt("T9")))
    with pytest.raises(InputFileError, match=r"1 unsaved acts on another version of m\.prior\.npz"):
        ReviewSession.open(path)
    assert ReviewJournal.path_of(path).exists()
    with ReviewSession.open(path, discard=True) as session:
        assert session.edits == ()


def test_two_reviews_of_one_prior_at_a_time_are_refused(path: Path) -> None:
    with ReviewSession.open(path) as first:
        first.do(ConfirmBolt(bolt="B1"))
        with pytest.raises(InputFileError, match="another open review of this prior"):
            ReviewSession.open(path)
    with ReviewSession.open(path) as again:
        assert again.resumed_edits == 1


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (b'"n": 1', b'"n": 2', "lines missing or out of order"),
        (b'{"do"', b'x{"do"', "line 2 that is no JSON object"),
        (b"boltpose.review/1", b"boltpose.review/9", "format 'boltpose.review/9'"),
        (b'"bolt": "B1"', b'"bolt": "B7"', r"act 1, by version .*no bolt 'B7'"),
        (b'"confirm"', b'"explode"', "act 1, .*no edit of a prior"),
        (b'{"do"', b"[" * 100_000 + b'{"do"', "line 2 that is no JSON object"),
        (b'"n": 1', b'"n": 1, "made": {"id": "B1", "head_top_mm": "?"}', "act 1, .*elsewhere"),
    ],
)
def test_a_damaged_journal_is_refused_and_kept(
    path: Path, old: bytes, new: bytes, says: str
) -> None:
    with ReviewSession.open(path) as session:
        session.do(ConfirmBolt(bolt="B1"))
    journal = ReviewJournal.path_of(path)
    assert old in journal.read_bytes()
    journal.write_bytes(journal.read_bytes().replace(old, new))
    damaged = journal.read_bytes()
    with pytest.raises(InputFileError, match=says):
        ReviewSession.open(path)
    assert journal.read_bytes() == damaged


def test_a_bolt_that_is_measured_elsewhere_today_is_not_taken_up(path: Path) -> None:
    click = tuple(PRIOR.points[7].tolist())
    with ReviewSession.open(path) as session:
        made = session.do(AddBolt(position_mm=click))
    assert made is not None
    journal = ReviewJournal.path_of(path)
    entry = json.loads(journal.read_bytes().splitlines()[1])
    entry["made"]["head_top_mm"][0] += 0.5
    journal.write_bytes(
        journal.read_bytes().splitlines()[0] + b"\n" + json.dumps(entry).encode() + b"\n"
    )
    with pytest.raises(InputFileError, match="its head is now measured elsewhere"):
        ReviewSession.open(path)


def test_a_disk_that_is_full_leaves_review_and_journal_as_they_were(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with ReviewSession.open(path) as session:
        session.do(ConfirmBolt(bolt="B1"))
        before = ReviewJournal.path_of(path).read_bytes()
        real = os.write

        def half(fd: int, data: bytes) -> int:
            return real(fd, data[: len(data) // 2])

        monkeypatch.setattr(os, "write", half)
        with pytest.raises(InputFileError, match=r"cannot be written \(no space left on device\)"):
            session.do(SetTool(bolts=("T1",), tool="hex 8"))
        monkeypatch.undo()
        assert ReviewJournal.path_of(path).read_bytes() == before
        assert session.prior.bolt("T1").tool == ""
        session.do(SetTool(bolts=("T1",), tool="hex 8"))
    with ReviewSession.open(path) as again:
        assert again.prior.bolt("T1").tool == "hex 8"


def test_a_journal_of_nothing_but_zeros_is_not_taken_for_an_empty_one(path: Path) -> None:
    journal = ReviewJournal.path_of(path)
    journal.write_bytes(bytes(300))
    with pytest.raises(InputFileError, match="what nobody here wrote"):
        ReviewSession.open(path)
    assert journal.read_bytes() == bytes(300)
    with ReviewSession.open(path, discard=True) as session:
        assert session.edits == ()


@pytest.mark.parametrize("shape", ["short", "long", "none"])
def test_a_journal_whose_trace_has_another_shape_is_refused(path: Path, shape: str) -> None:
    with ReviewSession.open(path) as session:
        session.do(AddBolt(position_mm=tuple(PRIOR.points[7].tolist())))
    journal = ReviewJournal.path_of(path)
    first, second = journal.read_bytes().splitlines()
    entry = json.loads(second)
    top = entry["made"]["head_top_mm"]
    entry["made"]["head_top_mm"] = {"short": top[:2], "long": [*top, 0.0], "none": [None] * 3}[
        shape
    ]
    journal.write_bytes(first + b"\n" + json.dumps(entry).encode() + b"\n")
    with pytest.raises(InputFileError, match=r"act 1, .*cannot be done again"):
        ReviewSession.open(path)


def test_a_save_that_fails_loses_nothing(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    base = path.read_bytes()
    with ReviewSession.open(path) as session:
        session.do(ConfirmBolt(bolt="B1"))

        def full(file: Path, _: Prior) -> None:
            file.write_bytes(b"half")
            raise OSError(28, "No space left on device")

        monkeypatch.setattr("boltpose.prior.review.write_prior", full)
        with pytest.raises(InputFileError, match=r"m\.prior\.npz: found that it cannot be written"):
            session.save()
        monkeypatch.undo()
        assert path.read_bytes() == base
        assert list(path.parent.glob("*.tmp")) == []
        assert session.has_unsaved
        session.save()
    assert read_prior(path).bolt("B1").is_sure


def test_a_prior_with_a_review_of_its_own_is_not_saved_over(path: Path) -> None:
    other = path.with_name("other.prior.npz")
    write_prior(other, PRIOR)
    with ReviewSession.open(other) as theirs:
        theirs.do(ConfirmBolt(bolt="B1"))
    kept = other.read_bytes()
    with ReviewSession.open(path) as session:
        session.do(SetTool(bolts=("T1",), tool="hex 8"))
        with pytest.raises(InputFileError, match="edits of a review that were not saved"):
            session.save(output=other)
    assert other.read_bytes() == kept


def test_a_saved_prior_tells_of_its_reviews(path: Path) -> None:
    assert past_reviews(PRIOR) == ()
    with ReviewSession.open(path) as session:
        session.do(ConfirmBolt(bolt="B1"))
        session.save(by="A. Technician", date="2026-11-23")
    assert past_reviews(read_prior(path)) == (
        PastReview(by="A. Technician", date="2026-11-23", edit_count=1),
    )


CRASH = """
import os, signal, sys
from boltpose.prior.review import ReviewSession
from boltpose.prior.review_edits import ConfirmBolt, SetTool
session = ReviewSession.open(sys.argv[1])
session.do(ConfirmBolt(bolt="B1"))
session.do(SetTool(bolts=("T1",), tool="hex 8"))
if sys.argv[2] == "saving":
    # between the new prior and the emptied journal
    session._journal.start = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
    session.save()
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize("moment", ["editing", "saving"])
def test_a_killed_process_loses_nothing(path: Path, moment: str) -> None:
    killed = subprocess.run([sys.executable, "-c", CRASH, path, moment], check=False)
    assert killed.returncode == -signal.SIGKILL
    with ReviewSession.open(path) as session:
        assert session.prior.bolt("B1").is_sure
        assert session.prior.bolt("T1").tool == "hex 8"
        assert session.resumed_edits == (2 if moment == "editing" else 0)


def test_a_folder_that_cannot_be_written_is_said_at_once(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> int:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(InputFileError, match=r"no journal can be kept \(permission denied\)"):
        ReviewSession.open(path)


def test_nothing_is_left_of_a_review_without_edits(path: Path) -> None:
    before = path.read_bytes()
    with ReviewSession.open(path) as session, pytest.raises(ConfigError, match="nothing to save"):
        session.save()
    assert list(path.parent.iterdir()) == [path]
    assert path.read_bytes() == before


def test_the_most_doubtful_bolt_comes_first() -> None:
    doubts = {"T2": 0.6, "T3": 0.4}
    prior = records.prior(
        *(
            replace(
                records.prior_bolt(f"T{k}", seed=k, is_sure=f"T{k}" not in doubts),
                confidence=doubts.get(f"T{k}", 0.3),
            )
            for k in range(1, 5)
        )
    )
    assert [bolt.id for bolt in review_order(prior)] == ["T3", "T2", "T1", "T4"]
