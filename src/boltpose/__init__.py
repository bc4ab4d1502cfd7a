"""boltpose: the 6D pose of every bolt of a clamped motor, also of those the camera cannot see."""

__version__ = "0.1.0"
