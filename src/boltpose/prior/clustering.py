"""Bolt points -> one group of points per bolt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from sklearn.cluster import DBSCAN

from boltpose.arrays import FloatArray, IntArray
from boltpose.errors import ConfigError


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterConfig:
    """DBSCAN over the points of class bolt."""

    eps_mm: float = 2.0
    """Two spacings of a 1 mm scan. The paper's 5 mm joins neighbouring heads."""
    min_samples: int = 8
    """Points within `eps_mm` that make a core point."""
    min_points: int = 25
    """A cluster of fewer points is debris: the smallest head (M4 pan, half hidden) has 100."""

    def __post_init__(self) -> None:
        if not self.eps_mm > 0:
            raise ConfigError(f"eps_mm must be > 0, got {self.eps_mm}")
        for name in ("min_samples", "min_points"):
            if not getattr(self, name) >= 1:
                raise ConfigError(f"{name} must be >= 1, got {getattr(self, name)}")


def cluster_points(points: FloatArray, config: ClusterConfig) -> tuple[IntArray, ...]:
    """Group points by density.

    Args:
        points: Shape (N, 3), mm, the points of class bolt.
        config: Settings.

    Returns:
        Index arrays, one per cluster, debris left out, largest cluster first.

    Source:
        Ester et al., KDD 1996; paper, section 3.4.
    """
    if len(points) < config.min_points:
        return ()
    # the order of points must not decide border points: sort them first
    order = np.lexsort(points.T)
    names = DBSCAN(eps=config.eps_mm, min_samples=config.min_samples).fit_predict(points[order])
    groups = [np.sort(order[names == name]) for name in range(int(names.max()) + 1)]
    kept = [group for group in groups if len(group) >= config.min_points]
    kept.sort(key=lambda group: (-len(group), int(group[0])))
    return tuple(kept)
