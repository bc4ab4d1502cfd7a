"""Parametric starter motors, clamps and wear, made of watertight solids with exact truth."""
