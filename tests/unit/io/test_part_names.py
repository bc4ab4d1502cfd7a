from __future__ import annotations

from pathlib import Path

import pytest

from boltpose.errors import ConfigError, InputFileError
from boltpose.io import match_part_names, read_part_names
from boltpose.schema import Part


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def test_names_and_patterns_in_the_order_of_the_file(tmp_path: Path) -> None:
    path = write(
        tmp_path / "a.yaml", "bolt_*: bolt\nHousing: MAIN_HOUSING\n7: gear\n'*': solenoid\n"
    )

    assert list(read_part_names(path).items()) == [
        ("bolt_*", Part.BOLT),
        ("Housing", Part.MAIN_HOUSING),
        ("7", Part.GEAR),
        ("*", Part.SOLENOID),
    ]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("bolt_1: srew", r"the class 'srew' for 'bolt_1', wanted one of background, main_housing"),
        ("bolt_1: 6", "the class '6'"),
        ("bolt_1: [bolt]", "the class"),
        ("- bolt", "no mapping"),
        ("{}", "no mapping"),
        ("# nothing", "no mapping"),
        ("a: [", "ParserError"),
        ("? [a]\n: bolt", "ConstructorError"),
        ("!!python/name:os.system : bolt", "ConstructorError"),
    ],
)
def test_other_content_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(InputFileError, match=reason):
        read_part_names(write(tmp_path / "a.yaml", text))


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match="no such file"):
        read_part_names(tmp_path / "a.yaml")


def test_exact_names_beat_patterns_and_the_first_pattern_wins() -> None:
    names_to_part = {
        "*": Part.MAIN_HOUSING,
        "bolt_*": Part.BOLT,
        "bolt_9": Part.GEAR,
        "x[1]": Part.SOLENOID,
    }
    found = match_part_names(["bolt_1", "bolt_9", "x[1]", "x1"], names_to_part)
    assert found == (Part.MAIN_HOUSING, Part.GEAR, Part.SOLENOID, Part.MAIN_HOUSING)


def test_case_matters() -> None:
    with pytest.raises(ConfigError, match="no class for the parts Bolt_1, Nut; the patterns are"):
        match_part_names(["Bolt_1", "Nut", "bolt_1"], {"bolt_*": Part.BOLT})
