"""What was asked and answered survives, and only what is old enough is forgotten."""

from __future__ import annotations

import io
import os
import time
from pathlib import Path

import pytest

from boltpose.errors import ConfigError
from boltpose.service.blobs import Blob, BlobStore
from boltpose.service.failures import ServiceError
from boltpose.service.journal import Journal, State


def begin(journal: Journal, *contents: bytes) -> tuple[str, list[Blob]]:
    blobs = [journal.blobs.add(io.BytesIO(data), "a.ply", 10**6) for data in contents]
    entry = journal.start("locate", "{}", blobs, client="me", prior="m", software={"version": "1"})
    return entry, blobs


def make_old(journal: Journal) -> None:
    for path in journal.blobs.folder.glob("*/*"):
        os.utime(path, (time.time() - 7200,) * 2)


def test_a_request_is_there_before_its_work_and_closed_once(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    entry, _ = begin(journal, b"1")
    found = journal.find(entry)
    assert found is not None
    assert (found.state, found.result, found.has_inputs) == (State.STARTED, None, True)
    journal.finish(entry, State.DONE, seconds=1.0, result="{}", status="ok")
    journal.finish(entry, State.FAILED, seconds=2.0, error="too late")
    found = journal.find(entry)
    assert found is not None
    assert (found.state, found.result, found.error) == (State.DONE, "{}", None)
    journal.close()


def test_a_restart_marks_what_was_under_way(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    done, _ = begin(journal, b"1")
    journal.finish(done, State.DONE, seconds=1.0, result="{}")
    under_way, _ = begin(journal, b"2")
    journal.close()
    again = Journal(tmp_path)
    assert again.mark_interrupted() == 1
    states = {entry.id: entry.state for entry in again.entries()}
    assert states == {done: State.DONE, under_way: State.INTERRUPTED}
    again.close()


def test_services_that_share_a_database_leave_each_other_alone(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'shared.sqlite'}"
    one, two = Journal(tmp_path / "one", url), Journal(tmp_path / "two", url)
    entry, (blob,) = begin(one, b"1")
    assert two.mark_interrupted() == 0
    found = one.find(entry)
    assert found is not None
    assert found.state is State.STARTED
    # its inputs lie in the other's folder, and its answer is none of our clients' business
    assert (two.find(entry), two.entries()) == (None, [])
    two.blobs.add(io.BytesIO(b"1"), "a.ply", 10)
    make_old(two)
    two.purge(keep_days=0, keep_bytes=0)
    assert not two.blobs.path(blob.sha256).exists()
    one.close()
    two.close()


def test_old_inputs_go_and_shared_bytes_stay(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    old, (shared, alone) = begin(journal, b"shared", b"alone")
    journal.finish(old, State.DONE, seconds=1.0, result="{}")
    young, _ = begin(journal, b"shared")
    journal.finish(young, State.DONE, seconds=1.0, result="{}")
    make_old(journal)
    assert journal.purge(keep_days=1, keep_bytes=len(b"shared")) == 1
    found = journal.find(old)
    assert found is not None
    assert (found.has_inputs, found.result) == (False, "{}")
    assert journal.blobs.path(shared.sha256).is_file()
    assert not journal.blobs.path(alone.sha256).exists()
    assert journal.purge(keep_days=0, keep_bytes=1e9) == 1
    assert not journal.blobs.path(shared.sha256).exists()
    journal.close()


def test_inputs_of_work_under_way_are_never_deleted(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    _, (blob,) = begin(journal, b"1")
    make_old(journal)
    assert journal.purge(keep_days=0, keep_bytes=0) == 0
    assert journal.blobs.path(blob.sha256).is_file()
    journal.close()


def test_pages_of_entries_miss_none(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    ids = [begin(journal, b"1")[0] for _ in range(5)]
    first = journal.entries(limit=2)
    rest = journal.entries(limit=10, before=first[-1].id)
    assert [entry.id for entry in (*first, *rest)] == sorted(ids, reverse=True)
    journal.close()


@pytest.mark.parametrize("url", ["nonsense", "nosuch://x", "sqlite:////nowhere/x.sqlite"])
def test_a_database_that_cannot_be_opened_is_one_clear_error(tmp_path: Path, url: str) -> None:
    with pytest.raises(ConfigError, match="database"):
        Journal(tmp_path, url)


def test_a_stream_beyond_the_limit_leaves_nothing(tmp_path: Path) -> None:
    store = BlobStore(tmp_path / "blobs")
    with pytest.raises(ServiceError) as caught:
        store.add(io.BytesIO(b"12345"), "a.ply", 4)
    assert caught.value.status == 413
    assert not list(store.folder.rglob("*.*"))
    same = [store.add(io.BytesIO(b"1234"), name, 4) for name in ("a", "b")]
    assert same[0].sha256 == same[1].sha256
    assert len([path for path in store.folder.rglob("*") if path.is_file()]) == 1
