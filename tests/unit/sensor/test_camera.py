from __future__ import annotations

import numpy as np
import pytest

from boltpose.errors import ConfigError
from boltpose.sensor.camera import Chip, PinholeCamera


@pytest.mark.parametrize("chip", list(Chip))
def test_slopes_invert_the_matrix(chip: Chip) -> None:
    camera = chip.camera
    pixels = np.array([0, camera.width - 1, camera.width * camera.height - 1, 12345])

    across, down = camera.slopes(pixels)

    projected = np.stack([across, down, np.ones(4)], axis=1) @ camera.matrix.T
    np.testing.assert_allclose(projected[:, 1] * camera.width + projected[:, 0], pixels, atol=1e-6)


@pytest.mark.parametrize(
    ("chip", "distance_mm", "width_mm"),
    [
        (Chip.ZIVID_2_M70, 700, 754),
        (Chip.ZIVID_2_PLUS_M60, 600, 570),
        (Chip.ZIVID_2_PLUS_M130, 1300, 0.32 * 2448),
        (Chip.ZIVID_ONE_PLUS_M, 1000, 702),
    ],
)
def test_fields_of_view_are_those_of_the_data_sheets(
    chip: Chip, distance_mm: float, width_mm: float
) -> None:
    camera = chip.camera
    assert camera.width / camera.focal_px * distance_mm == pytest.approx(width_mm, rel=0.01)


def test_subsampling_keeps_the_field_of_view() -> None:
    full, half = Chip.ZIVID_2_PLUS_M60.camera, Chip.ZIVID_2_PLUS_M60_HALF.camera
    assert (half.width, half.height) == (1224, 1024)
    assert half.width / half.focal_px == full.width / full.focal_px


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"width": 4}, "width and height"),
        ({"focal_px": 0.0}, "focal_px must be > 0"),
        ({"focal_px": float("nan")}, "focal_px must be > 0"),
        ({"centre_px": (float("inf"), 0.0)}, "centre_px must be finite"),
    ],
)
def test_cameras_that_cannot_be_are_refused(change: dict[str, float], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        PinholeCamera(**({"width": 64, "height": 48, "focal_px": 50.0} | change))
    with pytest.raises(ConfigError, match="factor"):
        Chip.ZIVID_2_M70.camera.binned(0)
