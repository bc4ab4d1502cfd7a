"""`boltpose prior review`: the human check of a prior before production, in a browser."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from boltpose.cli.console import note, note_console
from boltpose.cli.options import JsonOption, PriorArgument
from boltpose.cli.outputs import PRIOR_SUFFIXES, check_output
from boltpose.cli.prior_edit import ByOption, DateOption


def review(
    prior: PriorArgument,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="By default PRIOR is replaced."),
    ] = None,
    by: ByOption = "",
    date: DateOption = "",
    discard: Annotated[
        bool,
        typer.Option("--discard", help="Throw away the edits of an earlier review, not saved."),
    ] = False,
    port: Annotated[
        int, typer.Option("--port", help="Port of the page on this machine; 0 for any free one.")
    ] = 8321,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")
    ] = True,
    as_json: JsonOption = False,
) -> None:
    """Check a new prior in the browser: confirm, remove, add, flip and name its bolts.

    Every edit is on disk at once, in PRIOR.review.jsonl beside the prior. A review that was
    interrupted goes on where it was. The prior itself changes when you press Save.
    """
    target = output or prior
    check_output(target, PRIOR_SUFFIXES)

    import webbrowser

    from boltpose.prior.review import ReviewSession
    from boltpose.viewer.config import ViewerConfig
    from boltpose.viewer.review import ReviewPage

    config = ViewerConfig(port=port)
    notes = note_console()
    with ReviewSession.open(prior, discard=discard) as session:
        if session.resumed_edits:
            notes.print(f"edits of an earlier review taken up: {session.resumed_edits}")
        review_page = ReviewPage(session, config, by=by, date=date, output=output)
        with review_page.page as page:
            notes.print(f"review of {prior} at {page.url}; Ctrl-C ends it", soft_wrap=True)
            if browser:
                webbrowser.open(page.url)
            try:
                page.wait()
            except KeyboardInterrupt:
                notes.print("ended")
        unsaved = len(session.edits) if session.has_unsaved else 0
    if as_json:
        saved = [str(path) for path in dict.fromkeys(review_page.saved)]
        typer.echo(json.dumps({"prior": str(prior), "saved": saved, "unsaved_edits": unsaved}))
        return
    for path in dict.fromkeys(review_page.saved):
        note(f"wrote {path}")
    if unsaved:
        notes.print(
            f"edits not saved: {unsaved}; the same command goes on with them", soft_wrap=True
        )
