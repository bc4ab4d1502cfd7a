"""Bolts belong to the motor: they move with the scan and ignore the points' order."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from boltpose.geometry.transforms import Transform
from boltpose.prior.find_bolts import find_bolts
from boltpose.schema import PriorBolt, Side
from tests.support.strategies import transforms
from tests.support.toy_heads import ToyHead, toy_plate, true_alignment

PLATE = toy_plate(
    [
        ToyHead(x=0.0, y=18.0),
        ToyHead(x=-17.0, y=-5.0, corners=0, radius=4.0, sunk=2.0),
        ToyHead(x=14.0, y=-10.0, side=Side.BOTTOM, corners=0, seen_deg=250.0),
    ]
)
SHARES = PLATE.probabilities()
REFERENCE = find_bolts(PLATE.points, PLATE.normals, SHARES, true_alignment())


def assert_same_bolt(found: PriorBolt, expected: PriorBolt, moved: Transform) -> None:
    np.testing.assert_allclose(
        found.prior_from_bolt.matrix,
        moved.matrix @ expected.prior_from_bolt.matrix,
        atol=1e-6,
    )
    np.testing.assert_allclose(
        found.cluster_centre, moved.apply(expected.cluster_centre), atol=1e-6
    )
    assert (found.id, found.side, found.is_sure) == (expected.id, expected.side, expected.is_sure)
    assert found.point_count == expected.point_count
    assert np.linalg.det(found.prior_from_bolt.rotation) > 0.999


def test_the_reference_has_every_bolt() -> None:
    assert [bolt.id for bolt in REFERENCE] == ["T1", "T2", "B1"]


@settings(max_examples=15, deadline=None)
@given(prior_from_motor=transforms("prior", "motor"))
def test_bolts_move_with_the_scan(prior_from_motor: Transform) -> None:
    found = find_bolts(
        prior_from_motor.apply(PLATE.points),
        prior_from_motor.rotate(PLATE.normals),
        SHARES,
        true_alignment(prior_from_motor),
    )
    assert len(found) == len(REFERENCE)
    for bolt, expected in zip(found, REFERENCE, strict=True):
        assert_same_bolt(bolt, expected, prior_from_motor)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_bolts_do_not_depend_on_the_order_of_points(seed: int) -> None:
    order = np.random.default_rng(seed).permutation(len(PLATE.points))
    found = find_bolts(PLATE.points[order], PLATE.normals[order], SHARES[order], true_alignment())
    identity = Transform.identity("prior", "prior")
    assert len(found) == len(REFERENCE)
    for bolt, expected in zip(found, REFERENCE, strict=True):
        assert_same_bolt(bolt, expected, identity)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_every_bolt_appears_once_whatever_the_noise(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shares = SHARES + rng.uniform(0, 0.2, SHARES.shape)
    found = find_bolts(
        PLATE.points + rng.normal(scale=0.02, size=PLATE.points.shape),
        PLATE.normals,
        shares / shares.sum(axis=1, keepdims=True),
        true_alignment(),
    )
    assert [bolt.id for bolt in found] == ["T1", "T2", "B1"]
