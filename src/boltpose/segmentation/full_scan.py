"""Every point of a full scan labelled as `build_prior` labels those it works on."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree
from threadpoolctl import threadpool_limits

from boltpose.arrays import as_points
from boltpose.errors import EmptyScanError
from boltpose.geometry.normals import estimate_normals, orient_outward
from boltpose.segmentation.predictor import PartPredictor, PartProbabilities
from boltpose.segmentation.thinning import thin_scan

MIN_POINTS = 5000
"""As for a prior: fewer show no bolt."""

_NORMAL_NEIGHBOURS = 20


def label_full_scan(
    points_prior: npt.ArrayLike, predictor: PartPredictor, *, source: str = "the scan"
) -> PartProbabilities:
    """Tell the part of every point of a complete scan.

    The predictor sees the points that a prior would be built from: without strays, and not denser
    than the networks know. Every other point takes the answer of the nearest of them.

    Args:
        points_prior: Shape (N, 3), mm, frame `prior`, any order and density.
        predictor: Labels scans of the density it was trained on.
        source: Where the points come from, for the error text.

    Returns:
        Probabilities of all N points, in their order.

    Raises:
        ShapeError: The shape is another one or a value is not finite.
        EmptyScanError: Too few points.
        DegenerateGeometryError: The scan has no cylinder to hold on to.
    """
    points = as_points(points_prior, "points_prior")
    # one BLAS thread: sums in another order give other bits
    with threadpool_limits(1, user_api="blas"):
        keep = thin_scan(points) if len(points) >= MIN_POINTS else np.arange(len(points))
        if len(keep) < MIN_POINTS:
            raise EmptyScanError(
                f"{source}: found {len(keep)} points after thinning, "
                f"wanted at least {MIN_POINTS}: is this a complete scan in mm?"
            )
        # as a prior stores them, so that label and prior agree to the bit
        shown = points[keep].astype(np.float32).astype(np.float64)
        normals = orient_outward(shown, estimate_normals(shown, _NORMAL_NEIGHBOURS))
        normals = normals.astype(np.float32).astype(np.float64)
        answer = predictor.predict(shown, normals)
    nearest = np.zeros(len(points), dtype=np.int64)
    nearest[keep] = np.arange(len(keep))
    rest = np.ones(len(points), dtype=np.bool_)
    rest[keep] = False
    _, found = KDTree(shown).query(points[rest], workers=-1)
    nearest[rest] = found
    return PartProbabilities(probabilities=answer.probabilities[nearest], frame=answer.frame)
