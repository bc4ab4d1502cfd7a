"""Every request's input and result, in SQLite or PostgreSQL, so that a cell can be audited."""

from __future__ import annotations

import json
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from pathlib import Path
from typing import Any

from boltpose.errors import BoltposeError, ConfigError, MissingExtraError
from boltpose.service.blobs import Blob, BlobStore

try:
    import sqlalchemy as sql
    from sqlalchemy import event
    from sqlalchemy.exc import ArgumentError, NoSuchModuleError, SQLAlchemyError
except ImportError as error:
    raise MissingExtraError("sqlalchemy", "service") from error

JOURNAL_VERSION = 1
_METADATA = sql.MetaData()
_REQUESTS = sql.Table(
    "boltpose_requests",
    _METADATA,
    sql.Column("id", sql.String(40), primary_key=True),
    sql.Column("instance", sql.String(32), nullable=False),
    sql.Column("version", sql.Integer, nullable=False),
    sql.Column("kind", sql.String(16), nullable=False),
    sql.Column("state", sql.String(16), nullable=False, index=True),
    sql.Column("started", sql.String(32), nullable=False, index=True),
    sql.Column("finished", sql.String(32)),
    sql.Column("client", sql.String(200), nullable=False),
    sql.Column("prior", sql.String(400), nullable=False),
    sql.Column("call", sql.Text, nullable=False),
    sql.Column("software", sql.Text, nullable=False),
    sql.Column("result", sql.Text),
    sql.Column("status", sql.String(16)),
    sql.Column("reason", sql.String(64)),
    sql.Column("error_code", sql.String(64)),
    sql.Column("error", sql.Text),
    sql.Column("seconds", sql.Float),
)
_INPUTS = sql.Table(
    "boltpose_inputs",
    _METADATA,
    sql.Column("request", sql.String(40), sql.ForeignKey(_REQUESTS.c.id), primary_key=True),
    sql.Column("sha256", sql.String(64), primary_key=True, index=True),
    sql.Column("size", sql.BigInteger, nullable=False),
)


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
    """The very text that was answered."""
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
    starts again were interrupted.
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
        self.blobs = BlobStore(data / "blobs")
        self.instance = _instance_of(data)
        url = database or f"sqlite:///{(data / 'journal.sqlite').resolve()}"
        try:
            self._engine = sql.create_engine(url, pool_pre_ping=True)
        except (ArgumentError, NoSuchModuleError) as error:
            raise ConfigError(
                "database: wanted a URL like postgresql+psycopg://user@host/name "
                f"({type(error).__name__})"
            ) from error
        except ModuleNotFoundError as error:
            raise MissingExtraError(str(error.name), "postgres") from error
        if self._engine.dialect.name == "sqlite":
            event.listen(self._engine, "connect", _set_up_sqlite)
        try:
            _METADATA.create_all(self._engine)
        except SQLAlchemyError as error:
            raise ConfigError(f"database: cannot be opened ({_cause(error)})") from error

    @property
    def database(self) -> str:
        """Its URL without the password."""
        return self._engine.url.render_as_string(hide_password=True)

    def close(self) -> None:
        """Let go of the database."""
        self._engine.dispose()

    def mark_interrupted(self) -> int:
        """Mark what was under way when the service ended; returns how many."""
        return self._write(
            sql.update(_REQUESTS)
            .where(_REQUESTS.c.instance == self.instance, _REQUESTS.c.state == State.STARTED)
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
            sql.insert(_REQUESTS).values(
                id=request,
                instance=self.instance,
                version=JOURNAL_VERSION,
                kind=kind,
                state=State.STARTED,
                started=_now(),
                client=client[:200],
                prior=prior[:400],
                call=call,
                software=json.dumps(dict(software), sort_keys=True),
            )
        ]
        if sizes:
            rows = [
                {"request": request, "sha256": sha256, "size": size}
                for sha256, size in sizes.items()
            ]
            statements.append(sql.insert(_INPUTS).values(rows))
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
            JournalError: It cannot be written; then the result must not be handed out.
        """
        self._write(
            sql.update(_REQUESTS)
            .where(_REQUESTS.c.id == request, _REQUESTS.c.state == State.STARTED)
            .values(
                state=state,
                finished=_now(),
                seconds=seconds,
                result=result,
                status=status,
                reason=reason,
                error_code=error_code,
                error=error,
            )
        )

    def entries(
        self, *, limit: int = 50, before: str | None = None, state: str | None = None
    ) -> list[Entry]:
        """The latest requests, newest first.

        Args:
            limit: At most so many.
            before: Only requests with a smaller id, that is earlier ones.
            state: Only those in this state.
        """
        query = _select().order_by(_REQUESTS.c.id.desc()).limit(limit)
        if before is not None:
            query = query.where(_REQUESTS.c.id < before)
        if state is not None:
            query = query.where(_REQUESTS.c.state == state)
        return [_entry(row) for row in self._read(query)]

    def find(self, request: str) -> Entry | None:
        """One request, None if there is none of that id."""
        rows = self._read(_select().where(_REQUESTS.c.id == request))
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
            sql.select(_REQUESTS.c.id, _REQUESTS.c.started, _INPUTS.c.sha256, _INPUTS.c.size)
            .join(_INPUTS, _INPUTS.c.request == _REQUESTS.c.id)
            .where(_REQUESTS.c.instance == self.instance, _REQUESTS.c.state != State.STARTED)
            .order_by(_REQUESTS.c.id.desc())
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
        if lost:
            self._write(sql.delete(_INPUTS).where(_INPUTS.c.request.in_(lost)))
        self.blobs.sweep(
            {row.sha256 for row in self._read(sql.select(_INPUTS.c.sha256).distinct())}
        )
        return len(lost)

    def _read(self, query: Any) -> Sequence[Any]:
        try:
            with self._engine.connect() as connection:
                return connection.execute(query).all()
        except SQLAlchemyError as error:
            raise JournalError(f"the journal cannot be read ({_cause(error)})") from error

    def _write(self, *statements: Any) -> int:
        try:
            with self._engine.begin() as connection:
                return max(int(connection.execute(entry).rowcount) for entry in statements)
        except SQLAlchemyError as error:
            raise JournalError(f"the journal cannot be written ({_cause(error)})") from error


def _select() -> Any:
    has_inputs = sql.exists().where(_INPUTS.c.request == _REQUESTS.c.id)
    return sql.select(_REQUESTS, has_inputs.label("has_inputs"))


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


def _set_up_sqlite(connection: Any, _: Any) -> None:
    cursor = connection.cursor()
    # readers do not block the writer, and what was committed survives a power cut
    cursor.execute("PRAGMA journal_mode=WAL")
    cursor.execute("PRAGMA synchronous=FULL")
    cursor.execute("PRAGMA foreign_keys=ON")
    cursor.execute("PRAGMA busy_timeout=10000")
    cursor.close()


def _instance_of(data: Path) -> str:
    """Which service of a shared database this is; made once per folder."""
    path = data / "instance"
    if path.exists():
        return path.read_text(encoding="ascii").strip()
    name = secrets.token_hex(8)
    path.write_text(name + "\n", encoding="ascii")
    return name


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="microseconds")


def _cause(error: SQLAlchemyError) -> str:
    cause = getattr(error, "orig", None) or error
    lines = str(cause).splitlines()
    return lines[0] if lines else type(cause).__name__
