"""Measure the pipeline against known truth."""
