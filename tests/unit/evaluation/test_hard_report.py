import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boltpose.errors import EmptyScanError, InputFileError
from boltpose.evaluation.hard_fit import fit_probability, is_judged
from boltpose.evaluation.hard_picture import draw_verdict
from boltpose.evaluation.hard_records import (
    HardMotor,
    read_hard_motor,
    read_hard_motors,
    write_hard_motor,
)
from boltpose.evaluation.hard_report import area_under_curve, error_rates, judge_cases, sections
from boltpose.registration.probability import probability_correct
from boltpose.registration.probability_config import FEATURES
from tests.unit.evaluation.hard_samples import case, motors

scores = st.lists(st.tuples(st.integers(0, 5), st.booleans()), min_size=1, max_size=20)


def write(folder: Path, records: tuple[HardMotor, ...]) -> None:
    for record in records:
        write_hard_motor(folder / f"{record.data_set}_{record.motor}.json", record)


def test_records_come_back_as_they_were_but_for_the_fifth_digit(tmp_path: Path) -> None:
    write(tmp_path, motors())

    found = read_hard_motors(tmp_path)

    for record, truth in zip(found, motors(), strict=True):
        assert replace(record, cases=()) == replace(truth, cases=())
        for one, other in zip(record.cases, truth.cases, strict=True):
            assert replace(one, evidence=None) == replace(other, evidence=None)
            if one.evidence and other.evidence:
                assert one.evidence.tight == pytest.approx(other.evidence.tight, rel=1e-4)
            else:
                assert one.evidence is other.evidence is None


def test_records_of_other_evidence_are_refused(tmp_path: Path) -> None:
    write(tmp_path, motors()[:1])
    path = next(tmp_path.iterdir())
    path.write_text(path.read_text().replace('"sunk"', '"sank"'))

    with pytest.raises(InputFileError, match="those of today's evidence"):
        read_hard_motor(path)


@given(scores)
def test_area_under_the_curve_counts_pairs(pairs: list[tuple[int, bool]]) -> None:
    value = np.array([score for score, _ in pairs], dtype=float)
    right = np.array([flag for _, flag in pairs])

    found = area_under_curve(value, right)

    wins = [(r > w) + 0.5 * (r == w) for r in value[right] for w in value[~right]]
    assert found == pytest.approx(np.mean(wins)) if wins else math.isnan(found)


@given(scores)
def test_error_rates_are_those_of_a_threshold_on_every_score(pairs) -> None:
    value = np.array([score for score, _ in pairs], dtype=float)
    right = np.array([flag for _, flag in pairs])

    accepted, refused = error_rates(value, right)

    for row, threshold in enumerate([*np.unique(value), np.inf]):
        if right.any():
            assert refused[row] == pytest.approx(np.mean(value[right] < threshold))
        if not right.all():
            assert accepted[row] == pytest.approx(np.mean(value[~right] >= threshold))


def test_the_fit_tells_right_from_wrong_with_weights_that_are_not_negative() -> None:
    config = fit_probability(motors())

    assert all(getattr(config, name) >= 0 for name in FEATURES)
    tester = motors()[1]
    stated = [
        (probability_correct(c.evidence, config), c.is_wrong)
        for c in tester.cases
        if c.evidence and is_judged(c) and not c.is_starved
    ]
    assert min(p for p, is_wrong in stated if not is_wrong) > 0.5
    assert max(p for p, is_wrong in stated if is_wrong) < 0.5


def test_the_fit_never_looks_at_the_testers() -> None:
    chooser, tester = motors()
    spoiled = replace(tester, cases=tuple(replace(c, worst_bolt_mm=0.0) for c in tester.cases))

    assert fit_probability((chooser, tester)) == fit_probability((chooser, spoiled))


def test_a_fit_needs_both_sides() -> None:
    chooser = motors()[0]
    only_right = replace(chooser, cases=tuple(c for c in chooser.cases if not c.is_wrong))

    with pytest.raises(EmptyScanError, match="right and wrong"):
        fit_probability((only_right,))


def test_without_a_pose_nothing_is_accepted_and_half_right_poses_are_neither() -> None:
    judged = judge_cases(
        [
            replace(
                motors()[0],
                cases=(
                    case(None, math.inf),
                    case(0.999, 1.5, pose_kind="moved, raw", is_settled=False),
                ),
            )
        ]
    )

    assert judged.p_correct[0] == 0.0
    assert not judged.is_accepted[0]
    assert not judged.is_good.any()
    assert judged.is_wrong.tolist() == [True, False]


def test_the_report_counts_false_accepts_and_refusals(tmp_path: Path) -> None:
    fooled = replace(motors()[1], cases=(*motors()[1].cases, case(0.999, 9.0)))
    (tmp_path / "verdict").mkdir()
    write(tmp_path / "verdict", (motors()[0], fooled))

    text = "\n".join(sections(tmp_path))

    assert "**1 false accepts in 123 hard wrong cases**" in text
    assert "bolt_lost" in text
    assert "simulated" in text


def test_nothing_measured_gives_no_section_and_no_picture(tmp_path: Path) -> None:
    assert sections(tmp_path) == []
    assert not draw_verdict(tmp_path, tmp_path / "results.md")


def test_the_picture_has_the_same_bytes_for_the_same_numbers(tmp_path: Path) -> None:
    (tmp_path / "verdict").mkdir()
    write(tmp_path / "verdict", motors())

    assert draw_verdict(tmp_path, tmp_path / "results.md")
    first = (tmp_path / "images" / "verdict_roc.png").read_bytes()
    draw_verdict(tmp_path, tmp_path / "results.md")

    assert (tmp_path / "images" / "verdict_roc.png").read_bytes() == first


def test_motors_measured_after_the_limits_were_final_have_a_row_of_their_own(
    tmp_path: Path,
) -> None:
    early, late = (
        replace(record, data_set="factory", motor=name)
        for record, name in zip(motors(), ("motor_00010", "motor_00011"), strict=False)
    )
    (tmp_path / "verdict").mkdir()
    write(tmp_path / "verdict", (early, late))

    row = next(
        line
        for section in sections(tmp_path)
        for line in section.splitlines()
        if line.startswith("| blind")
    )

    wrong = sum(found.is_wrong for found in late.cases)
    assert row.split("|")[2].strip() == str(wrong)
    assert wrong != sum(found.is_wrong for record in (early, late) for found in record.cases)
