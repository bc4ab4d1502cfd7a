from __future__ import annotations

import numpy as np

from boltpose.schema import Scan
from boltpose.viewer.sight import WORDS, MotorSight, Seen
from tests.unit.registration.scenes import motor_prior, pose, visible_points

POSE = pose(turn=(0.4, 1.9, 0.3))
PLATE_MM = 150.0
"""So far before the middle of the motor."""


def plate() -> np.ndarray:
    """Before the right half of the motor, and far beyond it to the right."""
    x, y = (part.ravel() for part in np.meshgrid(np.arange(0, 160, 0.7), np.arange(-90, 90, 0.7)))
    middle = POSE.translation_mm
    depth = middle[2] - PLATE_MM
    scale = depth / middle[2]
    return np.stack([x + scale * middle[0], y + scale * middle[1], np.full(len(x), depth)], axis=1)


def covered_by_plate(points: np.ndarray) -> np.ndarray:
    return points[:, 0] / points[:, 2] > POSE.translation_mm[0] / POSE.translation_mm[2] + 0.01


def sight_of(points: np.ndarray) -> MotorSight:
    return MotorSight(Scan(points=points), motor_prior(), POSE)


def test_every_point_of_the_motor_has_one_word_and_they_are_true() -> None:
    seen = visible_points(POSE, noise_mm=0.0)
    free = seen[~covered_by_plate(seen)]
    found = sight_of(np.vstack([free, plate()])).of_prior

    posed = POSE.apply(motor_prior().points)
    cosine = -np.einsum("ni,ni->n", POSE.rotate(motor_prior().normals), posed) / np.linalg.norm(
        posed, axis=1
    )
    assert found.shape == (len(posed),)
    assert (found[cosine < -0.3] == Seen.TURNED_AWAY).mean() > 0.99
    # what faces the camera may still lie behind another part of the motor
    facing = (cosine > 0.5) & (found != Seen.TURNED_AWAY)
    assert facing.sum() > 1000
    # near the plate's edge the neighbouring cells of the depth buffer have a say
    right = posed[:, 0] / posed[:, 2] - POSE.translation_mm[0] / POSE.translation_mm[2]
    assert (found[facing & (right > 0.02)] == Seen.HIDDEN).all()
    assert (found[facing & (right < -0.02)] == Seen.SEEN).mean() > 0.98
    assert not (found == Seen.SEEN_THROUGH).any()


def test_a_motor_that_is_not_there_is_seen_through() -> None:
    wall = plate() + [-80.0, 0.0, 3 * PLATE_MM]
    wall = np.vstack([wall - [dx, 0.0, 0.0] for dx in (-80.0, 80.0)])
    found = sight_of(wall).of_prior

    assert (found == Seen.SEEN_THROUGH).sum() > 1000
    assert not np.isin(found, (Seen.SEEN, Seen.HIDDEN)).any()


def test_only_what_is_in_the_way_stands_before_the_motor() -> None:
    seen = visible_points(POSE, noise_mm=0.0)
    sight = sight_of(np.vstack([seen, plate()]))
    posed = POSE.apply(motor_prior().points)
    widest = (posed[:, 0] / posed[:, 2]).max()
    beyond = plate()[:, 0] / plate()[:, 2] > widest + 0.02

    assert sight.is_before(plate()).mean() > 0.05
    assert not sight.is_before(plate()[beyond]).any()
    assert not sight.is_before(plate() + [0.0, 0.0, 3 * PLATE_MM]).any()
    assert sight.is_before(seen).mean() < 0.01


def test_every_word_is_one_of_its_own() -> None:
    assert set(WORDS) == set(Seen)
    assert len(set(WORDS.values())) == len(Seen)
