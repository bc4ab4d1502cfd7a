"""A motor as files for other programs, and as what `boltpose locate` knows beforehand."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import yaml

from boltpose.arrays import FloatArray, UInt8Array
from boltpose.factory.glb import glb_bytes, stl_bytes
from boltpose.factory.model import MotorModel, TrueBolt
from boltpose.geometry.transforms import Transform
from boltpose.io.atomic import write_atomic
from boltpose.io.mesh import MeshPart
from boltpose.io.mesh_sampling import sample_mesh
from boltpose.schema import Alignment, Part, Prior, PriorBolt

_SIGMA_MM = 0.05
"""Of a bolt's place against its drawing, lateral and axial: general tolerances of machining (ISO
2768 f) are twice that."""
_FULL_SUPPORT = 20.0
"""Head-fit support that counts in full; nothing had to be fitted here."""
_CLUSTER_PLAY_MM = 0.5
_SEED = 0


def export_model(model: MotorModel, folder: str | Path) -> tuple[Path, ...]:
    """Write a motor for CAD programs, Blender, simulators and `boltpose prior build`.

    Files are called after the motor: `.stl` (all of it, mm), `.glb` (named parts, metres, z as
    in frame `motor`), `.parts.yaml` (which class every part has), `.bolts.json` (true bolts in
    frame `motor`), `.spec.json` (how it was made).

    Args:
        model: The motor.
        folder: Exists; files of that name are replaced.

    Returns:
        The files.

    Raises:
        OSError: The folder is missing or not writable.
    """
    name = model.spec.name
    classes = {solid.name: solid.part.name.lower() for solid in model.parts}
    contents = {
        f"{name}.stl": stl_bytes(model.parts),
        f"{name}.glb": glb_bytes(model.parts),
        f"{name}.parts.yaml": yaml.safe_dump(classes, sort_keys=False).encode(),
        f"{name}.bolts.json": _json(bolts_to_json(model)),
        f"{name}.spec.json": _json(model.spec.model_dump(mode="json")),
    }
    files: list[Path] = []
    for file_name, data in contents.items():

        def write(stream: BinaryIO, data: bytes = data) -> None:
            stream.write(data)

        write_atomic(Path(folder) / file_name, write)
        files.append(Path(folder) / file_name)
    return tuple(files)


def bolts_to_json(model: MotorModel) -> dict[str, Any]:
    """All true bolts, JSON-ready; lengths mm, frame `motor`."""
    return {
        "name": model.spec.name,
        "unit": "mm",
        "frame": "motor",
        "bolts": [
            {
                "id": bolt.id,
                "side": str(bolt.side),
                "head": bolt.spec.head.value,
                "thread": f"M{bolt.spec.thread_mm}",
                "across_mm": bolt.across_mm,
                "head_diameter_mm": bolt.head_diameter_mm,
                "head_height_mm": bolt.head_height_mm,
                "head_top": bolt.head_top.tolist(),
                "head_centre": bolt.head_centre.tolist(),
                "axis": bolt.axis.tolist(),
                "motor_from_bolt": bolt.motor_from_bolt.matrix.tolist(),
            }
            for bolt in model.bolts
        ],
    }


def model_prior(model: MotorModel, *, spacing_mm: float = 1.0) -> Prior:
    """What a perfect full scan of the motor would tell, with its bolts and axes as built.

    Args:
        model: The motor. Frame `prior` is its frame `motor`.
        spacing_mm: Distance of the surface points.

    Returns:
        A prior that `boltpose locate` takes; `prior.file.write_prior` stores it.

    Raises:
        ConfigError: The spacing is not positive or gives too many points.
    """
    meshes = [
        MeshPart(name=solid.name, vertices=solid.vertices, faces=solid.faces)
        for solid in model.parts
    ]
    scan = sample_mesh(
        meshes,
        {solid.name: solid.part for solid in model.parts},
        spacing_mm=spacing_mm,
        rng=np.random.default_rng(_SEED),
    )
    assert scan.normals is not None
    assert scan.labels is not None
    # as a file stores them, so that memory and disk agree
    points = scan.points.astype(np.float32).astype(np.float64)
    normals = scan.normals.astype(np.float32).astype(np.float64)
    prior_from_motor = Transform.identity("prior", "motor")
    housing = int((scan.labels == Part.MAIN_HOUSING).sum())
    return Prior(
        name=model.spec.name,
        points=points,
        normals=normals,
        labels=scan.labels,
        bolts=tuple(
            _prior_bolt(bolt, points, scan.labels, prior_from_motor) for bolt in model.bolts
        ),
        alignment=Alignment(
            prior_from_motor=prior_from_motor,
            axis_spread_rad=0.0,
            axis_sigma_rad=0.0,
            normal_count=housing,
            inlier_ratio=1.0,
            has_solenoid=model.spec.solenoid is not None,
        ),
        provenance={"labels": "model", "spec": model.spec.model_dump(mode="json")},
    )


def _prior_bolt(
    bolt: TrueBolt, points: FloatArray, labels: UInt8Array, prior_from_motor: Transform
) -> PriorBolt:
    prior_from_bolt = prior_from_motor @ bolt.motor_from_bolt
    local = prior_from_bolt.inverse().apply(points)
    on_bolt = (
        (labels == Part.BOLT)
        & (np.hypot(local[:, 0], local[:, 1]) < 0.5 * bolt.head_diameter_mm + _CLUSTER_PLAY_MM)
        & (local[:, 2] > -bolt.head_height_mm - _CLUSTER_PLAY_MM)
        & (local[:, 2] < _CLUSTER_PLAY_MM)
    )
    centre = (
        points[on_bolt].mean(axis=0) if on_bolt.any() else prior_from_motor.apply(bolt.head_centre)
    )
    return PriorBolt(
        id=bolt.id,
        side=bolt.side,
        prior_from_bolt=prior_from_bolt,
        cluster_centre=centre,
        head_diameter_mm=bolt.across_mm,
        head_height_mm=bolt.head_height_mm,
        point_count=int(on_bolt.sum()),
        class_probability=1.0,
        head_fit_support=_FULL_SUPPORT,
        sigma_lateral_mm=_SIGMA_MM,
        sigma_axial_mm=_SIGMA_MM,
        is_sure=True,
    )


def _json(document: dict[str, Any]) -> bytes:
    return json.dumps(document, indent=1).encode() + b"\n"
