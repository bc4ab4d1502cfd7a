"""The one door to viser, the web server and 3D page that the viewer is made of."""

from __future__ import annotations

import contextlib
import errno
import io
import socket

from boltpose.errors import ConfigError, MissingExtraError

try:
    import viser
except ImportError as error:  # pragma: no cover - the tests have it
    raise MissingExtraError("viser", "viewer") from error

__all__ = ["LOOPBACK", "LocalServer", "start_server", "viser"]

LOOPBACK = "127.0.0.1"


class LocalServer(viser.ViserServer):
    """A page for this machine only: it cannot be published to viser's relay on the internet."""

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
        return LocalServer(host=LOOPBACK, port=port, label=title, verbose=False)


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
