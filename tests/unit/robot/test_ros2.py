"""The MCAP file as two independent readers see it."""

from __future__ import annotations

import io
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from boltpose.errors import ConfigError, MissingExtraError
from boltpose.robot import RobotConfig, RobotFormat, plan_tools, robot_file
from boltpose.robot.ros2 import mcap_bytes, pose_covariance
from boltpose.schema import Visibility
from tests.unit.robot.bolts import SCAN_SHA256, bolt, of_axes, result

pytest.importorskip("mcap_ros2", reason="needs the extra ros2")
rosbags_highlevel = pytest.importorskip("rosbags.highlevel", reason="needs the extra dev")
STAMP_NS = 1_700_000_000_123_456_789
TOPICS = ["/boltpose/bolts", "/boltpose/approach", "/boltpose/contact", "/boltpose/retreat"]


def scene():
    return result(
        bolt("T1", (0.1, -0.2, -0.97), confidence=0.91,
             covariance_mm2=np.array([[0.04, 0.01, 0], [0.01, 0.09, 0.002], [0, 0.002, 0.16]])),
        bolt("T2", (1, 0, 0), (500, -80, 250)),
        bolt("T3", visibility=Visibility.HIDDEN),
    )  # fmt: skip


def read_with_mcap(content: bytes):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    reader = make_reader(io.BytesIO(content), decoder_factories=[DecoderFactory()])
    found = {}
    for _, channel, message, decoded in reader.iter_decoded_messages():
        assert message.log_time == message.publish_time == STAMP_NS
        found[channel.topic] = decoded
    return found


def read_with_rosbags(content: bytes, folder: Path):
    path = folder / "bolts.mcap"
    path.write_bytes(content)
    with rosbags_highlevel.AnyReader([path]) as reader:
        found = {}
        for connection, stamp_ns, raw in reader.messages():
            assert stamp_ns == STAMP_NS
            found[connection.topic] = reader.deserialize(raw, connection.msgtype)
        types = {connection.topic: connection.msgtype for connection in reader.connections}
    assert types["/boltpose/bolts"] == "vision_msgs/msg/Detection3DArray"
    assert {types[topic] for topic in TOPICS[1:]} == {"geometry_msgs/msg/PoseArray"}
    return found


@pytest.fixture(params=["mcap", "rosbags"])
def messages(request, tmp_path: Path):
    content = mcap_bytes(plan_tools(scene(), RobotConfig(ros_frame="base_link")), STAMP_NS)
    read = read_with_mcap(content) if request.param == "mcap" else None
    return read or read_with_rosbags(content, tmp_path)


def matrix(ros_pose):
    turn = Rotation.from_quat([getattr(ros_pose.orientation, axis) for axis in "xyzw"])
    out = np.eye(4)
    out[:3, :3] = turn.as_matrix()
    out[:3, 3] = [1000 * getattr(ros_pose.position, axis) for axis in "xyz"]
    return out


def test_headers(messages) -> None:
    assert sorted(messages) == sorted(TOPICS)
    headers = [messages[topic].header for topic in TOPICS]
    headers += [detection.header for detection in messages["/boltpose/bolts"].detections]
    for header in headers:
        assert header.frame_id == "base_link"
        assert header.stamp.sec * 10**9 + header.stamp.nanosec == STAMP_NS


def test_bolts(messages) -> None:
    plan = plan_tools(scene())
    detections = messages["/boltpose/bolts"].detections
    assert [one.id for one in detections] == [pose.bolt.id for pose in plan.poses]
    for pose, detection in zip(plan.poses, detections, strict=True):
        one = pose.bolt
        (found,) = detection.results
        assert found.hypothesis.class_id == "bolt"
        assert found.hypothesis.score == one.confidence
        np.testing.assert_allclose(matrix(found.pose.pose), one.frame_from_bolt.matrix, atol=1e-9)
        middle = matrix(detection.bbox.center)
        np.testing.assert_allclose(middle[:3, 3], one.position, atol=1e-9)
        size = [1000 * getattr(detection.bbox.size, axis) for axis in "xyz"]
        np.testing.assert_allclose(
            size, [one.head_diameter_mm, one.head_diameter_mm, one.head_height_mm]
        )


def test_covariance(messages) -> None:
    bolts = {pose.bolt.id: pose.bolt for pose in plan_tools(scene()).poses}
    for detection in messages["/boltpose/bolts"].detections:
        one = bolts[detection.id]
        (found,) = detection.results
        covariance = np.array(list(found.pose.covariance)).reshape(6, 6)  # row-major
        np.testing.assert_array_equal(covariance, covariance.T)
        np.testing.assert_allclose(covariance[:3, :3] * 1e6, one.covariance_mm2)
        turns = covariance[3:, 3:]
        across = np.linalg.svd(one.axis[None])[2][1:]
        for direction in across:
            assert direction @ turns @ direction == pytest.approx(one.sigma_axis_rad**2)
        # the turn about its own axis may be anything: the variance of -pi to pi
        assert one.axis @ turns @ one.axis == pytest.approx(math.pi**2 / 3)
        assert np.linalg.eigvalsh(covariance).min() > 0


def test_tool_poses(messages) -> None:
    plan = plan_tools(scene())
    for topic in TOPICS[1:]:
        poses = messages[topic].poses
        for planned, found in zip(plan.poses, poses, strict=True):
            wanted = getattr(planned, topic.rsplit("/", 1)[1])
            np.testing.assert_allclose(matrix(found), wanted.matrix, atol=1e-9)


def test_covariance_is_what_small_errors_do() -> None:
    one = bolt(axis=(0.3, -0.5, 0.8), sigma_axis_rad=0.01)
    rng = np.random.default_rng(3)
    turns = rng.multivariate_normal(np.zeros(3), pose_covariance(one)[3:, 3:], 20000)
    # only the part across the axis tilts it
    tilts = np.cross(turns - np.outer(turns @ one.axis, one.axis), one.axis)
    across = np.linalg.svd(one.axis[None])[2][1:]
    assert np.std(tilts @ across.T, axis=0) == pytest.approx([0.01, 0.01], rel=0.03)


def test_the_head_is_in_the_metadata() -> None:
    from mcap.reader import make_reader

    content = mcap_bytes(plan_tools(scene()), STAMP_NS)
    reader = make_reader(io.BytesIO(content))
    assert reader.get_header().profile == "ros2"
    (metadata,) = list(reader.iter_metadata())
    head = metadata.metadata["head"]
    for wanted in (SCAN_SHA256, "status: ok", "metres", "left out T3", "quaternions x y z w"):
        assert wanted in head


def test_stamps() -> None:
    plan = plan_tools(of_axes(np.eye(3)))
    assert robot_file(plan, RobotFormat.ROS2_MCAP) == mcap_bytes(plan, 0)
    for bad in (-1, 2**31 * 10**9):
        with pytest.raises(ConfigError, match="stamp"):
            mcap_bytes(plan, bad)


def test_without_the_package_the_install_line_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mcap_ros2.writer", None)
    with pytest.raises(MissingExtraError, match=r"boltpose\[ros2\]"):
        mcap_bytes(plan_tools(scene()))
