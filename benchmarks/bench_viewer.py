"""What the viewer sends of a scan of two million points, and how soon the first picture is there.

The scan is the shipped demo's (simulated), made denser: every point four times, moved within the
gap to its neighbours. The browser is Chromium without a graphics card, so its frame rates are the
worst case; what is sent does not depend on it.

    python benchmarks/bench_viewer.py --points 2000000
"""

from __future__ import annotations

import argparse
import shutil
import sys
import time
from pathlib import Path

import numpy as np
from playwright.sync_api import sync_playwright

import boltpose
from boltpose.io.scan import read_scan
from boltpose.schema import Scan
from boltpose.viewer.config import ViewerConfig
from boltpose.viewer.detail import cut
from boltpose.viewer.page import Page
from boltpose.viewer.scan_colors import ColorMode, ScanColors
from boltpose.viewer.scan_layer import ScanLayer

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from tests.support.browser import CHROMIUM, FLAGS

DEMO = Path(boltpose.__file__).parent / "demo"
FRAMES = """() => new Promise(done => {let n = 0; const t = performance.now();
const step = () => {
n++; if (performance.now() - t > 2000) done(n / 2); else requestAnimationFrame(step)};
requestAnimationFrame(step)})"""


def dense_scan(count: int) -> Scan:
    """The demo's scan with `count` points."""
    scan = read_scan(DEMO / "000002.png", camera=DEMO / "scene_camera.json")
    rng = np.random.default_rng(0)
    rows = np.resize(np.arange(len(scan)), count)
    noise = rng.normal(0, 0.25, size=(count, 3))
    return Scan(points=scan.points[rows] + noise, source="dense")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=2_000_000)
    count = parser.parse_args().points
    scan = dense_scan(count)
    config = ViewerConfig(port=0)
    start = time.perf_counter()
    detail = cut(scan.points, config)
    print(f"{count} points cut into {len(detail.tiles)} tiles: {time.perf_counter() - start:.2f} s")
    print("points per level", [detail.count(level) for level in range(3)])
    print("spacing mm", [round(value, 2) for value in detail.spacing_mm])
    with Page("bench", config) as page, sync_playwright() as driver:
        layer = ScanLayer(page)
        start = time.perf_counter()
        colors = ScanColors(scan, None, None)
        print(f"normals: {time.perf_counter() - start:.2f} s")
        middle = np.median(scan.points, axis=0)
        page.look_at(middle, middle + np.array([0, 0, -900.0]), up=np.array([0, -1.0, 0]))
        layer.show(scan.points, lambda rows: colors.of(ColorMode.PLAIN, rows))
        browser = driver.chromium.launch(executable_path=shutil.which(CHROMIUM), args=list(FLAGS))
        tab = browser.new_page(viewport={"width": 1280, "height": 800})
        received: list[tuple[float, int]] = []
        start = time.perf_counter()
        tab.on(
            "websocket",
            lambda socket: socket.on(
                "framereceived",
                lambda data: received.append((time.perf_counter() - start, len(data))),
            ),
        )

        def settle(what: str) -> None:
            last = -1
            while last != sum(size for _, size in received):
                last = sum(size for _, size in received)
                tab.wait_for_timeout(1500)
            sent = sum(size for _, size in received)
            print(
                f"{what}: {sent / 1e6:.2f} MB received, last after {received[-1][0]:.1f} s, "
                f"{tab.evaluate(FRAMES):.0f} frames/s still"
            )

        tab.goto(page.url)
        tab.wait_for_selector("canvas")
        settle("first view, still")
        large = [(when, size) for when, size in received if size > 100_000]
        print(
            f"first picture: {large[0][1] / 1e6:.2f} MB, {large[0][0]:.2f} s after the address was"
            " opened"
        )
        tab.mouse.move(500, 400)
        for _ in range(8):
            tab.mouse.wheel(0, -240)
            tab.wait_for_timeout(80)
        settle("near the motor")
        before = sum(size for _, size in received)
        tab.mouse.down()
        frames = []
        for step in range(30):
            tab.mouse.move(500 + 8 * step, 400)
        frames.append(tab.evaluate(FRAMES))
        tab.mouse.up()
        print(f"after turning: {frames[0]:.0f} frames/s")
        settle("turned")
        print(f"for that {(sum(size for _, size in received) - before) / 1e6:.2f} MB more")
        browser.close()


if __name__ == "__main__":
    main()
