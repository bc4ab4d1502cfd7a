"""One ONNX network on disk: checked, opened on first use, run without threads of its own."""

from __future__ import annotations

import hashlib
import json
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime

from boltpose.arrays import Float32Array
from boltpose.errors import InputFileError
from boltpose.segmentation.farthest_points import nested_centres


class OnnxNetwork:
    """A network that maps `inputs` to `logits`; safe to share by threads.

    PointNet++ has `centres_1` and `centres_2` as further inputs: what it groups points around.
    Its settings tell their number, and `run` finds them.
    """

    def __init__(self, path: Path, kind: str) -> None:
        """Check that the file is there; it is read on first use.

        Args:
            path: An .onnx file written by `boltpose.training.export`.
            kind: What the network must be for, for example `parts`.

        Raises:
            InputFileError: There is no such file.
        """
        if not path.is_file():
            raise InputFileError(path, "no file", f"the '{kind}' network of boltpose (.onnx)")
        self.path = path
        self.kind = kind

    @cached_property
    def sha256(self) -> str:
        """Hash of the file, for provenance."""
        return hashlib.sha256(self.path.read_bytes()).hexdigest()

    @cached_property
    def settings(self) -> dict[str, Any]:
        """What the network was trained with, as stored in its metadata.

        Raises:
            InputFileError: The file is no network, or one of another kind.
        """
        self.check_kind()
        return dict(json.loads(self._metadata.get("boltpose.settings", "{}")))

    def check_kind(self) -> None:
        """Check that the network is for what it was opened for.

        Raises:
            InputFileError: The file is no network, or one of another kind.
        """
        if self.found_kind != self.kind:
            found = f"kind '{self.found_kind}'"
            raise InputFileError(self.path, found, f"a network of kind '{self.kind}'")

    @property
    def found_kind(self) -> str:
        """What the file says it is for, whatever was asked for; `unknown` if it does not say.

        Raises:
            InputFileError: The file is no network.
        """
        return self._metadata.get("boltpose.kind", "unknown")

    @cached_property
    def _metadata(self) -> dict[str, str]:
        return dict(self._session.get_modelmeta().custom_metadata_map)

    @cached_property
    def _session(self) -> onnxruntime.InferenceSession:
        options = onnxruntime.SessionOptions()
        # one thread per call: sums are added in the same order on every machine
        options.intra_op_num_threads = 1
        options.inter_op_num_threads = 1
        options.log_severity_level = 3
        try:
            return onnxruntime.InferenceSession(
                self.path.read_bytes(), options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:  # onnxruntime's errors share no public base
            first_line = (str(error).splitlines() or [type(error).__name__])[0]
            raise InputFileError(self.path, first_line, "a readable ONNX network") from error

    @property
    def temperature(self) -> float:
        """What scores are divided by so that probabilities are calibrated."""
        return float(self.settings.get("temperature", 1.0))

    def require(self, **expected: Any) -> None:
        """Check settings the code depends on.

        Raises:
            InputFileError: A setting of the file differs from the code's.
        """
        for name, wanted in expected.items():
            found = self.settings.get(name)
            if found != wanted:
                raise InputFileError(self.path, f"{name} = {found}", f"{name} = {wanted}")

    @property
    def centre_counts(self) -> tuple[int, ...]:
        """Most centres on every level the network groups points around; mostly no levels."""
        return tuple(int(count) for count in self.settings.get("centres", ()))

    def run(self, inputs: Float32Array) -> Float32Array:
        """Class scores of inputs: (B, N, inputs) to (B, N, classes), for some (N, inputs) too."""
        feeds: dict[str, Any] = {"inputs": inputs}
        counts = self.centre_counts
        if counts:
            levels = nested_centres(inputs[:, :, :3], counts)
            feeds |= {f"centres_{number}": index for number, index in enumerate(levels, start=1)}
        logits: Any = self._session.run(["logits"], feeds)[0]
        return np.asarray(logits, dtype=np.float32)


def softmax(logits: Float32Array) -> Float32Array:
    """Probabilities from scores along the last axis."""
    shifted = np.exp(logits - logits.max(axis=-1, keepdims=True))
    return shifted / shifted.sum(axis=-1, keepdims=True)
