"""Read scans, meshes and hand-eye matrices; the suffix picks the codec. Units end here."""

from boltpose.io.atomic import write_atomic
from boltpose.io.hand_eye import HandEye, PoseResidual, read_hand_eye
from boltpose.io.labelled import write_ply
from boltpose.io.mesh import MESH_SUFFIXES, MeshPart, read_mesh
from boltpose.io.mesh_sampling import sample_mesh
from boltpose.io.part_names import match_part_names, read_part_names
from boltpose.io.scan import SCAN_SUFFIXES, read_scan
from boltpose.io.units import Unit

__all__ = [
    "MESH_SUFFIXES",
    "SCAN_SUFFIXES",
    "HandEye",
    "MeshPart",
    "PoseResidual",
    "Unit",
    "match_part_names",
    "read_hand_eye",
    "read_mesh",
    "read_part_names",
    "read_scan",
    "sample_mesh",
    "write_atomic",
    "write_ply",
]
