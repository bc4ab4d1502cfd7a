"""Hand-eye matrices and robot poses from Zivid, OpenCV and plain files."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.errors import FrameError, InputFileError
from boltpose.geometry.transforms import ROTATION_TOLERANCE, Transform
from boltpose.io.guard import refusing, require_file
from boltpose.io.matrix_text import FoundMatrix, find_matrices, find_residuals, parse_document
from boltpose.io.units import Unit, as_unit, check_translation
from boltpose.schema import HandEyeError

_WANTED = "one 4x4 rigid transform in a .yaml, .yml, .json, .csv or .txt file"
_LAST_ROW = (0.0, 0.0, 0.0, 1.0)
_ROW_TOLERANCE = 1e-9
"""That of `Transform`."""
_DIRECTION = re.compile(r"([a-z]+)_from_([a-z]+)")
_FRAMES = {"base", "flange", "tool", "camera", "prior", "motor", "bolt"}


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseResidual:
    """How far one pose of a hand-eye calibration is from the calibrated transform."""

    rotation_deg: float
    translation_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class HandEye:
    """A calibrated transform and what its calibration said about it."""

    transform: Transform
    residuals: tuple[PoseResidual, ...] = ()
    """Empty where the file holds none. Small ones do not prove that the tool meets the bolt."""


def read_hand_eye(
    path: str | Path,
    *,
    unit: str = Unit.MM,
    target: str = "base",
    source: str = "camera",
    option: str = "--hand-eye-unit",
) -> HandEye:
    """Read `target_from_source`: a hand-eye matrix, or a robot pose with other frame names.

    Args:
        path: Zivid `FloatMatrix` YAML, OpenCV `PoseState` YAML, or a plain 4x4 in YAML, JSON or
            CSV, row-major, acting on columns (translation in the last column).
        unit: The unit of the translation, a `Unit`.
        target: The frame that coordinates are taken to.
        source: The frame that coordinates are taken from.
        option: The command-line option that sets the unit, for the error text.

    Returns:
        The transform, its translation in mm, with the residuals the file holds.

    Raises:
        ConfigError: There is no such unit.
        InputFileError: The file is missing or broken, holds no or several matrices, says that it
            goes the other way, or its matrix is scaled, mirrored, transposed or otherwise no
            rigid transform.
        UnitError: The translation does not fit the unit.
    """
    length_unit = as_unit(unit)
    file = require_file(path, _WANTED)
    with refusing(file, _WANTED):
        document = parse_document(file, _WANTED)
        matrix = _choose(file, find_matrices(document), target, source)
        _check_rigid(file, matrix)
        length = float(np.linalg.norm(matrix[:3, 3]))
        check_translation(file, length, length_unit, option=option)
        matrix[:3, 3] *= length_unit.mm
        residuals = tuple(
            PoseResidual(rotation_deg=rotation, translation_mm=translation)
            for rotation, translation in find_residuals(document)
        )
        try:
            transform = Transform(target, source, matrix)
        except FrameError as error:
            raise InputFileError(file, str(error), _WANTED) from error
    return HandEye(transform=transform, residuals=residuals)


def hand_eye_error(hand_eye: HandEye) -> HandEyeError | None:
    """Estimate how well a hand-eye matrix is known from the residuals of its calibration.

    Every residual is taken for one draw of the matrix's own error, so the estimate does not shrink
    with the number of poses: the residuals of one calibration share board, camera and arm. It is
    conservative where the residuals are independent, and too small where an error is common to all
    poses (a tool centre point measured wrong, a camera that has drifted since): residuals cannot
    show that, only a touch can.

    Args:
        hand_eye: As read.

    Returns:
        Sigmas per axis: the root mean square over the poses, by the square root of 3, since a
        residual is the length of three components. None without residuals.
    """
    if not hand_eye.residuals:
        return None
    rotation = np.array([residual.rotation_deg for residual in hand_eye.residuals])
    translation = np.array([residual.translation_mm for residual in hand_eye.residuals])
    return HandEyeError(
        rotation_sigma_rad=float(np.radians(np.sqrt(np.mean(rotation**2) / 3.0))),
        translation_sigma_mm=float(np.sqrt(np.mean(translation**2) / 3.0)),
    )


def _choose(path: Path, found: list[FoundMatrix], target: str, source: str) -> FloatArray:
    """Take the only matrix, or the one named like the wanted transform."""
    wanted_name = f"{target}_from_{source}"
    named = [entry for entry in found if entry.key.lower() == wanted_name]
    if len(named) == 1:
        found = named
    if len(found) != 1:
        keys = ", ".join(entry.key or "(unnamed)" for entry in found)
        text = f"{len(found)} matrices: {keys[:120]}" if found else "no 4x4 matrix"
        raise InputFileError(path, text, f"{_WANTED}, or one named {wanted_name}")
    direction = _DIRECTION.fullmatch(found[0].key.lower())
    # `transform_from_calibration` says nothing about frames
    if (
        direction
        and {*direction.groups()} <= _FRAMES | {target, source}
        and (direction.group(1, 2) != (target, source))
    ):
        raise InputFileError(path, f"a matrix named {found[0].key}", wanted_name)
    return found[0].matrix.copy()


def _check_rigid(path: Path, matrix: FloatArray) -> None:
    """Refuse what is no rigid transform, and say what it looks like."""
    if not np.isfinite(matrix).all():
        raise InputFileError(path, "a matrix with values that are not finite", _WANTED)
    if np.abs(matrix[3] - _LAST_ROW).max() > _ROW_TOLERANCE:
        is_transposed = np.abs(matrix[:, 3] - _LAST_ROW).max() <= _ROW_TOLERANCE
        found = f"the last row {matrix[3].tolist()}"
        if is_transposed:
            found += " and the last column 0 0 0 1, so it looks transposed"
        raise InputFileError(path, found, "0 0 0 1 in the last row, the translation in the column")
    rotation = matrix[:3, :3]
    gram = rotation @ rotation.T
    scale = float(np.sqrt(np.trace(gram) / 3))
    wanted = "a rotation matrix: orthonormal, det +1"
    if scale == 0 or np.abs(gram / scale**2 - np.eye(3)).max() > ROTATION_TOLERANCE:
        error = float(np.abs(gram - np.eye(3)).max())
        raise InputFileError(path, f"a rotation part R with R Rt off from 1 by {error:.3g}", wanted)
    if abs(scale - 1) > ROTATION_TOLERANCE / 2:
        raise InputFileError(path, f"a rotation part scaled by {scale:.6g}", wanted)
    if np.linalg.det(rotation) < 0:
        raise InputFileError(path, "a mirrored rotation part (det -1)", wanted)
