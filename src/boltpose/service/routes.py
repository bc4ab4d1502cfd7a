"""The routes of the service."""

from __future__ import annotations

import asyncio
from typing import Annotated, Any, Literal

from fastapi import APIRouter, FastAPI, Path, Query, Request, Response
from fastapi.responses import FileResponse, HTMLResponse
from pydantic import BaseModel, ConfigDict, Field

from boltpose.errors import InputFileError
from boltpose.prior.file import prior_to_json, read_prior
from boltpose.results import PosesFile
from boltpose.service.answers import ERRORS
from boltpose.service.calls import LocateCall
from boltpose.service.failures import ServiceError
from boltpose.service.intake import build_schema, locate_schema
from boltpose.service.journal import Entry
from boltpose.service.journal import State as Row
from boltpose.service.run_build import delete_prior, start_build
from boltpose.service.run_locate import locate_for
from boltpose.service.shelf import prior_name
from boltpose.service.state import State

JournalId = Annotated[str, Path(pattern=r"^[0-9T]{21}-[0-9a-f]{8}$")]
PriorName = Annotated[str, Path(min_length=1, max_length=200)]

_REQUEST_ID = {"schema": {"type": "string"}, "description": "Id in the journal"}


class _Answer(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Liveness(_Answer):
    """Yes or no, for a watchdog."""

    status: Literal["live", "ready"]


class Health(_Answer):
    """How the service is."""

    status: Literal["ready", "not_ready"]
    problem: str
    """Why it is not ready; empty if it is."""
    version: str
    poses_schema: str
    models: dict[str, str]
    """SHA-256 of every network's file."""
    workers: int
    waiting: int
    priors: int
    journal: str
    """`sqlite` or `postgresql`."""


class PriorSummary(_Answer):
    """A motor the service knows."""

    name: str
    bytes: int
    sha256: str


class PriorList(_Answer):
    """All motors the service knows."""

    priors: list[PriorSummary]


class Job(_Answer):
    """A prior that is, or was, being built."""

    id: str
    prior: str
    state: Literal["waiting", "running", "done", "failed", "cancelled", "interrupted"]
    stages_done: list[str]
    error_code: str | None = None
    error: str | None = None


class JournalEntry(_Answer):
    """One request of the past."""

    id: str
    kind: str
    state: Row
    started: str
    finished: str | None
    client: str
    prior: str
    status: str | None
    reason: str | None
    error_code: str | None
    error: str | None
    seconds: float | None
    has_inputs: bool


class JournalEntryInFull(JournalEntry):
    """One request of the past with all that was asked and answered."""

    call: dict[str, Any]
    software: dict[str, Any]
    result: dict[str, Any] | None


class JournalPage(_Answer):
    """Requests, the latest first."""

    entries: list[JournalEntry]
    next_before: Annotated[str | None, Field(description="`before` of the next page")]


class Deleted(_Answer):
    """What was deleted; its bytes stay in the journal for a while."""

    deleted: str
    request: str


def add_routes(app: FastAPI, state: State) -> None:
    """Add all routes of one service to its app."""
    router = APIRouter(responses=ERRORS)
    _add_locate(router, state)
    _add_priors(router, state)
    _add_journal(router, state)
    _add_health(router, state)
    app.include_router(router)


def _add_locate(router: APIRouter, state: State) -> None:
    @router.post(
        "/v1/locate",
        tags=["locate"],
        response_model=PosesFile,
        response_description="poses.json; a refused pose is an answer too: read `status` first",
        responses={200: {"headers": {"X-Boltpose-Request": _REQUEST_ID}}},
        openapi_extra={"requestBody": locate_schema()},
    )
    async def locate(request: Request) -> Response:  # pyright: ignore[reportUnusedFunction]
        """Locate every bolt of a clamped motor."""
        entry, text = await locate_for(state, request)
        return Response(text, media_type="application/json", headers={"X-Boltpose-Request": entry})


def _add_priors(router: APIRouter, state: State) -> None:
    @router.get("/v1/priors", tags=["priors"])
    async def list_priors() -> PriorList:  # pyright: ignore[reportUnusedFunction]
        """List the motors the service knows."""

        def look() -> PriorList:
            return PriorList(
                priors=[
                    PriorSummary(name=prior_name(blob), bytes=blob.size, sha256=blob.sha256)
                    for blob in state.shelf.take_all()
                ]
            )

        return await asyncio.to_thread(look)

    @router.post(
        "/v1/priors",
        tags=["priors"],
        status_code=202,
        openapi_extra={"requestBody": build_schema()},
    )
    async def build_prior(  # pyright: ignore[reportUnusedFunction]
        request: Request, response: Response
    ) -> Job:
        """Build the prior of a motor from its full scan or CAD mesh; ask for the job after."""
        job = await start_build(state, request)
        response.headers["Location"] = f"/v1/jobs/{job.id}"
        return Job(id=job.id, prior=job.name, state="waiting", stages_done=[])

    @router.get("/v1/priors/{name}", tags=["priors"], response_model=dict[str, Any])
    async def show_prior(name: PriorName) -> Any:  # pyright: ignore[reportUnusedFunction]
        """Return a prior's bolts and axes, without its points."""

        def read() -> dict[str, Any]:
            blob = state.shelf.take(name)
            try:
                return prior_to_json(read_prior(state.blobs.find(blob)))
            except InputFileError as error:  # by its name, not by where the service keeps it
                raise InputFileError(blob.name, error.found, error.wanted) from error

        return await asyncio.to_thread(read)

    @router.get(
        "/v1/priors/{name}/file",
        tags=["priors"],
        response_model=None,
        responses={200: {"content": {"application/octet-stream": {}}}},
    )
    async def load_prior(name: PriorName) -> Response:  # pyright: ignore[reportUnusedFunction]
        """Download the `.prior.npz`."""
        blob = await asyncio.to_thread(state.shelf.take, name)
        # from the store: the folder's file may be replaced or deleted while it is sent
        path = state.blobs.path(blob.sha256)
        return FileResponse(path, media_type="application/octet-stream", filename=blob.name)

    @router.delete("/v1/priors/{name}", tags=["priors"])
    async def remove_prior(  # pyright: ignore[reportUnusedFunction]
        name: PriorName, request: Request
    ) -> Deleted:
        """Delete a prior."""
        return Deleted(deleted=name, request=await delete_prior(state, request, name))

    @router.get("/v1/jobs/{job}", tags=["priors"])
    async def show_job(job: JournalId) -> Job:  # pyright: ignore[reportUnusedFunction]
        """Tell how far the building of a prior is."""
        return await _job(state, job)

    @router.delete("/v1/jobs/{job}", tags=["priors"])
    async def stop_job(job: JournalId) -> Job:  # pyright: ignore[reportUnusedFunction]
        """Stop the building of a prior; no harm if it is done."""
        running = state.jobs.get(job)
        if running is not None:
            await running.stop()
        return await _job(state, job)


def _add_journal(router: APIRouter, state: State) -> None:
    @router.get("/v1/journal", tags=["journal"])
    async def list_entries(  # pyright: ignore[reportUnusedFunction]
        limit: Annotated[int, Query(ge=1, le=1000)] = 50,
        before: Annotated[str | None, Query(pattern=r"^[0-9T]{21}-[0-9a-f]{8}$")] = None,
        state_: Annotated[Row | None, Query(alias="state")] = None,
    ) -> JournalPage:
        """List requests, the latest first."""
        entries = await asyncio.to_thread(
            lambda: state.journal.entries(limit=limit, before=before, state=state_)
        )
        return JournalPage(
            entries=[
                JournalEntry.model_validate(entry.to_json(with_result=False)) for entry in entries
            ],
            next_before=entries[-1].id if len(entries) == limit else None,
        )

    @router.get("/v1/journal/{entry}", tags=["journal"])
    async def show_entry(  # pyright: ignore[reportUnusedFunction]
        entry: JournalId,
    ) -> JournalEntryInFull:
        """Return all of one request."""
        found = await _entry(state, entry)
        return JournalEntryInFull.model_validate(found.to_json(with_result=True))

    @router.get("/v1/journal/{entry}/poses.json", tags=["journal"], response_model=PosesFile)
    async def show_poses(entry: JournalId) -> Response:  # pyright: ignore[reportUnusedFunction]
        """Return the very bytes that were answered."""
        found = await _entry(state, entry)
        if found.kind != "locate" or found.result is None:
            raise ServiceError(404, "no_result", f"request {entry} has no poses.json")
        return Response(found.result, media_type="application/json")

    @router.get(
        "/v1/journal/{entry}/report",
        tags=["journal"],
        response_model=None,
        responses={200: {"content": {"text/html": {}}}},
    )
    async def show_report(entry: JournalId) -> Response:  # pyright: ignore[reportUnusedFunction]
        """Return one page with verdict, pictures and bolts, made from the stored input."""
        found = await _entry(state, entry)
        if found.kind != "locate" or found.result is None:
            raise ServiceError(404, "no_result", f"request {entry} has no poses.json")
        if not found.has_inputs:
            raise ServiceError(404, "inputs_deleted", f"the input of {entry} is not kept any more")
        return await _report(state, found)


def _add_health(router: APIRouter, state: State) -> None:
    @router.get("/v1/health/live", tags=["health"])
    async def live() -> Liveness:  # pyright: ignore[reportUnusedFunction]
        """Answer as long as the service runs."""
        return Liveness(status="live")

    @router.get("/v1/health/ready", tags=["health"])
    async def ready() -> Liveness:  # pyright: ignore[reportUnusedFunction]
        """Answer 503 while no request can be answered: no worker, or no journal."""
        if state.problem:
            raise ServiceError(503, "not_ready", state.problem, retry_after_s=2)
        return Liveness(status="ready")

    @router.get("/v1/health", tags=["health"])
    async def health() -> Health:  # pyright: ignore[reportUnusedFunction]
        """Tell versions, networks and load."""
        software = state.software
        names = await asyncio.to_thread(state.shelf.names)
        return Health(
            status="not_ready" if state.problem else "ready",
            problem=state.problem,
            version=software["version"],
            poses_schema=software["schema"],
            models=software["models"],
            workers=state.pool.ready,
            waiting=state.pool.waiting,
            priors=len(names),
            journal=state.journal.kind,
        )

    @router.get(
        "/metrics",
        tags=["health"],
        response_model=None,
        responses={200: {"content": {"text/plain": {}}}},
    )
    async def metrics() -> Response:  # pyright: ignore[reportUnusedFunction]
        """Counters for Prometheus."""
        pool, found = state.pool, state.metrics
        found.queue_length.set(pool.waiting)
        found.running.set(pool.taken)
        found.workers.set(pool.ready)
        found.restarts.set(pool.restarts)
        return Response(found.text(), media_type="text/plain; version=0.0.4")


async def _entry(state: State, entry: str) -> Entry:
    found = await asyncio.to_thread(state.journal.find, entry)
    if found is None:
        raise ServiceError(404, "unknown_request", f"no request {entry} in the journal")
    return found


async def _job(state: State, job: str) -> Job:
    running = state.jobs.get(job)
    if running is not None:
        return Job(
            id=job,
            prior=running.name,
            state="running" if running.is_running else "waiting",
            stages_done=list(running.stages),
        )
    found = await _entry(state, job)
    if found.kind != "build":
        raise ServiceError(404, "unknown_request", f"request {job} built no prior")
    return Job.model_validate(
        {
            "id": job,
            "prior": found.prior,
            # between the last look at `jobs` and the row it is still open for a moment
            "state": "running" if found.state is Row.STARTED else found.state.value,
            "stages_done": [],
            "error_code": found.error_code,
            "error": found.error,
        }
    )


async def _report(state: State, entry: Entry) -> Response:
    output = state.work / f"{entry.id}-{id(entry):x}.html"
    pool = await state.use_side()
    try:
        pool.take_place()
        try:
            await pool.run(
                {
                    "kind": "report",
                    "call": LocateCall.from_json(entry.call).to_json(),
                    "poses": entry.result,
                    "output": str(output),
                },
                timeout_s=state.config.locate_timeout_s,
                queue_timeout_s=state.config.queue_timeout_s,
            )
        finally:
            pool.free_place()
        text = await asyncio.to_thread(output.read_text, encoding="utf-8")
    finally:
        output.unlink(missing_ok=True)
        await state.leave_side()
    return HTMLResponse(text)
