"""The pinhole camera inside a structured-light sensor, and the chips of cameras that exist."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from boltpose.arrays import FloatArray, IntArray
from boltpose.errors import ConfigError


@dataclass(frozen=True, slots=True, kw_only=True)
class PinholeCamera:
    """An ideal camera: x right, y down, z along the optical axis, no lens distortion.

    A structured-light camera hands out points that its maker has undistorted; what is left of the
    lens is the warp in `StructuredLightConfig`.
    """

    width: int
    """Columns."""
    height: int
    """Rows."""
    focal_px: float
    """Focal length in pixels, the same for rows and columns: pixels are square."""
    centre_px: tuple[float, float] | None = None
    """Column and row of the optical axis; pixel centres have whole numbers. None: the middle."""

    def __post_init__(self) -> None:
        if not (8 <= self.width <= 8192 and 8 <= self.height <= 8192):
            raise ConfigError(
                f"width and height must be 8 to 8192 pixels, got {self.width} x {self.height}"
            )
        if not 0 < self.focal_px < math.inf:
            raise ConfigError(f"focal_px must be > 0, got {self.focal_px}")
        if self.centre_px is not None and not all(map(math.isfinite, self.centre_px)):
            raise ConfigError(f"centre_px must be finite, got {self.centre_px}")

    @property
    def matrix(self) -> FloatArray:
        """Shape (3, 3), the K of textbooks and of BOP's `cam_K`."""
        column, row = self.centre_px or ((self.width - 1) / 2, (self.height - 1) / 2)
        return np.array([[self.focal_px, 0, column], [0, self.focal_px, row], [0, 0, 1]])

    def slopes(self, pixels: IntArray) -> tuple[FloatArray, FloatArray]:
        """The ratios x / z and y / z of the rays through pixels.

        Args:
            pixels: Shape (N,), integers, row * width + column.

        Returns:
            Two arrays of shape (N,).
        """
        matrix = self.matrix
        rows, columns = np.divmod(pixels, self.width)
        return (
            (columns - matrix[0, 2]) / self.focal_px,
            (rows - matrix[1, 2]) / self.focal_px,
        )

    def binned(self, factor: int) -> PinholeCamera:
        """The same lens with only every `factor`-th pixel, as Zivid's subsampling delivers."""
        if factor < 1:
            raise ConfigError(f"factor must be >= 1, got {factor}")
        centre = self.centre_px
        return PinholeCamera(
            width=self.width // factor,
            height=self.height // factor,
            focal_px=self.focal_px / factor,
            centre_px=None if centre is None else (centre[0] / factor, centre[1] / factor),
        )


class Chip(StrEnum):
    """Cameras by name. The focal lengths follow from the fields of view in the data sheets."""

    ZIVID_ONE_PLUS_M = "zivid_one_plus_m"
    """1920 x 1200, 702 x 432 mm at 1000 mm (Zivid One+ Medium)."""
    ZIVID_2_M70 = "zivid_2_m70"
    """1944 x 1200, 754 x 449 mm at 700 mm (Zivid 2 M70)."""
    ZIVID_2_PLUS_M60 = "zivid_2_plus_m60"
    """2448 x 2048, 570 x 460 mm at 600 mm (Zivid 2+ M60)."""
    ZIVID_2_PLUS_M60_HALF = "zivid_2_plus_m60_half"
    """1224 x 1024: the same, 2 x 2 subsampled."""
    ZIVID_2_PLUS_M130 = "zivid_2_plus_m130"
    """2448 x 2048, a pixel is 0.32 mm wide at 1300 mm (support.zivid.com, Sampling)."""
    ZIVID_2_PLUS_M130_HALF = "zivid_2_plus_m130_half"
    """1224 x 1024: the same, 2 x 2 subsampled."""

    @property
    def camera(self) -> PinholeCamera:
        """The pinhole camera of this name."""
        return _CAMERAS[self]


_M60 = PinholeCamera(width=2448, height=2048, focal_px=2580.0)
_M130 = PinholeCamera(width=2448, height=2048, focal_px=4060.0)
_CAMERAS = {
    Chip.ZIVID_ONE_PLUS_M: PinholeCamera(width=1920, height=1200, focal_px=2735.0),
    Chip.ZIVID_2_M70: PinholeCamera(width=1944, height=1200, focal_px=1805.0),
    Chip.ZIVID_2_PLUS_M60: _M60,
    Chip.ZIVID_2_PLUS_M60_HALF: _M60.binned(2),
    Chip.ZIVID_2_PLUS_M130: _M130,
    Chip.ZIVID_2_PLUS_M130_HALF: _M130.binned(2),
}
