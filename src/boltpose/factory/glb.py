"""Binary glTF and STL of models, written by hand: the bytes depend on the model alone."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

from boltpose.factory.looks import LOOKS
from boltpose.factory.model import Material, SolidPart

_M_PER_MM = 1e-3
_FLOAT32, _UINT32 = 5126, 5125
_VERTICES, _INDICES = 34962, 34963


def glb_bytes(solids: Sequence[SolidPart]) -> bytes:
    """A GLB file with one named node per solid, in metres, z as in the solids' frame.

    Source:
        glTF 2.0 specification, sections 3.6 (buffers), 3.7 (meshes), 3.9 (materials), 4 (GLB).
    """
    materials = sorted({solid.material for solid in solids})
    views: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []
    chunks: list[bytes] = []
    start = 0
    for solid in solids:
        vertices = (solid.vertices * _M_PER_MM).astype("<f4")
        corners = solid.faces.astype("<u4").reshape(-1)
        accessors.append(
            {
                "bufferView": len(views),
                "componentType": _FLOAT32,
                "count": len(vertices),
                "type": "VEC3",
                # the standard wants the box of positions
                "min": vertices.min(axis=0).astype(np.float64).tolist(),
                "max": vertices.max(axis=0).astype(np.float64).tolist(),
            }
        )
        accessors.append(
            {
                "bufferView": len(views) + 1,
                "componentType": _UINT32,
                "count": len(corners),
                "type": "SCALAR",
            }
        )
        for data, target in ((vertices.tobytes(), _VERTICES), (corners.tobytes(), _INDICES)):
            views.append(
                {"buffer": 0, "byteOffset": start, "byteLength": len(data), "target": target}
            )
            chunks.append(data)
            start += len(data)
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "boltpose"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(solids)))}],
        "nodes": [{"name": solid.name, "mesh": row} for row, solid in enumerate(solids)],
        "meshes": [
            _mesh(solid, row, materials.index(solid.material)) for row, solid in enumerate(solids)
        ],
        "materials": [_material(material) for material in materials],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": start}],
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    binary = b"".join(chunks)
    total = 12 + 8 + len(text) + 8 + len(binary)
    return b"".join(
        [
            struct.pack("<4sII", b"glTF", 2, total),
            struct.pack("<I4s", len(text), b"JSON"),
            text,
            struct.pack("<I4s", len(binary), b"BIN\0"),
            binary,
        ]
    )


def stl_bytes(solids: Sequence[SolidPart]) -> bytes:
    """A binary STL of all solids, in mm."""
    corners = np.concatenate([solid.vertices[solid.faces] for solid in solids])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    record = np.zeros(
        len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")]
    )
    record["normal"] = normals / np.maximum(lengths, 1e-12)
    record["corners"] = corners
    header = b"boltpose, millimetres".ljust(80, b" ")
    return header + struct.pack("<I", len(corners)) + record.tobytes()


def _mesh(solid: SolidPart, row: int, material: int) -> dict[str, Any]:
    attributes = {"POSITION": 2 * row}
    primitive = {"attributes": attributes, "indices": 2 * row + 1, "material": material}
    return {"name": solid.name, "primitives": [primitive]}


def _material(material: Material) -> dict[str, Any]:
    look = LOOKS[material]
    return {
        "name": material.value,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*look.color, 1.0],
            "metallicFactor": look.metallic,
            "roughnessFactor": look.roughness,
        },
    }
