"""Inputs of commands: one place that knows a scan from a mesh, and hashes what was read."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from boltpose.errors import ConfigError
from boltpose.geometry.transforms import Transform
from boltpose.io.guard import require_file
from boltpose.io.hand_eye import hand_eye_error, read_hand_eye
from boltpose.io.label_files import read_labelled_scan
from boltpose.io.mesh import MESH_SUFFIXES, read_mesh
from boltpose.io.mesh_sampling import sample_mesh
from boltpose.io.part_names import read_part_names
from boltpose.io.ply_header import read_ply_header
from boltpose.io.scan import read_scan
from boltpose.schema import HandEyeError, Scan

_MESH_SEED = 0
"""A mesh is sampled at random; always the same way, so that a prior can be built again."""


def read_full_scan(
    path: Path, *, unit: str | None, parts: Path | None, needs_labels: bool = False
) -> Scan:
    """Read a complete scan, or sample a CAD mesh.

    Args:
        path: A scan or a mesh; a `.ply` with faces is a mesh.
        unit: Unit of the file; None for the format's own (mm, but metres for `.glb`).
        parts: File with the classes of a mesh's parts; the scan then carries labels.
        needs_labels: Refuse a scan without labels; those of the paper's palette count too.

    Returns:
        The points in mm, in the file's own frame.

    Raises:
        InputFileError: A file cannot be used.
        ConfigError: `parts` was given for a scan, or does not fit the mesh.
    """
    if is_mesh(path):
        names_to_part = None if parts is None else read_part_names(parts)
        rng = np.random.default_rng(_MESH_SEED)
        return sample_mesh(read_mesh(path, unit=unit), names_to_part, rng=rng)
    if parts is not None:
        raise ConfigError(f"--parts names the parts of a mesh, but {path} is a scan")
    if needs_labels:
        return read_labelled_scan(path, unit=unit or "mm")
    return read_scan(path, unit=unit or "mm")


def is_mesh(path: Path) -> bool:
    """Tell a mesh from a scan by its suffix; a `.ply` by whether it has faces.

    Raises:
        InputFileError: A `.ply` is missing or broken.
    """
    if path.suffix.lower() != ".ply":
        return path.suffix.lower() in MESH_SUFFIXES
    with require_file(path, "a scan or a mesh").open("rb") as stream:
        header = read_ply_header(path, stream)
    return any(element.name == "face" and element.count > 0 for element in header.elements)


def read_hand_eye_of(
    hand_eye: Path | None, robot_pose: Path | None, unit: str
) -> tuple[Transform | None, HandEyeError | None]:
    """Read the hand-eye matrix; with a robot pose, that of a camera on the arm.

    Args:
        hand_eye: `base_from_camera`, or `flange_from_camera` when a robot pose is given.
        robot_pose: `base_from_flange` at the moment of the scan.
        unit: Unit of both.

    Returns:
        `base_from_camera`, and how well it is known if the file holds residuals; None without
        hand-eye.

    Raises:
        InputFileError: A file holds no rigid transform.
        ConfigError: A robot pose without hand-eye.
    """
    if hand_eye is None:
        if robot_pose is not None:
            raise ConfigError("--robot-pose needs --hand-eye, the camera in the flange")
        return None, None
    if robot_pose is None:
        found = read_hand_eye(hand_eye, unit=unit)
        return found.transform, hand_eye_error(found)
    found = read_hand_eye(hand_eye, unit=unit, target="flange")
    base_from_flange = read_hand_eye(robot_pose, unit=unit, source="flange").transform
    return base_from_flange @ found.transform, hand_eye_error(found)
