from __future__ import annotations

import re

import numpy as np
import pytest

from boltpose.geometry.transforms import Transform
from boltpose.report.markup import tag
from boltpose.viewer.bolt_tips import Tip, lay_tips

FOV_RAD = np.radians(40)
ASPECT = 1.5


def tip(position: tuple[float, float, float], name: str = "B1") -> Tip:
    return Tip(bolt_id=name, name=name, position_mm=np.array(position), text=tag("p", f"<{name}>"))


def places(tips: list[Tip], page_from_view: Transform) -> dict[str, tuple[float, float]]:
    html = lay_tips(tips, page_from_view, fov_rad=FOV_RAD, aspect=ASPECT)
    found = re.findall(r'data-tip="(\w+)" style="left:([\d.]+)vh;top:([\d.]+)vh', html)
    return {name: (float(left), float(top)) for name, left, top in found}


STRAIGHT = Transform.identity("page", "view")


def test_spots_lie_where_a_pinhole_puts_the_names() -> None:
    half = float(np.tan(FOV_RAD / 2))
    found = places(
        [
            tip((0.0, 0.0, 100.0), "MIDDLE"),
            tip((0.0, 50 * half, 100.0), "LOW"),
            tip((-60 * half * ASPECT, 0.0, 100.0), "LEFT"),
        ],
        STRAIGHT,
    )

    # a hundredth of the height is 1 vh; the picture is 150 wide
    assert found["MIDDLE"] == pytest.approx((75.0, 50.0), abs=0.01)
    assert found["LOW"] == pytest.approx((75.0, 75.0), abs=0.01)
    assert found["LEFT"] == pytest.approx((30.0, 50.0), abs=0.01)


def test_the_view_moves_them() -> None:
    turned = Transform.from_parts(
        "page", "view", np.diag([-1.0, 1.0, -1.0]), np.array([0.0, 0.0, 300.0])
    )
    point = (10.0, 0.0, 100.0)

    assert places([tip(point)], STRAIGHT)["B1"][0] > 75
    assert places([tip(point)], turned)["B1"][0] < 75


@pytest.mark.parametrize(
    "position", [(0.0, 0.0, -100.0), (0.0, 0.0, 0.0), (200.0, 0.0, 100.0), (0.0, -90.0, 100.0)]
)
def test_what_is_not_in_the_picture_has_none(position: tuple[float, float, float]) -> None:
    assert places([tip(position)], STRAIGHT) == {}


def test_texts_are_escaped_and_turn_into_the_picture() -> None:
    html = lay_tips(
        [tip((30.0, 30.0, 100.0), "A"), tip((-30.0, -30.0, 100.0), "B")],
        STRAIGHT,
        fov_rad=FOV_RAD,
        aspect=ASPECT,
    )

    assert "&lt;A&gt;" in html
    assert re.findall(r'class="bptip ([a-z ]+)"', html) == ["up left", "down right"]
