"""Clamps: devices that hold a motor on a bench, built around the motor they hold."""
