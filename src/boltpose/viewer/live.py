"""Scans that come while the page is open: dropped into it, or written to a folder."""

from __future__ import annotations

import logging
import re
import tempfile
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path, PurePath

from boltpose.errors import BoltposeError
from boltpose.io.scan import SCAN_SUFFIXES
from boltpose.viewer.page import Page
from boltpose.viewer.panel import Sign
from boltpose.viewer.result_page import ResultPage, Shown
from boltpose.viewer.watch import FileWatch, FolderWatch
from boltpose.viewer.web import viser

_LOG = logging.getLogger(__name__)
_READY = "Drop a scan into the box, or choose a file."

LocateFile = Callable[[Path], Shown]
"""Reads one scan's file and locates it; raises `BoltposeError` or `OSError` on a bad one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Job:
    path: Path
    name: str
    """As a person knows the scan."""
    number: int
    is_upload: bool


class LivePage:
    """Locates every scan that comes, the newest first, and shows what came of it.

    While a scan is worked on the page shows no result at all. A result is shown only if no newer
    scan has come meanwhile.
    """

    def __init__(self, results: ResultPage, locate: LocateFile, watch: Path | None = None) -> None:
        """Add the upload to the page and start to work.

        Args:
            results: Where results are shown.
            locate: What is done with a scan.
            watch: A folder; every scan that is written to it from now on is located.

        Raises:
            InputFileError: There is no such folder.
        """
        self._results = results
        self._page: Page = results.page
        self._locate = locate
        self._change = threading.Condition()
        self._next: _Job | None = None
        self._number = 0
        self._skipped = 0
        self._is_stopped = False
        self._uploads = tempfile.TemporaryDirectory(prefix="boltpose-view-")
        # above the tabs, so that it is there whatever is looked at
        self._upload = self._page.server.gui.add_upload_button(
            "Drop a scan here, or click",
            hint=_about(watch),
            mime_type=",".join(SCAN_SUFFIXES),
            icon=viser.Icon.UPLOAD,
            order=50,
        )
        self._upload.on_upload(self._uploaded)
        text = _READY if watch is None else f"Waiting for a scan in folder {watch.name or watch}."
        results.wait(Sign(kind="wait", word="Ready", text=text))
        self._watch: FolderWatch | None = None
        if watch is not None:
            self._watch = FolderWatch(
                watch,
                SCAN_SUFFIXES,
                self._page.config.poll_s,
                found=lambda path: self.submit(path, path.name),
                lost=self._folder_lost,
            )
        self._thread = threading.Thread(target=self._run, name="locate", daemon=True)
        self._page.at_stop(self._stop)
        self._thread.start()

    def submit(self, path: Path, name: str, *, is_upload: bool = False) -> None:
        """Locate a scan as soon as the one at work is done; one that still waits is left out."""
        with self._change:
            if self._next is not None:
                self._skipped += 1
                _discard(self._next)
            self._number += 1
            self._next = _Job(path=path, name=name, number=self._number, is_upload=is_upload)
            self._change.notify_all()

    def _uploaded(self, event: viser.GuiEvent[viser.GuiUploadButtonHandle]) -> None:
        file = event.target.value
        name = PurePath(file.name.replace("\\", "/")).name or "scan"
        with self._change:
            folder = Path(self._uploads.name) / f"{self._number + 1}"
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / safe_name(name)
        path.write_bytes(file.content)
        self.submit(path, name, is_upload=True)

    def _folder_lost(self, text: str) -> None:
        self._page.do(self._results.wait, _no_result("The folder of scans cannot be read.", text))

    def _run(self) -> None:
        while True:
            with self._change:
                while self._next is None and not self._is_stopped:
                    self._change.wait()
                if self._is_stopped or self._next is None:
                    return
                job, self._next = self._next, None
                skipped, self._skipped = self._skipped, 0
            try:
                self._work(job, skipped)
            finally:
                _discard(job)

    def _work(self, job: _Job, skipped: int) -> None:
        note = f"{skipped} older ones were left out." if skipped else ""
        self._results.wait(
            Sign(kind="busy", word="Locating \N{HORIZONTAL ELLIPSIS}", text=note, scan=job.name)
        )
        try:
            shown = self._locate(job.path)
        except (BoltposeError, OSError) as error:
            text = str(error).replace(str(job.path), job.name)
            self._fail(job, text)
        except Exception as error:  # noqa: BLE001 - the page works on with the next scan
            _LOG.exception("locating %s", job.name)
            self._fail(job, f"a fault in boltpose ({type(error).__name__}: {error})")
        else:
            if job.number == self._number:
                self._results.show(shown, scan_name=job.name)

    def _fail(self, job: _Job, text: str) -> None:
        self._results.wait(_no_result("This scan could not be used.", text, job.name))

    def _stop(self) -> None:
        if self._watch is not None:
            self._watch.stop()
        with self._change:
            self._is_stopped = True
            self._change.notify_all()
        self._thread.join(timeout=30.0)
        self._uploads.cleanup()


class SavedPage:
    """A `poses.json` that is shown again whenever it is written anew.

    A result that was replaced or removed on disk must not stay on the screen as if it still held.
    """

    def __init__(
        self, results: ResultPage, path: Path, open_saved: Callable[[Path], Shown]
    ) -> None:
        """Show it.

        Args:
            results: Where it is shown.
            path: The `poses.json`.
            open_saved: Opens it with its scan and prior.

        Raises:
            BoltposeError: It cannot be opened.
        """
        self._results = results
        self._path = path
        self._open = open_saved
        self._watch = FileWatch(path, results.page.config.poll_s, changed=self._changed)
        try:
            results.show(open_saved(path))
        except BaseException:
            self._watch.stop()
            raise
        results.page.at_stop(self._watch.stop)

    def _changed(self, is_there: bool) -> None:
        page = self._results.page
        page.do(self._reopen, is_there)

    def _reopen(self, is_there: bool) -> None:
        name = self._path.name
        self._results.wait(
            Sign(kind="busy", word="Changed", text=f"{name} was written anew: reading it.")
        )
        try:
            if not is_there:
                raise FileNotFoundError(f"{self._path}: the file is gone; locate again")
            self._results.show(self._open(self._path))
        except (BoltposeError, OSError) as error:
            self._results.wait(_no_result(f"{name} does not hold any more.", str(error)))


def safe_name(name: str) -> str:
    """The name a file that was uploaded gets here: no folder, nothing a path could mean.

    A depth image is found in its camera file by its name, so the name is kept where it can be.
    """
    kept = re.sub(r"[^A-Za-z0-9._-]", "_", PurePath(name).name)[-100:].lstrip(".")
    return kept or "scan"


def _no_result(text: str, reason: str, scan: str = "") -> Sign:
    return Sign(kind="refused", word="NO RESULT", text=text, scan=scan, points=(reason,))


def _discard(job: _Job) -> None:
    if job.is_upload:
        job.path.unlink(missing_ok=True)


def _about(watch: Path | None) -> str:
    text = f"One of {', '.join(SCAN_SUFFIXES)}. The newest scan counts; the result before goes."
    return text if watch is None else f"{text} Scans written to {watch} are located too."
