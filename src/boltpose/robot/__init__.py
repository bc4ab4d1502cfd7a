"""Poses in the forms robots take."""
