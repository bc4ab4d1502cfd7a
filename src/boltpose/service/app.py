"""The web application: routes behind the guard, workers for as long as it lives."""

from __future__ import annotations

import asyncio
import errno
import logging
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager, suppress
from typing import Any

from boltpose.errors import BoltposeError, MissingExtraError

try:
    from fastapi import FastAPI, Request
    from fastapi.exceptions import RequestValidationError
    from fastapi.responses import JSONResponse
    from starlette.exceptions import HTTPException
    from starlette.requests import ClientDisconnect
    from starlette.routing import Match
except ImportError as error:
    raise MissingExtraError("fastapi", "service") from error

import boltpose
from boltpose.service.answers import error_answer
from boltpose.service.config import ServiceConfig
from boltpose.service.failures import ServiceError, as_failure, bad_request, journal_failed
from boltpose.service.guard import Guard
from boltpose.service.journal import JournalError
from boltpose.service.routes import add_routes
from boltpose.service.run_locate import INTERNAL
from boltpose.service.state import State

_LOG = logging.getLogger(__name__)
_HTTP_CODES = {404: "not_found", 405: "method_not_allowed", 400: "bad_request"}


def create_app(config: ServiceConfig | None = None) -> FastAPI:
    """Make the application of one service; it takes its data folder at once.

    Args:
        config: Settings.

    Raises:
        ConfigError: A setting or folder cannot be used.
        InputFileError: A file of the data folder is damaged.
        MissingExtraError: The `service` extra is not installed.
    """
    state = State(config or ServiceConfig())

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncGenerator[None]:
        care: asyncio.Task[None] | None = None
        try:
            await state.start()
            care = asyncio.get_running_loop().create_task(state.look_after())
            yield
        finally:
            if care is not None:
                care.cancel()
                with suppress(asyncio.CancelledError):
                    await care
            await state.close()

    app = FastAPI(
        title="boltpose",
        version=boltpose.__version__,
        summary="The 6D pose of every bolt of a clamped motor, in the robot's frame.",
        lifespan=lifespan,
        openapi_url="/v1/openapi.json",
        # their pages load scripts from the internet, which a cell does not have
        docs_url=None,
        redoc_url=None,
    )
    app.state.service = state
    app.add_middleware(Guard, config=state.config, keys=state.keys, metrics=state.metrics)
    add_routes(app, state)
    _add_error_answers(app, state)
    return app


def _add_error_answers(app: FastAPI, state: State) -> None:
    def answer(error: ServiceError) -> JSONResponse:
        state.metrics.errors.labels(error.code).inc()
        return error_answer(error, getattr(error, "request", None))

    async def ours(_: Request, error: Exception) -> JSONResponse:
        assert isinstance(error, BoltposeError)
        if isinstance(error, JournalError):
            _LOG.error("%s", error)
            return answer(journal_failed())
        return answer(as_failure(error))

    async def http(request: Request, error: Exception) -> JSONResponse:
        assert isinstance(error, HTTPException)
        code = _HTTP_CODES.get(error.status_code, "bad_request")
        reply = answer(ServiceError(error.status_code, code, str(error.detail)))
        reply.headers.update(error.headers or {})
        if error.status_code == 405:
            reply.headers["Allow"] = ", ".join(_methods_of(app, request))
        return reply

    async def invalid(_: Request, error: Exception) -> JSONResponse:
        assert isinstance(error, RequestValidationError)
        first: dict[str, Any] = dict(error.errors()[0])
        where = ".".join(str(part) for part in first["loc"])
        return answer(ServiceError(422, "bad_setting", f"{where[:80]!a}: {first['msg']}"))

    async def gone(_: Request, __: Exception) -> JSONResponse:
        return answer(bad_request("the connection ended in the middle of the body"))

    async def system(_: Request, error: Exception) -> JSONResponse:
        assert isinstance(error, OSError)
        _LOG.exception("the system refused", exc_info=error)
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            return answer(ServiceError(507, "storage_full", "the service's disk is full"))
        return answer(ServiceError(500, *INTERNAL))

    async def unknown(_: Request, error: Exception) -> JSONResponse:
        _LOG.error("a request failed", exc_info=error)
        return answer(ServiceError(500, *INTERNAL))

    app.add_exception_handler(BoltposeError, ours)
    app.add_exception_handler(HTTPException, http)
    app.add_exception_handler(RequestValidationError, invalid)
    app.add_exception_handler(ClientDisconnect, gone)
    app.add_exception_handler(OSError, system)
    app.add_exception_handler(Exception, unknown)


def _methods_of(app: FastAPI, request: Request) -> list[str]:
    """What a path can do; the framework tells that of its first route only."""
    known = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE")
    scope = dict(request.scope)
    return [
        method
        for method in known
        if any(route.matches({**scope, "method": method})[0] is Match.FULL for route in app.routes)
    ]
