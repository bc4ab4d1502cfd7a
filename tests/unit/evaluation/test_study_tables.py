from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.stats import kendalltau

from boltpose.errors import ConfigError
from boltpose.evaluation.study_curve import draw_curve
from boltpose.evaluation.study_paper import PAPER
from boltpose.evaluation.study_records import StudyRecord
from boltpose.evaluation.study_rows import ROWS
from boltpose.evaluation.study_statistics import (
    METRICS,
    MeanSpread,
    PairOrder,
    compare_orders,
    kendall_tau,
    mean_spread,
    paired_difference,
    table_records,
)
from boltpose.evaluation.study_tables import render_study, study_as_json
from tests.unit.evaluation.study_samples import record, row

ORDER = ("pointnet", "pointnet2", "dgcnn", "pct")
"""As the paper has it by overall accuracy and mIoU."""


def backbones(*shares: int, folds: int = 3) -> list[StudyRecord]:
    """Table 2 with so many per cent right, a point more from split to split."""
    return [
        record(row("table2", name), f"split{fold}", share + fold)
        for name, share in zip(ORDER, shares, strict=True)
        for fold in range(folds)
    ]


def cells(text: str, start: str) -> list[str]:
    (line,) = (line for line in text.splitlines() if line.startswith(f"| {start} |"))
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_a_row_shows_mean_and_spread_beside_the_papers_numbers() -> None:
    text = render_study(backbones(60, 70, 80, 90), tables=["table2"])

    # 80, 81, 82 of 100 points right in both classes
    iou = [100 * share / (200 - share) for share in (80, 81, 82)]
    spread = mean_spread(iou)
    assert spread is not None
    shown = f"{spread.mean:.2f} +- {spread.deviation:.2f}"
    assert cells(text, "dgcnn") == [
        "dgcnn", "1.40 M", "3", "81.00 +- 1.00", "84.57", shown, "75.07", shown, "48.04", "10",
    ]  # fmt: skip


def test_rows_stand_in_the_papers_order_whatever_order_records_have() -> None:
    text = render_study(backbones(60, 70, 80, 90)[::-1], tables=["table2"])

    assert re.findall(r"^\| (\w+) \| 1\.40", text, re.MULTILINE) == list(ORDER)


def test_the_papers_order_is_found_again() -> None:
    text = render_study(backbones(60, 70, 80, 90), tables=["table2"])

    assert "overall accuracy 6 of 6 (Kendall's tau 1.00); mIoU 6 of 6" in text
    # by bolt IoU the paper has PointNet++ 0.12 above DGCNN
    assert "bolt IoU 5 of 6 (Kendall's tau 0.67)" in text
    assert "other way round" not in text


def test_pairs_the_other_way_round_are_named_with_their_size() -> None:
    text = render_study(backbones(60, 90, 80, 70), tables=["table2"])

    assert "mIoU 3 of 6 (Kendall's tau 0.00)" in text
    for pair in ("dgcnn above pct", "pointnet2 above pct", "pointnet2 above dgcnn"):
        assert pair in text


def test_one_split_decides_no_order() -> None:
    text = render_study(backbones(60, 90, 80, 70, folds=1), tables=["table2"])

    assert "by more than the spread" not in text
    assert "3 other pair(s) the other way round" in text


def test_rows_without_runs_are_left_out_and_counted_by_splits() -> None:
    runs = [one for one in backbones(60, 70, 80, 90) if "dgcnn" not in one.run][:-1]
    text = render_study(runs, tables=["table2"])

    assert "| dgcnn |" not in text
    assert [cells(text, name)[2] for name in ("pointnet", "pct")] == ["3", "2"]


def test_effects_of_table_3_are_paired_over_splits_beside_the_papers() -> None:
    shares = {"2048": (60, 80), "2048 pretrain": (65, 85), "2048 warm-up": (60, 80)}
    runs = [
        record(row("table3", name), f"split{fold}", share)
        for name, both in shares.items()
        for fold, share in enumerate(both)
    ]

    text = render_study(runs, tables=["table3"])

    found = cells(text, "pretraining, without warm-up")
    # the splits differ by 20 points, the rows by 5 in each
    assert found[1:3] == ["+5.00 +- 0.00", "+8.23"]
    assert cells(text, "warm-up, from scratch")[1:3] == ["+0.00 +- 0.00", "+3.67"]
    assert "| warm-up, pretrained |" not in text


def test_binary_shows_no_bolts() -> None:
    text = render_study([record(row("binary", "binary"), "split0", 99)], tables=["binary"])

    assert cells(text, "binary")[3:7] == ["99.00", "99.80", "98.02", "99.07"]
    assert "bolt IoU, %" not in text


def test_the_curve_is_of_split_0_and_shows_the_picture_it_is_given() -> None:
    names = ("pct-small x0.5", "pct-small x1", "pct-small x2", "pointnet2 x1")
    runs = [record(row("curve", name), "split0", 80 + i) for i, name in enumerate(names)]
    extra = record(row("curve", "pct-small x1"), "split1", 10)

    text = render_study([*runs, extra], tables=["curve"], picture="images/learning_curve.png")

    assert "| pct-small | 1 | 768 | 81.00 |" in text
    assert "](images/learning_curve.png)" in text
    assert "mIoU of pct-small less that of pointnet2: -2.9 at 1 times" in text
    assert "](" not in render_study(runs, tables=["curve"])


def test_the_unit_budget_alone_is_no_curve() -> None:
    assert (
        render_study([record(row("curve", "pct-small x1"), "split0", 80)], tables=["curve"]) == ""
    )


def test_families_left_out_do_not_mix_with_splits() -> None:
    pct = row("honest", "pct")
    runs = [
        record(pct, "without-family_1", 70),
        record(pct, "without-family_2", 80),
        record(pct, "split0", 95),
    ]

    honest = render_study(runs, tables=["honest"])
    assert cells(honest, "pct")[1:3] == ["2", "75.00 +- 7.07"]
    assert cells(honest, "pct")[-1] == "53.85 (family_1)"
    assert cells(render_study(runs, tables=["table2"]), "pct")[2] == "1"


def test_no_runs_give_no_text() -> None:
    assert render_study([]) == ""


def test_what_must_not_be_overlooked_is_said() -> None:
    runs = backbones(60, 70, 80, 90)
    text = render_study(runs, tables=["table2"])

    assert text.startswith("**Simulated data.** Made by `boltpose reproduce`: 12 runs, 2.0 hours")
    assert "4.0 for 4 pretrainings" in text
    assert "Commit abc123" in text
    assert "not one budget" not in text
    other = record(row("table2", "pct"), "split4", 90, budget="quick")
    assert "not one budget" in render_study([*runs, other], tables=["table2"])


def test_the_same_runs_as_json() -> None:
    found = study_as_json(backbones(60, 70, 80, 90), ["table2", "table3"])

    assert list(found) == ["table2"]
    assert found["table2"]["pct"]["folds"] == ["split0", "split1", "split2"]
    assert found["table2"]["pct"]["overall accuracy"] == {
        "count": 3,
        "mean": pytest.approx(91),
        "deviation": pytest.approx(1),
    }
    assert found["table2"]["pct"]["paper"]["mean_iou"] == PAPER["table2"]["pct"].mean_iou


@settings(deadline=None)
@given(st.permutations(range(4)), st.integers(1, 5))
def test_kendalls_tau_is_scipys(order: list[int], folds: int) -> None:
    shares = [60 + 5 * place for place in order]
    rows = table_records("table2", backbones(*shares, folds=folds))
    paper = {name: one.mean_iou for name, one in PAPER["table2"].items()}

    tau = kendall_tau(compare_orders(rows, paper, METRICS["mIoU"]))

    assert tau == pytest.approx(kendalltau(shares, [paper[name] for name in ORDER]).statistic)


def test_rows_that_share_no_split_are_not_compared() -> None:
    runs = [
        record(row("table2", "pct"), "split0", 90),
        record(row("table2", "dgcnn"), "split1", 80),
    ]
    rows = table_records("table2", runs)

    assert paired_difference(rows["pct"], rows["dgcnn"], METRICS["mIoU"]) is None
    assert kendall_tau(compare_orders(rows, {"pct": 2.0, "dgcnn": 1.0}, METRICS["mIoU"])) is None
    assert "One row alone has no order." in render_study(runs[:1], tables=["table2"])


@pytest.mark.parametrize(
    ("mean", "deviation", "agrees", "beyond"),
    [(2, 1, True, True), (-2, 1, False, True), (-1, 2, False, False), (3, None, True, False)],
)
def test_a_difference_counts_when_it_is_larger_than_its_spread(
    mean: float, deviation: float | None, agrees: bool, beyond: bool
) -> None:
    pair = PairOrder(
        lower="a", higher="b", difference=MeanSpread(count=5, mean=mean, deviation=deviation)
    )
    assert (pair.is_as_in_paper, pair.is_beyond_spread) == (agrees, beyond)


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_the_curve_is_drawn_the_same_every_time(tmp_path: Path, suffix: str) -> None:
    runs = [record(one, "split0", 70 + i) for i, one in enumerate(ROWS["curve"])]
    paths = [tmp_path / f"{name}{suffix}" for name in "ab"]

    for path, order in zip(paths, (runs, runs[::-1]), strict=True):
        draw_curve(order, path)

    assert paths[0].read_bytes() == paths[1].read_bytes()
    if suffix == ".png":
        with Image.open(paths[0]) as image:
            assert image.width > 600
        draw_curve([replace(runs[0], run=runs[0].run)], paths[1])
        assert paths[0].read_bytes() != paths[1].read_bytes()


def test_a_curve_without_runs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="boltpose reproduce curve"):
        draw_curve(backbones(60, 70, 80, 90)[-1:], tmp_path / "curve.png")
    assert not list(tmp_path.iterdir())
