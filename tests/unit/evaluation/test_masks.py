from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from boltpose.errors import InputFileError
from boltpose.evaluation.masks import MaskCounts, count_mask, score_masks


def _images(tmp_path: Path) -> tuple[Path, Path]:
    depth = np.array([[5, 0, 7], [9, 9, 0]], dtype=np.uint16)
    label = np.array([[1, 6, 0], [6, 0, 0]], dtype=np.uint8)
    for name, array in (("depth", depth), ("label", label)):
        Image.fromarray(array).save(tmp_path / f"{name}.png")
    return tmp_path / "depth.png", tmp_path / "label.png"


def test_pixels_without_a_measurement_do_not_count(tmp_path: Path) -> None:
    # measured, row by row: motor, background, motor, background
    found = count_mask(np.array([True, True, False, False]), *_images(tmp_path))
    assert found == MaskCounts(
        motor_as_motor=1, motor_as_background=1, background_as_motor=1, background_as_background=1
    )
    assert found.points == 4


def test_a_mask_of_another_scan_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match="found 4 measured pixels, wanted 5"):
        count_mask(np.zeros(5, dtype=bool), *_images(tmp_path))


def test_views_are_scored_together() -> None:
    right = MaskCounts(
        motor_as_motor=30, motor_as_background=0, background_as_motor=0, background_as_background=60
    )
    wrong = MaskCounts(
        motor_as_motor=0, motor_as_background=10, background_as_motor=0, background_as_background=0
    )
    scores = score_masks([right, wrong])
    assert scores is not None
    assert scores.views == 2
    assert scores.overall_accuracy == pytest.approx(0.9)
    assert scores.mean_iou == pytest.approx((30 / 40 + 60 / 70) / 2)
    assert score_masks([]) is None
