from __future__ import annotations

import numpy as np
import pytest

from boltpose.geometry.transforms import Transform
from boltpose.picture.paint import paint_finely, typical_spacing_mm
from boltpose.picture.view import frame_subject


def grid(count: int, pitch_mm: float) -> np.ndarray:
    ticks = pitch_mm * np.arange(count)
    x, y = (part.ravel() for part in np.meshgrid(ticks, ticks))
    return np.stack([x, y, np.full_like(x, 700.0)], axis=1)


@pytest.mark.parametrize(
    ("count", "pitch_mm"),
    # few points; many, measured in columns; many but so sparse that columns would not do
    [(50, 0.5), (300, 0.5), (300, 3.0)],
)
def test_the_spacing_of_a_grid_is_its_pitch(count: int, pitch_mm: float) -> None:
    assert typical_spacing_mm(grid(count, pitch_mm)) == pytest.approx(pitch_mm)


def test_no_points_give_an_empty_picture() -> None:
    subject = grid(5, 10.0)
    view = frame_subject(Transform.identity("view", "camera"), subject, width=40, height=30)

    image = paint_finely(view, np.zeros((0, 3)), np.zeros((0, 3)), 2)

    assert image.shape == (60, 80, 3)
    assert (image == 1).all()
