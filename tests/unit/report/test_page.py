from __future__ import annotations

import base64
import re
from collections.abc import Callable
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from boltpose.errors import ConfigError, FrameError
from boltpose.geometry.transforms import Transform
from boltpose.report import render_report, write_report
from boltpose.schema import BoltState, Check, ExtraHead, LocateResult, Prior, Scan, Visibility
from tests.support import results
from tests.unit.report.conftest import Element, parse

NASTY = "<script>alert(1)</script><img src=x onerror='alert(2)'>\"&amp;"


@pytest.fixture(scope="module")
def prior() -> Prior:
    return results.cube_prior()


@pytest.fixture(scope="module")
def scan(prior: Prior) -> Scan:
    return results.cube_scan(prior)


def contradicted(result: LocateResult, *ids: str) -> LocateResult:
    bolts = tuple(
        replace(bolt, state=BoltState.CONTRADICTED, state_reason="a missing screw")
        if bolt.id in ids
        else bolt
        for bolt in result.bolts
    )
    return replace(result, bolts=bolts)


def rows_of(page: Element) -> dict[str, Element]:
    """The groups of the table of bolts by id."""
    (table,) = page.all("table", "bolts")
    return {body.all("b")[0].text: body for body in table.all("tbody")}


def notices(page: Element) -> list[str]:
    return [notice.text for notice in page.all("p", "notice")]


def test_an_accepted_result_says_ok_and_where_every_bolt_is(prior: Prior, scan: Scan) -> None:
    result = results.located(prior)
    page = parse(render_report(result, scan, prior))

    (heading,) = page.all("h1")
    assert heading.text == "OK"
    assert page.all("header", "ok")
    assert "3 bolts in frame base: 1 seen, 1 partly seen, 1 hidden." in page.all("header")[0].text
    rows = rows_of(page)
    assert list(rows) == ["T1", "T2", "B1"]
    for bolt in result.bolts:
        figures = [cell.text.replace("\u2212", "-") for cell in rows[bolt.id].all("td", "n")]
        numbers = [float(part) for part in " ".join(figures[:4]).split()]
        np.testing.assert_allclose(numbers[:3], bolt.head_top, atol=0.006)
        np.testing.assert_allclose(numbers[3:], bolt.axis, atol=0.0006)
    assert "0.11 / 0.22, 0.33\u00b0" in rows["T1"].text
    assert "NOT ROBOT COORDINATES" not in page.text
    assert notices(page) == [
        "LOOK ONCE AT B1. The prior is not sure here. A person checks it once per type of motor: "
        "boltpose prior review"
    ]


def test_a_refused_page_names_reasons_and_advice_and_nothing_to_follow(
    prior: Prior, scan: Scan
) -> None:
    result = results.refused(prior)
    page = parse(render_report(result, scan, prior))

    assert page.all("h1")[0].text == "REFUSED"
    assert page.all("header", "refused")
    assert not page.all("table", "bolts")
    (advice,) = page.all("table", "advice")
    assert [code.text for code in advice.all("code")] == ["free_space_violated", "ambiguous_pose"]
    for reason in result.verdict.reasons:
        assert any(item.text == f"{reason}." for item in page.all("li"))
    labels = [svg.attributes.get("aria-label") or "" for svg in page.all("svg")]
    assert any("rejected" in text for text in labels)
    words = [text.text for text in page.all("text")]
    assert "REFUSED: no pose is given" in words
    assert "REJECTED: never use this pose" in words
    assert not page.all("text", "name")
    # no number of the rejected pose, in any frame
    assert result.registration is not None
    for value in np.abs(result.registration.camera_from_prior.translation_mm):
        assert value == 0 or f"{value:.0f}" not in page.all("main")[0].text


def test_reasons_are_sorted_the_most_telling_first(prior: Prior, scan: Scan) -> None:
    result = results.refused(prior)
    verdict = replace(result.verdict, failed=tuple(reversed(Check)))
    page = parse(render_report(replace(result, verdict=verdict), scan, prior))

    (advice,) = page.all("table", "advice")
    codes = [code.text for code in advice.all("code")]
    assert codes == [str(check) for check in Check]


def test_without_any_candidate_the_scan_alone_is_shown(prior: Prior, scan: Scan) -> None:
    page = parse(render_report(results.refused(prior, has_candidate=False), scan, prior))

    assert len(page.all("figure")) == 1
    assert "Pose is right" not in page.text


def test_a_scan_without_points_still_gives_a_page(prior: Prior) -> None:
    empty = Scan(points=np.zeros((0, 3)), source="empty.ply")
    for has_candidate in (True, False):
        result = results.refused(prior, has_candidate=has_candidate)
        page = parse(render_report(result, empty, prior))
        assert page.all("h1")[0].text == "REFUSED"


def test_a_contradicted_bolt_is_crossed_out_in_table_and_picture(prior: Prior, scan: Scan) -> None:
    result = contradicted(results.located(prior), "T1")
    page = parse(render_report(result, scan, prior))

    row = rows_of(page)["T1"]
    assert "forbidden" in (row.attributes["class"] or "")
    assert "DO NOT TOUCH" in row.text
    assert "No tool must go here. The camera saw something else: a missing screw." in row.text
    struck = " ".join(element.text for element in row.all("s")).replace("\u2212", "-")
    for value in (*result.bolts[0].head_top, *result.bolts[0].axis):
        assert f"{value:.3f}".rstrip("0").rstrip(".") in struck
    for figure in row.all("td", "n"):
        assert figure.text == figure.all("s")[0].text
    assert not rows_of(page)["T2"].all("s")
    assert notices(page)[0].startswith("DO NOT TOUCH T1.")
    assert "2 of 3 bolts may be used" in page.all("header")[0].text
    names = [e for e in page.all("text", "name") if e.text == "T1"]
    assert names
    assert all(name.attributes["text-decoration"] == "line-through" for name in names)


def test_a_result_in_the_cameras_frame_warns_before_all_else(prior: Prior, scan: Scan) -> None:
    result = contradicted(results.located(prior, None), "T1")
    page = parse(render_report(result, scan, prior))

    assert page.all("h1")[0].text == "OK in the camera's frame only"
    first, second, *_ = notices(page)
    assert first.startswith("NOT ROBOT COORDINATES.")
    assert "--hand-eye FILE" in first
    assert second.startswith("DO NOT TOUCH")
    assert "danger" in (page.all("p", "notice")[0].attributes["class"] or "")
    assert any("NOT ROBOT COORDINATES" in title.text for title in page.all("h2"))


def test_a_refusal_without_hand_eye_has_no_coordinates_to_warn_of(prior: Prior, scan: Scan) -> None:
    result = replace(results.refused(prior), frame="camera", base_from_camera=None)
    assert notices(parse(render_report(result, scan, prior))) == []


def test_an_ok_that_its_own_scores_deny_is_told_not_to_be_used(prior: Prior, scan: Scan) -> None:
    result = results.located(prior)
    scores = {**result.verdict.scores, "free_space_violation": 0.5}
    forged = replace(result, verdict=replace(result.verdict, scores=scores))

    first, *_ = notices(parse(render_report(forged, scan, prior)))
    assert first.startswith("DO NOT USE THIS RESULT.")
    assert "free_space_violation" in first


def test_bolts_stand_in_their_turn_with_tool_and_chance(prior: Prior, scan: Scan) -> None:
    result = results.located(prior)
    turns, tools = (2, None, 1), ("hex 8", "", "Torx T30")
    bolts = tuple(
        replace(bolt, order=turn, tool=tool, p_tool_fits=0.987, name=f"name of {bolt.id}")
        for bolt, turn, tool in zip(result.bolts, turns, tools, strict=True)
    )
    page = parse(render_report(replace(result, bolts=bolts), scan, prior))

    rows = rows_of(page)
    assert list(rows) == ["B1", "T1", "T2"]
    assert rows["T1"].all("td")[0].text == "2"
    assert "hex 8" in rows["T1"].text
    assert "name of T1" in rows["T1"].text
    assert "98\u00a0%" in rows["T1"].texts
    heads = [head.text for head in page.all("table", "bolts")[0].all("thead")[0].all("th")]
    assert {"turn", "tool", "tool fits"} <= set(heads)
    # every row has as many cells as the head, so that readers of the table find the columns
    for row in rows.values():
        cells = row.all("tr")[0].children
        assert len(cells) == len(heads)


def test_columns_that_say_nothing_are_left_out(prior: Prior, scan: Scan) -> None:
    page = parse(render_report(results.located(prior), scan, prior))
    heads = [head.text for head in page.all("table", "bolts")[0].all("thead")[0].all("th")]
    assert not {"turn", "tool", "tool fits"} & set(heads)
    for row in rows_of(page).values():
        assert len(row.all("tr")[0].children) == len(heads)
        for note in row.all("td", "note"):
            assert note.attributes["colspan"] == str(len(heads))


def test_extra_heads_are_named_and_marked(prior: Prior, scan: Scan) -> None:
    head = ExtraHead(head_top_mm=np.array([510.0, 30.0, 150.0]), diameter_mm=9.6, height_mm=4.0)
    page = parse(render_report(replace(results.located(prior), extra_heads=(head,)), scan, prior))
    text = next(t for t in notices(page) if t.startswith("PERHAPS A BOLT"))
    assert "10 mm wide at 510.0, 30.0, 150.0" in text
    assert "perhaps a bolt" in page.all("figcaption")[0].text


def all_nasty(prior: Prior, result: LocateResult) -> tuple[LocateResult, Prior]:
    ids = {bolt.id: f"{NASTY}{bolt.id}" for bolt in prior.bolts}
    known = replace(
        prior,
        name=NASTY,
        bolts=tuple(replace(bolt, id=ids[bolt.id], name=NASTY) for bolt in prior.bolts),
    )
    bolts = tuple(
        replace(
            bolt,
            id=ids[bolt.id],
            name=NASTY,
            tool=NASTY,
            remarks=(NASTY,),
            is_sure=False,
            state=BoltState.CONTRADICTED,
            state_reason=NASTY,
        )
        for bolt in result.bolts
    )
    verdict = replace(
        result.verdict,
        reasons=(NASTY,),
        scores={**result.verdict.scores, NASTY: 1.0},
        thresholds={**result.verdict.thresholds, NASTY: 1.0},
    )
    provenance = {
        "version": NASTY,
        "scan": NASTY,
        "scan_sha256": NASTY,
        "models": {NASTY: NASTY},
        "config": {NASTY: NASTY},
        "inputs": {"scan_unit": NASTY},
        "views": [NASTY, NASTY],
    }
    changed = replace(result, bolts=bolts, verdict=verdict, provenance=provenance, prior_name=NASTY)
    return changed, known


Make = Callable[[Prior], LocateResult]


@pytest.mark.parametrize("make", [results.located, results.refused])
def test_no_text_of_a_file_becomes_part_of_the_page(prior: Prior, scan: Scan, make: Make) -> None:
    plain = parse(render_report(make(prior), scan, prior))
    result, known = all_nasty(prior, make(prior))
    nasty_scan = replace(scan, source=f"{NASTY}.ply")
    page = render_report(result, nasty_scan, known, {NASTY: 3.0})

    parsed = parse(page)
    kinds = {element.name for element in parsed.all()}
    # `s` and `strong` come with the state of a bolt, no element comes with a text
    assert kinds <= {element.name for element in plain.all()} | {"s", "strong", "circle", "code"}
    for element in parsed.all():
        assert not [name for name in element.attributes if name.startswith("on")]
    assert "<script" not in page.lower()
    assert NASTY in "".join(parsed.texts)


@pytest.mark.parametrize("make", [results.located, results.refused])
def test_the_page_needs_no_network_and_no_script(prior: Prior, scan: Scan, make: Make) -> None:
    page = render_report(make(prior), scan, prior)
    parsed = parse(page)

    assert not parsed.all("script")
    assert not parsed.all("link")
    for element in parsed.all():
        for name in ("src", "href", "xlink:href", "action", "data"):
            address = element.attributes.get(name)
            assert address is None or address.startswith("data:image/jpeg;base64,")
    (style,) = parsed.all("style")
    assert "url(" not in style.text
    assert "@import" not in style.text
    assert "&" not in style.text
    (policy,) = [m for m in parsed.all("meta") if m.attributes.get("http-equiv")]
    assert (policy.attributes["content"] or "").startswith("default-src 'none'")
    assert len(page.encode()) < 1_500_000


@pytest.mark.parametrize("make", [results.located, results.refused])
def test_people_who_do_not_see_the_page_are_told_the_same(
    prior: Prior, scan: Scan, make: Make
) -> None:
    page = parse(render_report(make(prior), scan, prior))

    assert page.all("html")[0].attributes["lang"] == "en"
    assert page.all("title")[0].text.startswith(page.all("h1")[0].text)
    assert len(page.all("main")) == 1
    for svg in page.all("svg"):
        told = svg.attributes.get("role") == "img" and svg.attributes.get("aria-label")
        assert told or svg.attributes.get("aria-hidden") == "true"
    for table in page.all("table"):
        assert table.all("thead")[0].all("th")
        for cell in table.all("th"):
            assert cell.attributes.get("scope") in ("col", "row")
    for figure in page.all("figure"):
        assert figure.all("figcaption")[0].text


def test_the_pictures_are_pictures_of_the_stated_size(prior: Prior, scan: Scan) -> None:
    page = parse(render_report(results.located(prior), scan, prior))

    images = page.all("image")
    assert len(images) >= 3
    for image in images:
        data = (image.attributes["href"] or "").split(",", 1)[1]
        with Image.open(BytesIO(base64.b64decode(data))) as picture:
            assert picture.size == (
                int(image.attributes["width"] or 0),
                int(image.attributes["height"] or 0),
            )
            # not one colour: something is drawn
            assert np.ptp(np.asarray(picture.convert("L"))) > 50


def test_every_bolt_is_named_in_the_camera_picture_and_the_hidden_once_more(
    prior: Prior, scan: Scan
) -> None:
    page = parse(render_report(results.located(prior), scan, prior))
    shown = [[name.text for name in f.all("text", "name")] for f in page.all("figure")]
    assert sorted(shown[0]) == ["B1?", "T1", "T2"]
    assert shown[1] == []
    assert "B1?" in shown[2]


def test_hidden_bolts_on_both_ends_get_a_view_each(prior: Prior, scan: Scan) -> None:
    result = results.located(prior)
    bolts = tuple(replace(bolt, visibility=Visibility.HIDDEN) for bolt in result.bolts)
    page = parse(render_report(replace(result, bolts=bolts), scan, prior))
    third = page.all("figure")[2]

    assert len(third.all("image")) == 2
    labels = [svg.attributes["aria-label"] for svg in third.all("svg")]
    assert [str(text).rsplit(": ", 1)[1] for text in labels] == ["T1, T2.", "B1."]


def test_the_same_result_gives_the_same_bytes_but_for_the_times(prior: Prior, scan: Scan) -> None:
    result = results.located(prior, count=len(scan))
    first = render_report(result, scan, prior, {"registration": 10.0})

    assert first == render_report(result, scan, prior, {"registration": 10.0})
    # a saved result has no mask: its page must be the same
    assert first == render_report(
        replace(result, motor_mask=None), scan, prior, {"registration": 10.0}
    )
    other = render_report(result, scan, prior, {"registration": 99.0})
    lines = re.compile(r"<dt>Time</dt><dd>.*?</dd>")
    assert first != other
    assert lines.sub("", first) == lines.sub("", other)


def test_another_motors_prior_is_refused(prior: Prior, scan: Scan) -> None:
    result = results.located(prior)
    moved = Transform.from_parts("prior", "bolt", np.eye(3), (20.0, 20.0, 50.2))
    other = replace(prior, bolts=(replace(prior.bolts[0], prior_from_bolt=moved), *prior.bolts[1:]))
    with pytest.raises(ConfigError, match=r"'T1' of the result lies 0\.20 mm"):
        render_report(result, scan, other)
    with pytest.raises(ConfigError, match="has no bolt 'T1'"):
        render_report(result, scan, replace(prior, bolts=prior.bolts[1:]))


def test_a_result_in_base_must_hold_its_hand_eye(prior: Prior, scan: Scan) -> None:
    with pytest.raises(FrameError, match="must hold base_from_camera"):
        render_report(replace(results.located(prior), base_from_camera=None), scan, prior)


def test_the_file_appears_whole_or_not_at_all(tmp_path: Path, prior: Prior, scan: Scan) -> None:
    result = results.located(prior)
    write_report(tmp_path / "a.html", result, scan, prior)
    assert (tmp_path / "a.html").read_text("utf-8") == render_report(result, scan, prior)

    with pytest.raises(ConfigError):
        write_report(tmp_path / "b.html", result, scan, replace(prior, bolts=()))
    assert [path.name for path in tmp_path.iterdir()] == ["a.html"]
