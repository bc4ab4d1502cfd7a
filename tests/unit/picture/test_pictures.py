from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from PIL import Image

from boltpose.errors import FrameError, InputFileError
from boltpose.geometry.transforms import Transform
from boltpose.picture import draw_located, draw_prior
from boltpose.picture.behind import choose_direction, heads_in_sight
from boltpose.picture.bolt_marks import BoltMark, Ink
from boltpose.picture.fit import tint_fit
from boltpose.picture.paint import distance_tints
from boltpose.picture.view import frame_subject, look_along
from boltpose.schema import BoltState
from tests.support import results

GREEN, RED = (0x1B, 0x7F, 0x3B), (0xB3, 0x00, 0x1B)


def banner_color(path: Path) -> tuple[int, ...]:
    with Image.open(path) as image:
        return tuple(int(v) for v in np.asarray(image.convert("RGB"))[3, 5])


def mark(name: str, axis: float, position: tuple[float, float, float]) -> BoltMark:
    return BoltMark(
        name=name,
        scene_from_bolt=Transform.from_parts(
            "camera", "bolt", np.diag([1.0, axis, axis]), position
        ),
        head_diameter_mm=10.0,
        ink=Ink.HIDDEN,
        is_sure=True,
    )


@pytest.mark.parametrize("has_hand_eye", [True, False])
def test_an_accepted_result_has_a_green_banner(tmp_path: Path, has_hand_eye: bool) -> None:
    prior = results.cube_prior()
    scan = results.cube_scan(prior)
    base_from_camera = results.BASE_FROM_CAMERA if has_hand_eye else None
    result = results.located(prior, base_from_camera, count=len(scan))

    draw_located(tmp_path / "p.png", result, scan, prior, base_from_camera)

    assert banner_color(tmp_path / "p.png") == GREEN


@pytest.mark.parametrize("has_candidate", [True, False])
def test_a_refused_result_has_a_red_banner(tmp_path: Path, has_candidate: bool) -> None:
    prior = results.cube_prior()
    result = results.refused(prior, has_candidate=has_candidate)

    draw_located(
        tmp_path / "p.png", result, results.cube_scan(prior), prior, results.BASE_FROM_CAMERA
    )

    assert banner_color(tmp_path / "p.png") == RED


def test_the_same_result_gives_the_same_bytes(tmp_path: Path) -> None:
    prior = results.cube_prior()
    for name in ("a.svg", "b.svg", "a.png", "b.png"):
        draw_prior(tmp_path / name, prior)

    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.fixture
def texts(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Everything that is written into pictures."""
    written: list[str] = []
    original = Axes.text

    def text(self: Axes, x: float, y: float, s: str, *rest, **options):
        written.append(s)
        return original(self, x, y, s, *rest, **options)

    monkeypatch.setattr(Axes, "text", text)
    return written


def test_every_bolt_of_a_prior_is_named_once_and_the_unsure_are_marked(
    tmp_path: Path, texts: list[str]
) -> None:
    draw_prior(tmp_path / "p.svg", results.cube_prior())

    assert [text for text in texts if text[:2] in ("T1", "T2", "B1")] == ["T1", "T2", "B1 ?"]
    assert "please check: B1" in texts


def test_hidden_and_unsure_bolts_are_drawn_from_both_viewpoints(
    tmp_path: Path, texts: list[str]
) -> None:
    prior = results.cube_prior()
    scan = results.cube_scan(prior)

    draw_located(
        tmp_path / "p.png",
        results.located(prior, count=len(scan)),
        scan,
        prior,
        results.BASE_FROM_CAMERA,
    )

    # the cube hides the bolts of the top from the second viewpoint
    assert [text for text in texts if text[:2] in ("T1", "T2", "B1")] == [
        "T1",
        "T2",
        "B1 ?",
        "B1 ?",
    ]
    assert "1 seen, 1 partly seen, 1 hidden" in texts


def test_a_refused_result_names_the_reasons_and_no_bolt(tmp_path: Path, texts: list[str]) -> None:
    prior = results.cube_prior()
    result = results.refused(prior)

    draw_located(
        tmp_path / "p.png", result, results.cube_scan(prior), prior, results.BASE_FROM_CAMERA
    )

    assert texts.count("REFUSED") == 2
    assert set(result.verdict.reasons) <= {text.replace("\n", " ") for text in texts}
    assert not any(text.startswith(("T1", "T2", "B1")) for text in texts)


def test_a_contradicted_bolt_is_crossed_out_without_an_arrow(
    tmp_path: Path, texts: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    arrows = []
    monkeypatch.setattr("boltpose.picture.marks._draw_arrow", lambda *given: arrows.append(given))
    prior = results.cube_prior()
    scan = results.cube_scan(prior)
    result = results.located(prior)
    first, *others = result.bolts
    gone = replace(first, state=BoltState.CONTRADICTED, state_reason="a missing screw")

    draw_located(
        tmp_path / "p.png",
        replace(result, bolts=(gone, *others)),
        scan,
        prior,
        results.BASE_FROM_CAMERA,
    )

    assert {call[3] for call in arrows} == {Ink.PARTIAL, Ink.HIDDEN}
    assert any(text.startswith("NO TOOL AT T1;") for text in texts)


def test_names_are_never_taken_for_formulas(tmp_path: Path) -> None:
    prior = replace(results.cube_prior(), name=r"$\frac{$")
    scan = results.cube_scan(prior)
    result = results.located(prior)
    bolts = tuple(replace(bolt, id=rf"$\{bolt.id}{{$") for bolt in result.bolts)

    draw_located(
        tmp_path / "p.png",
        replace(result, bolts=bolts),
        scan,
        prior,
        results.BASE_FROM_CAMERA,
    )

    assert banner_color(tmp_path / "p.png") == GREEN


def test_a_result_in_base_cannot_be_drawn_without_hand_eye(tmp_path: Path) -> None:
    prior = results.cube_prior()
    with pytest.raises(FrameError, match="needs base_from_camera"):
        draw_located(
            tmp_path / "p.png", results.located(prior), results.cube_scan(prior), prior, None
        )


def test_an_unknown_suffix_is_refused_and_nothing_is_left(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=r"p\.bmp"):
        draw_prior(tmp_path / "p.bmp", results.cube_prior())

    assert not list(tmp_path.iterdir())


def test_the_second_viewpoint_sees_the_hidden_heads() -> None:
    prior = results.cube_prior()
    points = results.CAMERA_FROM_PRIOR.apply(prior.points)
    # heads on the far side of the cube, away from the camera
    marks = [mark("B1", 1.0, (15.0, 15.0, 750.0)), mark("B2", 1.0, (-30.0, 0.0, 750.0))]

    forward = choose_direction(points, marks)

    middle = points.mean(axis=0)
    for direction, is_seen in ((forward, True), (np.array([0.0, 0, 1]), False)):
        view = frame_subject(
            look_along(direction, np.array([0.0, -1, 0]), middle, "camera", 2000.0),
            points,
            width=200,
            height=200,
        )
        assert (heads_in_sight(view, points, marks) == is_seen).all()


def test_no_bolts_have_a_second_viewpoint_too() -> None:
    points = results.CAMERA_FROM_PRIOR.apply(results.cube_prior().points)

    forward = choose_direction(points, [])

    np.testing.assert_allclose(forward, (0, 0, -1), atol=1e-9)


def test_distance_colours_run_from_green_to_red_and_stay_there() -> None:
    tints = distance_tints(np.array([0.0, 1.0, 50.0]), 1.0)

    assert tints[0, 1] > tints[0, 0]
    assert tints[1, 0] > tints[1, 1]
    np.testing.assert_array_equal(tints[1], tints[2])


def test_clamp_points_near_the_prior_are_not_coloured_as_misfit() -> None:
    prior = results.cube_prior()
    motor = results.CAMERA_FROM_PRIOR.apply(prior.points)
    normals = results.CAMERA_FROM_PRIOR.rotate(prior.normals)
    on, clamp = np.array([0.0, 0, 650]), np.array([10.0, 10, 647.0])
    scan = np.stack([on, clamp])

    _, with_mask = tint_fit(scan, np.array([True, False]), motor, normals)
    _, without_mask = tint_fit(scan, np.array([False, False]), motor, normals)

    np.testing.assert_array_equal(with_mask[0], distance_tints(np.array([0.0]), 1.0)[0])
    np.testing.assert_array_equal(without_mask[1], distance_tints(np.array([1.0]), 1.0)[0])
    assert (with_mask[1] != without_mask[1]).any()


def test_a_candidate_behind_the_camera_is_still_shown_as_refused(tmp_path: Path) -> None:
    prior = results.cube_prior()
    result = results.refused(prior)
    assert result.registration is not None
    behind = Transform.from_parts("camera", "prior", np.eye(3), (0.0, 0.0, -700.0))
    turned = replace(result, registration=replace(result.registration, camera_from_prior=behind))

    draw_located(
        tmp_path / "p.png", turned, results.cube_scan(prior), prior, results.BASE_FROM_CAMERA
    )

    assert banner_color(tmp_path / "p.png") == RED
