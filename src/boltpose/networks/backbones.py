"""The segmentation networks by name."""

from __future__ import annotations

from boltpose.errors import ConfigError
from boltpose.networks.dgcnn import Dgcnn, DgcnnConfig
from boltpose.networks.pct import Pct, PctConfig
from boltpose.networks.pointnet import PointNet, PointNetConfig
from boltpose.networks.pointnet2 import PointNet2, PointNet2Config
from boltpose.networks.segmentation_network import SegmentationNetwork

BACKBONES: tuple[str, ...] = ("pointnet", "pointnet2", "dgcnn", "pct", "pct-small")


def build_backbone(name: str, *, inputs: int, classes: int) -> SegmentationNetwork:
    """Build a network with its published layers, freshly initialised by torch's random state.

    Args:
        name: One of `BACKBONES`; `pct-small` is the network behind dense local features.
        inputs: Numbers per point, coordinates first.
        classes: Number of classes.

    Raises:
        ConfigError: Unknown name.
    """
    match name:
        case "pointnet":
            return PointNet(PointNetConfig(inputs=inputs, classes=classes))
        case "pointnet2":
            return PointNet2(PointNet2Config(inputs=inputs, classes=classes))
        case "dgcnn":
            return Dgcnn(DgcnnConfig(inputs=inputs, classes=classes))
        case "pct":
            # neighbourhoods of 20 as the motor paper's authors; PCT's own have 32 and cost twice
            return Pct(PctConfig(inputs=inputs, classes=classes, neighbours=20))
        case "pct-small":
            return Pct(PctConfig.small(inputs, classes))
        case _:
            raise ConfigError(f"unknown backbone {name!r}, choose from {', '.join(BACKBONES)}")
