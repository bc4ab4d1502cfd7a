"""A process that computes: `python -m boltpose.service.worker`, driven by lines of JSON.

A process and not a thread: a computation that takes too long, or whose client has gone, can only
be stopped by ending its process, and the next one must not wait for it.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
import queue
import sys
import threading
from pathlib import Path
from typing import Any, BinaryIO

from boltpose.errors import BoltposeError
from boltpose.service.calls import BuildCall, LocateCall
from boltpose.service.execute import Executor
from boltpose.service.failures import ServiceError

_LOG = logging.getLogger(__name__)


def main(arguments: list[str] | None = None) -> int:
    """Answer jobs from stdin on stdout until stdin ends."""
    parser = argparse.ArgumentParser(prog="python -m boltpose.service.worker")
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--models", type=Path)
    parser.add_argument("--prior-memory-mb", type=float, default=512.0)
    parser.add_argument("--memory-mb", type=float, required=True)
    parser.add_argument("--work", type=Path, required=True)
    options = parser.parse_args(arguments)
    _bound_memory(int(options.memory_mb * 1e6))
    # whatever a library prints must not get between the answers
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    try:
        executor = Executor(options.data, options.models, options.prior_memory_mb, options.work)
        executor.warm()
    except BoltposeError as error:
        _send(answers, event="failed", status=500, code="not_ready", message=str(error))
        return 1
    except Exception as error:  # noqa: BLE001 - the service is told why, whatever it is
        _LOG.exception("the worker cannot start")
        _send(answers, event="failed", status=500, code="not_ready", message=str(error))
        return 1
    _send(answers, event="ready", models=dict(executor.models.hashes))
    jobs: queue.Queue[dict[str, Any]] = queue.Queue()
    threading.Thread(target=_read_jobs, args=(jobs,), daemon=True).start()
    while True:
        _answer(answers, executor, jobs.get())


def _bound_memory(size: int) -> None:
    """Let the system refuse more memory; not all systems can (Windows)."""
    try:
        import resource
    except ImportError:
        return
    resource.setrlimit(resource.RLIMIT_DATA, (size, size))


def _read_jobs(jobs: queue.Queue[dict[str, Any]]) -> None:
    for line in sys.stdin.buffer:
        jobs.put(json.loads(line))
    # the service has gone, also by a crash: nobody wants the answer any more
    os._exit(0)


def _answer(answers: BinaryIO, executor: Executor, job: dict[str, Any]) -> None:
    def on_stage(stage: str, seconds: float) -> None:
        _send(answers, event="stage", stage=stage, seconds=seconds)

    kind = job["kind"]
    try:
        if kind == "locate":
            text = executor.locate(LocateCall.from_json(job["call"]), on_stage)
        elif kind == "build":
            text = executor.build(BuildCall.from_json(job["call"]), Path(job["output"]), on_stage)
        elif kind == "report":
            executor.report(LocateCall.from_json(job["call"]), job["poses"], Path(job["output"]))
            text = ""
        else:
            raise ServiceError(500, "internal", f"no job of kind '{kind}'")
    except ServiceError as error:
        _send(answers, event="failed", status=error.status, code=error.code, message=str(error))
    except MemoryError:
        _send(
            answers,
            event="failed",
            status=422,
            code="too_large",
            message="this input needs more memory than the service has",
        )
    except Exception:  # noqa: BLE001 - the process lives on, see below
        # a mistake of ours, not of the client: the trace goes to the log, the process lives on
        _LOG.exception("job of kind %s failed", kind)
        _send(
            answers,
            event="failed",
            status=500,
            code="internal",
            message="the computation failed; the service's log says more",
        )
    else:
        _send(
            answers,
            event="done",
            text=text,
            priors_kept=len(executor.priors),
            prior_bytes=executor.priors.size,
        )


def _send(stream: BinaryIO, **message: Any) -> None:
    stream.write(json.dumps(message).encode() + b"\n")
    stream.flush()


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, stream=sys.stderr)
    sys.exit(main())
