"""One small network of every backbone, with statistics as if it had been trained."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from boltpose.networks.dgcnn import Dgcnn, DgcnnConfig
from boltpose.networks.pct import Pct, PctConfig
from boltpose.networks.pointnet import PointNet, PointNetConfig
from boltpose.networks.pointnet2 import PointNet2, PointNet2Config
from boltpose.networks.segmentation_network import SegmentationNetwork


def small_network(
    backbone: str, *, inputs: int, classes: int, seed: int = 0
) -> SegmentationNetwork:
    """All layers of the published network, most of them narrow; in evaluation mode."""
    torch.manual_seed(seed)
    network = _build(backbone, inputs, classes)
    network.set_standardisation(0.2 * torch.randn(inputs), 0.5 + torch.rand(inputs))
    pretend_training(network, torch.randn(4, 256, inputs))
    return network.eval()


def pretend_training(network: nn.Module, inputs: Tensor) -> None:
    """Give every normalisation factors of its own, and the statistics of some inputs.

    With statistics that fit, outputs follow the inputs: an untrained network hardly moves.
    """
    for module in network.modules():
        if isinstance(module, nn.BatchNorm1d):
            nn.init.uniform_(module.weight, 0.5, 1.5)
            nn.init.normal_(module.bias, std=0.2)
            module.momentum = 1.0
    network.train()
    with torch.no_grad():
        network(inputs)


def _build(backbone: str, inputs: int, classes: int) -> SegmentationNetwork:
    match backbone:
        case "pointnet":
            return PointNet(
                PointNetConfig(
                    inputs=inputs,
                    classes=classes,
                    local=16,
                    hidden=32,
                    embedding=64,
                    head=(32, 32),
                    transform_head=(32, 32),
                )
            )
        case "pointnet2":
            return PointNet2(
                PointNet2Config(
                    inputs=inputs,
                    classes=classes,
                    down_1=(32, 64),
                    down_2=(32, 64),
                    down_3=(64, 128),
                    up_3=(64,),
                    up_2=(64,),
                    up_1=(64,),
                    head=32,
                )
            )
        case "dgcnn":
            return Dgcnn(
                DgcnnConfig(
                    inputs=inputs, classes=classes, channels=16, embedding=64, head=(32, 32)
                )
            )
        case "pct":
            return Pct(
                PctConfig(
                    inputs=inputs,
                    classes=classes,
                    channels=32,
                    layers=2,
                    embedding=64,
                    head=(32, 32),
                )
            )
        case "pct-small":
            return Pct(PctConfig.small(inputs, classes))
        case _:
            raise ValueError(backbone)
