"""`poses.json`: the result of one scan as a robot cell reads it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, BinaryIO

from boltpose.io.atomic import write_atomic
from boltpose.schema import LocatedBolt, LocateResult, Registration, Verdict

FORMAT = "boltpose.poses/1"


def to_json(result: LocateResult) -> dict[str, Any]:
    """Turn a result into JSON-ready data: lengths mm, angles rad, matrices row-major 4x4.

    The same result gives the same bytes: no time stamp, no timing, no path of this machine.
    """
    return {
        "format": FORMAT,
        "status": str(result.verdict.status),
        "reasons": list(result.verdict.reasons),
        "frame": result.frame,
        "unit": "mm",
        "prior": result.prior_name,
        "bolts": [_bolt(bolt) for bolt in result.bolts],
        "verdict": _verdict(result.verdict),
        "registration": None if result.registration is None else _registration(result.registration),
        "provenance": dict(result.provenance),
    }


def dump_json(result: LocateResult) -> str:
    """The text of `poses.json`."""
    return json.dumps(to_json(result), indent=2, allow_nan=False) + "\n"


def write_poses(path: str | Path, result: LocateResult) -> None:
    """Write `poses.json`; the file appears whole or not at all.

    Raises:
        InputFileError: The file cannot be written there.
    """
    text = dump_json(result).encode()

    def write(stream: BinaryIO) -> None:
        stream.write(text)

    write_atomic(Path(path), write)


def _bolt(bolt: LocatedBolt) -> dict[str, Any]:
    pose = bolt.frame_from_bolt
    return {
        "id": bolt.id,
        "side": str(bolt.side),
        "position_mm": pose.translation_mm.tolist(),
        "axis": pose.z_axis.tolist(),
        f"{pose.target}_from_bolt": pose.matrix.tolist(),
        "quaternion_wxyz": pose.quaternion_wxyz.tolist(),
        "visibility": str(bolt.visibility),
        "visible_fraction": bolt.visible_fraction,
        "sigma_lateral_mm": bolt.sigma_lateral_mm,
        "sigma_axial_mm": bolt.sigma_axial_mm,
        "sigma_axis_rad": bolt.sigma_axis_rad,
        "head_diameter_mm": bolt.head_diameter_mm,
        "is_sure": bolt.is_sure,
        "cluster_centre_mm": bolt.cluster_centre.tolist(),
        "remarks": list(bolt.remarks),
    }


def _verdict(verdict: Verdict) -> dict[str, Any]:
    return {
        "failed": [str(check) for check in verdict.failed],
        "scores": dict(verdict.scores),
        "thresholds": dict(verdict.thresholds),
    }


def _registration(registration: Registration) -> dict[str, Any]:
    return {
        "camera_from_prior": registration.camera_from_prior.matrix.tolist(),
        "converged": registration.converged,
        "rms_mm": registration.rms_mm,
        "inlier_ratio": registration.inlier_ratio,
        "score": registration.score,
        "runner_up_score": registration.runner_up_score,
        "covariance": registration.covariance.tolist(),
        "centre_mm": registration.centre_mm.tolist(),
    }
