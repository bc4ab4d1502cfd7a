"""Segmentation networks in PyTorch, one file each."""
