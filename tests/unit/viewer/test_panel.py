"""What the panel says: the verdict, never a number to follow of a refused scan, nobody's markup."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from boltpose.report.advice import ADVICE
from boltpose.schema import BoltState, LocateResult
from boltpose.viewer.panel import headline, sign_of, verdict_panel
from boltpose.viewer.panel_bolts import bolt_detail, bolt_table
from tests.support.results import cube_prior, located, refused

PRIOR = cube_prior()


def changed(result: LocateResult, **changes: object) -> LocateResult:
    first = replace(result.bolts[0], **changes)  # type: ignore[arg-type] - fields by name
    return replace(result, bolts=(first, *result.bolts[1:]))


def test_the_sign_of_an_accepted_scan_counts_what_was_seen_and_names_the_scan() -> None:
    sign = sign_of(located(PRIOR), "folder/clamp 7.ply")
    assert (sign.kind, sign.word, sign.scan) == ("ok", "OK", "clamp 7.ply")
    assert sign.text == "3 bolts in frame 'base': 1 seen, 1 partly seen, 1 hidden"
    assert sign.points == ()


def test_the_sign_of_a_refused_scan_says_why_in_an_operators_words() -> None:
    result = refused(PRIOR)
    sign = sign_of(result, "a.ply")
    assert (sign.kind, sign.word) == ("refused", "REFUSED")
    assert set(sign.points) == {ADVICE[check].meaning for check in result.verdict.failed}
    page = str(verdict_panel(result, {}))
    for check in result.verdict.failed:
        assert ADVICE[check].todo in page
    assert "rejected candidate" in page


def test_poses_in_the_cameras_frame_are_called_no_robot_coordinates() -> None:
    sign = sign_of(located(PRIOR, None), "a.ply")
    assert any("NOT robot coordinates" in point for point in sign.points)


def test_a_contradicted_bolt_is_named_on_the_sign_and_struck_out_of_the_table() -> None:
    result = changed(
        located(PRIOR), state=BoltState.CONTRADICTED, state_reason="the camera saw a hole there"
    )
    assert sign_of(result, "a.ply").points == ("T1: NOT THERE. No tool must go there.",)
    table = str(bolt_table(result.bolts))
    assert table.count("<s>") == 4  # its three coordinates and its sigma
    assert "NOT THERE" in table
    assert "the camera saw a hole there" in str(bolt_detail(result.bolts[0], "base"))


def test_the_table_has_the_bolts_in_the_order_they_are_taken_out() -> None:
    result = located(PRIOR)
    bolts = [
        replace(bolt, order=order) for bolt, order in zip(result.bolts, (3, None, 1), strict=True)
    ]
    table = str(bolt_table(bolts))
    places = [table.index(f"<b>{name}</b>") for name in ("B1", "T1", "T2")]
    assert places == sorted(places)


def test_without_a_pose_there_is_no_table_of_bolts() -> None:
    assert "<table" not in str(bolt_table(()))


@pytest.mark.parametrize("evil", ["<script>alert(1)</script>", "\"><img src=x onerror='x()'>"])
def test_names_from_files_stay_text(evil: str) -> None:
    result = changed(located(PRIOR), name=evil, tool=evil, remarks=(evil,))
    result = replace(result, prior_name=evil, provenance={"version": evil, "scan_sha256": evil})
    pages = (
        headline(sign_of(result, evil)),
        verdict_panel(result, {evil: 3.0}),
        bolt_table(result.bolts),
        bolt_detail(result.bolts[0], "base"),
    )
    for page in pages:
        assert "<script" not in page
        assert "<img" not in page


def test_the_panel_shows_every_score_with_its_threshold_and_where_time_went() -> None:
    result = located(PRIOR)
    page = str(verdict_panel(result, {"segmentation": 250.0, "registration": 750.0}))
    for name in result.verdict.thresholds:
        assert name.replace("_", " ") in page
    assert "Time: 1.00 s" in page
    assert "registration 750 ms" in page


def test_an_accepted_result_whose_scores_miss_is_not_shown_as_good() -> None:
    result = located(PRIOR)
    worse = replace(result, verdict=replace(result.verdict, scores={"coverage": 0.1}))
    assert "DO NOT USE THIS RESULT" in str(verdict_panel(worse, {}))
    assert sign_of(worse, "a.ply").kind == "refused"


def test_a_chosen_bolt_is_told_in_numbers() -> None:
    bolt = located(PRIOR).bolts[0]
    page = str(bolt_detail(bolt, "base"))
    for value in bolt.head_top:
        assert f"{abs(value):.2f}" in page
    assert "0.33" in page  # degrees of the axis
    assert np.isfinite(bolt.head_top).all()
