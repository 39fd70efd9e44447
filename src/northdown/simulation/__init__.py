"""Recordings with known truth."""

from __future__ import annotations

from northdown.simulation.imu import LOW_COST, SensorErrors, measure, simulate
from northdown.simulation.motion import Motion, random_motion

__all__ = ["LOW_COST", "Motion", "SensorErrors", "measure", "random_motion", "simulate"]
