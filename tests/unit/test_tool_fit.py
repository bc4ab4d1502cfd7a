from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from boltpose.errors import ConfigError, ShapeError
from boltpose.tool_fit import ToolTolerance, disc_probability, tool_fit_probability

SIGMAS = st.floats(0.01, 3.0)


@given(sigma=SIGMAS, radius=st.floats(0.01, 100.0))
def test_a_round_distribution_is_rayleigh(sigma: float, radius: float) -> None:
    expected = -math.expm1(-0.5 * (radius / sigma) ** 2)
    assert disc_probability(sigma, sigma, radius) == pytest.approx(expected, abs=1e-8)


@given(first=SIGMAS, second=SIGMAS, radius=st.floats(0.05, 5.0))
def test_the_order_of_the_components_does_not_matter(
    first: float, second: float, radius: float
) -> None:
    one, other = disc_probability(first, second, radius), disc_probability(second, first, radius)
    assert one == pytest.approx(other, abs=1e-7)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_it_is_the_share_of_sampled_bolts_that_the_tool_meets(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn = Rotation.random(rng=rng).as_matrix()
    covariance = turn @ np.diag([0.01, 0.09, 0.16]) @ turn.T
    axis = Rotation.random(rng=rng).as_matrix()[:, 2]
    tilt, height = 0.02, 8.0
    tool = ToolTolerance(lateral_mm=0.45, axial_mm=0.5, angle_rad=0.03)
    stated = tool_fit_probability(covariance, axis, tilt, height, tool)

    count = 400_000
    top = rng.multivariate_normal(np.zeros(3), covariance, count)
    frame = np.linalg.svd(axis[None])[2][1:]
    foot = rng.normal(scale=tilt, size=(count, 2))  # the lever's draw and the angle's are one
    lateral = np.linalg.norm(top @ frame.T + height * foot, axis=1) <= tool.lateral_mm
    meets = lateral.mean()
    assert tool_fit_probability(
        covariance, axis, tilt, height, ToolTolerance(lateral_mm=0.45)
    ) == pytest.approx(meets, abs=5 * math.sqrt(0.25 / count))
    # window along the axis and angle are independent of it where the ellipsoid is not askew
    straight = np.diag([0.01, 0.09, 0.16])
    alone = tool_fit_probability(
        straight, np.array([0.0, 0.0, 1.0]), tilt, 0.0, ToolTolerance(lateral_mm=0.45)
    )
    both = tool_fit_probability(straight, np.array([0.0, 0.0, 1.0]), tilt, 0.0, tool)
    draws = rng.multivariate_normal(np.zeros(3), straight, count)
    angle = np.linalg.norm(rng.normal(scale=tilt, size=(count, 2)), axis=1)
    fits = (np.hypot(draws[:, 0], draws[:, 1]) <= 0.45) & (np.abs(draws[:, 2]) <= 0.5)
    fits &= angle <= 0.03
    assert both == pytest.approx(fits.mean(), abs=5 * math.sqrt(0.25 / count))
    assert both < alone
    assert 0 < stated < 1


def test_more_play_never_fits_worse() -> None:
    covariance, axis = np.diag([0.02, 0.05, 0.1]), np.array([0.0, 0.6, 0.8])
    fits = [
        tool_fit_probability(covariance, axis, 0.01, 6.0, ToolTolerance(lateral_mm=play))
        for play in (0.01, 0.1, 0.3, 1.0, 10.0, 1000.0)
    ]
    assert (np.diff(fits) > -1e-9).all()
    assert fits[-1] == pytest.approx(1.0)


@pytest.mark.parametrize("field", ["lateral_mm", "axial_mm", "angle_rad"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_a_tolerance_is_positive(field: str, value: float) -> None:
    with pytest.raises(ConfigError, match=field):
        ToolTolerance(**{"lateral_mm": 1.0, field: value})


def test_shapes_are_checked() -> None:
    with pytest.raises(ShapeError, match="covariance_mm2"):
        tool_fit_probability(np.eye(2), np.eye(3)[2], 0.0, 1.0, ToolTolerance(lateral_mm=1.0))
