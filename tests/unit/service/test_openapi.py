"""`/v1/openapi.json` says what is really answered, errors too."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.support.service import running, upload
from tests.unit.service.test_service import locate, wait_for

jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is not installed")


def check(document: dict[str, Any], route: str, answer: httpx.Response) -> None:
    """The document knows this status, its kind of content, and every field of its body."""
    operation = document["paths"][route][answer.request.method.lower()]
    said = operation["responses"][str(answer.status_code)]
    content = said["content"]
    kind = answer.headers["content-type"].split(";")[0]
    assert kind in content, (route, answer.status_code, kind)
    for name in said.get("headers", {}):
        assert name in answer.headers, (route, answer.status_code, name)
    schema = content[kind].get("schema")
    if kind != "application/json":
        return
    assert schema, (route, answer.status_code)
    validator = jsonschema.Draft202012Validator({**schema, "components": document["components"]})
    faults = [
        f"{list(fault.path)}: {fault.message}" for fault in validator.iter_errors(answer.json())
    ]
    assert not faults, (route, answer.status_code, faults)


def test_real_answers_are_as_the_document_says(tmp_path: Path) -> None:
    with running(tmp_path, locate_timeout_s=0.3, max_upload_mb=0.5) as (client, state):
        document = client.get("/v1/openapi.json").json()
        found: dict[str, set[int]] = {}

        def look(route: str, answer: httpx.Response, status: int) -> httpx.Response:
            assert answer.status_code == status, answer.text
            check(document, route, answer)
            found.setdefault(route, set()).add(status)
            return answer

        ok = look("/v1/locate", locate(client), 200)
        for name, status in {
            "refused.ply": 200,
            "bad.ply": 422,
            "slow.ply": 504,
            "crash.ply": 500,
        }.items():
            look("/v1/locate", locate(client, name), status)
        look("/v1/locate", client.post("/v1/locate", content=b"x"), 415)
        look("/v1/locate", client.post("/v1/locate", content=b"x" * 600_000), 413)
        look("/v1/locate", locate(client, prior="nope"), 404)
        look("/v1/locate", locate(client, scan_unit="feet"), 422)
        look("/v1/locate", client.post("/v1/locate", headers={"Origin": "http://evil"}), 403)
        state.pool._taken += 100
        look("/v1/locate", locate(client), 429)
        state.pool._taken -= 100
        state.journal.failure = "away"
        look("/v1/health/ready", client.get("/v1/health/ready"), 503)
        look("/v1/health", client.get("/v1/health"), 200)
        state.journal.failure = ""
        for route in ("/v1/health/live", "/v1/health/ready", "/v1/priors", "/v1/journal"):
            look(route, client.get(route), 200)
        for route in ("/v1/priors/{name}", "/v1/priors/{name}/file"):
            look(route, client.get(route.format(name="cube")), 200)
            look(route, client.get(route.format(name="nope")), 404)
        entry = ok.headers["X-Boltpose-Request"]
        for route in ("", "/poses.json", "/report"):
            look(f"/v1/journal/{{entry}}{route}", client.get(f"/v1/journal/{entry}{route}"), 200)
            other = f"/v1/journal/{entry[:-8]}00000000{route}"
            look(f"/v1/journal/{{entry}}{route}", client.get(other), 404)
        look("/v1/journal", client.get("/v1/journal?limit=0"), 422)
        new = {"data": {"name": "new"}, "files": upload("full.ply")}
        job = look("/v1/priors", client.post("/v1/priors", **new), 202).headers["Location"]
        wait_for(lambda: client.get(job).json()["state"] == "done")
        look("/v1/jobs/{job}", client.get(job), 200)
        look("/v1/jobs/{job}", client.delete(job), 200)
        look("/v1/priors", client.post("/v1/priors", **new), 409)
        look("/v1/priors/{name}", client.delete("/v1/priors/new"), 200)
        look("/metrics", client.get("/metrics"), 200)
        assert set(found) == set(document["paths"])
