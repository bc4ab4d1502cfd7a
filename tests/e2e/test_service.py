"""`boltpose serve` as a process, with the real networks and the shipped motor (simulated)."""

from __future__ import annotations

import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Generator
from contextlib import closing
from pathlib import Path
from typing import Any

import httpx
import pytest

from boltpose.cli.app import main
from boltpose.cli.demo import DEMO_FOLDER
from boltpose.client import Client

SCAN = DEMO_FOLDER / "000002.png"
CAMERA = DEMO_FOLDER / "scene_camera.json"
HAND_EYE = DEMO_FOLDER / "hand_eye.yaml"


def start(folder: Path) -> tuple[subprocess.Popen[str], str]:
    process = subprocess.Popen(
        [
            *(sys.executable, "-m", "boltpose", "serve", "--port", "0"),
            *("--data", str(folder / "data"), "--priors", str(folder / "priors")),
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    line = process.stdout.readline()
    assert "http://127.0.0.1:" in line, line
    return process, line.split()[2]


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Generator[tuple[Path, str]]:
    folder = tmp_path_factory.mktemp("cell")
    process, url = start(folder)
    with httpx.Client(base_url=url, trust_env=False, timeout=60) as client:
        with (DEMO_FOLDER / "full_scan.ply").open("rb") as stream:
            answer = client.post("/v1/priors", data={"name": "motor"}, files={"scan": stream})
        assert answer.status_code == 202, answer.text
        while (job := client.get(answer.headers["Location"]).json())["state"] in (
            "waiting",
            "running",
        ):
            time.sleep(0.1)
        assert job["state"] == "done", job
    yield folder, url
    process.send_signal(signal.SIGTERM)
    assert process.wait(30) == 0
    assert process.stdout is not None
    process.stdout.close()


def without_clock(text: str) -> dict[str, Any]:
    data = json.loads(text)
    data.pop("timings_ms")
    return data


def test_the_service_answers_what_the_command_writes(cell: tuple[Path, str]) -> None:
    folder, url = cell
    with Client(url) as client:
        poses = client.locate(SCAN, prior="motor", hand_eye=HAND_EYE, camera=CAMERA)
    assert len(poses.bolts) == 9
    served = without_clock(httpx.get(f"{url}/v1/journal/{poses.request}/poses.json").text)
    output = folder / "poses.json"
    prior = folder / "priors" / "motor.prior.npz"
    code = main(
        [
            *("locate", str(SCAN), "--prior", str(prior), "--hand-eye", str(HAND_EYE)),
            *("--camera", str(CAMERA), "-o", str(output)),
        ]
    )
    assert code == 0
    written = without_clock(output.read_text())
    # where the files lie is the only thing that the two cannot have in common, and so the seal
    for data in (served, written):
        data["provenance"].pop("inputs")
        data.pop("content_sha256")
    assert served == written


def test_a_stored_request_gives_the_same_poses_again(
    cell: tuple[Path, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, url = cell
    with Client(url) as client:
        poses = client.locate(SCAN, prior="*", camera=CAMERA)
    data = ["--data", str(folder / "data")]
    assert main(["journal", "replay", poses.request, *data]) == 0
    assert "same" in capsys.readouterr().out
    assert main(["journal", "export", poses.request, "-o", str(tmp_path / "out"), *data]) == 0
    assert (tmp_path / "out" / SCAN.name).read_bytes() == SCAN.read_bytes()
    # an answer that was changed afterwards is found out
    with closing(sqlite3.connect(folder / "data" / "journal.sqlite")) as journal, journal:
        journal.execute(
            "UPDATE boltpose_requests SET result = replace(result, ?, ?) WHERE id = ?",
            ('"status": "ok"', '"status": "refused"', poses.request),
        )
    assert main(["journal", "replay", poses.request, *data]) == 3
    assert "status: was" in capsys.readouterr().out


def test_a_service_that_was_killed_says_so_after_a_restart(tmp_path: Path) -> None:
    process, url = start(tmp_path)
    (tmp_path / "priors" / "m.prior.npz").write_bytes(b"no prior")
    with Client(url) as client, pytest.raises(Exception, match=r"m\.prior\.npz|found"):
        client.locate(SCAN, prior="m", camera=CAMERA)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert process.stdout is not None
    process.stdout.close()
    with closing(sqlite3.connect(tmp_path / "data" / "journal.sqlite")) as journal, journal:
        journal.execute("UPDATE boltpose_requests SET state = 'started', error_code = NULL")
    again, url = start(tmp_path)
    try:
        (entry,) = httpx.get(f"{url}/v1/journal").json()["entries"]
        assert (entry["state"], entry["error_code"]) == ("interrupted", "interrupted")
    finally:
        again.terminate()
        assert again.wait(30) == 0
        assert again.stdout is not None
        again.stdout.close()


def test_networks_that_are_none_are_told_before_a_folder_is_made(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "models").mkdir()
    data = tmp_path / "data"

    assert main(["serve", "--models", str(tmp_path / "models"), "--data", str(data)]) == 2

    assert "models: found no network" in capfd.readouterr().err.strip("\n")
    assert not data.exists()
