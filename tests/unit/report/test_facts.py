from __future__ import annotations

from dataclasses import asdict, replace

from boltpose.locate_config import LocateConfig
from boltpose.registration.config import VerifyConfig
from boltpose.registration.joint import JointConfig
from boltpose.report.facts import changed_settings, fact_section
from boltpose.schema import Status, VariantScore
from boltpose.variant_search import VariantConfig
from tests.support import results
from tests.unit.report.conftest import parse


def test_defaults_are_no_changes_also_after_a_file() -> None:
    provenance = {
        "config": asdict(LocateConfig()),
        "joint": asdict(JointConfig()),
        "variants": {"priors": 3, "compared": ["a"], **asdict(VariantConfig())},
    }
    assert changed_settings(provenance) == []


def test_a_changed_threshold_is_told_and_a_picture_is_no_change() -> None:
    config = LocateConfig(verification=VerifyConfig(min_tight=0.5), label_scan=True)
    assert changed_settings({"config": asdict(config)}) == [
        ("config.verification.min_tight", "0.5")
    ]


def test_a_setting_that_this_version_lacks_is_told() -> None:
    config = {**asdict(LocateConfig()), "old_knob": 3}
    assert changed_settings({"config": config}) == [("config.old_knob", "3")]


def test_hashes_times_and_motors_tried_are_shown() -> None:
    result = replace(
        results.located(results.cube_prior()),
        provenance={
            "version": "9.9",
            "scan": ["a.ply", "b.ply"],
            "scan_sha256": ["1" * 64, "2" * 64],
            "prior_sha256": "3" * 64,
            "models": {"scene.onnx": "4" * 64},
        },
        variants=tuple(
            VariantScore(name=f"m{n}", status=Status.REFUSED, p_correct=0.0, score=score)
            for n, score in enumerate([0.9, 0.8, 0.7, 0.6, 0.5, 0.4, float("-inf")])
        ),
    )
    section = parse(fact_section(result, {"registration": 1234.4, "bolts": 100.0}))

    assert "1.33 s = registration 1234 ms + bolts 100 ms" in section.text
    assert "boltpose 9.9" in section.text
    assert {code.attributes["title"] for code in section.all("code")} == {
        digit * 64 for digit in "1234"
    }
    assert "scan b.ply 222222222222" in section.text
    assert "m4 0.50" in section.text
    assert "and 2 more" in section.text
    assert "not noted" in section.text  # the settings


def test_provenance_may_hold_anything() -> None:
    result = replace(
        results.located(results.cube_prior()),
        provenance={
            "version": ["<b>"],
            "config": {"verification": 7, "tool": {"x": [1, {}]}},
            "joint": "?",
            "models": ["a"],
            "scan": {"a": 1},
            "scan_sha256": [None, 3, "5" * 64],
            "inputs": [1],
        },
    )
    section = parse(fact_section(result, None))

    assert not section.all("b")
    assert "config.verification = 7" in section.text
