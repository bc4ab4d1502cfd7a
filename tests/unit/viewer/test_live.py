"""A result is shown for the scan it is about, or not at all."""

from __future__ import annotations

import threading
import urllib.request
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from boltpose.errors import ConfigError, InputFileError
from boltpose.schema import LocateResult, Prior, Scan, Status
from boltpose.viewer.config import ViewerConfig
from boltpose.viewer.live import LivePage, SavedPage, safe_name
from boltpose.viewer.page import Page
from boltpose.viewer.panel import Sign
from boltpose.viewer.prior_scene import PriorScene
from boltpose.viewer.result_page import ResultPage, Shown, is_measured
from boltpose.viewer.scan_colors import ColorMode, ScanColors
from boltpose.viewer.web import start_server
from tests.support.results import CAMERA_FROM_PRIOR, cube_prior, cube_scan, located, refused

PRIOR = cube_prior()
SCAN = cube_scan(PRIOR)
WAIT_S = 20.0


def shown(result: LocateResult) -> Shown:
    return Shown(result=result, scan=SCAN, prior=PRIOR, timings_ms={"registration": 1.0})


class Watched(ResultPage):
    """Notes what is shown, in order."""

    def __init__(self, page: Page) -> None:
        self.said: list[str] = []
        self.news = threading.Condition()
        super().__init__(page)

    def wait(self, sign: Sign) -> None:
        super().wait(sign)
        self._note(f"{sign.word} {sign.scan}".strip())

    def show(self, shown: Shown, *, scan_name: str | None = None) -> None:
        super().show(shown, scan_name=scan_name)
        self._note(f"{shown.result.verdict.status} {scan_name or ''}".strip())

    def until(self, text: str) -> None:
        with self.news:
            assert self.news.wait_for(lambda: text in self.said, WAIT_S), self.said

    def _note(self, text: str) -> None:
        with self.news:
            self.said.append(text)
            self.news.notify_all()


@pytest.fixture
def page() -> Iterator[Page]:
    with Page("test", ViewerConfig(port=0, poll_s=0.05)) as one:
        yield one


def test_the_page_is_served_on_the_loopback_address_only_and_is_gone_afterwards() -> None:
    with Page("test", ViewerConfig(port=0)) as page:
        assert page.url.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(page.url) as answer:
            assert answer.status == 200
        assert page.server.get_host() == "127.0.0.1"
        # viser can publish a page through a relay on the internet: this one cannot
        assert page.server.request_share_url() is None
        with pytest.raises(ConfigError, match="--port"):
            start_server(page.server.get_port(), "second")
        url = page.url
    with pytest.raises(OSError, match=r"refused|closed|reset"):
        urllib.request.urlopen(url, timeout=2)


def test_a_refused_result_shows_no_bolts_even_if_it_holds_some(page: Page) -> None:
    results = ResultPage(page)
    good = located(PRIOR)
    results.show(shown(good))
    assert set(results.bolts.ids()) == {"T1", "T2", "B1"}
    lying = replace(good, verdict=replace(good.verdict, status=Status.REFUSED))
    results.show(shown(lying))
    assert results.bolts.ids() == ()


def test_waiting_takes_everything_away(page: Page) -> None:
    results = ResultPage(page)
    results.show(shown(located(PRIOR)))
    results.wait(Sign(kind="busy", word="Locating", text=""))
    assert results.shown is None
    assert results.bolts.ids() == ()
    assert "Locating" in page.headline.content
    assert "OK" not in page.headline.content


def test_scans_that_come_while_one_is_located_leave_only_the_newest(
    page: Page, tmp_path: Path
) -> None:
    results, gate, entered = Watched(page), threading.Event(), threading.Event()

    def locate(path: Path) -> Shown:
        entered.set()
        if path.name == "first.ply":
            assert gate.wait(WAIT_S)
        return shown(located(PRIOR))

    live = LivePage(results, locate)
    live.submit(tmp_path / "first.ply", "first.ply")
    assert entered.wait(WAIT_S)
    live.submit(tmp_path / "second.ply", "second.ply")
    live.submit(tmp_path / "third.ply", "third.ply")
    gate.set()
    results.until("ok third.ply")
    # first was overtaken, second never begun
    assert [text for text in results.said if text.startswith("ok")] == ["ok third.ply"]
    assert not any("second" in text for text in results.said)


@pytest.mark.parametrize(
    "error", [InputFileError("x.ply", "nothing", "a scan"), OSError("disk"), RuntimeError("fault")]
)
def test_a_bad_scan_takes_the_old_result_away_and_the_page_works_on(
    page: Page, tmp_path: Path, error: Exception
) -> None:
    results = Watched(page)

    def locate(path: Path) -> Shown:
        if path.name == "bad.ply":
            raise error
        return shown(located(PRIOR))

    live = LivePage(results, locate)
    live.submit(tmp_path / "good.ply", "good.ply")
    results.until("ok good.ply")
    live.submit(tmp_path / "bad.ply", "bad.ply")
    results.until("NO RESULT bad.ply")
    assert results.shown is None
    assert str(error).split(":")[-1].strip() in page.headline.content
    live.submit(tmp_path / "next.ply", "next.ply")
    results.until("ok next.ply")


def test_a_scan_written_to_the_folder_is_located(page: Page, tmp_path: Path) -> None:
    results = Watched(page)
    LivePage(results, lambda path: shown(refused(PRIOR)), tmp_path)
    (tmp_path / "a.ply").write_bytes(b"x")
    results.until("refused a.ply")


def test_a_result_that_is_replaced_or_removed_on_disk_does_not_stay(
    page: Page, tmp_path: Path
) -> None:
    path = tmp_path / "poses.json"
    path.write_text("good")
    results = Watched(page)

    def open_saved(file: Path) -> Shown:
        text = file.read_text()
        if text == "broken":
            raise InputFileError(file, "no JSON", "a result")
        return shown(located(PRIOR) if text == "good" else refused(PRIOR))

    SavedPage(results, path, open_saved)
    results.until("ok")
    path.write_text("another")
    results.until("refused")
    path.write_text("broken")
    results.until("NO RESULT")
    assert results.shown is None
    results.said.clear()
    path.unlink()
    results.until("NO RESULT")
    assert "gone" in page.headline.content
    path.write_text("good")
    results.until("ok")


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("../../etc/passwd", "passwd"),
        ("a b;c.ply", "a_b_c.ply"),
        ("..", "scan"),
        ("", "scan"),
        (".hidden.ply", "hidden.ply"),
        ("000002.png", "000002.png"),
    ],
)
def test_an_uploaded_name_is_no_path(name: str, kept: str) -> None:
    assert safe_name(name) == kept


def test_a_refused_result_paints_no_parts_onto_the_scan() -> None:
    good = ScanColors(SCAN, located(PRIOR), PRIOR).modes()
    bad = ScanColors(SCAN, refused(PRIOR), PRIOR).modes()
    assert {ColorMode.PARTS, ColorMode.MOTOR, ColorMode.DISTANCE} <= set(good)
    assert bad == [ColorMode.PLAIN]


def test_colours_by_distance_are_those_of_the_distance() -> None:
    lifted = Scan(points=SCAN.points + np.array([0.0, 0.0, -0.9]), source="lifted")
    rows = np.arange(2000)  # of the cube's top face
    near = ScanColors(SCAN, located(PRIOR), PRIOR).of(ColorMode.DISTANCE, rows)
    far = ScanColors(lifted, located(PRIOR), PRIOR).of(ColorMode.DISTANCE, rows)
    # pale on the prior, dark beside it
    assert np.median(near.sum(axis=1)) > 2 * np.median(far.sum(axis=1))


def test_what_the_camera_measured_of_the_prior_is_its_upper_side() -> None:
    measured = is_measured(PRIOR, SCAN, CAMERA_FROM_PRIOR)
    top = PRIOR.points[:, 2] >= 49.9
    assert measured[top].all()
    # its lower side lies on the table, which was measured too
    side = np.abs(PRIOR.points[:, 2]) < 45
    assert not measured[side].any()


def test_a_prior_is_shown_with_its_bolts_and_an_unsure_one_is_marked(page: Page) -> None:
    scene = PriorScene(page)
    prior: Prior = PRIOR
    scene.show(prior)
    scene.look_from_above()
    assert set(scene.bolts.ids()) == {bolt.id for bolt in prior.bolts}
    scene.bolts.choose("B1")
    scene.show(prior)
    assert scene.bolts.chosen == "B1"
    with pytest.raises(KeyError):
        scene.bolts.choose("X9")
