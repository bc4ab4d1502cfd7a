"""The page as a technician has it: `boltpose view` in a real browser."""

from __future__ import annotations

import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

import boltpose
from boltpose.cli.app import main
from tests.support.browser import drop_file, open_tab, picture

if TYPE_CHECKING:
    from playwright.sync_api import Page as Tab

DEMO = Path(boltpose.__file__).parent / "demo"
SCAN = DEMO / "000002.png"
WAIT_MS = 60_000


@pytest.fixture(scope="module")
def prior(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("prior") / "motor.prior.npz"
    assert main(["prior", "build", str(DEMO / "full_scan.ply"), "-o", str(path)]) == 0
    return path


@contextmanager
def served(*arguments: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """The command in a process of its own; yields its address."""
    process = subprocess.Popen(
        [sys.executable, "-m", "boltpose", "view", *arguments, "--port", "0", "--no-browser"],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stderr is not None
        for line in process.stderr:
            found = re.search(r"http://127\.0\.0\.1:\d+", line)
            if found:
                break
        else:
            pytest.fail("the command ended without an address")
        yield found.group(), process
    finally:
        process.kill()
        process.wait()
        for stream in (process.stdout, process.stderr):
            if stream is not None:
                stream.close()


def opened(tab: Tab, url: str) -> None:
    tab.goto(url)
    tab.wait_for_selector("canvas")
    tab.wait_for_selector(".verdict")


def says(tab: Tab, word: str) -> None:
    tab.wait_for_function(
        "word => document.querySelector('.verdict b')?.textContent === word",
        arg=word,
        timeout=WAIT_MS,
    )


def until(tab: Tab, folder: Path, holds, what: str) -> np.ndarray:
    """Wait until the picture is as wanted; software rendering takes its time."""
    end = time.monotonic() + WAIT_MS / 1000
    while time.monotonic() < end:
        image = picture(tab, folder, "now")
        if holds(image):
            return image
        tab.wait_for_timeout(300)
    pytest.fail(f"the picture never showed {what}")


def edges(image: np.ndarray) -> float:
    """Mean difference of neighbouring pixels: nearly 0 for an empty backdrop."""
    return float(np.abs(np.diff(image, axis=1)).mean())


@pytest.mark.slow
def test_scans_are_dropped_into_the_page_and_written_to_a_folder(
    prior: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "scans"
    folder.mkdir()
    bad = tmp_path / "bad.ply"
    bad.write_bytes(b"no scan at all")
    with (
        open_tab() as tab,
        served(
            "--live",
            *("--prior", str(prior)),
            *("--hand-eye", str(DEMO / "hand_eye.yaml")),
            *("--camera", str(DEMO / "scene_camera.json")),
            *("--watch", str(folder)),
        ) as (url, process),
    ):
        opened(tab, url)
        says(tab, "Ready")
        empty = until(tab, tmp_path, lambda image: edges(image) < 0.3, "an empty page")

        drop_file(tab, "div:has(> input[type=file])", SCAN)
        says(tab, "OK")
        assert "000002.png" in tab.locator(".verdict").inner_text()
        assert "free space violation" in tab.content()
        assert "registration" in tab.content()
        # prior and bolts come first and cover 0.24 of the picture; with the scan it is 0.43
        full = until(tab, tmp_path, lambda image: changed(image, empty) > 0.33, "the scan")

        # a toggle takes the scan away, and brings it back
        tab.get_by_role("tab", name="View").click()
        tab.get_by_label("Scan", exact=True).click()
        until(tab, tmp_path, lambda image: differs(image, full), "the page without the scan")
        tab.get_by_label("Scan", exact=True).click()
        until(tab, tmp_path, lambda image: not differs(image, full), "the scan again")

        # every bolt can be looked at in numbers
        tab.get_by_role("tab", name="Bolts").click()
        tab.get_by_label("Bolt", exact=True).click()
        tab.get_by_role("option", name="B2").click()
        tab.wait_for_selector("table[data-bolt=B2]:visible")

        # a bad scan: one line, and nothing of the scan before
        tab.set_input_files("input[type=file]", bad)
        says(tab, "NO RESULT")
        assert "found no 'ply' in the first line" in tab.locator(".verdict").inner_text()
        assert tab.locator("table[data-bolt]").count() == 0
        until(tab, tmp_path, lambda image: not differs(image, empty), "an empty page again")

        # and the page works on
        shutil.copy(SCAN, folder / "000002.part")
        (folder / "000002.part").rename(folder / "000002.png")
        says(tab, "OK")

        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=30) == 0


def differs(image: np.ndarray, other: np.ndarray) -> bool:
    """More than one in twenty of the pixels have another colour."""
    return changed(image, other) > 0.05


def changed(image: np.ndarray, other: np.ndarray) -> float:
    """Share of the pixels that have clearly another colour."""
    return float((np.abs(image - other).max(axis=2) > 24).mean())


def test_a_saved_result_is_shown_and_goes_when_it_is_removed(prior: Path, tmp_path: Path) -> None:
    poses = tmp_path / "poses.json"
    locate = ["locate", str(SCAN), "--prior", str(prior), "-o", str(poses)]
    locate += ["--camera", str(DEMO / "scene_camera.json")]
    assert main([*locate, "--hand-eye", str(DEMO / "hand_eye.yaml")]) == 0
    with open_tab() as tab, served(str(poses)) as (url, _):
        opened(tab, url)
        says(tab, "OK")
        until(tab, tmp_path, lambda image: edges(image) > 1, "the scan")
        # a mouse that rests on a name: what is known of that bolt, and of no other
        name = tab.locator('.bptip[data-tip="B1"]')
        name.wait_for(timeout=WAIT_MS)
        place = name.bounding_box()
        assert place is not None
        assert tab.locator(".bptip .tip:visible").count() == 0
        tab.mouse.move(place["x"] + place["width"] / 2, place["y"] + place["height"] / 2)
        tab.locator(".bptip .tip:visible").wait_for(timeout=WAIT_MS)
        assert tab.locator(".bptip .tip:visible h3").all_inner_texts() == ["B1"]
        # the same scan without a hand-eye: the page follows, and says what that means
        assert main(locate) == 0
        tab.wait_for_function(
            "() => document.querySelector('.verdict')?.textContent.includes('NOT robot')",
            timeout=WAIT_MS,
        )
        poses.unlink()
        says(tab, "NO RESULT")
        assert tab.locator(".bptip").count() == 0
        assert "gone" in tab.locator(".verdict").inner_text()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "poses.json or a .prior.npz"),
        (["--live"], "no prior: give --prior"),
        (["--live", "poses.json"], "one of them"),
        (["missing.json"], "missing.json: found no such file"),
        (["missing.prior.npz"], "missing.prior.npz"),
        (["--live", "--prior", "missing.prior.npz"], "missing.prior.npz"),
        (["a.json", "--watch", "."], "--watch goes with --live only"),
    ],
)
def test_what_cannot_be_shown_is_told_in_one_line(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["view", *arguments, "--port", "0", "--no-browser"]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1
