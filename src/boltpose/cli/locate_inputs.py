"""What `boltpose locate` reads: scans, where the camera was, and how well that is known."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from boltpose.errors import ConfigError, InputFileError
from boltpose.geometry.transforms import Transform
from boltpose.io.camera_pose import read_camera_pose
from boltpose.io.digest import sha256_of
from boltpose.io.scan import read_scan
from boltpose.prior.folder import PRIOR_PATTERN
from boltpose.schema import HandEyeError, Scan
from boltpose.tool_fit import ToolTolerance


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ShotFiles:
    """One scan and its camera pose, as they were given."""

    scan: Scan
    base_from_camera: Transform | None
    hand_eye_error: HandEyeError | None


def read_shots(
    scans: Sequence[Path],
    hand_eyes: Sequence[Path],
    robot_poses: Sequence[Path],
    *,
    scan_unit: str,
    hand_eye_unit: str,
    camera: Path | None,
    sigma: HandEyeError | None,
) -> list[ShotFiles]:
    """Read every scan with its camera pose.

    Args:
        scans: At least one.
        hand_eyes: One per scan; or one in all, where there is a robot pose per scan.
        robot_poses: None, or one per scan.
        scan_unit: Unit of the scans.
        hand_eye_unit: Unit of the hand-eye matrices and robot poses.
        camera: `scene_camera.json` of depth images.
        sigma: How well the hand-eye is known; None takes it from the file's residuals, if any.

    Raises:
        InputFileError: A file cannot be used.
        ConfigError: The numbers of files do not fit each other.
    """
    count = len(scans)
    if robot_poses and len(robot_poses) != count:
        raise ConfigError(f"{count} scans need {count} --robot-pose, got {len(robot_poses)}")
    if robot_poses and len(hand_eyes) == 1:
        hand_eyes = list(hand_eyes) * count
    if count > 1 and len(hand_eyes) != count:
        raise ConfigError(
            f"{count} scans need {count} --hand-eye, or one and a --robot-pose per scan, "
            f"got {len(hand_eyes)}"
        )
    if count == 1 and len(hand_eyes) > 1:
        raise ConfigError(f"one scan needs one --hand-eye, got {len(hand_eyes)}")
    shots = []
    for row, path in enumerate(scans):
        base_from_camera, error = read_camera_pose(
            hand_eyes[row] if hand_eyes else None,
            robot_poses[row] if robot_poses else None,
            hand_eye_unit,
        )
        shots.append(
            ShotFiles(
                scan=read_scan(path, unit=scan_unit, camera=camera),
                base_from_camera=base_from_camera,
                hand_eye_error=None if base_from_camera is None else sigma or error,
            )
        )
    return shots


def hash_inputs(
    scans: Sequence[Path],
    prior: Path,
    hand_eyes: Sequence[Path],
    robot_poses: Sequence[Path],
    *,
    scan_unit: str,
    camera: Path | None,
) -> dict[str, object]:
    """What was read, and its SHA-256, for provenance; lists where there are several scans."""

    def hashes(paths: Sequence[Path]) -> object:
        found = [sha256_of(path) for path in paths]
        if len(scans) > 1:
            return found
        return found[0] if found else None

    names = [_as_text(Path(path.name)) for path in scans]
    return {
        "scan": names if len(names) > 1 else names[0],
        "scan_sha256": hashes(scans),
        "prior_sha256": sha256_of(prior) if prior.is_file() else None,
        "hand_eye_sha256": hashes(hand_eyes),
        "robot_pose_sha256": hashes(robot_poses),
        # for `open_saved_result`
        "inputs": {
            "scans": [_as_text(path.resolve()) for path in scans],
            "scan_unit": str(scan_unit),
            "camera": None if camera is None else _as_text(camera.resolve()),
            "prior": _as_text(prior.resolve()),
        },
    }


def _as_text(path: Path) -> str:
    r"""A path that is no UTF-8 cannot stand in JSON: its odd bytes are written as `\udcff`."""
    return str(path).encode("utf-8", "backslashreplace").decode("utf-8")


@dataclass(frozen=True, slots=True)
class InputStamps:
    """How files stood before they were read.

    A camera may write its next scan over the one that is being located. Then the result would be
    about a motor that is not there any more, with the hash of a scan it was not made from.
    """

    stamps: Mapping[Path, tuple[int, int, int] | None]
    """Inode, size and time of change in ns; None where there was no file."""

    @classmethod
    def of(cls, paths: Iterable[Path]) -> InputStamps:
        """Look at files, and at the priors in folders."""
        files = [
            file
            for path in paths
            for file in (path.glob(PRIOR_PATTERN) if path.is_dir() else [path])
        ]
        return cls({file: _stamp(file) for file in files})

    def check(self) -> None:
        """Compare with how the files stand now.

        Raises:
            InputFileError: One has changed.
        """
        for path, stamp in self.stamps.items():
            if _stamp(path) != stamp:
                raise InputFileError(
                    path, "changed while boltpose was at work", "a file at rest: locate again"
                )


def _stamp(path: Path) -> tuple[int, int, int] | None:
    try:
        found = path.stat()
    except OSError:  # the reader says what is wrong with it
        return None
    return found.st_ino, found.st_size, found.st_mtime_ns


def check_age(paths: Iterable[Path], max_age_s: float | None) -> None:
    """Refuse files that were written too long ago: a camera that did not write leaves the old scan.

    Args:
        paths: Scans and robot poses; one that is missing is left to its reader.
        max_age_s: None checks nothing.

    Raises:
        ConfigError: The age is not positive.
        InputFileError: A file is older, or from the future.
    """
    if max_age_s is None:
        return
    if not max_age_s > 0:
        raise ConfigError(f"--max-age must be positive, got {max_age_s:g}")
    for path in paths:
        if not path.is_file():
            continue
        age_s = time.time() - path.stat().st_mtime
        if not 0 <= age_s <= max_age_s:
            when = f"{age_s:.0f} s ago" if age_s >= 0 else f"{-age_s:.0f} s from now"
            wanted = f"at most {max_age_s:g} s ago (--max-age): scan again"
            raise InputFileError(path, f"a file written {when}", wanted)


def parse_sigma(text: str | None) -> HandEyeError | None:
    """Read `MM,DEG` of `--hand-eye-sigma`.

    Raises:
        ConfigError: It is no such pair.
    """
    if text is None:
        return None
    translation, rotation = _numbers("--hand-eye-sigma", text, "MM,DEG", most=2, least=2)
    return HandEyeError(translation_sigma_mm=translation, rotation_sigma_rad=math.radians(rotation))


def parse_tool(text: str | None) -> ToolTolerance | None:
    """Read `LATERAL[,AXIAL[,DEG]]` of `--tool-tolerance`.

    Raises:
        ConfigError: It is no such list.
    """
    if text is None:
        return None
    values = _numbers("--tool-tolerance", text, "MM[,AXIAL_MM[,DEG]]", most=3, least=1)
    return ToolTolerance(
        lateral_mm=values[0],
        axial_mm=values[1] if len(values) > 1 else None,
        angle_rad=math.radians(values[2]) if len(values) > 2 else None,
    )


def _numbers(option: str, text: str, form: str, *, least: int, most: int) -> list[float]:
    wanted = f"wanted {form}, positive numbers"
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError as error:
        raise ConfigError(f"{option}: found '{text}', {wanted}") from error
    if not least <= len(values) <= most or not all(0 < value < math.inf for value in values):
        raise ConfigError(f"{option}: found '{text}', {wanted}")
    return values
