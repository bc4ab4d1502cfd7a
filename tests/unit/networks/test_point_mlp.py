from __future__ import annotations

import pytest
import torch

from boltpose.networks.point_mlp import PointMlp, PointMlpConfig


def test_every_row_is_judged_by_itself() -> None:
    torch.manual_seed(0)
    network = PointMlp(PointMlpConfig(inputs=5, classes=3, hidden=8)).eval()
    rows = torch.randn(20, 5)
    with torch.inference_mode():
        together = network(rows)
        alone = torch.cat([network(row[None]) for row in rows])
    torch.testing.assert_close(together, alone)


def test_standardisation_is_part_of_the_network() -> None:
    torch.manual_seed(0)
    network = PointMlp(PointMlpConfig(inputs=5, classes=3, hidden=8)).eval()
    rows = torch.randn(20, 5)
    with torch.inference_mode():
        wanted = network(rows)
        network.set_standardisation(torch.full((5,), -2.0), torch.full((5,), 0.5))
        torch.testing.assert_close(network(rows * 0.5 - 2), wanted, atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize(("name", "value"), [("inputs", 0), ("hidden", 0), ("dropout", -0.1)])
def test_settings_are_checked(name: str, value: float) -> None:
    settings = {"inputs": 3, "classes": 2, name: value}
    with pytest.raises(ValueError, match=name):
        PointMlpConfig(**settings)  # pyright: ignore[reportArgumentType]
