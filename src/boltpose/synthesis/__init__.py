"""Labelled data sets of synthetic motors and clamped scenes, made at any scale."""
