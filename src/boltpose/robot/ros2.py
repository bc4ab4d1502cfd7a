"""Located bolts and tool poses as ROS 2 messages in an MCAP file; no ROS is needed."""

from __future__ import annotations

import io
import math
from typing import Any

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.errors import ConfigError, MissingExtraError
from boltpose.geometry.transforms import Transform
from boltpose.robot.head import head_lines
from boltpose.robot.plan import ToolPlan
from boltpose.schema import LocatedBolt

BOLTS_TOPIC = "/boltpose/bolts"
TOOL_TOPICS = ("/boltpose/approach", "/boltpose/contact", "/boltpose/retreat")
_DETECTIONS = "vision_msgs/msg/Detection3DArray"
_POSES = "geometry_msgs/msg/PoseArray"
_FREE_TURN_VARIANCE = math.pi**2 / 3.0
"""rad^2; of an angle that may be anything from -pi to pi: a bolt's turn about its own axis."""
_LAST_STAMP_NS = (2**31 - 1) * 10**9 + 999_999_999
"""builtin_interfaces/Time counts seconds in an int32."""
_CONVENTIONS = (
    "ROS: metres, radians, quaternions x y z w; header.frame_id is the base.",
    "/boltpose/bolts, vision_msgs/Detection3DArray (4.1): pose of frame bolt, at the top of the "
    "head, +z OUT of the head. Covariance 6x6 row-major (x y z, then turns about the fixed axes). "
    "A bolt's turn about its own axis is unknown: its variance is pi^2/3.",
    "/boltpose/approach, contact, retreat, geometry_msgs/PoseArray: tool poses in the same order, "
    "z INTO the bolt.",
)

# Source: message definitions of common_interfaces and vision_msgs 4.1.1 (fields and types)
_SEPARATOR = "=" * 80
_COMMON = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
}
_VISION = {
    "vision_msgs/Detection3D": (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
        "vision_msgs/BoundingBox3D bbox\nstring id"
    ),
    "vision_msgs/ObjectHypothesisWithPose": (
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose"
    ),
    "vision_msgs/ObjectHypothesis": "string class_id\nfloat64 score",
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose\nfloat64[36] covariance",
    "vision_msgs/BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
}


def mcap_bytes(plan: ToolPlan, stamp_ns: int = 0) -> bytes:
    """Write the bolts of a plan and its tool poses; the same input gives the same bytes.

    Args:
        plan: What to write.
        stamp_ns: Nanoseconds since 1970, of every header and message: when the scan was taken.

    Raises:
        MissingExtraError: The extra `ros2` is not installed.
        ConfigError: The stamp does not fit a ROS time.
    """
    if not 0 <= stamp_ns <= _LAST_STAMP_NS:
        raise ConfigError(f"the stamp must be 0 to {_LAST_STAMP_NS} ns, got {stamp_ns}")
    try:
        from mcap_ros2.writer import Writer
    except ImportError as error:
        raise MissingExtraError("mcap-ros2-support", "ros2") from error
    header = _header(plan, stamp_ns)
    stream = io.BytesIO()
    with Writer(stream) as writer:
        detections = writer.register_msgdef(
            _DETECTIONS,
            _definition(
                "std_msgs/Header header\nvision_msgs/Detection3D[] detections",
                {**_VISION, **_COMMON},
            ),
        )
        poses = writer.register_msgdef(
            _POSES, _definition("std_msgs/Header header\ngeometry_msgs/Pose[] poses", _COMMON)
        )
        bolts = [_detection(pose.bolt, header) for pose in plan.poses]
        message = {"header": header, "detections": bolts}
        writer.write_message(BOLTS_TOPIC, detections, message, stamp_ns, stamp_ns)
        for topic in TOOL_TOPICS:
            points = [getattr(pose, topic.rsplit("/", 1)[1]) for pose in plan.poses]
            message = {"header": header, "poses": [_ros_pose(point) for point in points]}
            writer.write_message(topic, poses, message, stamp_ns, stamp_ns)
        writer.add_metadata("boltpose", {"head": "\n".join(head_lines(plan, _CONVENTIONS))})
    return stream.getvalue()


def pose_covariance(bolt: LocatedBolt) -> FloatArray:
    """Covariance of a bolt's pose as ROS wants it.

    Position and direction are taken as independent: their joint covariance is not in the result.

    Args:
        bolt: With `covariance_mm2` in the frame of its pose.

    Returns:
        Shape (6, 6): x, y, z in m^2, then turns about the fixed axes in rad^2.
    """
    along = np.outer(bolt.axis, bolt.axis)
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = bolt.covariance_mm2 * 1e-6
    covariance[3:, 3:] = bolt.sigma_axis_rad**2 * (np.eye(3) - along) + _FREE_TURN_VARIANCE * along
    return covariance


def _definition(fields: str, parts: dict[str, str]) -> str:
    blocks = [fields, *(f"{_SEPARATOR}\nMSG: {name}\n{text}" for name, text in parts.items())]
    return "\n".join(blocks) + "\n"


def _header(plan: ToolPlan, stamp_ns: int) -> dict[str, Any]:
    seconds, nanoseconds = divmod(stamp_ns, 10**9)
    return {
        "stamp": {"sec": seconds, "nanosec": nanoseconds},
        "frame_id": plan.config.ros_frame,
    }


def _detection(bolt: LocatedBolt, header: dict[str, Any]) -> dict[str, Any]:
    pose = bolt.frame_from_bolt
    middle = Transform.from_parts(pose.target, pose.source, pose.rotation, bolt.position)
    width, height = bolt.head_diameter_mm / 1000.0, bolt.head_height_mm / 1000.0
    return {
        "header": header,
        "results": [
            {
                "hypothesis": {"class_id": "bolt", "score": float(bolt.confidence)},
                "pose": {
                    "pose": _ros_pose(pose),
                    "covariance": pose_covariance(bolt).ravel().tolist(),
                },
            }
        ],
        "bbox": {"center": _ros_pose(middle), "size": {"x": width, "y": width, "z": height}},
        "id": bolt.id,
    }


def _ros_pose(pose: Transform) -> dict[str, dict[str, float]]:
    x, y, z = (float(value) / 1000.0 for value in pose.translation_mm)
    qw, qx, qy, qz = (float(value) for value in pose.quaternion_wxyz)
    return {
        "position": {"x": x, "y": y, "z": z},
        "orientation": {"x": qx, "y": qy, "z": qz, "w": qw},
    }
