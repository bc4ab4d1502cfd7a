from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from boltpose.factory.bolts import build_bolt
from boltpose.factory.model import Material, SolidPart, TrueBolt
from boltpose.factory.solids import mesh_arrays
from boltpose.factory.spec_fasteners import BoltSpec, HeadKind, Site
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part, Side
from boltpose.synthesis.head_surface import sample_outer_head, seen_share
from tests.support.strategies import transforms


def placed_bolt(head: HeadKind, pose: Transform | None = None) -> tuple[TrueBolt, SolidPart]:
    spec = BoltSpec(site=Site.REAR_CAP, radius_mm=0, angle_deg=0, head=head)
    built = build_bolt(spec)
    motor_from_bolt = Transform("motor", "bolt", np.eye(4) if pose is None else pose.matrix)
    vertices, faces = mesh_arrays(built.body)
    bolt = TrueBolt(
        id="T1",
        spec=spec,
        side=Side.TOP,
        motor_from_bolt=motor_from_bolt,
        across_mm=built.across_mm,
        head_diameter_mm=built.head_diameter_mm,
        head_height_mm=built.head_height_mm,
    )
    solid = SolidPart(
        name="bolt_T1",
        part=Part.BOLT,
        material=Material.ZINC,
        vertices=motor_from_bolt.apply(vertices),
        faces=faces,
        bolt_id="T1",
    )
    return bolt, solid


@pytest.mark.parametrize("head", list(HeadKind))
def test_points_are_on_the_outside_of_the_head_and_nowhere_else(head: HeadKind) -> None:
    bolt, solid = placed_bolt(head)
    points = sample_outer_head(bolt, solid)
    assert 400 <= len(points) <= 500
    radius = np.hypot(points[:, 0], points[:, 1])
    # within the head, none on the seat
    assert points[:, 2].max() <= 1e-6
    assert points[:, 2].min() > -bolt.head_height_mm - 1e-6
    assert radius.max() <= bolt.head_diameter_mm / 2 + 1e-6
    # not in the recess: nothing near the axis below the top face, but for slots that are open
    if head is not HeadKind.SLOTTED:
        deep = (radius < 0.2 * bolt.head_diameter_mm) & (points[:, 2] < -0.3 * bolt.head_height_mm)
        assert not deep.any()


def test_points_of_a_hexagon_are_shared_out_by_area() -> None:
    bolt, solid = placed_bolt(HeadKind.HEX)
    points = sample_outer_head(bolt, solid)
    corner_mm = bolt.across_mm / np.sqrt(3)
    flanks = 6 * corner_mm * bolt.head_height_mm
    top = 1.5 * np.sqrt(3) * corner_mm**2
    # the chamfer takes a little of both
    on_flanks = np.hypot(points[:, 0], points[:, 1]) > 0.97 * bolt.across_mm / 2
    assert on_flanks.mean() == pytest.approx(flanks / (flanks + top), abs=0.06)


@pytest.mark.parametrize("head", [HeadKind.HEX, HeadKind.SOCKET_CAP, HeadKind.TORX_PAN])
def test_the_centroid_is_on_the_axis(head: HeadKind) -> None:
    bolt, solid = placed_bolt(head)
    centroid = sample_outer_head(bolt, solid).mean(axis=0)
    np.testing.assert_allclose(centroid[:2], 0, atol=0.1)
    assert -bolt.head_height_mm < centroid[2] < 0


@settings(max_examples=10, deadline=None)
@given(pose=transforms())
def test_points_move_with_the_bolt(pose: Transform) -> None:
    still, moved = placed_bolt(HeadKind.HEX_FLANGE), placed_bolt(HeadKind.HEX_FLANGE, pose)
    expected = moved[0].motor_from_bolt.apply(sample_outer_head(*still))
    found = sample_outer_head(*moved)
    # a ray along a face may go either way after rounding
    assert abs(len(found) - len(expected)) <= 5
    np.testing.assert_allclose(found.mean(axis=0), expected.mean(axis=0), atol=0.2)


def test_seen_is_within_seven_tenths_of_a_millimetre() -> None:
    surface = np.array([[0.0, 0, 0], [10, 0, 0], [20, 0, 0], [30, 0, 0]])
    measured = np.array([[0.69, 0, 0], [10, 0.71, 0], [20, 0, 0]])
    assert seen_share(surface, measured) == 0.5
    assert seen_share(surface, np.zeros((0, 3))) == 0.0
    assert seen_share(np.zeros((0, 3)), measured) == 0.0
