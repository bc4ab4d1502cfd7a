"""All that lives as long as the service does."""

from __future__ import annotations

import asyncio
import logging
import os
import shutil
import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import boltpose
from boltpose.errors import ConfigError, InputFileError
from boltpose.results import SCHEMA
from boltpose.service.blobs import BlobStore
from boltpose.service.config import ServiceConfig
from boltpose.service.intake import Intake
from boltpose.service.journal import Journal, JournalError
from boltpose.service.keys import KeyRing
from boltpose.service.metrics import Metrics
from boltpose.service.pool import WorkerPool
from boltpose.service.shelf import PriorShelf, lock_folder

_LOG = logging.getLogger(__name__)
_LOOK_S = 5.0
_PURGE_S = 600.0


@dataclass(slots=True, eq=False)
class BuildJob:
    """A prior that is being built."""

    id: str
    name: str
    stages: list[str] = field(default_factory=list)
    """Stages that are done."""
    is_running: bool = False
    """False while it waits for a worker."""
    can_stop: bool = True
    """False while the built prior is laid into the folder: that is not left half done."""
    task: asyncio.Task[None] | None = None

    async def stop(self) -> None:
        """Stop it if it still can be, and wait for its end."""
        if self.task is None:
            return
        if self.can_stop:
            self.task.cancel()
        await asyncio.gather(self.task, return_exceptions=True)


class State:
    """Folders, journal, workers and counters of one service."""

    def __init__(self, config: ServiceConfig) -> None:
        """Take the data folder and open everything but the workers.

        Raises:
            ConfigError: A folder cannot be used, another service runs there, or an address that
                others can reach has no API key.
            InputFileError: The file of keys is damaged.
        """
        self.config = config
        self.data = Path(config.data).resolve()
        try:
            # scans and keys are nobody else's on this computer; a folder that is there stays so
            self.data.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._lock = lock_folder(self.data)
        except BlockingIOError:
            raise ConfigError(f"{self.data}: another service runs with this data folder") from None
        except OSError as error:
            raise ConfigError(f"{self.data}: no usable data folder ({error.strerror})") from error
        try:
            self._open()
        except BaseException:
            os.close(self._lock)
            raise

    def _open(self) -> None:
        config = self.config
        self.scans = None if config.scans is None else Path(config.scans).resolve()
        if self.scans is not None and not self.scans.is_dir():
            raise InputFileError(self.scans, "no folder", "the folder of scans")
        self.models = None if config.models is None else Path(config.models).resolve()
        self.keys = KeyRing(self.data)
        if not config.is_loopback and not len(self.keys):
            raise ConfigError(
                f"{config.host} can be reached by others and there is no API key: make one with "
                "`boltpose serve --new-key NAME`"
            )
        self.blobs = BlobStore(self.data / "blobs")
        self.blobs.clean()
        self.work = self.data / "work"
        self.work.mkdir(exist_ok=True)
        self.shelf = PriorShelf(Path(config.priors).resolve(), self.blobs)
        self.journal = Journal(self.data, config.database)
        self.metrics = Metrics()
        self.intake = Intake(
            blobs=self.blobs, shelf=self.shelf, scans=self.scans, max_bytes=config.max_upload_bytes
        )
        self.pool = self._make_pool(config.workers, config.queue_size)
        # priors and reports have a worker of their own: production does not wait for them
        self.side = self._make_pool(1, 4)
        self.next_purge_s = 0.0
        """On the monotonic clock."""
        self._side_users = 0
        self._side_lock = asyncio.Lock()
        self.jobs: dict[str, BuildJob] = {}

    def _make_pool(self, workers: int, queue_size: int) -> WorkerPool:
        return WorkerPool(
            self.data,
            self.models,
            prior_memory_mb=self.config.prior_memory_mb,
            memory_mb=self.config.worker_memory_mb,
            workers=workers,
            queue_size=queue_size,
        )

    @property
    def software(self) -> dict[str, Any]:
        """What computes: for the journal and for `/v1/health`."""
        return {
            "version": boltpose.__version__,
            "schema": SCHEMA,
            "models": dict(self.pool.models),
        }

    async def start(self) -> None:
        """Start the workers; what an earlier run left open is marked interrupted."""
        await asyncio.to_thread(self.journal.mark_interrupted)
        for stray in self.work.iterdir():  # of a service that was killed
            if stray.is_dir():
                await asyncio.to_thread(shutil.rmtree, stray, ignore_errors=True)
            else:
                stray.unlink(missing_ok=True)
        await self.pool.start()

    async def close(self) -> None:
        """Stop jobs and workers, let go of the journal and the data folder."""
        await asyncio.gather(*(job.stop() for job in list(self.jobs.values())))
        await self.pool.close()
        await self.side.close()
        with suppress(JournalError):
            self.journal.check()
        self.journal.close()
        os.close(self._lock)

    async def use_side(self) -> WorkerPool:
        """The pool for priors and reports, started for its first user; see `leave_side`."""
        async with self._side_lock:
            if self._side_users == 0:
                await self.side.start()
            self._side_users += 1
        return self.side

    async def leave_side(self) -> None:
        """Give the memory of the side worker back when nobody uses it any more."""
        async with self._side_lock:
            self._side_users -= 1
            if self._side_users == 0:
                await self.side.close()
                self.side = self._make_pool(1, 4)

    @property
    def problem(self) -> str:
        """Why no request can be answered now, for people; empty if it can."""
        if not self.pool.ready:
            return "no worker is ready"
        if self.journal.failure:
            return "the journal cannot be read or written"
        return ""

    async def look_after(self) -> None:
        """Ask the journal for a sign of life and delete old inputs, again and again.

        What fails is tried again: a database may be away for a while.
        """
        while True:
            try:
                await asyncio.to_thread(self.journal.check)
                if time.monotonic() >= self.next_purge_s:
                    self.next_purge_s = time.monotonic() + _PURGE_S
                    await asyncio.to_thread(
                        self.journal.purge,
                        keep_days=self.config.keep_inputs_days,
                        keep_bytes=self.config.keep_inputs_gb * 1e9,
                    )
            except (JournalError, OSError) as error:
                _LOG.error("%s", error)
            await asyncio.sleep(_LOOK_S)
