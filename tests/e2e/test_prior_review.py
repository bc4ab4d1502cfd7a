"""A technician's two minutes, in a real browser with real clicks."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from boltpose.prior.file import read_prior, write_prior
from boltpose.prior.review import ReviewSession
from boltpose.prior.review_journal import ReviewJournal
from boltpose.schema import Prior, PriorBolt
from boltpose.viewer.config import ViewerConfig
from boltpose.viewer.review import ReviewPage
from boltpose.viewer.review_view import look_from
from tests.support import browser as browser_support
from tests.support import reman18

playwright = pytest.importorskip("playwright.sync_api", reason="playwright drives the browser")
CHROMIUM = shutil.which(browser_support.CHROMIUM)
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="Debian's chromium is not installed")


@pytest.fixture(scope="module")
def browser() -> Iterator[playwright.Browser]:
    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(
            executable_path=CHROMIUM, args=list(browser_support.FLAGS)
        )
        yield chromium
        chromium.close()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A prior with two bolts to check."""
    prior = reman18.true_prior("motor_011")
    doubted = {"T1": 0.7, "B1": 0.4}
    bolts = tuple(
        replace(b, is_sure=False, confidence=doubted[b.id], remarks=("little flank seen",))
        if b.id in doubted
        else b
        for b in prior.bolts
    )
    # all points around the heads, few elsewhere: software draws the picture here
    heads = np.array([bolt.prior_from_bolt.translation_mm for bolt in bolts])
    gap = np.linalg.norm(prior.points[:, None] - heads[None], axis=2).min(axis=1)
    keep = (gap < 25.0) | (np.arange(len(prior.points)) % 6 == 0)
    small = replace(
        prior,
        bolts=bolts,
        points=prior.points[keep],
        normals=prior.normals[keep],
        labels=prior.labels[keep],
    )
    write_prior(tmp_path / "m.prior.npz", small)
    return tmp_path / "m.prior.npz"


def wait_until(tab: playwright.Page, is_so: Callable[[], bool], what: str) -> None:
    deadline = time.monotonic() + 60.0
    while not is_so():
        if time.monotonic() > deadline:
            pytest.fail(f"waited 60 s for {what}; the page says: {tab.inner_text('body')}")
        tab.wait_for_timeout(50)


def open_tab(browser: playwright.Browser, review: ReviewPage) -> playwright.Page:
    tab = browser.new_page(viewport={"width": 900, "height": 640})
    tab.goto(review.page.url)
    tab.get_by_role("button", name="Confirm: this is right").wait_for(timeout=60_000)
    return tab


def click_beside_the_middle(tab: playwright.Page, right_px: int, down_px: int) -> None:
    """Click on the picture; the viewer looks at its middle."""
    canvas = tab.locator("canvas").first.bounding_box()
    assert canvas is not None
    tab.mouse.click(
        canvas["x"] + canvas["width"] / 2 + right_px, canvas["y"] + canvas["height"] / 2 + down_px
    )


def look_at(tab: playwright.Page, review: ReviewPage, prior: Prior, bolt: PriorBolt) -> None:
    review.page.look_at(bolt.prior_from_bolt.translation_mm, look_from(prior, bolt))
    tab.wait_for_timeout(2000)  # a software renderer draws a few pictures per second


@pytest.mark.slow
def test_two_minutes_of_a_technician(
    browser: playwright.Browser, path: Path, tmp_path: Path
) -> None:
    before = read_prior(path)
    lost = before.bolt("B1")
    with ReviewSession.open(path) as session:
        review = ReviewPage(session, ViewerConfig(port=0))
        with review.page:
            tab = open_tab(browser, review)
            tab.get_by_text("2 to check").wait_for()
            tab.get_by_text("Unsure: confidence 40").wait_for()
            tab.wait_for_timeout(3000)
            tab.screenshot(path=tmp_path / "1-open.png")

            # the most doubtful one first: it is no bolt; the other is right
            tab.get_by_role("button", name="Remove: no bolt").click()
            tab.get_by_text("1 to check").wait_for()
            tab.get_by_role("button", name="Confirm: this is right").click()
            tab.get_by_text("All sure").wait_for()
            assert session.prior.bolt("T1").is_sure
            assert len(session.prior.bolts) == len(before.bolts) - 1

            # it was a bolt after all: a click on its head, 2 mm beside the axis
            look_at(tab, review, before, lost)
            tab.get_by_role("button", name="Add a missed bolt").click()
            tab.get_by_text("Click on the head that was missed").wait_for()
            tab.screenshot(path=tmp_path / "2-add.png")
            click_beside_the_middle(tab, 6, 6)
            wait_until(tab, lambda: len(session.edits) == 3, "the bolt to be added")
            found = session.prior.bolt("B1")
            x, y, z = lost.prior_from_bolt.inverse().apply(found.prior_from_bolt.translation_mm)
            assert np.hypot(x, y) < 0.05
            assert abs(z) < 0.05
            assert found.is_sure
            tab.get_by_text("its axis known to").first.wait_for()
            tab.wait_for_timeout(1500)
            tab.screenshot(path=tmp_path / "3-added.png")

            # name, tool and turn, as typed and with Enter
            name, tool, turn = tab.locator("form input:visible").all()
            for field, words in ((name, "through bolt left"), (tool, "hex 8"), (turn, "1")):
                field.fill(words)
                tab.wait_for_timeout(200)  # viser drops fields that change within 50 ms
            turn.press("Enter")
            wait_until(tab, lambda: len(session.edits) == 6, "name, tool and turn")
            named = session.prior.bolt("B1")
            assert (named.name, named.tool, named.order) == ("through bolt left", "hex 8", 1)

            # turned to the wrong side by a key, and back
            tab.mouse.click(20, 600)
            tab.keyboard.press("f")
            wait_until(tab, lambda: len(session.edits) == 7, "the bolt to be turned")
            tab.wait_for_timeout(1500)
            tab.screenshot(path=tmp_path / "4-turned.png")
            tab.get_by_role("button", name="Undo: turn B1 round").click()
            wait_until(tab, lambda: len(session.edits) == 6, "the turn to be taken back")
            assert session.prior.bolt("B1") is named

            # the browser is closed, and opened again
            tab.close()
            tab = open_tab(browser, review)
            tab.get_by_text("not saved yet; nothing is lost").wait_for()
            # viser ties no label to its fields; this is the one below the form
            tab.locator("input.mantine-TextInput-input").last.fill("A. Technician")
            tab.get_by_role("button", name="Save", exact=True).click()
            wait_until(tab, lambda: not session.has_unsaved, "the prior to be saved")
            tab.get_by_text("m.prior.npz is written").wait_for()
            tab.wait_for_timeout(1500)
            tab.screenshot(path=tmp_path / "5-saved.png")
            tab.close()
    saved = read_prior(path)
    assert saved.bolt("B1").name == "through bolt left"
    assert {bolt.id for bolt in saved.bolts} == {bolt.id for bolt in before.bolts}
    assert saved.provenance["reviews"][0]["by"] == "A. Technician"
    assert not ReviewJournal.path_of(path).exists()
