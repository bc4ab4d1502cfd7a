"""One HTML page per scan that an operator judges in five seconds; everything is inside it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

import numpy as np
from threadpoolctl import threadpool_limits

from boltpose.errors import ConfigError, FrameError
from boltpose.io.atomic import write_atomic
from boltpose.picture.bolt_marks import camera_from_result
from boltpose.report.bolts import bolt_section, has_notes
from boltpose.report.facts import fact_section
from boltpose.report.markup import tag
from boltpose.report.pictures import picture_section
from boltpose.report.scores import score_section
from boltpose.report.style import STYLE
from boltpose.report.verdict import banner, notices, refusal_section
from boltpose.schema import LocateResult, Prior, Scan

_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
"""The browser itself refuses scripts and every request, whatever a file's text may hold."""
_MANY_LINES = 17
"""More lines about bolts or reasons than this are set closer: twelve bolts fit on a sheet."""
_SAME_PLACE_MM = 0.05
"""A bolt of the result and of the posed prior farther apart than this belong to two motors."""


def render_report(
    result: LocateResult,
    scan: Scan,
    prior: Prior,
    timings_ms: Mapping[str, float] | None = None,
) -> str:
    """Build the page of one result.

    Args:
        result: Of `locate`.
        scan: The scan it was made from, frame `camera`; of several the one `result.registration`
            is about.
        prior: The prior it was made with.
        timings_ms: Wall time per stage.

    Returns:
        HTML without scripts and without anything that would have to be fetched. The same arguments
        give the same text.

    Raises:
        FrameError: The result is in `base` and does not hold its hand-eye.
        ConfigError: The prior is not the one of the result.
    """
    _check_frame(result)
    _check_prior(result, prior)
    # one BLAS thread, as in `locate`: the same bits everywhere, and half the processor time
    with threadpool_limits(1, user_api="blas"):
        pictures = picture_section(result, scan, prior)
    bolts = bolt_section(result)
    warnings = notices(result)
    lines = len(result.bolts) + sum(map(has_notes, result.bolts)) + 2 * len(warnings)
    if not result.is_ok:
        lines += 2 * len(result.verdict.failed) + len(result.verdict.reasons)
    body = tag(
        "main",
        banner(result, scan.source),
        *warnings,
        refusal_section(result),
        pictures,
        bolts,
        tag(
            "div",
            score_section(result.verdict),
            fact_section(result, timings_ms),
            class_="foot",
        ),
        tag(
            "footer",
            "Lengths in mm. The sigmas leave out the robot's own error, and that of the hand-eye"
            " unless it was told (--hand-eye-sigma). The robot reads poses.json, never this page.",
        ),
        class_="dense" if lines > _MANY_LINES else "roomy",
    )
    word = "OK" if result.is_ok else "REFUSED"
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=_POLICY),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("title", f"{word}: {result.prior_name}, {Path(scan.source).name}"),
        tag("style", STYLE),
    )
    page = tag("html", head, tag("body", body), lang="en")
    return f"<!doctype html>\n{page}\n"


def write_report(
    path: str | Path,
    result: LocateResult,
    scan: Scan,
    prior: Prior,
    timings_ms: Mapping[str, float] | None = None,
) -> None:
    """Write the page of one result; the file appears whole or not at all.

    Args:
        path: The .html file; its folder must exist.
        result: Of `locate`.
        scan: The scan it was made from, frame `camera`.
        prior: The prior it was made with.
        timings_ms: Wall time per stage.

    Raises:
        FrameError: The result is in `base` and does not hold its hand-eye.
        ConfigError: The prior is not the one of the result.
        OSError: The file cannot be written there.
    """
    data = render_report(result, scan, prior, timings_ms).encode()

    def write(stream: BinaryIO) -> None:
        stream.write(data)

    write_atomic(Path(path), write)


def _check_frame(result: LocateResult) -> None:
    if result.frame == "base" and result.base_from_camera is None and result.bolts:
        raise FrameError("a result in frame 'base' must hold base_from_camera, got None")


def _check_prior(result: LocateResult, prior: Prior) -> None:
    """Refuse another motor's prior: its picture under this result would be a lie."""
    if not result.bolts or result.registration is None:
        return
    camera_from_frame = camera_from_result(result)
    camera_from_prior = result.registration.camera_from_prior
    known = {bolt.id: bolt for bolt in prior.bolts}
    for bolt in result.bolts:
        if bolt.id not in known:
            raise ConfigError(
                f"the prior '{prior.name}' has no bolt '{bolt.id}', so it is not that of the result"
            )
        located = camera_from_frame.apply(bolt.head_top)
        expected = camera_from_prior.apply(known[bolt.id].prior_from_bolt.translation_mm)
        apart_mm = float(np.linalg.norm(located - expected))
        if not apart_mm <= _SAME_PLACE_MM:
            raise ConfigError(
                f"bolt '{bolt.id}' of the result lies {apart_mm:.2f} mm from that of the prior "
                f"'{prior.name}', so the prior is not that of the result"
            )
