"""The journal's tables, and the way to them: an SQLite file, or PostgreSQL by URL."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from boltpose.errors import ConfigError, MissingExtraError

try:
    import sqlalchemy as sql
    from sqlalchemy import event
    from sqlalchemy.exc import (
        ArgumentError,
        IntegrityError,
        NoSuchModuleError,
        ProgrammingError,
        SQLAlchemyError,
    )
except ImportError as error:
    raise MissingExtraError("sqlalchemy", "service") from error

DatabaseError = SQLAlchemyError
DATABASE_FILE = "journal.sqlite"
_DRIVERS = {"postgresql": "postgresql+psycopg", "postgres": "postgresql+psycopg"}
_POSTGRES_OPTIONS: Mapping[str, Any] = {
    # a database that is gone must be an error in seconds, not in the minutes of TCP
    "connect_timeout": 5,
    "keepalives_idle": 5,
    "keepalives_interval": 2,
    "keepalives_count": 3,
    "tcp_user_timeout": 10_000,
    "options": "-c statement_timeout=20s -c lock_timeout=10s",
}
_METADATA = sql.MetaData()
REQUESTS = sql.Table(
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
INPUTS = sql.Table(
    "boltpose_inputs",
    _METADATA,
    sql.Column("request", sql.String(40), sql.ForeignKey(REQUESTS.c.id), primary_key=True),
    sql.Column("sha256", sql.String(64), primary_key=True, index=True),
    sql.Column("size", sql.BigInteger, nullable=False),
)


def open_database(data: Path, url: str | None) -> sql.Engine:
    """Open the database of a journal, and make its tables if they are not there.

    Args:
        data: The service's folder; holds the SQLite file where there is no URL.
        url: Of another database.

    Raises:
        ConfigError: No such database can be opened.
        MissingExtraError: Its driver is not installed.
    """
    try:
        engine = _make_engine(url or f"sqlite:///{(data / DATABASE_FILE).resolve()}")
    except (ArgumentError, NoSuchModuleError) as error:
        # the URL is not told: it may hold a password
        raise ConfigError(
            f"database: wanted a URL like postgresql://user@host/name ({type(error).__name__})"
        ) from error
    except ModuleNotFoundError as error:
        raise MissingExtraError(str(error.name), "postgres") from error
    try:
        _make_tables(engine)
    except SQLAlchemyError as error:
        engine.dispose()
        raise ConfigError(f"database: cannot be opened ({cause_of(error)})") from error
    return engine


def _make_engine(url: str) -> sql.Engine:
    parsed = sql.make_url(url)
    parsed = parsed.set(drivername=_DRIVERS.get(parsed.drivername, parsed.drivername))
    options: dict[str, Any] = {}
    backend = parsed.get_backend_name()
    if backend not in ("sqlite", "postgresql"):
        raise ArgumentError(f"unknown kind of database: {backend}")
    if backend == "postgresql":
        # what the URL says itself counts
        options = {key: v for key, v in _POSTGRES_OPTIONS.items() if key not in parsed.query}
    engine = sql.create_engine(parsed, pool_pre_ping=True, pool_timeout=10, connect_args=options)
    if backend == "sqlite":
        event.listen(engine, "connect", _set_up_sqlite)
    return engine


def _make_tables(engine: sql.Engine) -> None:
    try:
        _METADATA.create_all(engine)
    except (IntegrityError, ProgrammingError):
        _METADATA.create_all(engine)  # another service has made them at the same moment


def _set_up_sqlite(connection: Any, _: Any) -> None:
    cursor = connection.cursor()
    # readers do not block the writer, and what was committed survives a power cut
    cursor.execute("PRAGMA journal_mode=WAL")
    cursor.execute("PRAGMA synchronous=FULL")
    cursor.execute("PRAGMA foreign_keys=ON")
    cursor.execute("PRAGMA busy_timeout=10000")
    cursor.close()


def cause_of(error: SQLAlchemyError) -> str:
    """What the driver says, in one line."""
    cause = getattr(error, "orig", None) or error
    lines = str(cause).splitlines()
    return lines[0] if lines else type(cause).__name__
