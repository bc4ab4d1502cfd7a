"""Labelled scans on disk."""
