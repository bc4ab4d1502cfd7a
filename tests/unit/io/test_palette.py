from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from boltpose.errors import InputFileError, ShapeError
from boltpose.io.palette import COLOR_TOLERANCE, PALETTE, colors_of_labels, labels_of_colors
from boltpose.schema import Part

PAPER = {
    Part.GEAR: (102, 140, 255),
    Part.CONNECTOR: (102, 255, 102),
    Part.BOLT: (247, 77, 77),
    Part.SOLENOID: (255, 165, 0),
    Part.ELECTRICAL_CONNECTOR: (255, 255, 0),
    Part.MAIN_HOUSING: (0, 100, 0),
    Part.BACKGROUND: (0, 0, 128),
}


def test_the_palette_is_the_papers() -> None:
    assert PALETTE == PAPER
    painted = colors_of_labels(np.array(list(PAPER)))
    assert painted.dtype == np.uint8
    assert [tuple(row) for row in painted.tolist()] == list(PAPER.values())


def test_every_colour_within_the_tolerance_is_its_class_and_no_other() -> None:
    steps = np.arange(-COLOR_TOLERANCE, COLOR_TOLERANCE + 1)
    cube = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    for part, rgb in PALETTE.items():
        around = np.clip(np.array(rgb) + cube, 0, 255).astype(np.uint8)
        assert set(labels_of_colors("a.ply", around)) == {part}
    # two classes are never both within reach
    nearest = min(np.abs(np.subtract(a, b)).max() for a, b in combinations(PALETTE.values(), 2))
    assert nearest > 2 * COLOR_TOLERANCE


@pytest.mark.parametrize("part", list(Part))
@pytest.mark.parametrize("channel", [0, 1, 2])
def test_one_step_beyond_the_tolerance_is_unknown(part: Part, channel: int) -> None:
    rgb = list(PALETTE[part])
    rgb[channel] += (COLOR_TOLERANCE + 1) * (1 if rgb[channel] < 128 else -1)
    with pytest.raises(InputFileError, match="on 1 point, wanted"):
        labels_of_colors("a.ply", [rgb])


def test_labels_keep_their_order() -> None:
    labels = np.random.default_rng(0).integers(0, 7, 5000).astype(np.uint8)
    np.testing.assert_array_equal(labels_of_colors("a", colors_of_labels(labels)), labels)
    assert labels_of_colors("a", np.zeros((0, 3), dtype=np.uint8)).shape == (0,)


def test_unknown_colours_are_named_with_their_number_the_most_frequent_first() -> None:
    rows = [(9, 9, 9)] * 2 + [(1, 2, 3)] * 5 + [(255, 255, 255)] + [(0, 0, 0)] + [(0, 100, 0)]
    with pytest.raises(InputFileError) as caught:
        labels_of_colors("scan.ply", rows)
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(
        "scan.ply: found the colour (1, 2, 3) on 5 points, (9, 9, 9) on 2 points, "
        "(0, 0, 0) on 1 point, 1 other colour on 1 point, wanted colours of the palette"
    )
    assert "bolt (247, 77, 77)" in text


@pytest.mark.parametrize("labels", [[7], [-1], [0.0], [[1]]])
def test_what_is_no_label_cannot_be_painted(labels: list[object]) -> None:
    with pytest.raises(ShapeError, match="labels must be"):
        colors_of_labels(np.array(labels))
