"""What a prior is built from: a complete scan, or a CAD mesh that is sampled like one."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from boltpose.errors import ConfigError
from boltpose.io.guard import require_file
from boltpose.io.label_files import read_labelled_scan
from boltpose.io.mesh import MESH_SUFFIXES, read_mesh
from boltpose.io.mesh_sampling import sample_mesh
from boltpose.io.part_names import read_part_names
from boltpose.io.ply_header import read_ply_header
from boltpose.io.scan import read_scan
from boltpose.schema import Scan

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
