from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from boltpose.errors import ConfigError, FrameError, PosesRefusedError
from boltpose.geometry.transforms import Transform
from boltpose.robot import RobotConfig, plan_tool_poses, plan_tools
from boltpose.schema import BoltState, Visibility
from tests.support import results
from tests.unit.robot.bolts import bolt, of_axes, result

directions = st.tuples(*3 * [st.floats(-1, 1)]).filter(lambda v: np.linalg.norm(v) > 0.1)
named = st.sampled_from(["+x", "-x", "+y", "-y", "+z", "-z", "outward", "inward", "1,1,0"])


@given(directions, named, st.floats(-math.pi, math.pi), st.floats(-20, 20))
def test_the_tool_goes_straight_into_the_bolt(axis, tool_x, turn_rad, offset_mm) -> None:
    one = bolt(axis=axis, turn_rad=turn_rad)
    config = RobotConfig(
        approach_mm=40.0, retreat_mm=60.0, contact_offset_mm=offset_mm, tool_x=tool_x
    )
    (pose,) = plan_tool_poses(result(one), config)

    for point, distance_mm in ((pose.contact, 0.0), (pose.approach, 40.0), (pose.retreat, 60.0)):
        assert (point.target, point.source) == ("base", "tool")
        np.testing.assert_allclose(point.z_axis, -one.axis, atol=1e-12)
        np.testing.assert_allclose(
            point.translation_mm, one.head_top + (offset_mm + distance_mm) * one.axis, atol=1e-9
        )
        assert np.array_equal(point.rotation, pose.contact.rotation)


@given(directions, named, st.floats(-math.pi, math.pi))
def test_the_turn_of_the_bolts_own_frame_means_nothing(axis, tool_x, turn_rad) -> None:
    config = RobotConfig(tool_x=tool_x)
    (first,) = plan_tool_poses(result(bolt(axis=axis)), config)
    (second,) = plan_tool_poses(result(bolt(axis=axis, turn_rad=turn_rad)), config)
    np.testing.assert_allclose(first.contact.matrix, second.contact.matrix, atol=1e-9)


@given(directions)
def test_tool_x_is_as_near_to_its_direction_as_any_turn_allows(axis) -> None:
    (pose,) = plan_tool_poses(result(bolt(axis=axis)), RobotConfig(tool_x="+x"))
    x_axis, z_axis = pose.contact.rotation[:, 0], pose.contact.z_axis
    sine = np.linalg.norm(np.cross(z_axis, [1, 0, 0]))
    if sine > math.sin(math.radians(20)):
        assert x_axis[0] == pytest.approx(sine, abs=1e-9)  # the best that can be had
    else:  # the bolt looks along x: then x of the tool goes up
        assert x_axis[2] == pytest.approx(np.linalg.norm(np.cross(z_axis, [0, 0, 1])), abs=1e-9)


@pytest.mark.parametrize("tool_x", ["+x", "-y", "+z", "outward", "1,1,1"])
def test_a_small_error_of_the_axis_never_spins_the_tool(tool_x: str) -> None:
    # away from where the rule changes over: exactly along the base's axes, where bolts are
    for axis in [*np.eye(3), *-np.eye(3)]:
        config = RobotConfig(tool_x=tool_x)
        (exact,) = plan_tool_poses(result(bolt(axis=axis)), config)
        for small in (1e-12, 1e-6, 1e-3):
            for other in np.eye(3):
                (moved,) = plan_tool_poses(result(bolt(axis=axis + small * other)), config)
                between = Rotation.from_matrix(exact.contact.rotation.T @ moved.contact.rotation)
                assert between.magnitude() <= 3.1 * small + 1e-9


def test_outward_and_inward_look_from_the_robots_foot() -> None:
    one = bolt(axis=(0, 0, 1), at=(300.0, 400.0, 200.0))
    (out,) = plan_tool_poses(result(one), RobotConfig(tool_x="outward"))
    (back,) = plan_tool_poses(result(one), RobotConfig(tool_x="inward"))
    np.testing.assert_allclose(out.contact.rotation[:, 0], [0.6, 0.8, 0], atol=1e-12)
    np.testing.assert_allclose(back.contact.rotation[:, 0], [-0.6, -0.8, 0], atol=1e-12)
    over_the_foot = bolt(axis=(0, 0, 1), at=(3.0, -4.0, 200.0))
    (pose,) = plan_tool_poses(result(over_the_foot), RobotConfig(tool_x="outward"))
    np.testing.assert_allclose(pose.contact.rotation[:, 0], [1, 0, 0], atol=1e-12)


def test_flange_poses_put_the_tools_tip_on_the_bolt() -> None:
    one = bolt(axis=(0.2, -0.3, 0.9))
    tcp = Transform.from_parts(
        "flange", "tool", Rotation.from_euler("xyz", (10, -20, 30), degrees=True).as_matrix(),
        (12.0, -5.0, 180.0),
    )  # fmt: skip
    (tip,) = plan_tool_poses(result(one))
    (flange,) = plan_tool_poses(result(one), flange_from_tool=tcp)
    for name in ("approach", "contact", "retreat"):
        moved = getattr(flange, name)
        assert moved.source == "flange"
        np.testing.assert_allclose((moved @ tcp).matrix, getattr(tip, name).matrix, atol=1e-9)
    assert plan_tools(result(one), flange_from_tool=tcp).moved_frame == "flange"


def test_a_tcp_of_the_wrong_direction_is_refused() -> None:
    wrong = Transform.identity("tool", "flange")
    with pytest.raises(FrameError, match="flange_from_tool, got tool_from_flange"):
        plan_tools(result(bolt()), flange_from_tool=wrong)


def kinds():
    return result(
        bolt("T1"),
        bolt("T2", visibility=Visibility.HIDDEN),
        bolt("T3", is_sure=False, remarks=("little flank",)),
        bolt("T4", state=BoltState.CONTRADICTED, state_reason="a hole is there", p_tool_fits=0.0),
        bolt("T5", visibility=Visibility.PARTIAL),
    )


@pytest.mark.parametrize(
    ("setting", "extra"),
    [
        ({}, None),
        ({"include_hidden": True}, "T2"),
        ({"include_unsure": True}, "T3"),
        ({"include_contradicted": True}, "T4"),
    ],
)
def test_only_what_was_asked_for(setting, extra) -> None:
    plan = plan_tools(kinds(), RobotConfig(**setting))
    wanted = {"T1", "T5"} | ({extra} if extra else set())
    assert {pose.bolt.id for pose in plan.poses} == wanted
    assert {out.bolt.id for out in plan.left_out} == {"T1", "T2", "T3", "T4", "T5"} - wanted
    # whoever is let in against advice is warned of, and nobody else
    assert {text.split(":")[0] for text in plan.warnings} == ({extra} if extra else set())


def test_a_contradicted_bolt_is_warned_of_loudly() -> None:
    plan = plan_tools(kinds(), RobotConfig(include_contradicted=True))
    assert plan.warnings == (
        "T4: CONTRADICTED by the camera (a hole is there): no tool must go there",
    )


def test_two_reasons_need_two_settings() -> None:
    both = result(bolt("T1"), bolt("T2", visibility=Visibility.HIDDEN, is_sure=False))
    for setting in ({"include_hidden": True}, {"include_unsure": True}):
        assert len(plan_tool_poses(both, RobotConfig(**setting))) == 1
    assert len(plan_tool_poses(both, RobotConfig(include_hidden=True, include_unsure=True))) == 2


@pytest.mark.parametrize(
    ("limits", "reason"),
    [
        ({"min_confidence": 0.96}, "confidence 0.950 below 0.96"),
        ({"min_tool_fits": 0.8}, "p_tool_fits 0.700 below 0.8"),
        ({"max_sigma_mm": 0.21}, "sigma 0.22 mm above 0.21 mm"),
        ({"max_sigma_axis_deg": 0.3}, "sigma of the axis 0.33 deg above 0.3 deg"),
    ],
)
def test_limits(limits, reason) -> None:
    good = bolt("T1", confidence=0.99, p_tool_fits=0.9, sigma_axial_mm=0.1, sigma_axis_rad=0.001)
    plan = plan_tools(result(good, bolt("T2", p_tool_fits=0.7)), RobotConfig(**limits))
    assert [pose.bolt.id for pose in plan.poses] == ["T1"]
    assert [out.reason for out in plan.left_out] == [reason]


@pytest.mark.parametrize(
    "field", ["confidence", "sigma_lateral_mm", "sigma_axial_mm", "sigma_axis_rad"]
)
def test_a_number_that_is_none_is_never_good_enough(field: str) -> None:
    config = RobotConfig(min_confidence=0.1, max_sigma_mm=1.0, max_sigma_axis_deg=1.0)
    broken = bolt("T2", **{field: math.nan})
    plan = plan_tools(result(bolt("T1"), broken), config)
    assert [pose.bolt.id for pose in plan.poses] == ["T1"]


def test_tool_fits_must_be_in_the_result() -> None:
    with pytest.raises(ConfigError, match="--tool-tolerance"):
        plan_tools(result(bolt()), RobotConfig(min_tool_fits=0.5))


def test_turns_of_the_prior_come_first_then_the_nearest() -> None:
    bolts = [
        bolt("A", at=(500, 0, 300)),
        bolt("B", at=(590, 0, 300)),
        bolt("C", at=(700, 0, 300), order=2),
        bolt("D", at=(400, 0, 300), order=1),
        bolt("E", at=(640, 0, 300)),
        # near, but on the other side: its approach point is far away
        bolt("F", axis=(0, 0, -1), at=(690, 0, 290)),
    ]
    names = [pose.bolt.id for pose in plan_tool_poses(result(*bolts))]
    assert names == ["D", "C", "E", "B", "A", "F"]
    # the order of the list must not matter
    assert names == [pose.bolt.id for pose in plan_tool_poses(result(*bolts[::-1]))]


def test_without_turns_the_best_seen_bolt_is_first() -> None:
    bolts = [
        bolt("A", visibility=Visibility.HIDDEN, confidence=0.99),
        bolt("B", visibility=Visibility.PARTIAL, confidence=0.98, at=(600, 160, 300)),
        bolt("C", confidence=0.90, at=(600, 180, 300)),
        bolt("D", confidence=0.95, at=(600, 190, 300)),
    ]
    poses = plan_tool_poses(result(*bolts), RobotConfig(include_hidden=True))
    assert [pose.bolt.id for pose in poses] == ["D", "C", "B", "A"]


def test_by_confidence() -> None:
    bolts = [
        bolt("A", confidence=0.7),
        bolt("B", confidence=0.9),
        bolt("C", order=5, confidence=0.1),
    ]
    plan = plan_tools(result(*bolts), RobotConfig(order="confidence"))
    assert [pose.bolt.id for pose in plan.poses] == ["C", "B", "A"]
    assert [pose.turn for pose in plan.poses] == [1, 2, 3]


def test_a_turn_that_is_skipped_is_warned_of() -> None:
    bolts = [bolt("A", order=1, visibility=Visibility.HIDDEN), bolt("B", order=2), bolt("C")]
    (warning,) = plan_tools(result(*bolts)).warnings
    assert warning.startswith("A has turn 1 in the prior but is left out")
    last = [bolt("A", order=2, visibility=Visibility.HIDDEN), bolt("B", order=1)]
    assert plan_tools(result(*last)).warnings == ()


def test_a_refused_result_gives_nothing() -> None:
    with pytest.raises(PosesRefusedError, match=r"free_space_violation 0\.06"):
        plan_tools(results.refused(results.cube_prior()))
    # not even where bolts were left in it
    broken = replace(results.refused(results.cube_prior()), bolts=(bolt(),))
    with pytest.raises(PosesRefusedError):
        plan_tools(broken, RobotConfig(include_hidden=True, include_contradicted=True))


def test_frame_camera_is_no_frame_for_a_robot() -> None:
    in_camera = results.located(results.cube_prior(), None)
    with pytest.raises(FrameError, match="--hand-eye"):
        plan_tools(in_camera)


def test_a_camera_that_is_called_base_is_no_robot() -> None:
    nobody_calibrated = Transform.identity("base", "camera")
    with pytest.raises(FrameError, match="the hand-eye is the identity"):
        plan_tools(results.located(results.cube_prior(), nobody_calibrated))


def test_no_bolt_left_is_a_refusal() -> None:
    with pytest.raises(PosesRefusedError, match="T1: hidden from the camera"):
        plan_tools(result(bolt(visibility=Visibility.HIDDEN)))
    with pytest.raises(PosesRefusedError, match="the prior has none"):
        plan_tools(of_axes([]))


def test_a_bolt_outside_the_workspace_means_a_wrong_frame_for_all() -> None:
    near = bolt("T1", at=(600.0, 100.0, 300.0))
    hidden = bolt("T2", at=(60.0, 10.0, 30.0), visibility=Visibility.HIDDEN)
    box = RobotConfig(workspace_mm=(550.0, 650.0, 50.0, 150.0, 300.0, 350.0))
    assert [pose.bolt.id for pose in plan_tools(result(near), box).poses] == ["T1"]
    with pytest.raises(PosesRefusedError, match="bolt T2 is at 60, 10, 30 mm, outside workspace"):
        plan_tools(result(near, hidden), box)
    for axis in range(3):
        for step in (-150.0, 150.0):
            at = np.array([600.0, 100.0, 325.0])
            at[axis] += step
            with pytest.raises(PosesRefusedError, match="outside workspace_mm"):
                plan_tools(result(bolt("T1", at=tuple(at))), box)


@pytest.mark.parametrize(
    "box",
    [(1.0, 0.0, 0.0, 1.0, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0, 0.0, math.inf), (math.nan,) * 6],
)
def test_a_workspace_has_three_sides(box: tuple[float, ...]) -> None:
    with pytest.raises(ConfigError, match="workspace_mm must be x from, to"):
        RobotConfig(workspace_mm=box)
