from __future__ import annotations

import numpy as np
import pytest

from boltpose.training.calibration import fit_temperature


@pytest.mark.parametrize("truth", [0.6, 1.0, 2.0])
def test_the_temperature_that_spoilt_probabilities_is_found(truth: float) -> None:
    rng = np.random.default_rng(0)
    logits = 1.5 * rng.normal(size=(20000, 4))
    right = np.exp(logits) / np.exp(logits).sum(axis=1, keepdims=True)
    classes = (right.cumsum(axis=1) < rng.random((20000, 1))).sum(axis=1)
    spoilt = right**truth / (right**truth).sum(axis=1, keepdims=True)
    assert fit_temperature(spoilt, classes) == pytest.approx(truth, rel=0.05)
