from __future__ import annotations

import math

import numpy as np
import pytest

from boltpose.errors import ConfigError
from boltpose.robot import Order, RobotConfig
from boltpose.robot.config import parse_direction


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ({"approach_mm": 0.0}, "approach_mm must be 1 to 1000 mm, got 0.0"),
        ({"approach_mm": math.nan}, "approach_mm"),
        ({"retreat_mm": 1e6}, "retreat_mm"),
        ({"contact_offset_mm": -200.0}, "contact_offset_mm"),
        ({"contact_offset_mm": -60.0}, "does not leave the bolt's head"),
        ({"tool_x": "x"}, "tool_x must be"),
        ({"tool_x": "0,0,0"}, "tool_x must be"),
        ({"tool_x": "1,2"}, "tool_x must be"),
        ({"tool_x": "nan,0,1"}, "tool_x must be"),
        ({"order": "random"}, "order must be nearest or confidence, got 'random'"),
        ({"min_confidence": 1.5}, "min_confidence must be 0 to 1, got 1.5"),
        ({"min_tool_fits": -0.1}, "min_tool_fits"),
        ({"max_sigma_mm": 0.0}, "max_sigma_mm must be positive"),
        ({"max_sigma_axis_deg": math.inf}, "max_sigma_axis_deg"),
        ({"fanuc_user_frame": -1}, "fanuc_user_frame"),
        ({"fanuc_tool": 0}, "fanuc_tool"),
        ({"fanuc_config": "whatever"}, "fanuc_config must look like"),
        ({"fanuc_config": "N U T, 0, 0, 0',\n"}, "fanuc_config"),
        ({"fanuc_first_register": 0}, "fanuc_first_register"),
        ({"fanuc_count_register": 0}, "fanuc_count_register"),
        ({"ros_frame": "base link"}, "ros_frame"),
    ],
)
def test_bad_settings(setting, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        RobotConfig(**setting)


def test_a_name_from_a_file_becomes_the_enum() -> None:
    assert RobotConfig(order="confidence").order is Order.CONFIDENCE


def test_directions() -> None:
    np.testing.assert_array_equal(parse_direction("-y"), [0, -1, 0])
    np.testing.assert_allclose(parse_direction("3, 0, -4"), [0.6, 0, -0.8])
    assert parse_direction("inward") == "inward"


@pytest.mark.parametrize("text", ["N U T, 0, 0, 0", "F D B, -1, 0, 1", "N U L T, 0, 0, 0"])
def test_configurations_as_controllers_write_them(text: str) -> None:
    assert RobotConfig(fanuc_config=text).fanuc_config == text
