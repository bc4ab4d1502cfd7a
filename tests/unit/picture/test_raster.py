from __future__ import annotations

import numpy as np
import pytest

from boltpose.geometry.transforms import Transform
from boltpose.picture.raster import light, rasterise, shrink
from boltpose.picture.view import View


def looking_down_z(size: int = 60, scale: float = 1.0) -> View:
    return View(
        view_from_scene=Transform.identity("view", "scene"),
        scale=scale,
        centre=(size / 2, size / 2),
        width=size,
        height=size,
        is_pinhole=False,
        focus_mm=100.0,
    )


def grid(step: float, reach: float, depth: float) -> np.ndarray:
    ticks = np.arange(-reach, reach + step / 2, step)
    x, y = (a.ravel() for a in np.meshgrid(ticks, ticks))
    return np.stack([x, y, np.full_like(x, depth)], axis=1)


def test_the_nearest_point_wins_whatever_the_order() -> None:
    far, near = grid(1, 20, 120.0), grid(1, 5, 80.0)
    view = looking_down_z()
    images = []
    for points in (np.vstack([far, near]), np.vstack([near, far])):
        image = rasterise(view, points, 1.5)
        np.testing.assert_array_equal(
            image.depth[image.filled], points[image.index, 2].astype(np.float32)[image.filled]
        )
        images.append(image)

    np.testing.assert_array_equal(images[0].depth, images[1].depth)
    assert images[0].depth[30, 30] == 80.0
    assert images[0].depth[15, 15] == 120.0


def test_splats_as_wide_as_the_spacing_close_a_surface() -> None:
    points = grid(3.0, 24.0, 100.0)

    open_image = rasterise(looking_down_z(), points, 0.5)
    closed = rasterise(looking_down_z(), points, 4.0)

    inner = slice(10, 50)
    assert not open_image.filled[inner, inner].all()
    assert closed.filled[inner, inner].all()


def test_points_behind_the_viewer_or_outside_are_not_drawn() -> None:
    points = np.array([[0.0, 0, -5], [500, 0, 50], [0, -500, 50]])

    image = rasterise(looking_down_z(), points, 1.0)

    assert not image.filled.any()
    assert np.isinf(image.depth).all()


def test_nothing_to_draw_gives_an_empty_dark_image() -> None:
    view = looking_down_z()
    image = rasterise(view, np.zeros((0, 3)), 1.0)

    assert not light(image, view).any()


def test_a_slope_towards_the_lamp_is_brighter_than_one_away() -> None:
    view = looking_down_z()
    flat = grid(0.5, 28, 100.0)
    towards, away = flat.copy(), flat.copy()
    # the lamp is at the upper left: a surface that recedes to the lower right faces it
    towards[:, 2] += 0.4 * (-flat[:, 0] - flat[:, 1])
    away[:, 2] += 0.4 * (flat[:, 0] + flat[:, 1])
    middle = slice(20, 40)

    bright, dark = (
        light(rasterise(view, points, 1.0), view)[middle, middle].mean()
        for points in (away, towards)
    )

    assert abs(bright - dark) > 0.2


def test_light_is_between_zero_and_one_and_zero_on_nothing() -> None:
    view = looking_down_z()
    points = np.random.default_rng(0).uniform(-20, 20, (400, 3)) + np.array([0, 0, 100])
    image = rasterise(view, points, 2.0)

    brightness = light(image, view)

    assert brightness.min() >= 0
    assert brightness.max() <= 1
    assert (brightness[~image.filled] == 0).all()
    assert (brightness[image.filled] > 0).all()


def test_shrinking_averages_blocks() -> None:
    image = np.arange(4 * 4 * 3, dtype=np.float64).reshape(4, 4, 3)

    small = shrink(image, 2)

    assert small.shape == (2, 2, 3)
    np.testing.assert_allclose(small[0, 0], image[:2, :2].reshape(-1, 3).mean(axis=0))
    assert small.mean() == pytest.approx(image.mean())
