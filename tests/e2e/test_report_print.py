"""The report in a real browser: how many sheets it takes, and that nothing in it runs."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from boltpose.report import write_report
from boltpose.schema import (
    BoltState,
    Check,
    ExtraHead,
    LocateResult,
    Prior,
    Status,
    VariantScore,
)
from tests.support import results

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("chrome")
pytestmark = pytest.mark.skipif(BROWSER is None, reason="needs Chromium (Debian: chromium)")
FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    # the page must be whole without any network
    "--host-resolver-rules=MAP * ~NOTFOUND",
)  # fmt: skip
A4_POINTS = (595, 842)


def chromium(tmp_path: Path, page: Path, *options: str) -> str:
    done = subprocess.run(
        [str(BROWSER), *FLAGS, f"--user-data-dir={tmp_path / 'profile'}", *options, page.as_uri()],
        check=True,
        capture_output=True,
        timeout=120,
    )
    return done.stdout.decode()


def sheets(tmp_path: Path, page: Path) -> list[tuple[int, int]]:
    """Print a page; the size of every sheet in points."""
    target = tmp_path / "printed.pdf"
    chromium(tmp_path, page, "--no-pdf-header-footer", f"--print-to-pdf={target}")
    data = target.read_bytes()
    count = len(re.findall(rb"/Type\s*/Page\b(?!s)", data))
    boxes = re.findall(rb"/MediaBox\s*\[\s*0 0 ([\d.]+) ([\d.]+)\s*\]", data)
    assert len(boxes) == count
    return [(round(float(width)), round(float(height))) for width, height in boxes]


def crowded(count: int) -> tuple[LocateResult, Prior]:
    """A result with everything a page can hold, on so many bolts."""
    prior = results.cube_prior()
    result = results.located(prior)
    known, located = [], []
    for row in range(count):
        said = {
            "id": f"{'TB'[row % 2]}{row + 1}",
            "name": ("solenoid upper", "through bolt, long side, near the flange", "")[row % 3],
            "tool": ("hex 8", "Torx T30", "square drive 10 mm")[row % 3],
            "order": row + 1 if row % 5 else None,
            "is_sure": row % 4 != 1,
            "remarks": ("little flank seen (support 12.3)", "axis uncertain by 0.42 mm")
            if row % 4 == 1
            else (),
        }
        known.append(replace(prior.bolts[row % 3], **said))
        located.append(
            replace(
                result.bolts[row % 3],
                **said,
                p_tool_fits=0.93,
                state=BoltState.CONTRADICTED if row in (2, 5) else BoltState.CONFIRMED,
                state_reason="the surface lies 12.9 mm behind the head's over 97 % of what the"
                " camera saw of it: a missing screw",
            )
        )
    head = ExtraHead(head_top_mm=result.bolts[0].head_top + 20, diameter_mm=9.7, height_mm=4.0)
    names = [
        "motor_points", "free_space_violation", "explained", "tight", "coverage", "judged_points",
        "measured", "margin", "bolt_sigma_mm", "converged", "p_correct", "variant_lead",
    ]  # fmt: skip
    verdict = replace(
        result.verdict,
        scores=dict.fromkeys(names, 1.0) | {"weakest_tight": 0.9, "sunk": 0.001},
        thresholds=dict.fromkeys(names, 1.0),
    )
    provenance = {
        "version": "0.1.0",
        "scan": "a rather long name of a scan, as cells give them 2026-11-23T05-12-00.ply",
        "scan_sha256": "1" * 64,
        "prior_sha256": "2" * 64,
        "hand_eye_sha256": "3" * 64,
        "models": {f"network_{n}.onnx": str(n) * 64 for n in range(4)},
        "config": {f"setting_{n}": n for n in range(12)},
    }
    full = replace(
        result,
        bolts=tuple(located),
        verdict=verdict,
        extra_heads=(head,) * 3,
        variants=tuple(
            VariantScore(name=f"motor_{n:05d}", status=Status.OK, p_correct=0.5, score=0.5)
            for n in range(9)
        ),
        provenance=provenance,
    )
    return full, replace(prior, bolts=tuple(known))


STAGES = ("prepare prior", "segmentation", "registration", "relabelling", "verification", "bolts")
TIMINGS = dict.fromkeys(STAGES, 123.4)


@pytest.mark.parametrize("frame", ["base", "camera"])
def test_twelve_bolts_with_all_remarks_print_on_one_a4_sheet(tmp_path: Path, frame: str) -> None:
    result, prior = crowded(12)
    if frame == "camera":
        bare = results.located(results.cube_prior(), None).bolts
        bolts = tuple(
            replace(bolt, frame_from_bolt=bare[row % 3].frame_from_bolt)
            for row, bolt in enumerate(result.bolts)
        )
        result = replace(result, frame="camera", base_from_camera=None, bolts=bolts)
    page = tmp_path / "page.html"
    write_report(page, result, results.cube_scan(prior), prior, TIMINGS)

    assert sheets(tmp_path, page) == [A4_POINTS]


def test_many_bolts_go_on_on_a_second_sheet(tmp_path: Path) -> None:
    result, prior = crowded(40)
    page = tmp_path / "page.html"
    write_report(page, result, results.cube_scan(prior), prior, TIMINGS)

    assert sheets(tmp_path, page) == [A4_POINTS, A4_POINTS]


def test_a_refusal_for_every_reason_prints_on_one_sheet(tmp_path: Path) -> None:
    full, prior = crowded(12)
    reason = "share of the motor points near the prior that lie on it to the measuring error: 0.431"
    verdict = replace(
        full.verdict,
        status=Status.REFUSED,
        failed=tuple(Check),
        reasons=(f"{reason}, wanted at least 0.94",) * len(Check),
    )
    page = tmp_path / "page.html"
    result = replace(full, bolts=(), extra_heads=(), verdict=verdict)
    write_report(page, result, results.cube_scan(prior), prior, TIMINGS)

    assert sheets(tmp_path, page) == [A4_POINTS]


def test_nothing_in_a_file_can_run(tmp_path: Path) -> None:
    prior = results.cube_prior()
    attack = "<script>document.title='ran'</script><img src=x onerror=\"document.title='ran'\">"
    result = results.located(prior)
    bolts = tuple(replace(bolt, name=attack, remarks=(attack,)) for bolt in result.bolts)
    page = tmp_path / "page.html"
    write_report(page, replace(result, bolts=bolts), results.cube_scan(prior), prior)

    shown = chromium(tmp_path, page, "--dump-dom")
    assert "<title>OK: cube, cube.ply</title>" in shown
    assert "<img" not in shown
    # the policy holds even where a script gets in
    page.write_text(page.read_text("utf-8").replace("</main>", f"</main>{attack}"), "utf-8")
    shown = chromium(tmp_path, page, "--dump-dom")
    assert "<img" in shown
    assert "<title>OK: cube, cube.ply</title>" in shown
