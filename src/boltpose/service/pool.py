"""Worker processes and the bounded queue before them."""

from __future__ import annotations

import asyncio
import json
import logging
import shutil
import sys
import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from boltpose.service.failures import ServiceError

_LOG = logging.getLogger(__name__)
_MAX_LINE_BYTES = 256 * 1024 * 1024
_START_TIMEOUT_S = 120.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Done:
    """What a worker answered."""

    text: str
    prior_bytes: int = 0


@dataclass(slots=True, eq=False)
class _Worker:
    """One process that is ready for a job."""

    process: asyncio.subprocess.Process
    folder: Path
    """For its files; goes with it, however it ends."""
    models: Mapping[str, str] = field(default_factory=dict)


class WorkerPool:
    """Hands jobs to processes, one each at a time, and ends a process that must not go on.

    Jobs wait in the order they came. A cancelled job, and one past its time, takes its process
    with it; a new one is started at once.
    """

    def __init__(
        self,
        data: Path,
        models: Path | None,
        *,
        prior_memory_mb: float,
        memory_mb: float,
        workers: int,
        queue_size: int,
    ) -> None:
        """Say what workers are like; `start` starts them."""
        self._command = [
            sys.executable,
            "-m",
            "boltpose.service.worker",
            f"--data={data}",
            f"--prior-memory-mb={prior_memory_mb}",
            f"--memory-mb={memory_mb}",
            *([] if models is None else [f"--models={models}"]),
        ]
        self._work = data / "work"
        self._count = workers
        self._capacity = workers + queue_size
        self._taken = 0
        self._idle: asyncio.Queue[_Worker] = asyncio.Queue()
        self._alive: set[_Worker] = set()
        self._ending: set[_Worker] = set()
        """Killed, but nobody has waited for their end yet."""
        self._starting: set[asyncio.Task[None]] = set()
        self._is_open = False
        self.restarts = 0
        self.models: Mapping[str, str] = {}
        self.failure = ""
        """Why no worker could be started last time; empty if it could."""

    async def start(self) -> None:
        """Start all workers and wait until they are ready.

        Raises:
            ServiceError: One cannot start.
        """
        self._is_open = True
        for _ in range(self._count):
            self._idle.put_nowait(await self._spawn())

    async def close(self) -> None:
        """End all workers."""
        self._is_open = False
        for task in list(self._starting):
            task.cancel()
        await asyncio.gather(*self._starting, return_exceptions=True)
        for worker in [*self._alive, *self._ending]:
            await self._end(worker)

    @property
    def ready(self) -> int:
        """Workers that live, idle or not."""
        return len(self._alive)

    @property
    def waiting(self) -> int:
        """Requests that have a place but no worker yet, uploads included."""
        return max(0, self._taken - self._count)

    @property
    def taken(self) -> int:
        """Requests that have a place."""
        return self._taken

    def take_place(self) -> None:
        """Take a place in the queue; `free_place` gives it back.

        Raises:
            ServiceError: 429, all are taken.
        """
        if self._taken >= self._capacity:
            raise ServiceError(
                429,
                "queue_full",
                f"{self._taken} requests are at work or waiting, wanted fewer than "
                f"{self._capacity}: come again later",
                retry_after_s=max(1, self._taken // self._count),
            )
        self._taken += 1

    def free_place(self) -> None:
        """Give a place back."""
        self._taken -= 1

    async def run(
        self,
        job: Mapping[str, Any],
        *,
        timeout_s: float,
        queue_timeout_s: float,
        on_stage: Callable[[str, float], None] | None = None,
        on_start: Callable[[], None] | None = None,
    ) -> Done:
        """Run one job.

        Args:
            job: For `worker`.
            timeout_s: Longest time for it, once a worker has it.
            queue_timeout_s: Longest wait for a worker.
            on_stage: Told each stage's name and seconds.
            on_start: Told when a worker has it.

        Raises:
            ServiceError: The job failed, waited or took too long, or its worker died.
        """
        try:
            async with asyncio.timeout(queue_timeout_s):
                worker = await self._take_worker()
        except TimeoutError:
            raise ServiceError(
                503,
                "queue_timeout",
                f"no worker was free within {queue_timeout_s:g} s",
                retry_after_s=5,
            ) from None
        is_sound = False
        try:
            if on_start is not None:
                on_start()
            async with asyncio.timeout(timeout_s):
                answer = await self._talk(worker, job, on_stage)
            is_sound = True
        except TimeoutError:
            raise ServiceError(
                504, "timeout", f"the computation took more than {timeout_s:g} s and was stopped"
            ) from None
        finally:
            if is_sound:
                self._idle.put_nowait(worker)
            else:
                self._replace(worker)
        if answer["event"] == "failed":
            raise ServiceError(int(answer["status"]), answer["code"], answer["message"])
        return Done(text=answer["text"], prior_bytes=int(answer.get("prior_bytes", 0)))

    async def _take_worker(self) -> _Worker:
        while True:
            worker = await self._idle.get()
            if worker.process.returncode is None:
                return worker
            self._replace(worker)  # it died between two jobs

    async def _talk(
        self,
        worker: _Worker,
        job: Mapping[str, Any],
        on_stage: Callable[[str, float], None] | None,
    ) -> dict[str, Any]:
        sink, source = worker.process.stdin, worker.process.stdout
        assert sink is not None
        assert source is not None
        died = ServiceError(
            500, "worker_died", "the computation's process ended; a new one was started"
        )
        try:
            sink.write(json.dumps(dict(job)).encode() + b"\n")
            await sink.drain()
        except OSError as error:
            raise died from error
        while True:
            line = await source.readline()
            if not line.endswith(b"\n"):
                raise died
            answer = json.loads(line)
            if answer["event"] != "stage":
                return answer
            if on_stage is not None:
                on_stage(answer["stage"], answer["seconds"])

    async def _spawn(self) -> _Worker:
        folder = Path(tempfile.mkdtemp(dir=self._work))
        process = await asyncio.create_subprocess_exec(
            *self._command,
            f"--work={folder}",
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            limit=_MAX_LINE_BYTES,
            # Ctrl-C is for the service, which lets its workers finish
            start_new_session=True,
        )
        worker = _Worker(process, folder)
        self._alive.add(worker)
        assert process.stdout is not None
        try:
            async with asyncio.timeout(_START_TIMEOUT_S):
                line = await process.stdout.readline()
            answer: dict[str, Any] = {"event": "failed", "message": "it ended"}
            if line:
                answer = json.loads(line)
            if answer["event"] != "ready":
                raise ServiceError(
                    503,
                    "not_ready",
                    f"no worker could start: {answer['message']}",
                    retry_after_s=5,
                )
        except BaseException as error:
            self.failure = str(error) or type(error).__name__
            await self._end(worker)
            raise
        worker.models = answer["models"]
        self.models = worker.models
        self.failure = ""
        return worker

    def _replace(self, worker: _Worker) -> None:
        """End a worker and start another, without making anybody wait."""
        self._alive.discard(worker)
        self._ending.add(worker)
        with suppress(ProcessLookupError):
            worker.process.kill()
        if not self._is_open:
            return  # `close` waits for it
        self.restarts += 1

        async def renew() -> None:
            await self._end(worker)
            delay_s = 1.0
            while self._is_open:
                try:
                    self._idle.put_nowait(await self._spawn())
                except (ServiceError, OSError, TimeoutError, ValueError):
                    _LOG.exception("a worker could not be started, again in %g s", delay_s)
                    await asyncio.sleep(delay_s)
                    delay_s = min(60.0, 2 * delay_s)
                else:
                    return

        task = asyncio.get_running_loop().create_task(renew())
        self._starting.add(task)
        task.add_done_callback(self._starting.discard)

    async def _end(self, worker: _Worker) -> None:
        self._alive.discard(worker)
        self._ending.add(worker)
        with suppress(ProcessLookupError):
            worker.process.kill()
        await worker.process.wait()
        await asyncio.to_thread(shutil.rmtree, worker.folder, ignore_errors=True)
        self._ending.discard(worker)
        # asyncio closes its end of the pipes with the process's transport only
        transport = getattr(worker.process, "_transport", None)
        if transport is not None:
            transport.close()
