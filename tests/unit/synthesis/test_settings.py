from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import pytest

from boltpose.errors import ConfigError
from boltpose.synthesis.settings import DataSetSettings, Kind, choose_names, parse_size

SCENES = DataSetSettings(
    kind=Kind.SCENES, families=("a", "b", "c", "d"), views=2, clamps=("p", "q", "r", "s")
)


def test_settings_survive_json() -> None:
    assert DataSetSettings.from_json(SCENES.to_json()) == SCENES


def test_one_shot_per_clamping_is_not_spoken_of() -> None:
    # data sets made before there were angles can be read, and are made again byte by byte
    assert "angles" not in SCENES.to_json()
    several = replace(SCENES, angles=3)
    assert several.to_json()["angles"] == 3
    assert DataSetSettings.from_json(several.to_json()) == several


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"seed": -1}, "seed must be >= 0"),
        ({"families": ()}, "families must name at least one"),
        ({"views": 0}, "views must be 1 to 1000"),
        ({"clamps": ()}, "clamps must name at least one"),
        ({"width_px": 10}, "width_px must be 64"),
        ({"height_px": 5000}, "height_px must be 64 to 4096"),
        ({"angles": 0}, "angles must be 1 to 100"),
        ({"kind": Kind.MOTORS, "views": 0, "clamps": (), "angles": 2}, "has no angles"),
        ({"kind": Kind.MOTORS}, "neither views nor clamps"),
    ],
)
def test_settings_out_of_range_are_refused(change: dict[str, Any], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        replace(SCENES, **change)


@pytest.mark.parametrize("change", [{"seed": "x"}, {"more": 1}, {"kind": "photos"}])
def test_settings_of_another_form_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match="settings"):
        DataSetSettings.from_json({**SCENES.to_json(), **change})


def test_families_and_clamps_are_as_frequent_and_meet_each_other() -> None:
    pairs = Counter(
        (SCENES.family_of(sample), SCENES.clamp_of(sample, view))
        for sample in range(64)
        for view in range(2)
    )
    assert len(pairs) == 16
    assert set(pairs.values()) == {8}


def test_names_are_chosen_in_the_order_of_the_list() -> None:
    known = ("a", "b", "c")
    assert choose_names(None, known, "family") == known
    assert choose_names("c, a", known, "family") == ("a", "c")
    with pytest.raises(ConfigError, match="family must be one of a, b, c; got 'x'"):
        choose_names("a,x", known, "family")
    with pytest.raises(ConfigError, match="got none"):
        choose_names(" ,", known, "family")


def test_sizes_are_width_times_height() -> None:
    assert parse_size("1920x1200") == (1920, 1200)
    for text in ("1920", "x1200", "1920x", "-1x5", "wide"):
        with pytest.raises(ConfigError, match="WIDTHxHEIGHT"):
            parse_size(text)
