"""The shape of a mark says what the camera saw, without its colour."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from boltpose.picture.bolt_marks import Ink
from boltpose.viewer.glyphs import ARROW_MM, bolt_shape, ellipsoid_axes


@pytest.mark.parametrize("ink", [Ink.SEEN, Ink.PARTIAL, Ink.HIDDEN])
def test_an_arrow_points_out_of_the_head(ink: Ink) -> None:
    vertices = bolt_shape(ink, 10.0, 4.0).vertices
    assert vertices[:, 2].max() == pytest.approx(ARROW_MM)
    assert vertices[:, 2].min() == pytest.approx(-3.7, abs=0.1)


def test_a_contradicted_bolt_has_no_arrow_and_a_cross_wider_than_any_head() -> None:
    vertices = bolt_shape(Ink.FORBIDDEN, 10.0, 4.0).vertices
    assert vertices[:, 2].max() < 5
    assert np.ptp(vertices[:, 0]) > np.ptp(bolt_shape(Ink.SEEN, 10.0, 4.0).vertices[:, 0])


def test_no_two_marks_have_the_same_shape() -> None:
    shapes = [bolt_shape(ink, 10.0, 4.0).vertices.tobytes() for ink in Ink]
    assert len(set(shapes)) == len(Ink)


def test_faces_name_vertices_that_exist() -> None:
    for ink in Ink:
        shape = bolt_shape(ink, 10.0, 4.0)
        assert shape.faces.min() == 0
        assert shape.faces.max() == len(shape.vertices) - 1


def test_the_ellipsoid_is_that_of_the_covariance() -> None:
    turn = Rotation.from_rotvec([0.3, -0.2, 0.9]).as_matrix()
    covariance = turn @ np.diag([0.01, 0.04, 0.25]) @ turn.T
    axes, directions = ellipsoid_axes(covariance)
    np.testing.assert_allclose(directions @ np.diag(axes**2) @ directions.T, covariance, atol=1e-12)
    assert np.linalg.det(directions) == pytest.approx(1.0)
