"""Who may talk to the page: this machine's own pages and programs, nobody else's."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from boltpose.viewer.config import ViewerConfig
from boltpose.viewer.page import Page
from boltpose.viewer.web import is_own_page, viser


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with Page("test", ViewerConfig(port=0)) as page:
        yield page.url.replace("http", "ws")


def first_message(address: str, origin: str | None) -> str | bytes:
    """What a browser gets first; raises if it gets nothing."""
    with connect(
        address,
        origin=None if origin is None else Origin(origin),
        subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
        compression=None,
        proxy=None,
    ) as socket:
        return socket.recv(timeout=10)


@pytest.mark.parametrize("origin", ["http://127.0.0.1:8321", "http://localhost:9000", None])
def test_own_pages_and_programs_are_let_in_through_a_tunnel_too(
    address: str, origin: str | None
) -> None:
    assert len(first_message(address, origin)) > 0


@pytest.mark.parametrize(
    "origin", ["https://evil.example", "null", "http://127.0.0.1.evil.example"]
)
def test_another_sites_page_is_told_nothing(address: str, origin: str) -> None:
    with pytest.raises(ConnectionClosed) as closed:
        first_message(address, origin)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1008


@pytest.mark.parametrize("origin", ["", "null", "file://", "http://[", "http://user@evil.example"])
def test_what_is_no_address_of_this_machine_is_foreign(origin: str) -> None:
    assert not is_own_page(origin)
    assert is_own_page("http://[::1]:8321")
