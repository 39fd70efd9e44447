"""Arrays of single-axis accelerometers on one rigid body, which can stand in for gyroscopes."""

from northdown.arrays.geometry import AccelerometerArray

__all__ = ["AccelerometerArray"]
