from __future__ import annotations

import io
from dataclasses import replace

import pytest
from rich.console import Console

from boltpose.cli.console import TABLE_WIDTH, StageProgress
from boltpose.cli.tables import describe_prior, describe_result
from boltpose.geometry.transforms import Transform
from boltpose.schema import BoltState, Side, Visibility
from tests.support import results


def text_of(renderable: object, width: int = 120) -> str:
    console = Console(file=io.StringIO(), width=width)
    console.print(renderable)
    return console.file.getvalue()  # pyright: ignore


def test_stages_add_up_in_their_order() -> None:
    with StageProgress("x", quiet=True) as progress:
        progress.done("segment", 0.25)
        progress.done("register", 0.5)
        progress.done("segment", 0.25)

    assert progress.seconds == {"segment": 0.5, "register": 0.5}
    assert progress.summary() == "segment 0.50 s, register 0.50 s; 1.00 s in all"


def test_progress_off_a_terminal_writes_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with StageProgress("x") as progress:
        progress.done("segment", 0.25)

    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "")


def test_no_number_is_cut_off_in_the_narrowest_table() -> None:
    prior = results.cube_prior()
    plain = results.located(prior)
    # the widest there is: every column, the longest word in each
    result = replace(
        plain,
        bolts=tuple(
            replace(
                bolt,
                id=f"T1{row}",
                side=Side.BOTTOM,
                p_tool_fits=1.0,
                visible_fraction=1.0,
                visibility=Visibility.VISIBLE,
                state=BoltState.CONTRADICTED,
                state_reason="a hole",
                is_sure=False,
                sigma_lateral_mm=10.0,
                sigma_axial_mm=10.0,
                frame_from_bolt=Transform.from_parts(
                    "base", "bolt", bolt.frame_from_bolt.rotation, (-1234.56, -2345.67, -3456.78)
                ),
            )
            for row, bolt in enumerate(plain.bolts)
        ),
    )

    text = text_of(describe_result(result), TABLE_WIDTH)

    assert "…" not in text
    for bolt in result.bolts:
        row = next(line for line in text.splitlines() if line.split()[:1] == [bolt.id])
        assert all(f"{value:.2f}" in row for value in bolt.head_top)
        assert all(f"{value + 0.0:.3f}" in row for value in bolt.axis)


def test_a_refused_result_shows_no_coordinates() -> None:
    text = text_of(describe_result(results.refused(results.cube_prior())))

    assert "REFUSED" in text
    assert "head_top" not in text
    # measured and not measured scores stand beside their thresholds
    lines = [line.split() for line in text.splitlines()]
    assert ["free", "space", "violation", "0.06", "0.01"] in lines
    assert ["margin", "-", "0.03"] in lines


def test_the_bolts_to_look_at_come_first_and_the_most_doubtful_of_them_first() -> None:
    prior = results.cube_prior()
    doubts = {"T1": 0.4, "T2": 0.97, "B1": 0.2}
    bolts = tuple(
        replace(bolt, confidence=doubts[bolt.id], is_sure=bolt.id == "T2", remarks=("because",))
        for bolt in prior.bolts
    )
    text = text_of(describe_prior(replace(prior, bolts=bolts)), TABLE_WIDTH)

    assert "look at 2 bolts" in text
    told = [line for line in text.splitlines() if "because" in line]
    assert ["B1: confidence 20%" in told[0], "T1: confidence 40%" in told[1]] == [True, True]
    assert text.index("look at") < text.index("head_top")
    sure = tuple(replace(bolt, is_sure=True) for bolt in bolts)
    assert "every bolt is sure" in text_of(describe_prior(replace(prior, bolts=sure)))


def test_a_prior_with_a_free_roll_says_so() -> None:
    prior = results.cube_prior()
    free = replace(prior, alignment=replace(prior.alignment, has_solenoid=False))

    assert "no solenoid" in text_of(describe_prior(free))
    assert "no solenoid" not in text_of(describe_prior(prior))


def test_a_name_keeps_its_brackets() -> None:
    prior = replace(results.cube_prior(), name="[red] motor")
    assert "prior '[red] motor'" in text_of(describe_prior(prior))
    assert "prior '[red] motor'" in text_of(describe_result(results.located(prior)))


def test_what_a_person_said_of_a_bolt_is_shown() -> None:
    prior = results.cube_prior()
    first, *rest = prior.bolts
    prior = replace(prior, bolts=(replace(first, name="[upper]", tool="hex 8", order=2), *rest))
    lines = text_of(describe_prior(prior)).splitlines()
    assert "T1: [upper], hex 8, turn 2" in [line.strip() for line in lines]
