"""Every request's input and result, in SQLite or PostgreSQL, so that a cell can be audited."""

from __future__ import annotations

import json
import secrets
import threading
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from pathlib import Path
from typing import Any, BinaryIO

from boltpose.errors import BoltposeError
from boltpose.io.atomic import write_atomic
from boltpose.service.blobs import Blob, BlobStore
from boltpose.service.database import INPUTS, REQUESTS, DatabaseError, cause_of, open_database, sql

JOURNAL_VERSION = 1
_DELETED_AT_ONCE = 500
"""Databases bound how many values one statement may name."""
_HAS_INPUTS = sql.exists().where(INPUTS.c.request == REQUESTS.c.id)


class State(StrEnum):
    """How far a request came."""

    STARTED = "started"
    DONE = "done"
    """It has a result; a refusal is one."""
    FAILED = "failed"
    """Its input could not be used, or the computation failed."""
    CANCELLED = "cancelled"
    """The client went away."""
    INTERRUPTED = "interrupted"
    """The service ended before the request did."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One row of the journal."""

    id: str
    kind: str
    """`locate`, `build` or `delete`."""
    state: State
    started: str
    """UTC, ISO 8601."""
    finished: str | None
    client: str
    """Address, and the name of the API key."""
    prior: str
    call: str
    """JSON of `calls`."""
    software: Mapping[str, Any]
    """Version, and SHA-256 of the networks."""
    result: str | None
    """The very text that was answered; lists leave it out, it is long."""
    status: str | None
    reason: str | None
    error_code: str | None
    error: str | None
    seconds: float | None
    has_inputs: bool
    """Whether the input's bytes are still kept."""

    def to_json(self, *, with_result: bool) -> dict[str, Any]:
        """The entry for a client; `result` only where asked for, it is long."""
        data: dict[str, Any] = {
            "id": self.id,
            "kind": self.kind,
            "state": self.state.value,
            "started": self.started,
            "finished": self.finished,
            "client": self.client,
            "prior": self.prior,
            "status": self.status,
            "reason": self.reason,
            "error_code": self.error_code,
            "error": self.error,
            "seconds": self.seconds,
            "has_inputs": self.has_inputs,
        }
        if with_result:
            data["call"] = json.loads(self.call)
            data["software"] = dict(self.software)
            data["result"] = None if self.result is None else json.loads(self.result)
        return data


class JournalError(BoltposeError):
    """The journal cannot be read or written."""


class Journal:
    """The journal of one service; safe to share by threads.

    A row is written before work starts and finished after. Rows still open when the service
    starts again were interrupted. Of a database that several services share, each sees its own
    rows: the stored inputs are its own too.
    """

    def __init__(self, data: Path, database: str | None = None) -> None:
        """Open the journal, or make it.

        Args:
            data: The service's folder.
            database: URL; by default an SQLite file in `data`.

        Raises:
            ConfigError: No such database can be opened.
            MissingExtraError: Its driver is not installed.
        """
        data.mkdir(parents=True, exist_ok=True)
        self.data = data
        self.blobs = BlobStore(data / "blobs")
        self.instance = _instance_of(data)
        self.failure = ""
        """Why the database did not answer last time; empty if it did."""
        self._unanswered: set[str] = set()
        """Requests whose end could not be written: their clients got an error."""
        self._lock = threading.Lock()
        self._engine = open_database(data, database)

    @property
    def kind(self) -> str:
        """`sqlite` or `postgresql`."""
        return self._engine.dialect.name

    def close(self) -> None:
        """Let go of the database."""
        self._engine.dispose()

    def check(self) -> None:
        """Try whether the database can be written, and close what could not be closed before.

        Raises:
            JournalError: It does not answer, or cannot be written.
        """
        with self._lock:
            unanswered = tuple(self._unanswered)
        self._write(
            # Mostly there is no such row, but a database that can only be read says so even then.
            # A row may even be done: the loss came after it was written. It was not handed out.
            sql.update(REQUESTS)
            .where(REQUESTS.c.id.in_(unanswered))
            .values(
                state=State.FAILED,
                finished=_now(),
                result=None,
                status=None,
                reason=None,
                error_code="journal_failed",
                error="the journal could not be written when this ended; its client got no result",
            )
        )
        with self._lock:
            self._unanswered.difference_update(unanswered)

    def mark_interrupted(self) -> int:
        """Mark what was under way when the service ended; returns how many."""
        return self._write(
            sql.update(REQUESTS)
            .where(REQUESTS.c.instance == self.instance, REQUESTS.c.state == State.STARTED)
            .values(
                state=State.INTERRUPTED,
                finished=_now(),
                error_code="interrupted",
                error="the service ended before this request did",
            )
        )

    def start(
        self,
        kind: str,
        call: str,
        blobs: Sequence[Blob],
        *,
        client: str,
        prior: str,
        software: Mapping[str, Any],
    ) -> str:
        """Write a request down before work on it starts; returns its id.

        Raises:
            JournalError: It cannot be written; then no work must be done.
        """
        request = f"{datetime.now(UTC):%Y%m%dT%H%M%S%f}-{secrets.token_hex(4)}"
        sizes = {blob.sha256: blob.size for blob in blobs}
        statements: list[Any] = [
            sql.insert(REQUESTS).values(
                id=request,
                instance=self.instance,
                version=JOURNAL_VERSION,
                kind=kind,
                state=State.STARTED,
                started=_now(),
                client=_storable(client)[:200],
                prior=_storable(prior)[:400],
                call=call,
                software=json.dumps(dict(software), sort_keys=True),
            )
        ]
        if sizes:
            rows = [
                {"request": request, "sha256": sha256, "size": size}
                for sha256, size in sizes.items()
            ]
            statements.append(sql.insert(INPUTS).values(rows))
        self._write(*statements)
        return request

    def finish(
        self,
        request: str,
        state: State,
        *,
        seconds: float,
        result: str | None = None,
        status: str | None = None,
        reason: str | None = None,
        error_code: str | None = None,
        error: str | None = None,
    ) -> None:
        """Write down how a request ended.

        Raises:
            JournalError: It cannot be written; then the result must not be handed out. `check`
                writes that down as soon as it can.
        """
        try:
            self._write(
                sql.update(REQUESTS)
                .where(REQUESTS.c.id == request, REQUESTS.c.state == State.STARTED)
                .values(
                    state=state,
                    finished=_now(),
                    seconds=seconds,
                    result=result,
                    status=status,
                    reason=reason,
                    error_code=error_code,
                    error=None if error is None else _storable(error),
                )
            )
        except JournalError:
            with self._lock:
                self._unanswered.add(request)
            raise

    def entries(
        self,
        *,
        limit: int = 50,
        before: str | None = None,
        state: str | None = None,
        can_replay: bool = False,
    ) -> list[Entry]:
        """The latest requests, newest first, without their results.

        Args:
            limit: At most so many.
            before: Only requests with a smaller id, that is earlier ones.
            state: Only those in this state.
            can_replay: Only `locate` requests with a result whose input is still kept.
        """
        query = self._select(sql.null()).order_by(REQUESTS.c.id.desc()).limit(limit)
        if before is not None:
            query = query.where(REQUESTS.c.id < before)
        if state is not None:
            query = query.where(REQUESTS.c.state == state)
        if can_replay:
            query = query.where(
                REQUESTS.c.kind == "locate", REQUESTS.c.state == State.DONE, _HAS_INPUTS
            )
        return [_entry(row) for row in self._read(query)]

    def find(self, request: str) -> Entry | None:
        """One request with its result, None if there is none of that id."""
        rows = self._read(self._select(REQUESTS.c.result).where(REQUESTS.c.id == request))
        return _entry(rows[0]) if rows else None

    def purge(self, *, keep_days: float, keep_bytes: float) -> int:
        """Delete old inputs; what was asked and answered stays.

        Bytes that a younger request came with too are kept.

        Args:
            keep_days: Inputs of requests older than this go.
            keep_bytes: Beyond so much the oldest go.

        Returns:
            How many requests lost their inputs.
        """
        oldest = (datetime.now(UTC) - timedelta(days=keep_days)).isoformat(timespec="microseconds")
        query = (
            sql.select(REQUESTS.c.id, REQUESTS.c.started, INPUTS.c.sha256, INPUTS.c.size)
            .join(INPUTS, INPUTS.c.request == REQUESTS.c.id)
            .where(REQUESTS.c.instance == self.instance, REQUESTS.c.state != State.STARTED)
            .order_by(REQUESTS.c.id.desc())
        )
        kept: set[str] = set()
        lost: set[str] = set()
        total = 0
        for row in self._read(query):
            new = 0 if row.sha256 in kept else row.size
            if row.id in lost or row.started < oldest or total + new > keep_bytes:
                lost.add(row.id)
                continue
            kept.add(row.sha256)
            total += new
        requests = sorted(lost)
        for first in range(0, len(requests), _DELETED_AT_ONCE):
            some = requests[first : first + _DELETED_AT_ONCE]
            self._write(sql.delete(INPUTS).where(INPUTS.c.request.in_(some)))
        named = (
            sql.select(INPUTS.c.sha256)
            .join(REQUESTS, INPUTS.c.request == REQUESTS.c.id)
            .where(REQUESTS.c.instance == self.instance)
            .distinct()
        )
        self.blobs.sweep({row.sha256 for row in self._read(named)})
        return len(lost)

    def _select(self, result: Any) -> Any:
        columns = [column for column in REQUESTS.c if column is not REQUESTS.c.result]
        return sql.select(*columns, result.label("result"), _HAS_INPUTS.label("has_inputs")).where(
            REQUESTS.c.instance == self.instance
        )

    def _read(self, query: Any) -> Sequence[Any]:
        with self._noting("read"), self._engine.connect() as connection:
            return connection.execute(query).all()

    def _write(self, *statements: Any) -> int:
        with self._noting("written"), self._engine.begin() as connection:
            return max(int(connection.execute(entry).rowcount) for entry in statements)

    @contextmanager
    def _noting(self, done: str) -> Generator[None]:
        """Remember whether the database answers, for `/v1/health`."""
        try:
            yield
        except DatabaseError as error:
            self.failure = f"the journal cannot be {done} ({cause_of(error)})"
            raise JournalError(self.failure) from error
        self.failure = ""


def _entry(row: Any) -> Entry:
    return Entry(
        id=row.id,
        kind=row.kind,
        state=State(row.state),
        started=row.started,
        finished=row.finished,
        client=row.client,
        prior=row.prior,
        call=row.call,
        software=json.loads(row.software),
        result=row.result,
        status=row.status,
        reason=row.reason,
        error_code=row.error_code,
        error=row.error,
        seconds=row.seconds,
        has_inputs=bool(row.has_inputs),
    )


def _instance_of(data: Path) -> str:
    """Which service of a shared database this is; made once per folder."""
    path = data / "instance"
    if path.exists():
        return path.read_text(encoding="ascii").strip()
    name = secrets.token_hex(8)

    def write(stream: BinaryIO) -> None:
        stream.write(f"{name}\n".encode())

    write_atomic(path, write)
    return name


def _storable(text: str) -> str:
    """Text of a request as every database takes it: no NUL, no half of a surrogate pair."""
    return text.encode("utf-8", "replace").decode().replace("\0", "\ufffd")


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="microseconds")
