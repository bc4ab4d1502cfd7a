"""What lies around a clamp: tools, screws, blocks, boxes, other parts, cables."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from boltpose.factory.clamps.assembly import ClampBody
from boltpose.factory.clamps.contact import BoxedBody
from boltpose.factory.clamps.plates import Ground


def scatter_clutter(
    rng: np.random.Generator, ground: Ground, standing: Sequence[BoxedBody]
) -> tuple[ClampBody, ...]:
    return ()
