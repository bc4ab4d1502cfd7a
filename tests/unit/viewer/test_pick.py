"""What is under the mouse."""

from __future__ import annotations

import numpy as np

from boltpose.viewer.pick import PickLayer, pick_point

GRID = np.stack(np.meshgrid(np.arange(-50.0, 51), np.arange(-50.0, 51)), axis=-1).reshape(-1, 2)


def sheet(name: str, z: float) -> PickLayer:
    points = np.column_stack([GRID, np.full(len(GRID), z)])
    return PickLayer(name=name, points=points, spacing_mm=1.0)


def test_the_front_surface_is_met_at_the_point_nearest_to_the_ray() -> None:
    front, back = sheet("front", 100.0), sheet("back", 130.0)
    hit = pick_point([back, front], np.zeros(3), np.array([0.104, 0.0, 1.0]))
    assert hit is not None
    layer, row = hit
    assert layer is front
    np.testing.assert_allclose(front.points[row], [10, 0, 100])


def test_a_hidden_layer_is_clicked_through_and_nothing_lies_behind_the_viewer() -> None:
    front, back = sheet("front", 100.0), sheet("back", 130.0)
    front.is_shown = False
    hit = pick_point([front, back], np.zeros(3), np.array([0.0, 0.0, 2.0]))
    assert hit is not None
    assert hit[0] is back
    assert pick_point([front, back], np.zeros(3), np.array([0.0, 0.0, -1.0])) is None


def test_a_ray_beside_all_meets_nothing() -> None:
    assert pick_point([sheet("a", 100.0)], np.zeros(3), np.array([1.0, 0.0, 0.5])) is None
    assert pick_point([], np.zeros(3), np.array([1.0, 0.0, 0.5])) is None
