"""A data set of the form of reman18, small enough to run through in no time."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from boltpose.evaluation.pipeline import OnStage, Pipeline
from boltpose.evaluation.reman18 import read_motor
from boltpose.geometry.transforms import Transform
from boltpose.schema import LocateResult, Prior, Scan
from tests.unit.evaluation.records import TOPS, located, perfect_prior, true_bolts

SHAPE = (30, 40)
CAMERA = np.array([[200.0, 0, 20], [0, 200.0, 15], [0, 0, 1]])
SCALE = 0.02
FAMILIES = {"motor_000": "even", "motor_001": "odd", "motor_002": "even"}


def write_tiny_reman18(root: Path) -> Path:
    """Three motors of two families with two views each: a motor blob before a clamp plane."""
    for number, (name, family) in enumerate(FAMILIES.items()):
        folder = root / name
        for sub in ("depth", "label", "hand_eye"):
            (folder / sub).mkdir(parents=True)
        bolts = [
            {
                "id": bolt.id,
                "head": bolt.head,
                "side": bolt.side.value,
                "head_diameter": bolt.head_diameter_mm,
                "C": {"head_top": bolt.head_top_mm.tolist(), "axis": bolt.axis.tolist()},
            }
            for bolt in true_bolts()
        ]
        truth = {
            "family_name": family,
            "T_M_to_C": np.eye(4).tolist(),
            "dims_mm": {"R": 20.0, "L": 60.0},
            "bolts": bolts,
        }
        _write(folder / "prior_gt.json", truth)
        (folder / "prior.ply").write_text("the true prior is known")
        cameras, scenes, seen = {}, {}, {}
        for view in range(2):
            pose = np.eye(4)
            pose[:3, 3] = (5.0 * number, 3.0 * view, 600.0)
            hand_eye = np.eye(4)
            hand_eye[:3, 3] = (900.0, 0.0, 10.0 * view)
            cameras[str(view)] = {"cam_K": CAMERA.reshape(-1).tolist(), "depth_scale": SCALE}
            scenes[str(view)] = [{"T_C_to_B": pose.tolist(), "T_B_to_A": hand_eye.tolist()}]
            seen[str(view)] = {
                "clamp_name": f"clamp {view}",
                "bolts": [
                    {"id": i, "visible": i < 2, "visible_fraction": 0.4 if i < 2 else 0.0}
                    for i in range(len(TOPS))
                ],
            }
            _write_images(folder, view)
        _write(folder / "scene_camera.json", cameras)
        _write(folder / "scene_gt.json", scenes)
        _write(folder / "bolts.json", seen)
    return root


def _write(path: Path, data: object) -> None:
    path.write_text(json.dumps(data))


def _write_images(folder: Path, view: int) -> None:
    depth = np.full(SHAPE, 700.0)
    labels = np.zeros(SHAPE, dtype=np.uint8)
    depth[8:22, 10:30] = 600.0
    labels[8:22, 10:30] = 1
    depth[:, :2] = 0.0
    Image.fromarray(np.round(depth / SCALE).astype(np.uint16)).save(
        folder / "depth" / f"{view:06d}.png"
    )
    Image.fromarray(labels).save(folder / "label" / f"{view:06d}.png")


def read_tiny_scan(path: Path) -> Scan:
    """Read a depth image of the tiny data set; a full scan gives the true bolts' heads."""
    if path.suffix == ".ply":
        return Scan(points=TOPS, labels=np.full(len(TOPS), 6, dtype=np.uint8), source=str(path))
    with Image.open(path) as image:
        depth = np.asarray(image, dtype=np.float64) * SCALE
    pixels = np.argwhere(depth > 0)
    z = depth[depth > 0]
    x = (pixels[:, 1] - CAMERA[0, 2]) / CAMERA[0, 0] * z
    y = (pixels[:, 0] - CAMERA[1, 2]) / CAMERA[1, 1] * z
    return Scan(
        points=np.stack([x, y, z], axis=1),
        pixels=pixels.astype(np.int64),
        grid_shape=SHAPE,
        source=str(path),
    )


def tiny_pipeline(root: Path) -> Pipeline[str]:
    """A pipeline that knows the truth: always ok for plain views, always that view's pose."""

    def load_models(folder: Path) -> str:
        return folder.name

    def read_hand_eye(path: Path) -> Transform:
        view = read_motor(root, path.parent.parent.name).views[int(path.stem)]
        return view.base_from_camera

    def build_prior(scan: Scan, models: str, name: str, on_stage: OnStage) -> Prior:
        assert scan.labels is None, "the truth must not reach the prior"
        assert models == FAMILIES[name]
        on_stage("build", 0.25)
        return perfect_prior(name)

    def locate(
        scan: Scan, prior: Prior, base_from_camera: Transform, models: str, on_stage: OnStage
    ) -> LocateResult:
        path = Path(scan.source.split("#")[0])
        motor = read_motor(root, path.parent.parent.name)
        assert models == motor.family
        on_stage("find", 0.125)
        view = motor.views[int(path.stem)]
        result = located(prior, view.camera_from_prior, base_from_camera)
        with Image.open(view.label_path) as labels, Image.open(view.depth_path) as depth:
            is_motor = np.asarray(labels)[np.asarray(depth) > 0] > 0
        return replace(result, motor_mask=is_motor)

    return Pipeline(
        load_models=load_models,
        read_scan=read_tiny_scan,
        read_hand_eye=read_hand_eye,
        build_prior=build_prior,
        prepare=lambda prior: prior,
        locate=locate,
    )
