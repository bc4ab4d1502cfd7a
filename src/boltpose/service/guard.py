"""Who may talk to the service, and how much they may send: checked before any route is reached."""

from __future__ import annotations

import asyncio
import time
from contextlib import suppress
from typing import Any
from urllib.parse import urlsplit

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from boltpose.service.answers import error_answer
from boltpose.service.config import LOOPBACK_NAMES, ServiceConfig
from boltpose.service.failures import ServiceError
from boltpose.service.keys import KeyRing
from boltpose.service.metrics import Metrics

OPEN_PATHS = ("/v1/health/live", "/v1/health/ready")
"""Answered without a key: they say yes or no."""
_DISCARD_S = 5.0
_DISCARD_IDLE_S = 0.3
_KNOWN_METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS")


class Guard:
    """Checks name, origin, key and size of every request, and counts its answer.

    A web page that a person has open in the same computer's browser can send requests to
    `127.0.0.1` too, by its own name pointed there or straight. The first is told by `Host`, the
    second by `Origin` and `Sec-Fetch-Site`, which browsers send and pages cannot change.
    """

    def __init__(
        self, app: ASGIApp, config: ServiceConfig, keys: KeyRing, metrics: Metrics
    ) -> None:
        self._app = app
        self._config = config
        self._keys = keys
        self._metrics = metrics
        self._hosts = {name.lower() for name in (*LOOPBACK_NAMES, *config.allowed_hosts)}
        # without a key, or reachable by browsers of this computer, only known names are answered
        self._checks_host = config.is_loopback or bool(config.allowed_hosts)
        if not config.is_loopback and config.allowed_hosts:
            self._hosts.add(config.host.lower())
        self._hashing = asyncio.Semaphore(1)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        status = 500
        headers = _headers_of(scope)
        body = _Limited(receive, self._config)

        async def count(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                if status >= 400 and status != 408 and "expect" not in headers:
                    await body.discard()
                message["headers"] = [
                    *message["headers"],
                    (b"x-content-type-options", b"nosniff"),
                    (b"cache-control", b"no-store"),
                ]
            await send(message)

        try:
            try:
                self._check_host(headers)
                self._check_origin(headers)
                await self._check_key(scope, headers)
                _check_length(headers, self._config.max_upload_bytes)
            except ServiceError as error:
                self._metrics.errors.labels(error.code).inc()
                await error_answer(error)(scope, receive, count)
                return
            await self._app(scope, body, count)
        finally:
            route = scope.get("route")
            path = getattr(route, "path", "other")
            method = scope["method"] if scope["method"] in _KNOWN_METHODS else "other"
            self._metrics.requests.labels(path, method, str(status)).inc()

    def _check_host(self, headers: dict[str, str]) -> None:
        if not self._checks_host:
            return
        name = _host_name(headers.get("host", ""))
        if name not in self._hosts:
            raise ServiceError(
                403,
                "host_not_allowed",
                f"the service is not called {name[:80]!a}: use 127.0.0.1, or add the name to "
                "allowed_hosts",
            )

    def _check_origin(self, headers: dict[str, str]) -> None:
        origin = headers.get("origin")
        site = headers.get("sec-fetch-site", "none")
        is_own = origin is None or (
            origin != "null"
            and urlsplit(origin).scheme in ("http", "https")
            and urlsplit(origin).netloc.lower() == headers.get("host", "").lower()
        )
        if not is_own or site in ("cross-site", "same-site"):
            raise ServiceError(
                403, "cross_origin", "requests from web pages of other sites are not answered"
            )

    async def _check_key(self, scope: Scope, headers: dict[str, str]) -> None:
        if not len(self._keys) and self._config.is_loopback:
            return
        if scope["path"] in OPEN_PATHS:
            return
        key = headers.get("x-api-key", "")
        words = headers.get("authorization", "").split(" ", 1)
        if not key and len(words) == 2 and words[0].lower() == "bearer":
            key = words[1].strip()
        stored = None
        if key:
            # scrypt is slow on purpose: outside the event loop, one at a time
            async with self._hashing:
                stored = await asyncio.to_thread(self._keys.check, key)
        if stored is None:
            raise ServiceError(
                401,
                "bad_key",
                "send an API key as 'Authorization: Bearer KEY'; this one is "
                + ("unknown" if key else "missing"),
            )
        scope.setdefault("state", {})["key_name"] = stored.name


class _Limited:
    """The body of a request as it comes in: at most so many bytes, in at most so much time."""

    def __init__(self, receive: Receive, config: ServiceConfig) -> None:
        self._receive = receive
        self._left = config.max_upload_bytes
        self._config = config
        self._deadline = time.monotonic() + config.upload_timeout_s
        self._is_whole = False

    async def __call__(self) -> Message:
        if self._is_whole:
            return await self._receive()
        try:
            async with asyncio.timeout(self._deadline - time.monotonic()):
                message: Any = await self._receive()
        except TimeoutError:
            raise ServiceError(
                408,
                "upload_timeout",
                f"the request did not come in within {self._config.upload_timeout_s:g} s",
            ) from None
        if message["type"] == "http.request":
            self._is_whole = not message.get("more_body", False)
            self._left -= len(message.get("body", b""))
            if self._left < 0:
                raise _too_large(self._config.max_upload_bytes)
        return message

    async def discard(self) -> None:
        """Read on for a while: most clients look for an answer only when they have sent all."""
        end = time.monotonic() + _DISCARD_S
        with suppress(TimeoutError):
            while not self._is_whole and time.monotonic() < end:
                async with asyncio.timeout(_DISCARD_IDLE_S):
                    message = await self._receive()
                self._is_whole = not message.get("more_body", False)


def _check_length(headers: dict[str, str], limit: int) -> None:
    length = headers.get("content-length", "0")
    if not length.isdecimal() or len(length) > 18:
        raise ServiceError(400, "bad_request", "Content-Length: wanted a number")
    if int(length) > limit:
        raise _too_large(limit)


def _too_large(limit: int) -> ServiceError:
    return ServiceError(413, "too_large", f"wanted a request of at most {limit / 1e6:g} MB")


def _headers_of(scope: Scope) -> dict[str, str]:
    """Headers by lower-case name; of one that comes twice the last, but never of `host`."""
    headers: dict[str, str] = {}
    for name, value in scope["headers"]:
        key = name.decode("latin-1").lower()
        headers[key] = "two names" if key == "host" and key in headers else value.decode("latin-1")
    return headers


def _host_name(host: str) -> str:
    """Name of a `Host` header without its port."""
    host = host.strip().lower()
    if host.startswith("["):
        return host[1:].split("]", 1)[0]
    return host.rsplit(":", 1)[0] if host.count(":") == 1 else host
