"""Runs the service until it is told to end."""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Callable

from boltpose.errors import ConfigError, MissingExtraError

try:
    import uvicorn
except ImportError as error:
    raise MissingExtraError("uvicorn", "service") from error

from boltpose.service.app import create_app
from boltpose.service.config import ServiceConfig
from boltpose.service.state import State


def serve(config: ServiceConfig, on_ready: Callable[[str], None] | None = None) -> None:
    """Answer requests until SIGINT or SIGTERM; running ones are finished first.

    Args:
        config: Settings.
        on_ready: Told the URL once requests are answered.

    Raises:
        ConfigError: A setting cannot be used, the address is taken, or no worker can start.
    """
    app = create_app(config)
    state: State = app.state.service
    try:
        listener = _listen(config)
    except BaseException:
        asyncio.run(state.close())
        raise
    name = f"[{config.host}]" if ":" in config.host else config.host
    url = f"http://{name}:{listener.getsockname()[1]}"
    server = _Server(
        uvicorn.Config(
            app,
            # what is tested; other ones that happen to be installed end processes their own way
            loop="asyncio",
            http="h11",
            ws="none",
            log_level=logging.WARNING,
            access_log=False,
            server_header=False,
            # of a proxy's word on who asks nothing is believed
            proxy_headers=False,
            timeout_graceful_shutdown=max(1, round(config.drain_s)),
            timeout_keep_alive=30,
            h11_max_incomplete_event_size=65_536,
            limit_concurrency=config.workers + config.queue_size + 256,
        ),
        (lambda: on_ready(url)) if on_ready is not None else None,
    )
    with listener:
        server.run(sockets=[listener])
    if not server.started:
        raise ConfigError(f"the service could not start: {state.pool.failure or 'see the log'}")


class _Server(uvicorn.Server):
    """Tells when requests are answered."""

    def __init__(self, config: uvicorn.Config, on_ready: Callable[[], None] | None) -> None:
        super().__init__(config)
        self._on_ready = on_ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        if self.started and self._on_ready is not None:
            self._on_ready()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        await super().shutdown(sockets)
        # uvicorn would raise the signal once more, but to be told to end is how a service ends
        self._captured_signals.clear()


def _listen(config: ServiceConfig) -> socket.socket:
    try:
        family = socket.getaddrinfo(config.host, config.port, type=socket.SOCK_STREAM)[0][0]
        listener = socket.socket(family, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((config.host, config.port))
    except OSError as error:
        raise ConfigError(
            f"cannot listen on {config.host}, port {config.port}: {error.strerror}"
        ) from error
    return listener
