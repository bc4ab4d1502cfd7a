"""What a data set in the layout of reman18 holds, in numbers read from its files."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.datasets.reman18 import Reman18
from boltpose.errors import InputFileError
from boltpose.schema import Part

CLASS_NAMES = tuple(part.name.lower() for part in Part if part is not Part.BACKGROUND)


@dataclass(frozen=True, slots=True, kw_only=True)
class BoltStatistics:
    """One bolt of a full scan."""

    head: str
    thread_mm: int
    side: str
    scan_points: int

    @property
    def kind(self) -> str:
        """For example `hex M6`."""
        return f"{self.head} M{self.thread_mm}"


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewStatistics:
    """One view."""

    clamp: str
    valid_pixels: int
    motor_pixels: int
    distance_mm: float
    """From the camera to the motor's origin."""
    visible_fractions: tuple[float, ...]
    """Of every bolt that was there."""
    is_visible: tuple[bool, ...]
    gone: int
    """Bolts of the scan that were not on the clamped motor any more."""
    retries: int

    @property
    def hidden_share(self) -> float:
        """Share of the bolts that are not visible, 0 to 1."""
        return 1 - sum(self.is_visible) / max(1, len(self.is_visible))


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorStatistics:
    """One motor and its views."""

    name: str
    family: str
    scan_points: int
    class_points: tuple[int, ...]
    """In the order of `CLASS_NAMES`."""
    yoke_radius_mm: float
    yoke_length_mm: float
    solenoid_radius_mm: float
    """0 without a solenoid, as are the next two."""
    solenoid_length_mm: float
    solenoid_offset_mm: float
    size_mm: tuple[float, float, float]
    """Of the box around the scanned motor, frame `motor`."""
    bolts: tuple[BoltStatistics, ...]
    views: tuple[ViewStatistics, ...]
    retries: int


@dataclass(frozen=True, slots=True, kw_only=True)
class DataSetStatistics:
    """A whole data set."""

    root: Path
    motors: tuple[MotorStatistics, ...]

    @property
    def views(self) -> tuple[ViewStatistics, ...]:
        """Of all motors."""
        return tuple(view for motor in self.motors for view in motor.views)

    @property
    def bolts(self) -> tuple[BoltStatistics, ...]:
        """Of all motors."""
        return tuple(bolt for motor in self.motors for bolt in motor.bolts)

    @property
    def class_points(self) -> FloatArray:
        """Shape (6,), points of all full scans by class."""
        return np.array([m.class_points for m in self.motors], dtype=np.float64).sum(axis=0)


def read_statistics(root: Path) -> DataSetStatistics:
    """Read the numbers of a data set in the layout of reman18.

    Raises:
        InputFileError: It holds no motor, or a file is missing or of another form.
    """
    data = Reman18(root=root)
    return DataSetStatistics(root=root, motors=tuple(_read_motor(data, n) for n in data.motors))


def quantiles(values: Sequence[float], *shares: float) -> tuple[float, ...]:
    """Quantiles of numbers; NaN for none."""
    if not len(values):
        return tuple(float("nan") for _ in shares)
    return tuple(float(value) for value in np.quantile(np.asarray(values, np.float64), shares))


def _read_motor(data: Reman18, name: str) -> MotorStatistics:
    folder = data.root / name
    truth = _json(folder / "prior_gt.json")
    try:
        sizes = truth["dims_mm"]
        counts = truth["class_points"]
        extent = truth.get("size_mm") or _size_of_scan(data, name, truth)
        return MotorStatistics(
            name=name,
            family=str(truth["family_name"]),
            scan_points=int(truth["n_points"]),
            class_points=tuple(int(counts.get(part, 0)) for part in CLASS_NAMES),
            yoke_radius_mm=float(sizes["R"]),
            yoke_length_mm=float(sizes["L"]),
            solenoid_radius_mm=float(sizes["Rs"]),
            solenoid_length_mm=float(sizes["Ls"]),
            solenoid_offset_mm=float(sizes["offset"]),
            size_mm=(float(extent[0]), float(extent[1]), float(extent[2])),
            bolts=tuple(
                BoltStatistics(
                    head=str(bolt["head"]),
                    thread_mm=int(bolt["M"]),
                    side=str(bolt["side"]),
                    scan_points=int(bolt["scan_points"]),
                )
                for bolt in truth["bolts"]
            ),
            views=_read_views(folder, np.array(truth["T_M_to_C"], dtype=np.float64)),
            retries=len(truth.get("retries", ())),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise InputFileError(folder, f"truth that cannot be read ({error})", "reman18") from error


def _read_views(folder: Path, prior_from_motor: FloatArray) -> tuple[ViewStatistics, ...]:
    if not (folder / "bolts.json").exists():
        return ()
    views = _json(folder / "bolts.json")
    scenes = _json(folder / "scene_gt.json")
    found: list[ViewStatistics] = []
    for key in sorted(views, key=int):
        view = views[key]
        camera_from_prior = np.array(scenes[key][0]["T_C_to_B"], dtype=np.float64)
        there = [bolt for bolt in view["bolts"] if bolt.get("present", True)]
        found.append(
            ViewStatistics(
                clamp=str(view["clamp_name"]),
                valid_pixels=int(view["valid_pixels"]),
                motor_pixels=int(view["motor_pixels"]),
                distance_mm=float(np.linalg.norm((camera_from_prior @ prior_from_motor)[:3, 3])),
                visible_fractions=tuple(float(bolt["visible_fraction"]) for bolt in there),
                is_visible=tuple(bool(bolt["visible"]) for bolt in there),
                gone=len(view["bolts"]) - len(there),
                retries=len(view.get("retries", ())),
            )
        )
    return tuple(found)


def _size_of_scan(data: Reman18, name: str, truth: dict[str, Any]) -> list[float]:
    """Where the files do not say it: between the 0.1 % outermost points, so without stray ones."""
    prior_from_motor = np.array(truth["T_M_to_C"], dtype=np.float64)
    points = data.full_scan(name).points
    points_motor = (points - prior_from_motor[:3, 3]) @ prior_from_motor[:3, :3]
    low, high = np.quantile(points_motor, (0.001, 0.999), axis=0)
    return list(high - low)


def _json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputFileError(path, str(error), "a JSON file as in reman18") from error
