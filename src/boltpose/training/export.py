"""Networks to ONNX: with everything needed at run time inside, and checked by numbers."""

from __future__ import annotations

import json
import logging
import tempfile
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt
import onnx
import onnxscript.optimizer
import torch
from onnx import TensorProto, helper, numpy_helper
from onnx_ir.passes import common as passes
from torch import Tensor, nn

from boltpose.arrays import Float32Array
from boltpose.io.atomic import write_atomic
from boltpose.segmentation.farthest_points import nested_centres
from boltpose.segmentation.onnx_session import OnnxNetwork, softmax

OPSET = 18
_SMALL = 1024
"""Constants with fewer numbers keep float32: halving them saves nothing."""
_LEAST_POINTS = 64
"""Clouds of a network that looks at neighbours have so many points: more than it looks at."""


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
    content = build_onnx(
        network, kind=kind, settings=settings, sample_shape=sample_shape, half=half
    )
    write_onnx(path, content)
    rng = np.random.default_rng(0)
    samples: list[Float32Array] = []
    for factor in (0.5, 1.5):
        shape = [max(1, int(length * factor)) for length in sample_shape[:-1]]
        samples.append(rng.normal(size=(*shape, sample_shape[-1])).astype(np.float32))
    return largest_difference(network, OnnxNetwork(path, kind), samples)


def build_onnx(
    network: nn.Module,
    *,
    kind: str,
    settings: dict[str, Any],
    sample_shape: tuple[int, ...],
    half: bool = True,
) -> bytes:
    """Turn a network into the content of an ONNX file.

    Layers are kept apart: batch normalisation joined with the weights before it would make other
    numbers of weights that were rounded to 16 bits.

    Args:
        network: As for `export_onnx`. Where the settings hold `centres`, the number of centres
            per level, it takes as many further arguments: indices, as `nested_centres` finds them.
        kind: As for `export_onnx`, like all that follow.
        settings: Likewise.
        sample_shape: Likewise.
        half: Likewise.
    """
    network.eval()
    torch.manual_seed(0)
    inputs = torch.randn(sample_shape)
    levels = _centres(inputs, settings)
    free = [torch.export.Dim(f"size_{axis}", min=1) for axis in range(len(sample_shape) - 1)]
    if len(sample_shape) == 3 and sample_shape[1] >= _LEAST_POINTS:
        # or the exporter would have to allow for clouds with less points than neighbours
        free[1] = torch.export.Dim("size_1", min=_LEAST_POINTS)
    shapes: list[dict[int, Any]] = [dict(enumerate(free))]
    for number, index in enumerate(levels, start=1):
        centres = torch.export.Dim(f"centres_{number}", min=_LEAST_POINTS, max=index.shape[1])
        shapes.append({0: free[0], 1: centres})
    # it says four times that torchvision, which is not needed, is not there
    logging.getLogger("torch.onnx._internal.exporter._registration").setLevel(logging.ERROR)
    with warnings.catch_warnings():
        # torch 2.13's exporter warns about its own use of LeafSpec
        warnings.simplefilter("ignore")
        program = torch.onnx.export(
            network,
            (inputs, *levels),
            dynamo=True,
            opset_version=OPSET,
            input_names=["inputs", *(f"centres_{level + 1}" for level in range(len(levels)))],
            output_names=["logits"],
            dynamic_shapes=tuple(shapes),
            optimize=False,
            verbose=False,
        )
    if program is None:
        raise RuntimeError("torch.onnx.export returned nothing")
    passes.InlinePass()(program.model)
    onnxscript.optimizer.fold_constants(program.model)
    onnxscript.optimizer.remove_unused_nodes(program.model)
    passes.LiftConstantsToInitializersPass(lift_all_constants=True, size_limit=0)(program.model)
    passes.DeduplicateInitializersPass()(program.model)
    passes.CommonSubexpressionEliminationPass()(program.model)
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
    return model.SerializeToString()


def write_onnx(path: Path, content: bytes) -> None:
    """Write a file, complete or not at all; its folder is made."""
    path.parent.mkdir(parents=True, exist_ok=True)

    def write(stream: BinaryIO) -> None:
        stream.write(content)

    write_atomic(path, write)


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """How well a file answers as its network does."""

    largest: float
    """Largest difference of class probabilities."""
    usual: float
    """Not exceeded at 99 of 100 points."""
    same_label: float
    """Share of points with the same most probable class."""


def content_agreement(
    network: nn.Module, content: bytes, kind: str, samples: Iterable[Float32Array]
) -> Agreement:
    """As `agreement`, for the content of a file that is not written yet."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "network.onnx"
        path.write_bytes(content)
        return agreement(network, OnnxNetwork(path, kind), samples)


def agreement(
    network: nn.Module, exported: OnnxNetwork, samples: Iterable[Float32Array]
) -> Agreement:
    """Compare the class probabilities of a network and of its file, point by point.

    Args:
        network: In evaluation mode; finds its own centres where it needs some.
        exported: The file, as it is used for labelling.
        samples: Inputs, (..., inputs) each.
    """
    differences: list[Float32Array] = []
    is_same: list[npt.NDArray[np.bool_]] = []
    for inputs in samples:
        with torch.inference_mode():
            scores: Tensor = network(torch.from_numpy(inputs))
        here, there = softmax(scores.numpy()), softmax(exported.run(inputs))
        differences.append(np.abs(there - here).max(axis=-1).ravel())
        is_same.append((here.argmax(axis=-1) == there.argmax(axis=-1)).ravel())
    every = np.concatenate(differences)
    # of numpy's, these two keep NaN
    return Agreement(
        largest=float(every.max()),
        usual=float(np.quantile(every, 0.99)),
        same_label=float(np.concatenate(is_same).mean()),
    )


def largest_difference(
    network: nn.Module, exported: OnnxNetwork, samples: Iterable[Float32Array]
) -> float:
    """Largest difference of class probabilities between a network and its file."""
    return agreement(network, exported, samples).largest


def round_to_half(network: nn.Module) -> None:
    """Round large parameters to 16 bits in place, so that the stored network is this one."""
    with torch.no_grad():
        for tensor in network.state_dict().values():
            if tensor.is_floating_point() and tensor.numel() >= _SMALL:
                tensor.copy_(tensor.half().float())


def _centres(inputs: Tensor, settings: dict[str, Any]) -> tuple[Tensor, ...]:
    """Centres of every level the settings speak of."""
    counts = tuple(settings.get("centres", ()))
    if not counts:
        return ()
    return tuple(torch.from_numpy(index) for index in nested_centres(inputs.numpy(), counts))


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
