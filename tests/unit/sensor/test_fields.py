from __future__ import annotations

import numpy as np

from boltpose.sensor.fields import image_field, surface_field


def test_image_fields_have_mean_0_variance_1_and_their_length() -> None:
    field = image_field((600, 500), 6.0, np.random.default_rng(0))

    assert field.shape == (600, 500)
    assert abs(field.mean()) < 0.05
    assert abs(field.std() - 1) < 0.05

    def correlation(step: int) -> float:
        return float(np.mean(field[:-step] * field[step:]))

    assert correlation(1) > 0.95
    assert abs(correlation(24)) < 0.05


def test_surface_fields_have_mean_0_variance_1_and_their_length() -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform(-150, 150, (20000, 3))
    values = np.array([surface_field(points, 10.0, np.random.default_rng(k)) for k in range(8)])
    near = np.array(
        [surface_field(points + (0.3, 0, 0), 10.0, np.random.default_rng(k)) for k in range(8)]
    )

    assert abs(values.mean()) < 0.05
    assert abs(values.std() - 1) < 0.1
    assert np.mean(values * near) > 0.9
    shuffled = rng.permutation(values, axis=1)
    assert abs(np.mean(values * shuffled)) < 0.05


def test_fields_belong_to_places() -> None:
    points = np.random.default_rng(2).uniform(-100, 100, (500, 3))
    order = np.random.default_rng(3).permutation(500)

    whole = surface_field(points, 20.0, np.random.default_rng(4))
    shuffled = surface_field(points[order], 20.0, np.random.default_rng(4))

    np.testing.assert_array_equal(whole[order], shuffled)
