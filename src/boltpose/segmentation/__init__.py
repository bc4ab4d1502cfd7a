"""Points to labels, by ONNX networks on full-resolution evidence."""

from __future__ import annotations

import os

# onnxruntime 1.32 keeps and sends telemetry unless this is set before it is imported; what a cell
# does is nobody's business, and its computers have no internet
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
