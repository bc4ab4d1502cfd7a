"""reman18 on disk: simulated starter motors, full scans and views, labelled point by point."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from boltpose.arrays import FloatArray
from boltpose.datasets.labelled_motors import LabelledCloud
from boltpose.errors import InputFileError


@dataclass(frozen=True, slots=True, kw_only=True)
class Reman18:
    """The motors of a reman18 folder.

    Nothing is read before it is asked for.
    """

    root: Path

    def __post_init__(self) -> None:
        if not any(self.root.glob("motor_*/prior.ply")):
            raise InputFileError(self.root, "no motor_*/prior.ply", "a reman18 folder")

    @property
    def motors(self) -> tuple[str, ...]:
        """Names of all motors, sorted."""
        return tuple(sorted(path.parent.name for path in self.root.glob("motor_*/prior.ply")))

    @property
    def families(self) -> tuple[str, ...]:
        """Names of all families, sorted."""
        return tuple(sorted({self.family(motor) for motor in self.motors}))

    @property
    def fingerprint(self) -> str:
        """Twelve hexadecimal digits of names and sizes of all files of motors: for caches."""
        digest = hashlib.sha256()
        for path in sorted(self.root.glob("motor_*/**/*")):
            if path.is_file():
                name = path.relative_to(self.root).as_posix()
                digest.update(f"{name} {path.stat().st_size}\0".encode())
        return digest.hexdigest()[:12]

    def family(self, motor: str) -> str:
        """Family of a motor; motors of one family share their construction."""
        return str(self._json(motor, "prior_gt.json")["family_name"])

    def motors_of(self, family: str) -> tuple[str, ...]:
        """Motors of one family, sorted.

        Raises:
            ValueError: There is no such family.
        """
        found = tuple(motor for motor in self.motors if self.family(motor) == family)
        if not found:
            raise ValueError(f"family must be one of {self.families}, got '{family}'")
        return found

    def full_scan(self, motor: str) -> LabelledCloud:
        """Read the labelled full scan of a motor, frame `prior`."""
        path = self.root / motor / "prior.ply"
        data = path.read_bytes()
        end = data.find(b"end_header\n") + len(b"end_header\n")
        header = data[:end].decode("ascii", errors="replace")
        if "binary_little_endian" not in header or "uchar label" not in header:
            raise InputFileError(path, header[:80], "binary little endian x, y, z, label")
        row = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("label", "u1")])
        if (len(data) - end) % row.itemsize or "property double" in header:
            found = f"{len(data) - end} bytes of points"
            raise InputFileError(path, found, f"float x, y, z and uchar label: {row.itemsize} each")
        table = np.frombuffer(data[end:], row)
        points = np.stack([table["x"], table["y"], table["z"]], axis=1).astype(np.float64)
        return LabelledCloud(points=points, labels=table["label"].astype(np.uint8))

    def view_count(self, motor: str) -> int:
        """Number of views of a motor."""
        return len(self._json(motor, "scene_camera.json"))

    def view(self, motor: str, number: int) -> LabelledCloud:
        """Read one view, frame `camera`; pixels without a measurement are left out."""
        camera = self._json(motor, "scene_camera.json")[str(number)]
        depth = self._image(motor, "depth", number).astype(np.float64) * camera["depth_scale"]
        labels = self._image(motor, "label", number)
        intrinsics = np.reshape(np.array(camera["cam_K"], dtype=np.float64), (3, 3))
        row, column = np.nonzero(depth > 0)
        z = depth[row, column]
        x = (column - intrinsics[0, 2]) / intrinsics[0, 0] * z
        y = (row - intrinsics[1, 2]) / intrinsics[1, 1] * z
        return LabelledCloud(
            points=np.stack([x, y, z], axis=1), labels=labels[row, column].astype(np.uint8)
        )

    def camera_from_prior(self, motor: str, number: int) -> FloatArray:
        """True pose of the motor in a view; shape (4, 4), mm."""
        truth = self._json(motor, "scene_gt.json")[str(number)][0]
        matrix = np.eye(4)
        matrix[:3, :3] = np.reshape(truth["cam_R_m2c"], (3, 3))
        matrix[:3, 3] = truth["cam_t_m2c"]
        return matrix

    def _json(self, motor: str, name: str) -> Any:
        return json.loads((self.root / motor / name).read_text())

    def _image(self, motor: str, kind: str, number: int) -> npt.NDArray[Any]:
        with Image.open(self.root / motor / kind / f"{number:06d}.png") as image:
            return np.asarray(image)
