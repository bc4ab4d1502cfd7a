"""Hypothesis strategies shared by the tests."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from boltpose.geometry.transforms import Transform


@st.composite
def transforms(
    draw: st.DrawFn, target: str = "camera", source: str = "prior", reach_mm: float = 1000.0
) -> Transform:
    """Any rigid motion with a translation of at most `reach_mm` per axis."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    rotation = Rotation.random(rng=rng).as_matrix()
    return Transform.from_parts(target, source, rotation, rng.uniform(-reach_mm, reach_mm, 3))
