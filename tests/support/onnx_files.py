"""ONNX files as `boltpose export` writes them, made without training or exporting anything."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper


def write_linear_network(
    path: Path, kind: str, weight: np.ndarray, settings: dict[str, Any]
) -> np.ndarray:
    """Write a network whose class scores are the inputs times a matrix, and return the matrix.

    Args:
        path: Where to.
        kind: For example `parts_plain`.
        weight: Shape (columns, classes).
        settings: More of them, or others than the usual ones.
    """
    columns, classes = weight.shape
    matrix = weight.astype(np.float32)
    graph = helper.make_graph(
        [helper.make_node("MatMul", ["inputs", "weight"], ["logits"])],
        "linear",
        [helper.make_tensor_value_info("inputs", TensorProto.FLOAT, ["b", "n", columns])],
        [helper.make_tensor_value_info("logits", TensorProto.FLOAT, ["b", "n", classes])],
        [numpy_helper.from_array(matrix, "weight")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    usual = {"backbone": "linear", "columns": columns, "sub_cloud": 512, "temperature": 1.0}
    helper.set_model_props(
        model,
        {
            "boltpose.kind": kind,
            "boltpose.settings": json.dumps({**usual, **settings}, sort_keys=True),
        },
    )
    onnx.save(model, path)
    return matrix
