from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boltpose.errors import DegenerateGeometryError
from boltpose.geometry.transforms import Transform
from boltpose.picture.view import frame_subject, look_along

SEEDS = st.integers(0, 2**32 - 1)


@given(seed=SEEDS, is_pinhole=st.booleans(), margin=st.floats(0.0, 0.3))
def test_subject_lies_inside_and_touches_two_borders(
    seed: int, is_pinhole: bool, margin: float
) -> None:
    rng = np.random.default_rng(seed)
    subject = rng.uniform(-80, 80, (30, 3)) + np.array([rng.uniform(-50, 50), 0.0, 600.0])

    view = frame_subject(
        Transform.identity("view", "camera"),
        subject,
        width=400,
        height=300,
        margin=margin,
        is_pinhole=is_pinhole,
    )

    place = view.project(subject)[:, :2]
    size = np.array([400, 300])
    low, high = margin * size, (1 - margin) * size
    assert (place >= low - 1e-6).all()
    assert (place <= high + 1e-6).all()
    slack = np.minimum(place.min(axis=0) - low, high - place.max(axis=0))
    assert slack.min() == pytest.approx(0, abs=1e-6)


def test_a_length_at_the_subjects_middle_is_true_to_scale() -> None:
    subject = np.array([[-50.0, -40, 700], [50, 40, 700], [0, 0, 700]])
    for is_pinhole in (False, True):
        view = frame_subject(
            Transform.identity("view", "camera"),
            subject,
            width=300,
            height=300,
            is_pinhole=is_pinhole,
        )
        ends = view.project(np.array([[0.0, 0, 700], [10, 0, 700]]))

        assert ends[1, 0] - ends[0, 0] == pytest.approx(10 * view.pixels_per_mm)


def test_a_subject_behind_a_pinhole_is_refused() -> None:
    behind = np.array([[0.0, 0, -500], [10, 0, -500], [0, 10, -500]])
    with pytest.raises(DegenerateGeometryError, match="in front of the camera"):
        frame_subject(
            Transform.identity("view", "camera"), behind, width=10, height=10, is_pinhole=True
        )


def test_one_point_is_shown_in_its_surroundings() -> None:
    view = frame_subject(
        Transform.identity("view", "camera"), np.zeros((1, 3)), width=100, height=100, margin=0.0
    )

    assert view.pixels_per_mm == pytest.approx(1.0)
    np.testing.assert_allclose(view.project(np.zeros((1, 3)))[0, :2], (50, 50))


@given(seed=SEEDS)
def test_the_target_is_ahead_at_the_distance_and_up_is_up(seed: int) -> None:
    rng = np.random.default_rng(seed)
    direction, up, target = rng.normal(size=(3, 3))

    view_from_scene = look_along(direction, up, target * 100, "prior", 250.0)

    np.testing.assert_allclose(view_from_scene.apply(target * 100), (0, 0, 250), atol=1e-6)
    # y of the picture points down
    assert view_from_scene.rotate(up)[1] <= 1e-9
    assert abs(view_from_scene.rotate(up)[0]) < 1e-9


def test_looking_along_up_still_gives_a_picture() -> None:
    down = np.array([0.0, 0, -1])

    view_from_scene = look_along(down, np.array([0.0, 0, 1]), np.zeros(3), "base", 10.0)

    np.testing.assert_allclose(view_from_scene.rotate(down), (0, 0, 1), atol=1e-12)
