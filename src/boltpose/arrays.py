"""Array aliases and the one argument checker of the package."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from boltpose.errors import ShapeError

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]
IntArray = npt.NDArray[np.int64]
UInt8Array = npt.NDArray[np.uint8]
BoolArray = npt.NDArray[np.bool_]
AnyArray = npt.NDArray[Any]


def as_points(points: npt.ArrayLike, name: str, *, at_least: int = 1) -> FloatArray:
    """Check that an argument is a list of finite 3D points and return it as float64.

    Args:
        points: Shape (N, 3), N >= `at_least`, any real dtype.
        name: The argument's name, for the error text.
        at_least: The fewest rows that make sense.

    Returns:
        Shape (N, 3), float64; a view where possible.

    Raises:
        ShapeError: The shape is another one, there are too few rows or a value is not finite.
    """
    array = np.asarray(points)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ShapeError(f"{name} must have shape (N, 3), got {array.shape}")
    if len(array) < at_least:
        raise ShapeError(f"{name} must have at least {at_least} rows, got {len(array)}")
    if array.dtype.kind not in "fiu":
        raise ShapeError(f"{name} must hold real numbers, got dtype {array.dtype}")
    result: FloatArray = array.astype(np.float64, copy=False)
    if not np.isfinite(result).all():
        bad = int((~np.isfinite(result).all(axis=1)).sum())
        raise ShapeError(f"{name} must be finite, {bad} of {len(result)} rows are not")
    return result


def freeze(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return a read-only view, so that frozen records cannot be changed through their arrays."""
    view = array.view()
    view.flags.writeable = False
    return view
