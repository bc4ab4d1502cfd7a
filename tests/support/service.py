"""A service with workers that compute nothing, on a folder of its own."""

from __future__ import annotations

import hashlib
import socket
import sys
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import uvicorn

from boltpose.prior.file import write_prior
from boltpose.results import dump_json
from boltpose.service.app import create_app
from boltpose.service.config import ServiceConfig
from boltpose.service.state import State
from tests.support import results

POINTS = b"points"
FAKE = Path(__file__).parent / "fake_worker.py"


def make_config(folder: Path, **settings: Any) -> ServiceConfig:
    (folder / "scans").mkdir(exist_ok=True)
    return ServiceConfig(
        **{
            "data": str(folder / "data"),
            "priors": str(folder / "priors"),
            "scans": str(folder / "scans"),
            **settings,
        }
    )


@contextmanager
def running(folder: Path, **settings: Any) -> Generator[tuple[httpx.Client, State]]:
    """A service that knows the motor `cube`, and a client on the same computer."""
    (folder / "priors").mkdir(exist_ok=True)
    prior = results.cube_prior()
    write_prior(folder / "priors" / "cube.prior.npz", prior)
    answers = folder / "answers"
    answers.mkdir(exist_ok=True)
    write_prior(answers / "prior.npz", prior)
    # of the scan that `upload` sends, whatever is sent
    scan = {"scan_sha256": hashlib.sha256(POINTS).hexdigest()}
    for name, result in {
        "ok": results.located(prior),
        "refused": results.refused(prior),
    }.items():
        answer = replace(result, provenance={**result.provenance, **scan})
        (answers / f"{name}.json").write_text(dump_json(answer))
    app = create_app(make_config(folder, **settings))
    state: State = app.state.service
    command = [sys.executable, str(FAKE), str(answers)]
    make = state._make_pool

    def fake(workers: int, queue_size: int) -> Any:
        pool = make(workers, queue_size)
        pool._command = command
        return pool

    state._make_pool = fake
    state.pool._command = command
    state.side._command = command
    listener = socket.socket()
    listener.bind(("127.0.0.1", 0))
    server = uvicorn.Server(
        uvicorn.Config(app, log_level="critical", timeout_graceful_shutdown=1, lifespan="on")
    )
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
    thread.start()
    try:
        while not server.started and thread.is_alive():
            time.sleep(0.01)
        assert server.started
        url = f"http://127.0.0.1:{listener.getsockname()[1]}"
        with httpx.Client(base_url=url, trust_env=False, timeout=20) as client:
            yield client, state
    finally:
        server.should_exit = True
        thread.join()
        listener.close()


def upload(name: str = "ok.ply", content: bytes = POINTS) -> list[Any]:
    return [("scan", (name, content))]
