from pathlib import Path

import pytest

from boltpose.errors import InputFileError
from boltpose.evaluation.variants_picture import draw_variants
from boltpose.evaluation.variants_records import (
    FORMAT,
    VariantCase,
    VariantMotor,
    read_variant_motor,
    read_variant_motors,
    write_variant_motor,
)
from boltpose.evaluation.variants_report import sections
from boltpose.schema import Status


def case(named: str, *, is_ok: bool, is_known: bool = True, view: int = 0) -> VariantCase:
    return VariantCase(
        view=view,
        priors=18 if is_known else 17,
        is_known=is_known,
        named=named,
        status=Status.OK if is_ok else Status.REFUSED,
        failed=() if is_ok else ("unknown_motor",),
        reasons=() if is_ok else ("none fits",),
        agreements={"motor_001": 0.4, **({"motor_000": 0.9} if is_known else {})},
        registered=(named,),
        worst_bolt_mm=0.125 if is_ok and named == "motor_000" else None,
        cpu_s=2.0,
        one_prior_cpu_s=1.0,
    )


def motor() -> VariantMotor:
    cases = (
        case("motor_000", is_ok=True),
        case("motor_000", is_ok=False, view=1),
        case("motor_001", is_ok=True, view=2),
        case("motor_001", is_ok=False, is_known=False),
        case("motor_001", is_ok=True, is_known=False, view=1),
    )
    return VariantMotor(
        format=FORMAT, fingerprint="0", motor="motor_000", family="family", cases=cases
    )


def test_another_motor_reported_ok_is_wrong_known_or_not() -> None:
    record = motor()
    assert [record.is_right(case) for case in record.cases] == [True, False, False, False, False]
    assert [record.is_wrong(case) for case in record.cases] == [False, False, True, False, True]


def test_records_come_back_and_others_are_named(tmp_path: Path) -> None:
    write_variant_motor(tmp_path / "motor_000.json", motor())
    assert read_variant_motors(tmp_path) == (motor(),)
    bad = tmp_path / "bad.json"
    bad.write_text("{}")
    with pytest.raises(InputFileError, match=r"bad\.json: found .*, wanted a record"):
        read_variant_motor(bad)


def test_the_section_counts_right_and_wrong(tmp_path: Path) -> None:
    assert sections(tmp_path) == []
    assert not draw_variants(tmp_path, tmp_path / "results.md")
    (tmp_path / "variants").mkdir()
    write_variant_motor(tmp_path / "variants" / "motor_000.json", motor())

    text = "\n".join(sections(tmp_path))

    assert "simulated" in text
    assert "| 18 | 3 | 1 | 1 | 1 | 1.00 / 1 | 2.00 / 2.00 | 2.00 |" in text
    assert "| 17, left out | 2 | - | 1 | 1 |" in text
    assert "the lead is at least 0.50" in text
    assert draw_variants(tmp_path, tmp_path / "results.md")
    assert (tmp_path / "images" / "variants.png").stat().st_size < 200_000
