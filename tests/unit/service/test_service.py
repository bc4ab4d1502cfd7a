"""The service as a client sees it; workers answer at once, never, or die (tests.support)."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import httpx
import pytest

from boltpose.client import Client, RequestError
from boltpose.errors import InputFileError, PosesRefusedError
from boltpose.results import PosesFile
from boltpose.schema import Status
from boltpose.service.journal import State as Row
from boltpose.service.keys import KeyRing
from boltpose.service.state import State
from tests.support.service import running, upload

Cell = tuple[httpx.Client, State]


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Generator[Cell]:
    folder = tmp_path_factory.mktemp("cell")
    with running(folder, locate_timeout_s=0.7, queue_size=1, max_upload_mb=1.0) as found:
        (folder / "scans" / "ok.ply").write_bytes(b"points")
        (folder / "scans" / "link.ply").symlink_to("/etc/passwd")
        yield found


def locate(client: httpx.Client, name: str = "ok.ply", **fields: Any) -> httpx.Response:
    return client.post("/v1/locate", files=upload(name), data={"prior": "cube", **fields})


def latest(client: httpx.Client) -> dict[str, Any]:
    entries = client.get("/v1/journal", params={"limit": 1}).json()["entries"]
    # a place in the queue is taken before the inputs are stored and the row is written
    return entries[0] if entries else {"state": "none yet"}


def wait_for(condition: Callable[[], bool], limit_s: float = 10.0) -> None:
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.02)


def metric(client: httpx.Client, line: str) -> float:
    for found in client.get("/metrics").text.splitlines():
        if found.startswith(line + " "):
            return float(found.split()[-1])
    return 0.0


def test_an_upload_gets_the_workers_own_bytes_and_they_are_in_the_journal(cell: Cell) -> None:
    client, state = cell
    answer = locate(client)
    assert answer.status_code == 200
    assert PosesFile.model_validate_json(answer.content).status is Status.OK
    entry = client.get(f"/v1/journal/{answer.headers['X-Boltpose-Request']}").json()
    assert (entry["state"], entry["status"], entry["has_inputs"]) == ("done", "ok", True)
    again = client.get(f"/v1/journal/{entry['id']}/poses.json")
    assert again.content == answer.content
    stored = state.blobs.path(entry["call"]["scans"][0]["sha256"])
    assert stored.read_bytes() == b"points"
    prior = state.blobs.path(entry["call"]["priors"][0]["sha256"])
    assert prior.read_bytes() == state.shelf.path("cube").read_bytes()


def test_a_refused_pose_is_an_answer(cell: Cell) -> None:
    client, _ = cell
    before = metric(client, 'boltpose_refusals_total{reason="no_motor"}')
    answer = locate(client, "refused.ply")
    assert answer.status_code == 200
    found = answer.json()
    assert found["status"] == "refused"
    assert found["bolts"] == []
    name = f'boltpose_refusals_total{{reason="{found["reason"]}"}}'
    assert metric(client, name) >= 1
    assert latest(client)["reason"] == found["reason"]
    assert before >= 0


def test_the_client_hands_out_no_bolts_of_a_refused_pose(cell: Cell, tmp_path: Path) -> None:
    client, state = cell
    for name in ("ok.ply", "refused.ply", "bad.ply"):
        (tmp_path / name).write_bytes(b"points")
    with Client(str(client.base_url)) as ours:
        poses = ours.locate(tmp_path / "ok.ply", prior="cube")
        assert poses.is_ok
        assert [bolt.id for bolt in poses.bolts]
        assert poses.request == latest(client)["id"]
        refused = ours.locate(str(tmp_path / "refused.ply"), prior="cube")
        assert refused.status is Status.REFUSED
        with pytest.raises(PosesRefusedError, match=str(refused.reason)):
            _ = refused.bolts
        with pytest.raises(RequestError, match="found nothing") as caught:
            ours.locate(tmp_path / "bad.ply", prior="cube")
        assert (caught.value.status, caught.value.code) == (422, "bad_file")
        assert ours.priors() == ["cube"]
        # the workers of these tests always answer to the same scan
        (tmp_path / "other.ply").write_bytes(b"another scan")
        for files in ({"scan": "other.ply"}, {"scan": "ok.ply", "hand_eye": "other.ply"}):
            with pytest.raises(RequestError, match="another") as caught:
                ours.locate(prior="cube", **{key: tmp_path / f for key, f in files.items()})
            assert caught.value.code == "wrong_answer"
        with pytest.raises(InputFileError, match=r"none\.ply"):
            ours.locate(tmp_path / "none.ply", prior="cube")
        state.pool._taken += 100
        with pytest.raises(RequestError) as caught:
            ours.locate(tmp_path / "ok.ply", prior="cube")
        assert (caught.value.code, caught.value.status) == ("queue_full", 429)
        assert caught.value.retry_after_s is not None
        state.pool._taken -= 100
    with Client("http://127.0.0.1:9") as nobody, pytest.raises(RequestError, match="no answer"):
        nobody.health()


def test_a_file_of_the_scan_folder_is_read(cell: Cell) -> None:
    client, _ = cell
    answer = client.post("/v1/locate", json={"scan": "ok.ply", "prior": "cube"})
    assert answer.status_code == 200


@pytest.mark.parametrize(
    "path", ["../data/journal.sqlite", "/etc/passwd", "link.ply", "a\0.ply", "C:/x.ply", "..\\x"]
)
def test_no_path_leaves_the_scan_folder(cell: Cell, path: str) -> None:
    client, _ = cell
    answer = client.post("/v1/locate", json={"scan": path, "prior": "cube"})
    assert answer.status_code == 422
    assert answer.json()["error"]["code"] in ("path_not_allowed", "no_such_file")


@pytest.mark.parametrize(
    ("content", "status", "code"),
    [
        ({"json": {"scan": "ok.ply"}}, 422, "bad_setting"),
        ({"json": {"scan": "ok.ply", "prior": "nope"}}, 404, "unknown_prior"),
        ({"json": {"scan": "ok.ply", "prior": "../cube"}}, 404, "unknown_prior"),
        ({"json": {"scan": "ok.ply", "prior": ["cube", "cube"]}}, 422, "bad_setting"),
        ({"json": {"scan": "ok.ply", "prior": "cube", "typo": 1}}, 422, "bad_setting"),
        ({"json": {"scan": "ok.ply", "prior": "cube", "scan_unit": "feet"}}, 422, "bad_setting"),
        ({"json": {"scan": ["ok.ply", "ok.ply"], "prior": "cube"}}, 422, "bad_setting"),
        ({"json": {"scan": "ok.ply", "prior": "cube", "tool_lateral_mm": -1}}, 422, "bad_setting"),
        ({"json": [1]}, 422, "bad_setting"),
        ({"content": b"{", "headers": {"content-type": "application/json"}}, 400, "bad_request"),
        (
            {
                "content": b'{"scan": "ok.ply", "prior": "cube", "prior": "other"}',
                "headers": {"content-type": "application/json"},
            },
            422,
            "bad_setting",
        ),
        (
            {
                "content": b'{"scan": "' + b"x" * 300_000 + b'"}',
                "headers": {"content-type": "application/json"},
            },
            413,
            "too_large",
        ),
        ({"content": b"x", "headers": {"content-type": "text/xml"}}, 415, "wrong_content_type"),
        ({"content": b"x"}, 415, "wrong_content_type"),
        (
            {"content": b"x", "headers": {"content-type": "multipart/form-data"}},
            400,
            "bad_request",
        ),
        ({"data": {"prior": "cube", "scan": "text"}, "files": upload()}, 422, "bad_setting"),
        ({"data": {"prior": "cube"}, "files": [("other", ("a", b"a"))]}, 422, "bad_setting"),
        ({"data": {"prior": "cube"}, "files": [("camera", ("a", b"a"))]}, 422, "bad_setting"),
    ],
)
def test_bad_input_is_one_line_and_a_code(
    cell: Cell, content: dict[str, Any], status: int, code: str
) -> None:
    client, state = cell
    answer = client.post("/v1/locate", **content)
    error = answer.json()["error"]
    assert (answer.status_code, error["code"]) == (status, code)
    assert "\n" not in error["message"]
    assert state.pool.taken == 0


def test_an_input_the_library_cannot_use_is_in_the_journal(cell: Cell) -> None:
    client, _ = cell
    answer = locate(client, "bad.ply")
    assert answer.status_code == 422
    found = latest(client)
    assert answer.json()["error"] == {
        "code": "bad_file",
        "message": "bad.ply: found nothing",
        "request": found["id"],
    }
    assert (found["state"], found["error_code"]) == ("failed", "bad_file")


def test_a_computation_past_its_time_is_ended_and_the_next_is_not_held_up(cell: Cell) -> None:
    client, state = cell
    restarts = state.pool.restarts
    answer = locate(client, "slow.ply")
    assert (answer.status_code, answer.json()["error"]["code"]) == (504, "timeout")
    assert latest(client)["state"] == "failed"
    assert locate(client).status_code == 200
    assert state.pool.restarts == restarts + 1
    assert state.pool.ready == 1
    # the files of the ended one went with it
    wait_for(lambda: len(list(state.work.iterdir())) == 1)


def test_a_worker_that_dies_is_replaced(cell: Cell) -> None:
    client, _ = cell
    answer = locate(client, "crash.ply")
    assert (answer.status_code, answer.json()["error"]["code"]) == (500, "worker_died")
    assert locate(client).status_code == 200


def test_a_worker_that_died_while_idle_is_replaced(cell: Cell) -> None:
    client, state = cell
    (worker,) = state.pool._alive
    os.kill(worker.process.pid, 9)
    wait_for(lambda: worker.process.returncode is not None)
    assert locate(client).status_code == 200


def test_files_of_a_service_that_was_killed_are_removed(tmp_path: Path) -> None:
    stray = tmp_path / "data" / "work" / "tmpx" / "call"
    stray.mkdir(parents=True)
    (stray / "000002.png").write_bytes(b"pixels")
    (stray.parent.parent / "half.prior.npz").write_bytes(b"half")
    with running(tmp_path) as (_, state):
        assert not stray.exists()
        assert len(list(state.work.iterdir())) == 1


def test_a_worker_gets_no_more_memory_than_it_may_have(tmp_path: Path) -> None:
    script = (
        "from boltpose.service import worker\nworker._bound_memory(10**9)\nbytearray(2 * 10**9)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False
    )
    assert done.stderr.strip().endswith("MemoryError")


def test_a_client_that_goes_away_ends_its_computation(cell: Cell) -> None:
    client, state = cell
    restarts = state.pool.restarts
    with pytest.raises(httpx.ReadTimeout):
        client.post("/v1/locate", files=upload("slow.ply"), data={"prior": "cube"}, timeout=0.3)
    wait_for(lambda: latest(client)["state"] == "cancelled")
    assert state.pool.restarts == restarts + 1
    assert locate(client).status_code == 200
    assert state.pool.taken == 0


def test_a_full_queue_says_when_to_come_again(cell: Cell) -> None:
    client, state = cell
    answers: list[httpx.Response] = []

    def ask() -> None:
        with httpx.Client(base_url=client.base_url, trust_env=False, timeout=20) as own:
            answers.append(locate(own, "slow.ply"))

    threads = [threading.Thread(target=ask) for _ in range(2)]
    for thread in threads:
        thread.start()
    wait_for(lambda: state.pool.taken == 2)
    assert client.get("/v1/health").json()["waiting"] == 1
    full = locate(client)
    assert (full.status_code, full.json()["error"]["code"]) == (429, "queue_full")
    assert int(full.headers["Retry-After"]) >= 1
    for thread in threads:
        thread.join()
    assert [answer.status_code for answer in answers] == [504, 504]
    assert locate(client).status_code == 200


def test_a_body_that_says_it_is_too_large_is_not_read(cell: Cell) -> None:
    client, state = cell
    with socket.create_connection((client.base_url.host, client.base_url.port)) as raw:
        raw.sendall(
            b"POST /v1/locate HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 999999999\r\n\r\n"
        )
        assert b" 413 " in raw.recv(1000)
    assert state.pool.taken == 0


def test_a_body_of_unknown_length_is_cut_off(cell: Cell) -> None:
    client, state = cell
    boundary = b"--x\r\nContent-Disposition: form-data; name=scan; filename=a.ply\r\n\r\n"

    def body() -> Generator[bytes]:
        yield boundary
        for _ in range(20):  # the last one is too much: nothing is left unread
            yield b"0" * 50_500

    answer = client.post(
        "/v1/locate", content=body(), headers={"content-type": "multipart/form-data; boundary=x"}
    )
    assert (answer.status_code, answer.json()["error"]["code"]) == (413, "too_large")
    assert state.pool.taken == 0


def test_who_sends_much_for_nothing_gets_the_reason_and_no_broken_connection(
    tmp_path: Path,
) -> None:
    (tmp_path / "data").mkdir()
    key = KeyRing(tmp_path / "data").add("robot 1")
    with running(tmp_path, max_upload_mb=20.0) as (client, state):
        for status, code, size, headers in (
            (401, "bad_key", 19, {}),
            (413, "too_large", 30, {"X-API-Key": key}),
            (429, "queue_full", 19, {"X-API-Key": key}),
            (415, "wrong_content_type", 19, {"X-API-Key": key, "Content-Type": "text/xml"}),
        ):
            state.pool._taken += 100 * (status == 429)
            answer = client.post("/v1/locate", content=bytes(size * 10**6), headers=headers)
            assert (answer.status_code, answer.json()["error"]["code"]) == (status, code)
            state.pool._taken -= 100 * (status == 429)


def test_a_body_that_breaks_off_is_no_mistake_of_ours(
    cell: Cell, caplog: pytest.LogCaptureFixture
) -> None:
    client, state = cell
    with socket.create_connection((client.base_url.host, client.base_url.port)) as raw:
        raw.sendall(
            b"POST /v1/locate HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 99\r\n"
            b"Content-Type: application/json\r\n\r\n{"
        )
        wait_for(lambda: state.pool.taken == 1)
    wait_for(lambda: state.pool.taken == 0)
    assert locate(client).status_code == 200
    assert not caplog.records


@pytest.mark.parametrize(
    ("headers", "code"),
    [
        ({"Host": "evil.example"}, "host_not_allowed"),
        ({"Host": "127.0.0.1.evil.example"}, "host_not_allowed"),
        ({"Host": ""}, "host_not_allowed"),
        ({"Origin": "http://evil.example"}, "cross_origin"),
        ({"Origin": "null"}, "cross_origin"),
        ({"Origin": "http://127.0.0.1:1"}, "cross_origin"),
        ({"Sec-Fetch-Site": "cross-site"}, "cross_origin"),
        ({"Sec-Fetch-Site": "same-site"}, "cross_origin"),
    ],
)
def test_a_web_page_of_another_site_reaches_nothing(
    cell: Cell, headers: dict[str, str], code: str
) -> None:
    client, _ = cell
    for method, path in (("DELETE", "/v1/priors/cube"), ("GET", "/v1/journal")):
        answer = client.request(method, path, headers=headers)
        assert (answer.status_code, answer.json()["error"]["code"]) == (403, code)
    assert client.get("/v1/priors").json()["priors"][0]["name"] == "cube"


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1:1", "[::1]:80", "LOCALHOST"])
def test_names_of_this_computer_are_answered(cell: Cell, host: str) -> None:
    client, _ = cell
    assert client.get("/v1/health/ready", headers={"Host": host}).status_code == 200


def test_every_request_is_counted_under_a_bounded_label(cell: Cell) -> None:
    client, _ = cell
    line = 'boltpose_requests_total{method="GET",route="other",status="404"}'
    before = metric(client, line)
    for number in range(3):
        assert client.get(f"/nothing/{number}").json()["error"]["code"] == "not_found"
    assert metric(client, line) == before + 3


def test_every_stage_of_a_locate_is_timed(cell: Cell) -> None:
    client, _ = cell
    line = 'boltpose_stage_seconds_count{stage="segmentation"}'
    before = metric(client, line)
    locate(client).raise_for_status()
    assert metric(client, line) == before + 1


def test_an_unknown_entry_and_a_malformed_id_are_told_apart(cell: Cell) -> None:
    client, _ = cell
    assert client.get(f"/v1/journal/{'2' * 8}T{'2' * 12}-{'0' * 8}").status_code == 404
    assert client.get("/v1/journal/nonsense").status_code == 422
    assert client.get("/v1/journal", params={"limit": 0}).status_code == 422


def test_a_prior_is_built_replaced_loaded_and_deleted(tmp_path: Path) -> None:
    with running(tmp_path) as (client, state):
        form = {"data": {"name": "new one"}, "files": upload("full.ply")}
        answer = client.post("/v1/priors", **form)
        assert answer.status_code == 202
        place = answer.headers["Location"]
        wait_for(lambda: client.get(place).json()["state"] not in ("waiting", "running"))
        assert client.get(place).json()["state"] == "done"
        names = [entry["name"] for entry in client.get("/v1/priors").json()["priors"]]
        assert names == ["cube", "new one"]
        taken = client.post("/v1/priors", **form)
        assert (taken.status_code, taken.json()["error"]["code"]) == (409, "prior_exists")
        loaded = client.get("/v1/priors/new one/file")
        assert loaded.content == state.shelf.path("new one").read_bytes()
        assert client.get("/v1/priors/cube").json()["bolts"]
        assert client.get("/v1/priors/nope").status_code == 404
        gone = client.delete("/v1/priors/new one").json()
        assert client.get("/v1/priors/new one").status_code == 404
        # what was deleted can still be had from the journal
        entry = state.journal.find(gone["request"])
        assert entry is not None
        assert json.loads(entry.call)["sha256"] in {
            path.name for path in state.blobs.folder.glob("*/*")
        }
        slow = client.post("/v1/priors", data={"name": "slow"}, files=upload("slow.ply"))
        assert client.delete(slow.headers["Location"]).json()["state"] == "cancelled"
        assert locate(client).status_code == 200
        report = client.get(f"/v1/journal/{latest(client)['id']}/report")
        assert report.text == "<html>report</html>"
        (tmp_path / "priors" / "bad.prior.npz").write_bytes(b"no prior")
        answer = client.get("/v1/priors/bad")
        assert (answer.status_code, answer.json()["error"]["code"]) == (422, "bad_file")
        assert answer.json()["error"]["message"].startswith("bad.prior.npz: found")
        assert client.delete("/v1/priors/bad").status_code == 200
        for bad in ("../x", "a/b", ".x", ""):
            answer = client.post("/v1/priors", data={"name": bad}, files=upload())
            assert answer.status_code == 422
        assert sorted(path.name for path in (tmp_path / "priors").iterdir()) == ["cube.prior.npz"]


def test_a_read_only_service_changes_no_priors(tmp_path: Path) -> None:
    with running(tmp_path, can_change_priors=False, scans=None) as (client, _):
        assert client.delete("/v1/priors/cube").json()["error"]["code"] == "priors_fixed"
        answer = client.post("/v1/priors", data={"name": "a"}, files=upload())
        assert answer.status_code == 403
        off = client.post("/v1/locate", json={"scan": "ok.ply", "prior": "cube"})
        assert off.json()["error"]["code"] == "paths_off"


def test_as_soon_as_there_is_a_key_every_request_needs_one(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    key = KeyRing(tmp_path / "data").add("robot 1")
    with running(tmp_path) as (client, _):
        for headers in ({}, {"X-API-Key": key + "x"}, {"Authorization": f"Basic {key}"}):
            answer = client.get("/v1/journal", headers=headers)
            assert (answer.status_code, answer.json()["error"]["code"]) == (401, "bad_key")
            assert client.get("/metrics", headers=headers).status_code == 401
            answer = client.post(
                "/v1/locate", files=upload(), data={"prior": "cube"}, headers=headers
            )
            assert answer.status_code == 401
        assert client.get("/v1/health/live").status_code == 200
        assert client.get("/v1/health").status_code == 401
        client.headers["Authorization"] = f"Bearer {key}"
        assert locate(client).status_code == 200
        assert latest(client)["client"] == "127.0.0.1 (robot 1)"


def test_a_service_that_is_told_to_end_closes_its_journal(tmp_path: Path) -> None:
    with running(tmp_path) as (client, state):

        def ask() -> None:
            with (
                httpx.Client(base_url=client.base_url, trust_env=False, timeout=20) as own,
                pytest.raises(httpx.HTTPError),
            ):
                locate(own, "slow.ply").raise_for_status()

        thread = threading.Thread(target=ask)
        thread.start()
        wait_for(lambda: state.pool.taken == 1 and latest(client)["state"] == "started")
        journal = state.journal
    thread.join()
    assert [entry.state for entry in journal.entries()] == [Row.INTERRUPTED]
    journal.close()
