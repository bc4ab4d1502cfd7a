"""Debian's Chromium, driven by playwright; tests that need it skip where it is missing."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

if TYPE_CHECKING:
    from playwright.sync_api import Page as Tab

CHROMIUM = "chromium"
FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    # WebGL without a graphics card
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)

_NOTES_PX, _SIGN_PX, _PANEL_PX = 190, 200, 400
"""What viser's notes cover at the top, the sign at the bottom, and the panel on the right."""


@contextmanager
def open_tab(width: int = 1000, height: int = 640) -> Iterator[Tab]:
    """A tab of a fresh browser; skips the test where there is none."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    path = shutil.which(CHROMIUM)
    if path is None:
        pytest.skip("no chromium: apt-get install chromium")
    with sync_api.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=list(FLAGS))
        try:
            yield browser.new_page(viewport={"width": width, "height": height})
        finally:
            browser.close()


def drop_file(tab: Tab, selector: str, path: Path) -> None:
    """Drag a file from the desktop onto an element and let go, as a person does."""
    box = tab.locator(selector).first.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    session = tab.context.new_cdp_session(tab)
    data = {"items": [], "files": [str(path)], "dragOperationsMask": 1}
    for kind in ("dragEnter", "dragOver", "drop"):
        session.send("Input.dispatchDragEvent", {"type": kind, "x": x, "y": y, "data": data})
    session.detach()


def picture(tab: Tab, folder: Path, name: str) -> np.ndarray:
    """What the tab shows of the scene between notes, sign and panel; shape (H, W, 3), 0 to 255."""
    path = folder / f"{name}.png"
    tab.screenshot(path=path)
    with Image.open(path) as image:
        pixels = np.asarray(image.convert("RGB"), dtype=np.int16)
    height, width = pixels.shape[:2]
    return pixels[_NOTES_PX : height - _SIGN_PX, : width - _PANEL_PX]
