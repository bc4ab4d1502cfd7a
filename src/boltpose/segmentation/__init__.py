"""Points to labels, by ONNX networks on full-resolution evidence."""
