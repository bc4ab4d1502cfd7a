"""Building and deleting priors, written down like everything else."""

from __future__ import annotations

import asyncio
import json
import logging
import time
from pathlib import Path
from typing import BinaryIO

from fastapi import Request

from boltpose.io.atomic import write_atomic
from boltpose.service.blobs import Blob
from boltpose.service.calls import BuildCall
from boltpose.service.failures import ServiceError
from boltpose.service.journal import State as Row
from boltpose.service.run_locate import INTERNAL, JournaledError, client_of, close_entry
from boltpose.service.state import BuildJob, State

_LOG = logging.getLogger(__name__)
_MAX_JOBS = 5


async def start_build(state: State, request: Request) -> BuildJob:
    """Read a request for a prior and begin to build it.

    Raises:
        ServiceError: Not allowed, too many jobs, a name that is taken, or a bad request.
    """
    _check_allowed(state)
    _check_room(state)
    call = await state.intake.build_call(request)
    taken = await asyncio.to_thread(state.shelf.names)
    _check_room(state)  # others may have sent theirs meanwhile
    if call.name in taken and not call.replace:
        raise _taken(call.name)
    if call.name in [job.name for job in state.jobs.values()]:
        raise ServiceError(409, "prior_exists", f"'{call.name}' is being built already")
    entry = await asyncio.to_thread(
        state.journal.start,
        "build",
        call.to_json(),
        call.blobs,
        client=client_of(request),
        prior=call.name,
        software=state.software,
    )
    job = BuildJob(id=entry, name=call.name)
    state.jobs[entry] = job
    job.task = asyncio.get_running_loop().create_task(_build(state, job, call))
    return job


async def delete_prior(state: State, request: Request, name: str) -> str:
    """Delete a prior; its bytes stay with the journal's entry.

    Returns:
        The id of the entry.

    Raises:
        ServiceError: Not allowed, or there is none.
    """
    _check_allowed(state)
    path = await asyncio.to_thread(state.shelf.path, name)
    blob = await asyncio.to_thread(state.shelf.take, name)
    start = time.perf_counter()
    entry = await asyncio.to_thread(
        state.journal.start,
        "delete",
        json.dumps({"name": name, "sha256": blob.sha256}),
        (blob,),
        client=client_of(request),
        prior=name,
        software=state.software,
    )
    try:
        await asyncio.to_thread(path.unlink, missing_ok=True)
    except OSError as error:
        refused = ServiceError(
            500, "internal", f"'{name}' cannot be deleted ({error.strerror}); see the folder"
        )
        await close_entry(state, entry, Row.FAILED, start, refused)
        raise JournaledError(refused, entry) from error
    await asyncio.to_thread(
        state.journal.finish, entry, Row.DONE, seconds=time.perf_counter() - start
    )
    return entry


async def _build(state: State, job: BuildJob, call: BuildCall) -> None:
    start = time.perf_counter()
    output = state.work / f"{job.id}.prior.npz"

    def on_stage(stage: str, _: float) -> None:
        job.stages.append(stage)

    def on_start() -> None:
        job.is_running = True

    try:
        pool = await state.use_side()
        try:
            done = await pool.run(
                {"kind": "build", "call": call.to_json(), "output": str(output)},
                timeout_s=state.config.build_timeout_s,
                queue_timeout_s=state.config.build_timeout_s * _MAX_JOBS,
                on_stage=on_stage,
                on_start=on_start,
            )
        finally:
            await state.leave_side()
        job.can_stop = False
        await asyncio.to_thread(_install, state, call, output)
        await asyncio.to_thread(
            state.journal.finish,
            job.id,
            Row.DONE,
            seconds=time.perf_counter() - start,
            result=done.text,
        )
    except ServiceError as error:
        await close_entry(state, job.id, Row.FAILED, start, error)
    except asyncio.CancelledError:
        stopped = ServiceError(499, "cancelled", "the job was stopped")
        await close_entry(state, job.id, Row.CANCELLED, start, stopped)
    except Exception:  # noqa: BLE001 - the job has nobody above it, and its row must be closed
        _LOG.exception("building a prior failed")
        await close_entry(state, job.id, Row.FAILED, start, ServiceError(500, *INTERNAL))
    finally:
        output.unlink(missing_ok=True)
        state.jobs.pop(job.id, None)


def _install(state: State, call: BuildCall, built: Path) -> Blob:
    if call.name in state.shelf.names() and not call.replace:
        raise _taken(call.name)

    def write(stream: BinaryIO) -> None:
        stream.write(built.read_bytes())

    write_atomic(state.shelf.new_path(call.name), write)
    return state.shelf.take(call.name)


def _check_room(state: State) -> None:
    if len(state.jobs) >= _MAX_JOBS:
        raise ServiceError(
            429, "queue_full", f"{_MAX_JOBS} priors are being built", retry_after_s=30
        )


def _check_allowed(state: State) -> None:
    if not state.config.can_change_priors:
        raise ServiceError(403, "priors_fixed", "this service does not let clients change priors")


def _taken(name: str) -> ServiceError:
    return ServiceError(
        409, "prior_exists", f"there is a prior '{name}' already: another name, or replace=true"
    )
