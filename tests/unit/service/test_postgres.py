"""The journal in PostgreSQL: the service run whole, and its database going away and coming back."""

from __future__ import annotations

import threading
from collections.abc import Generator
from pathlib import Path
from typing import Any

import httpx
import pytest

from boltpose.cli.app import main
from boltpose.service import journal as journal_module
from boltpose.service import state as state_module
from boltpose.service.journal import Journal
from boltpose.service.journal import State as Row
from tests.support.postgres import Postgres, running_postgres, why_not
from tests.support.service import running, upload
from tests.unit.service.test_journal import begin
from tests.unit.service.test_service import latest, locate, wait_for

pytestmark = pytest.mark.skipif(bool(why_not()), reason=why_not())


@pytest.fixture(scope="module")
def postgres() -> Generator[Postgres]:
    with running_postgres() as server:
        yield server


@pytest.fixture(autouse=True)
def looks_often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(state_module, "_LOOK_S", 0.05)


def is_ready(client: httpx.Client) -> bool:
    health = client.get("/v1/health").json()
    answer = client.get("/v1/health/ready")
    assert (health["status"] == "ready") == (health["problem"] == "")
    return answer.status_code == 200


def test_requests_and_answers_outlive_the_service(
    tmp_path: Path,
    postgres: Postgres,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    url = postgres.url("whole")
    with running(tmp_path, database=url) as (client, _):
        assert client.get("/v1/health").json()["journal"] == "postgresql"
        answer = locate(client)
        assert locate(client, "refused.ply").json()["status"] == "refused"
        assert locate(client, "bad.ply").status_code == 422
    assert not (tmp_path / "data" / "journal.sqlite").exists()
    with running(tmp_path, database=url) as (client, _):
        entries = client.get("/v1/journal").json()["entries"]
        assert [(e["state"], e["status"], e["error_code"]) for e in entries] == [
            ("failed", None, "bad_file"),
            ("done", "refused", None),
            ("done", "ok", None),
        ]
        poses = client.get(f"/v1/journal/{answer.headers['X-Boltpose-Request']}/poses.json")
        assert poses.content == answer.content
    data = str(tmp_path / "data")
    assert main(["journal", "list", "--data", data, "--database", url]) == 0
    by_option = capsys.readouterr().out
    assert [line.split()[2] for line in by_option.splitlines()] == ["failed", "done", "done"]
    # an auditor who forgets the database is not shown an empty journal
    assert main(["journal", "list", "--data", data]) == 2
    assert "--database" in capsys.readouterr().err
    assert not (tmp_path / "data" / "journal.sqlite").exists()
    settings = tmp_path / "boltpose.toml"
    settings.write_text(f'[service]\ndata = "{data}"\ndatabase = "{url}"\n')
    monkeypatch.setenv("BOLTPOSE_CONFIG", str(settings))
    assert main(["journal", "list"]) == 0
    assert capsys.readouterr().out == by_option


def test_no_answer_without_a_row_while_the_database_is_away(
    tmp_path: Path, postgres: Postgres
) -> None:
    with running(tmp_path, database=postgres.url("away"), keep_inputs_days=0) as (client, state):
        run = state.pool.run

        async def run_and_lose_the_database(*job: Any, **settings: Any) -> Any:
            done = await run(*job, **settings)
            postgres.stop()
            return done

        assert is_ready(client)
        state.pool.run = run_and_lose_the_database
        lost = locate(client)
        state.pool.run = run
        assert (lost.status_code, lost.json()["error"]["code"]) == (503, "journal_failed")
        assert "bolts" not in lost.text
        assert not is_ready(client)
        assert client.get("/v1/health/live").status_code == 200
        for answer in (locate(client), client.get("/v1/journal")):
            assert (answer.status_code, answer.json()["error"]["code"]) == (503, "journal_failed")
            assert answer.headers["Retry-After"]
            assert "port" not in answer.text  # where the database is, is for the log
        new = client.post("/v1/priors", data={"name": "new"}, files=upload("full.ply"))
        assert new.json()["error"]["code"] == "journal_failed"
        assert (state.pool.taken, state.jobs) == (0, {})
        postgres.start()
        wait_for(lambda: is_ready(client))
        # what was computed and not answered is no answer in the journal either
        row = client.get(f"/v1/journal/{lost.json()['error']['request']}").json()
        assert (row["state"], row["error_code"]) == ("failed", "journal_failed")
        assert (row["status"], row["result"]) == (None, None)
        assert locate(client).status_code == 200
        assert (latest(client)["state"], latest(client)["has_inputs"]) == ("done", True)
        # old inputs are still looked for
        state.next_purge_s = 0.0
        wait_for(lambda: not latest(client)["has_inputs"])


def test_two_services_may_start_at_once_on_a_new_database(
    tmp_path: Path, postgres: Postgres
) -> None:
    url = postgres.url("shared")
    journals: list[Journal] = []

    def open_one(name: str) -> None:
        journals.append(Journal(tmp_path / name, url))

    threads = [threading.Thread(target=open_one, args=(f"service{row}",)) for row in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(journals) == 4
    entry, _ = begin(journals[0], b"1")
    for other in journals[1:]:
        assert (other.mark_interrupted(), other.find(entry), other.entries()) == (0, None, [])
    found = journals[0].find(entry)
    assert found is not None
    assert found.state is Row.STARTED
    for journal in journals:
        journal.close()


def test_what_files_are_called_never_stops_the_journal(tmp_path: Path, postgres: Postgres) -> None:
    journal = Journal(tmp_path, postgres.url("text"))
    odd = "a\0b\ud800\u2028" + "x" * 500
    entry = journal.start("locate", "{}", (), client=odd, prior=odd, software={})
    journal.finish(entry, Row.FAILED, seconds=0.1, error_code="bad_file", error=odd)
    found = journal.find(entry)
    assert found is not None
    assert found.error is not None
    assert (found.state, found.error[:2]) == (Row.FAILED, "a\ufffd")
    journal.close()


def test_many_old_inputs_go_in_several_statements(
    tmp_path: Path, postgres: Postgres, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(journal_module, "_DELETED_AT_ONCE", 2)
    journal = Journal(tmp_path, postgres.url("many"))
    for _ in range(5):
        entry, _ = begin(journal, b"1")
        journal.finish(entry, Row.DONE, seconds=0.0, result="{}")
    assert len(journal.entries(can_replay=True)) == 5
    assert journal.purge(keep_days=0, keep_bytes=0) == 5
    assert not journal.entries(can_replay=True)
    journal.close()
