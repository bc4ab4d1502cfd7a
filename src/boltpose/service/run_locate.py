"""One `POST /v1/locate` from its arrival to its answer, written down on the way."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Awaitable
from contextlib import suppress

from fastapi import Request

from boltpose.results import PosesFile
from boltpose.schema import Status
from boltpose.service.calls import LocateCall
from boltpose.service.failures import ServiceError, journal_failed
from boltpose.service.journal import JournalError
from boltpose.service.journal import State as Row
from boltpose.service.pool import Done
from boltpose.service.shelf import prior_name
from boltpose.service.state import State

_LOG = logging.getLogger(__name__)
INTERNAL = ("internal", "a mistake of the service; its log says more")


class JournaledError(ServiceError):
    """A failure that is in the journal."""

    def __init__(self, error: ServiceError, request: str) -> None:
        super().__init__(error.status, error.code, str(error), retry_after_s=error.retry_after_s)
        self.request = request


async def locate_for(state: State, request: Request) -> tuple[str, str]:
    """Answer one request.

    Returns:
        Its id in the journal, and the text of `poses.json`.

    Raises:
        ServiceError: The queue is full, or the request cannot be read.
        JournaledError: It was read and failed.
    """
    state.pool.take_place()
    try:
        call = await state.intake.locate_call(request)
        start = time.perf_counter()
        entry = await asyncio.to_thread(
            state.journal.start,
            "locate",
            call.to_json(),
            call.blobs,
            client=client_of(request),
            prior=", ".join(prior_name(blob) for blob in call.priors),
            software=state.software,
        )
        text = await _run(state, request, entry, call, start)
    finally:
        state.pool.free_place()
    state.metrics.locate_seconds.observe(time.perf_counter() - start)
    return entry, text


async def _run(state: State, request: Request, entry: str, call: LocateCall, start: float) -> str:
    metrics = state.metrics

    def on_stage(stage: str, seconds: float) -> None:
        metrics.stage_seconds.labels(stage).observe(seconds)

    def on_start() -> None:
        metrics.wait_seconds.observe(time.perf_counter() - start)

    work = state.pool.run(
        {"kind": "locate", "call": call.to_json()},
        timeout_s=state.config.locate_timeout_s,
        queue_timeout_s=state.config.queue_timeout_s,
        on_stage=on_stage,
        on_start=on_start,
    )
    try:
        done = await _unless_gone(request, work)
        file = PosesFile.model_validate_json(done.text)
        await asyncio.to_thread(
            state.journal.finish,
            entry,
            Row.DONE,
            seconds=time.perf_counter() - start,
            result=done.text,
            status=file.status.value,
            reason=None if file.reason is None else file.reason.value,
        )
    except asyncio.CancelledError:
        gone = ServiceError(503, "interrupted", "the service ended before this request did")
        await asyncio.shield(close_entry(state, entry, Row.INTERRUPTED, start, gone))
        raise
    except JournalError as error:
        _LOG.error("%s: %s", entry, error)
        raise JournaledError(journal_failed(), entry) from error
    except Exception as error:
        failure = error if isinstance(error, ServiceError) else ServiceError(500, *INTERNAL)
        if failure is not error:
            _LOG.exception("%s failed", entry)
        row = Row.CANCELLED if failure.code == "client_gone" else Row.FAILED
        await close_entry(state, entry, row, start, failure)
        raise JournaledError(failure, entry) from error
    metrics.prior_bytes.set(done.prior_bytes)
    metrics.poses.labels(file.status.value).inc()
    if file.status is Status.REFUSED and file.reason is not None:
        metrics.refusals.labels(file.reason.value).inc()
    return done.text


async def close_entry(
    state: State, entry: str, row: Row, start: float, error: ServiceError
) -> None:
    """Write down how a request failed; where that fails too, the journal does it later."""
    try:
        await asyncio.to_thread(
            state.journal.finish,
            entry,
            row,
            seconds=time.perf_counter() - start,
            error_code=error.code,
            error=str(error),
        )
    except JournalError as lost:
        _LOG.error("%s: %s", entry, lost)


async def _unless_gone(request: Request, work: Awaitable[Done]) -> Done:
    """Wait for a job; a client that hangs up ends it.

    Raises:
        ServiceError: The job failed, or the client has gone.
    """
    job = asyncio.ensure_future(work)
    gone = asyncio.ensure_future(_wait_until_gone(request))
    try:
        await asyncio.wait({job, gone}, return_when=asyncio.FIRST_COMPLETED)
        if job.done():
            return job.result()
        raise ServiceError(499, "client_gone", "the client went away before the answer")
    finally:
        for task in (job, gone):
            task.cancel()
            with suppress(asyncio.CancelledError, ServiceError):
                await task


async def _wait_until_gone(request: Request) -> None:
    while (await request.receive())["type"] != "http.disconnect":
        pass


def client_of(request: Request) -> str:
    """Who asks, for the journal: address and name of the key."""
    host = "" if request.client is None else request.client.host
    key = getattr(request.state, "key_name", "")
    return f"{host} ({key})" if key else host
