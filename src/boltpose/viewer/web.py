"""The one door to viser, the web server and 3D page that the viewer is made of."""

from __future__ import annotations

import contextlib
import errno
import io
import socket
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from boltpose.errors import ConfigError, MissingExtraError

try:
    import viser
    from websockets.exceptions import ConnectionClosed  # viser is made of it
except ImportError as error:  # pragma: no cover - the tests have it
    raise MissingExtraError("viser", "viewer") from error

if TYPE_CHECKING:
    from viser.infra import WebsockClientConnection

__all__ = ["LOOPBACK", "LocalServer", "is_own_page", "start_server", "viser"]

LOOPBACK = "127.0.0.1"
_OWN_HOSTS = frozenset({LOOPBACK, "localhost", "::1"})
_POLICY_VIOLATION = 1008
"""RFC 6455, 7.4.1."""


class LocalServer(viser.ViserServer):
    """A page for this machine only: it cannot be published to viser's relay on the internet.

    Nor can another site's page, open in a browser here, see scans or give commands: a browser says
    of every websocket which page opened it.
    """

    def __init__(self, *, port: int, title: str) -> None:
        """Serve an empty page on the loopback address.

        Args:
            port: 0 for any free one.
            title: On top of the panel.
        """
        super().__init__(host=LOOPBACK, port=port, label=title, verbose=False)
        # viser 1.1 has no public way to look at a websocket's request. Without these two attributes
        # a page does not open at all, rather than for everybody.
        sockets = self._websock_server._live_connections  # pyright: ignore[reportPrivateUsage] - see above

        async def check(connection: WebsockClientConnection) -> None:
            live = sockets[connection.client_id]
            if live.request is not None and is_own_page(live.request.headers.get("Origin")):
                return
            await live.close(_POLICY_VIOLATION, "not a page of this machine")
            with contextlib.suppress(EOFError, ConnectionClosed):
                while True:  # what it had already sent must not be carried out
                    await live.recv()

        self._websock_server.on_client_connect(check)

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Publish nothing, whatever a browser asks for: scans are the customer's."""
        del verbose

    def stop(self) -> None:
        """Close every browser's connection and free the port."""
        with contextlib.redirect_stdout(io.StringIO()):  # viser says goodbye on stdout
            super().stop()


def start_server(port: int, title: str) -> LocalServer:
    """Serve an empty page on the loopback address.

    Args:
        port: 0 for any free one.
        title: On top of the panel.

    Raises:
        ConfigError: The port is taken; another one would not be where the user looks.
    """
    _check_free(port)
    # viser prints a box to stdout, which belongs to the answer of the command
    with contextlib.redirect_stdout(io.StringIO()):
        return LocalServer(port=port, title=title)


def is_own_page(origin: str | None) -> bool:
    """Tell whether a websocket was opened by a page of this machine.

    Args:
        origin: The request's header `Origin`; None from a program, which is no browser.

    Returns:
        True for the loopback's names at any port: the other end of a tunnel has its own.
    """
    if origin is None:
        return True
    try:
        parts = urlsplit(origin)
    except ValueError:
        return False
    return parts.scheme in {"http", "https"} and parts.hostname in _OWN_HOSTS


def _check_free(port: int) -> None:
    if port == 0:
        return
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, port))
        except OSError as error:
            taken = error.errno == errno.EADDRINUSE
            raise ConfigError(
                f"port {port} is {'taken by another program' if taken else 'not to be had'}: "
                "choose another one with --port, or --port 0 for any"
            ) from error
