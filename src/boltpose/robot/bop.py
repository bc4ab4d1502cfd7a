"""Poses as the result file of the BOP benchmark (`.csv`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from boltpose.errors import ConfigError, PosesRefusedError
from boltpose.geometry.transforms import Transform
from boltpose.schema import LocateResult

HEADER = "scene_id,im_id,obj_id,score,R,t,time"


@dataclass(frozen=True, slots=True, kw_only=True)
class BopTarget:
    """Which row of the benchmark a result is about."""

    scene_id: int
    im_id: int
    obj_id: int
    """The motor's number among the models of the data set."""

    def __post_init__(self) -> None:
        for name in ("scene_id", "im_id", "obj_id"):
            if getattr(self, name) < 0:
                raise ConfigError(f"{name} must be 0 or more, got {getattr(self, name)}")


def bop_text(
    result: LocateResult,
    target: BopTarget,
    *,
    seconds: float = -1.0,
    prior_from_model: Transform | None = None,
) -> str:
    """Write the motor's pose in the camera, which is what BOP asks for: one row per image.

    BOP compares the pose of a model in the camera, `x_camera = R x_model + t`, in mm, R row-major.
    The object is the motor, and its model is in the prior's frame unless `prior_from_model` says
    otherwise. Bolts are no objects of BOP: they are symmetric about their axes and have no models.

    Source: BOP challenge, "Format of results": seven columns, the estimates of an image share
    one time, -1 if unknown.

    Args:
        result: Accepted.
        target: The numbers of scene, image and object.
        seconds: Time that the image took; -1 is unknown.
        prior_from_model: Where the benchmark's model is in the frame of the prior.

    Raises:
        PosesRefusedError: The result is refused: the benchmark counts a missing row as a miss.
        FrameError: `prior_from_model` is of other frames.
    """
    if not result.is_ok or result.registration is None:
        reasons = "; ".join(result.verdict.reasons) or "no reason given"
        raise PosesRefusedError(f"the scan was refused ({reasons}): leave its row out")
    pose = result.registration.camera_from_prior
    if prior_from_model is not None:
        pose = pose @ prior_from_model
    row = [
        str(target.scene_id),
        str(target.im_id),
        str(target.obj_id),
        _number(result.verdict.p_correct),
        " ".join(_number(value) for value in pose.rotation.ravel().tolist()),
        " ".join(_number(value) for value in pose.translation_mm.tolist()),
        _number(seconds),
    ]
    return "\n".join([HEADER, ",".join(row)]) + "\n"


def total_seconds(timings_ms: Sequence[float]) -> float:
    """Add up stage times, ms, to seconds; -1, which is BOP's unknown, if there are none."""
    return sum(timings_ms) / 1000.0 if timings_ms else -1.0


def _number(value: float) -> str:
    """Shortest text that gives the same number back: nothing is rounded."""
    return repr(float(value) + 0.0)
