"""Networks to ONNX: with everything needed at run time inside, and checked by numbers."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import torch
from onnx import TensorProto, helper, numpy_helper
from torch import nn

OPSET = 18
_SMALL = 1024
"""Constants with fewer numbers keep float32: halving them saves nothing."""


def export_onnx(
    network: nn.Module,
    path: Path,
    *,
    kind: str,
    settings: dict[str, Any],
    sample_shape: tuple[int, ...],
    half: bool = True,
) -> float:
    """Write a network as ONNX and compare it with the original.

    Args:
        network: Maps float32 (..., inputs) to class scores; is put in evaluation mode.
        path: Where to; its folder is made.
        kind: What it is for; the reader checks it.
        settings: JSON-ready values stored beside it.
        sample_shape: Shape of an input, the last axis fixed, the others free.
        half: Store large constants with 16 bits; they are widened when the file is opened.

    Returns:
        Largest difference of class probabilities between the file and the network, on random
        inputs of two other sizes.
    """
    network.eval()
    torch.manual_seed(0)
    free = {axis: torch.export.Dim(f"size_{axis}", min=1) for axis in range(len(sample_shape) - 1)}
    with warnings.catch_warnings():
        # torch 2.13's exporter warns about its own use of LeafSpec
        warnings.simplefilter("ignore")
        program = torch.onnx.export(
            network,
            (torch.randn(sample_shape),),
            dynamo=True,
            opset_version=OPSET,
            input_names=["inputs"],
            output_names=["logits"],
            dynamic_shapes=(free,),
            verbose=False,
        )
    if program is None:
        raise RuntimeError("torch.onnx.export returned nothing")
    model = program.model_proto
    del model.graph.value_info[:]
    for node in model.graph.node:
        # traces of source files: paths of the training machine, and half of the file
        del node.metadata_props[:]
        node.doc_string = ""
    if half:
        _store_half(model)
    del model.metadata_props[:]
    for key, value in (
        ("boltpose.kind", kind),
        ("boltpose.settings", json.dumps(settings, sort_keys=True)),
    ):
        entry = model.metadata_props.add()
        entry.key, entry.value = key, value
    onnx.checker.check_model(model)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.name + ".tmp")
    temporary.write_bytes(model.SerializeToString())
    temporary.replace(path)
    return _largest_difference(network, path, sample_shape)


def round_to_half(network: nn.Module) -> None:
    """Round large parameters to 16 bits in place, so that the stored network is this one."""
    with torch.no_grad():
        for tensor in network.state_dict().values():
            if tensor.is_floating_point() and tensor.numel() >= _SMALL:
                tensor.copy_(tensor.half().float())


def _store_half(model: onnx.ModelProto) -> None:
    """Keep large constants in 16 bits, with a node each that widens them."""
    casts: list[onnx.NodeProto] = []
    for constant in model.graph.initializer:
        values = numpy_helper.to_array(constant)
        if constant.data_type != TensorProto.FLOAT or values.size < _SMALL:
            continue
        name = constant.name
        constant.CopyFrom(numpy_helper.from_array(values.astype(np.float16), f"{name}_half"))
        casts.append(
            helper.make_node(
                "Cast", [f"{name}_half"], [name], f"widen_{name}", to=TensorProto.FLOAT
            )
        )
    nodes = [*casts, *model.graph.node]
    del model.graph.node[:]
    model.graph.node.extend(nodes)


def _largest_difference(network: nn.Module, path: Path, sample_shape: tuple[int, ...]) -> float:
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    largest = 0.0
    for factor in (0.5, 1.5):
        shape = [max(1, int(length * factor)) for length in sample_shape[:-1]]
        inputs = torch.randn(*shape, sample_shape[-1])
        with torch.inference_mode():
            wanted = torch.softmax(network(inputs), dim=-1)
        got: Any = session.run(["logits"], {"inputs": inputs.numpy()})[0]
        difference = torch.softmax(torch.from_numpy(got), dim=-1) - wanted
        largest = max(largest, float(difference.abs().max()))
    return largest
