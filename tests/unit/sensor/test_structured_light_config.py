from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from boltpose.errors import ConfigError
from boltpose.sensor.hand_held_config import HandHeldConfig, sample_hand_held
from boltpose.sensor.structured_light_config import (
    StructuredLightConfig,
    sample_structured_light,
)


@pytest.mark.parametrize("config", [StructuredLightConfig, HandHeldConfig])
def test_no_number_may_be_nan(config: type) -> None:
    for entry in fields(config):
        if isinstance(entry.default, float):
            with pytest.raises(ConfigError, match=f"{entry.name} must be finite"):
                config(**{entry.name: float("nan")})


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"noise_mm": -0.1}, "noise_mm must be >= 0"),
        ({"smoothing": 1.5}, "smoothing must be at most 1"),
        ({"working_distance_mm": 0.0}, "working_distance_mm must be > 0"),
        ({"noise_shot_share": 0.8}, "noise_shot_share"),
        ({"saturation_signal": 0.01}, "saturation_signal 0.01 must exceed"),
        ({"scale_error": 0.2}, "scale_error must be within 0.05"),
        ({"min_neighbours": 9}, "min_neighbours must be at most 8"),
        ({"max_incidence_deg": 120.0}, "max_incidence_deg"),
    ],
)
def test_cameras_that_cannot_be_are_refused(change: dict[str, float], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        StructuredLightConfig(**change)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"directions": 0}, "directions must be >= 1"),
        ({"cell_mm": 0.0}, "cell_mm must be > 0"),
        ({"stray_share": 1.5}, "stray_share must be at most 1"),
        ({"triangulation_deg": 85.0}, "triangulation_deg"),
        ({"saturation_signal": 0.01}, "saturation_signal"),
        ({"max_incidence_deg": 0.0}, "max_incidence_deg"),
    ],
)
def test_scanners_that_cannot_be_are_refused(change: dict[str, float], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        HandHeldConfig(**change)


def test_sampled_settings_are_valid_differ_and_repeat() -> None:
    for sample in (sample_structured_light, sample_hand_held):
        drawn = [sample(np.random.default_rng(seed)) for seed in range(200)]
        assert len(set(map(repr, drawn))) == 200
        assert drawn[7] == sample(np.random.default_rng(7))
