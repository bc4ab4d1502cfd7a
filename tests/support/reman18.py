"""Files of the simulated reman18 motors and predictors that know the truth."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.spatial import KDTree

from boltpose.geometry.transforms import Transform
from boltpose.io.scan import read_scan
from boltpose.prior.build import BuildConfig, build_prior
from boltpose.schema import Prior, Scan

ROOT = Path(__file__).parents[2] / "data" / "reman18"


class TruePredictor:
    """Hands out labels known beforehand, so that a test needs no network."""

    def __init__(self, points: np.ndarray, motor_probability: np.ndarray) -> None:
        self.tree = KDTree(points)
        self.motor_probability = motor_probability

    def predict(self, points: np.ndarray) -> np.ndarray:
        distance, rows = self.tree.query(points)
        assert not distance.any(), "asked about points of another scan"
        return self.motor_probability[rows]


@cache
def true_prior(motor: str) -> Prior:
    """The prior made with the full scan's true labels."""
    config = BuildConfig(use_file_labels=True)
    return build_prior(read_scan(ROOT / motor / "prior.ply"), config=config, name=motor)


@cache
def view(motor: str, number: int) -> tuple[Scan, TruePredictor]:
    """One view and its true scene labels."""
    scan = read_scan(ROOT / motor / "depth" / f"{number:06d}.png")
    assert scan.pixels is not None
    labels = np.asarray(Image.open(ROOT / motor / "label" / f"{number:06d}.png"))
    is_motor = labels[scan.pixels[:, 0], scan.pixels[:, 1]] > 0
    return scan, TruePredictor(scan.points, is_motor.astype(np.float32))


def true_pose(motor: str, number: int) -> Transform:
    """`camera_from_prior` of a view."""
    truth = json.loads((ROOT / motor / "scene_gt.json").read_text())[str(number)][0]
    rotation = np.array(truth["cam_R_m2c"]).reshape(3, 3)
    return Transform.from_parts("camera", "prior", rotation, truth["cam_t_m2c"])


def true_bolts(motor: str, number: int) -> list[dict]:
    """The bolts of a view as reman18 states them."""
    return json.loads((ROOT / motor / "bolts.json").read_text())[str(number)]["bolts"]
