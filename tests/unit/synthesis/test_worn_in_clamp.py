from __future__ import annotations

import numpy as np
import pytest

from boltpose.factory.families import sample_model
from boltpose.factory.scene import MAX_INTERPENETRATION_MM, interpenetration_mm, place_motor
from boltpose.factory.wear import wear_motor
from boltpose.factory.wear_spec import sample_wear
from boltpose.synthesis.views import put_worn_motor


@pytest.mark.parametrize(("seed", "clamp"), [(1, "parallel_vice"), (2, "tilted_chuck")])
def test_rust_and_dirt_go_no_deeper_into_a_clamp_than_it_may(seed: int, clamp: str) -> None:
    fresh = sample_model(np.random.default_rng(seed), "planetary_closed")
    worn = wear_motor(fresh, sample_wear(np.random.default_rng(seed)), seed)
    placed = place_motor(fresh, np.random.default_rng(seed), clamp)

    scene = put_worn_motor(placed, worn)

    assert len(scene.solids) >= len(placed.solids)
    assert interpenetration_mm(scene) <= MAX_INTERPENETRATION_MM
