"""The truth of reman18, a *simulated* data set, and nothing but the truth: no scan is read here."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from boltpose.arrays import FloatArray, UInt8Array, freeze
from boltpose.errors import InputFileError
from boltpose.geometry.transforms import Transform
from boltpose.schema import Side


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TrueBolt:
    """One bolt as the generator placed it."""

    id: int
    """Its number in the files, the same in every view."""
    head: str
    """Shape of the head, for example `hex_flange`."""
    side: Side
    head_top_mm: FloatArray
    """Shape (3,), mm, frame `prior`: on the axis, in the top face of the head."""
    axis: FloatArray
    """Shape (3,), unit, frame `prior`, out of the head."""
    head_diameter_mm: float

    def __post_init__(self) -> None:
        axis = np.asarray(self.axis, dtype=np.float64)
        object.__setattr__(self, "axis", freeze(axis / np.linalg.norm(axis)))
        object.__setattr__(self, "head_top_mm", freeze(np.asarray(self.head_top_mm, np.float64)))


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueVisibility:
    """What the simulated camera measured of one bolt."""

    is_visible: bool
    """The data set's own flag: fraction >= 0.10 and at least 30 pixels."""
    fraction: float
    """Share of the outer head surface, 0 to 1."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TrueView:
    """One single view of a clamped motor."""

    motor: str
    index: int
    camera_from_prior: Transform
    base_from_camera: Transform
    camera_matrix: FloatArray
    """Shape (3, 3), pixels."""
    depth_scale_mm: float
    """mm per unit of the depth image."""
    clamp: str
    visibility: Mapping[int, TrueVisibility]
    """By bolt number."""
    depth_path: Path
    label_path: Path
    hand_eye_path: Path


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TrueMotor:
    """One motor: its full scan's truth and its views."""

    name: str
    family: str
    prior_from_motor: Transform
    bolts: tuple[TrueBolt, ...]
    views: tuple[TrueView, ...]
    housing_radius_mm: float
    housing_length_mm: float
    scan_path: Path
    """The full scan, frame `prior`."""

    @property
    def number(self) -> int:
        """Its number in the data set; seeds what is random per motor."""
        return int(self.name.rsplit("_", 1)[1])


def list_motors(root: str | Path) -> tuple[str, ...]:
    """Name the motors of a data set folder, sorted.

    Raises:
        InputFileError: The folder holds none.
    """
    names = sorted(path.name for path in Path(root).glob("motor_*") if path.is_dir())
    if not names:
        raise InputFileError(root, "no folder motor_*", "the folder of reman18")
    return tuple(names)


def read_motor(root: str | Path, name: str, *, with_views: bool = True) -> TrueMotor:
    """Read the truth of one motor and its views.

    The files state `T_M_to_C` (here `prior_from_motor`), `T_C_to_B` (`camera_from_prior`) and
    `T_B_to_A` (`base_from_camera`) with six to nine decimals; `Transform` makes them orthonormal.

    Args:
        root: Folder of the data set.
        name: Folder of the motor in it, for example `motor_003`.
        with_views: Whether to read the views too; motors from the factory may have none.

    Returns:
        The truth, lengths in mm.

    Raises:
        InputFileError: A file is missing or is not what the README of the data set says.
    """
    folder = Path(root) / name
    truth = _read_json(folder / "prior_gt.json")
    try:
        bolts = tuple(_true_bolt(entry) for entry in truth["bolts"])
        return TrueMotor(
            name=name,
            family=str(truth["family_name"]),
            prior_from_motor=Transform("prior", "motor", np.array(truth["T_M_to_C"])),
            bolts=bolts,
            views=_true_views(folder) if with_views else (),
            housing_radius_mm=float(truth["dims_mm"]["R"]),
            housing_length_mm=float(truth["dims_mm"]["L"]),
            scan_path=folder / "prior.ply",
        )
    except (KeyError, TypeError, ValueError) as error:
        raise InputFileError(folder, f"truth that cannot be read ({error})", "reman18") from error


def read_pixel_labels(view: TrueView, pixels: npt.NDArray[np.integer[Any]]) -> UInt8Array:
    """Look up the true class of scan points.

    Args:
        view: The view.
        pixels: Shape (N, 2), row and column of every point.

    Returns:
        Shape (N,), `Part` numbers, 0 for clamp and background.

    Raises:
        InputFileError: The label image cannot be read.
    """
    labels = read_label_image(view)
    return labels[pixels[:, 0], pixels[:, 1]]


def read_label_image(view: TrueView) -> UInt8Array:
    """Read the true classes of a view's pixels, shape (rows, columns), 0 also where no depth is.

    Raises:
        InputFileError: The label image cannot be read.
    """
    try:
        with Image.open(view.label_path) as image:
            return np.asarray(image, dtype=np.uint8)
    except (OSError, ValueError) as error:
        raise InputFileError(view.label_path, str(error), "an 8-bit PNG") from error


def _true_bolt(entry: Mapping[str, Any]) -> TrueBolt:
    return TrueBolt(
        id=int(entry["id"]),
        head=str(entry["head"]),
        side=Side(entry["side"]),
        head_top_mm=np.array(entry["C"]["head_top"], dtype=np.float64),
        axis=np.array(entry["C"]["axis"], dtype=np.float64),
        head_diameter_mm=float(entry["head_diameter"]),
    )


def _true_views(folder: Path) -> tuple[TrueView, ...]:
    cameras = _read_json(folder / "scene_camera.json")
    scenes = _read_json(folder / "scene_gt.json")
    bolts = _read_json(folder / "bolts.json")
    views: list[TrueView] = []
    for key in sorted(cameras, key=int):
        scene = scenes[key][0]
        views.append(
            TrueView(
                motor=folder.name,
                index=int(key),
                camera_from_prior=Transform("camera", "prior", np.array(scene["T_C_to_B"])),
                base_from_camera=Transform("base", "camera", np.array(scene["T_B_to_A"])),
                camera_matrix=np.array(cameras[key]["cam_K"], dtype=np.float64).reshape(3, 3),
                depth_scale_mm=float(cameras[key]["depth_scale"]),
                clamp=str(bolts[key]["clamp_name"]),
                visibility={
                    int(bolt["id"]): TrueVisibility(
                        is_visible=bool(bolt["visible"]),
                        fraction=float(bolt["visible_fraction"]),
                    )
                    for bolt in bolts[key]["bolts"]
                },
                depth_path=folder / "depth" / f"{int(key):06d}.png",
                label_path=folder / "label" / f"{int(key):06d}.png",
                hand_eye_path=folder / "hand_eye" / f"{int(key):06d}.yaml",
            )
        )
    return tuple(views)


def _read_json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputFileError(path, str(error), "a JSON file of reman18") from error
