"""Recordings with known truth: motions, sensors with their errors, and magnetic disturbances.

>>> from northdown.simulation import MPU_9250, measure, random_motion
>>> recording = measure(random_motion(20.0, seed=1), MPU_9250.calibrated(), seed=2, rate=200.0)
>>> len(recording), recording.reference.gyr_bias.shape
(4001, (4001, 3))
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from northdown.simulation.array import simulate_array
    from northdown.simulation.array_errors import ArrayErrors
    from northdown.simulation.datasheet import accelerometer, gyroscope, magnetometer
    from northdown.simulation.dipole import Dipole
    from northdown.simulation.imu import measure, measure_chunks
    from northdown.simulation.imu_errors import SensorErrors, TriadErrors
    from northdown.simulation.motion import Kinematics, Motion, Path, Turning
    from northdown.simulation.motion_closed import AboutAxis, Coning, Fixed, steady, swing
    from northdown.simulation.motion_from_rate import FromRate, free_body, sines
    from northdown.simulation.motion_library import MOTIONS, coning, k06_sine, pitch_sweep, rest, tumbling
    from northdown.simulation.motion_paths import Shaking, SplinePath, Still
    from northdown.simulation.motion_random import random_motion
    from northdown.simulation.motion_through import replay, waypoints
    from northdown.simulation.motion_walk import walk
    from northdown.simulation.presets import (
        ADIS16470,
        ADXL345,
        BMI088,
        HMC5883L,
        ICM_20948,
        J14,
        K06_CHAPTER_4,
        K06_HIGH,
        K06_LOW,
        K06_MEDIUM,
        L3G4200D,
        LOW_COST,
        LSM6DSO,
        MPU_9250,
        PRESETS,
        preset,
    )
    from northdown.simulation.recordings import simulate, simulate_to_file
    from northdown.simulation.writing import write_chunks

__all__ = [
    "ADIS16470",
    "ADXL345",
    "BMI088",
    "HMC5883L",
    "ICM_20948",
    "J14",
    "K06_CHAPTER_4",
    "K06_HIGH",
    "K06_LOW",
    "K06_MEDIUM",
    "L3G4200D",
    "LOW_COST",
    "LSM6DSO",
    "MOTIONS",
    "MPU_9250",
    "PRESETS",
    "AboutAxis",
    "ArrayErrors",
    "Coning",
    "Dipole",
    "Fixed",
    "FromRate",
    "Kinematics",
    "Motion",
    "Path",
    "SensorErrors",
    "Shaking",
    "SplinePath",
    "Still",
    "TriadErrors",
    "Turning",
    "accelerometer",
    "coning",
    "free_body",
    "gyroscope",
    "k06_sine",
    "magnetometer",
    "measure",
    "measure_chunks",
    "pitch_sweep",
    "preset",
    "random_motion",
    "replay",
    "rest",
    "simulate",
    "simulate_array",
    "simulate_to_file",
    "sines",
    "steady",
    "swing",
    "tumbling",
    "walk",
    "waypoints",
    "write_chunks",
]

_HOMES = {
    "array": ("simulate_array",),
    "array_errors": ("ArrayErrors",),
    "datasheet": ("accelerometer", "gyroscope", "magnetometer"),
    "dipole": ("Dipole",),
    "imu": ("measure", "measure_chunks"),
    "imu_errors": ("SensorErrors", "TriadErrors"),
    "motion": ("Kinematics", "Motion", "Path", "Turning"),
    "motion_closed": ("AboutAxis", "Coning", "Fixed", "steady", "swing"),
    "motion_from_rate": ("FromRate", "free_body", "sines"),
    "motion_library": ("MOTIONS", "coning", "k06_sine", "pitch_sweep", "rest", "tumbling"),
    "motion_paths": ("Shaking", "SplinePath", "Still"),
    "motion_random": ("random_motion",),
    "motion_through": ("replay", "waypoints"),
    "motion_walk": ("walk",),
    "presets": (
        "ADIS16470",
        "ADXL345",
        "BMI088",
        "HMC5883L",
        "ICM_20948",
        "J14",
        "K06_CHAPTER_4",
        "K06_HIGH",
        "K06_LOW",
        "K06_MEDIUM",
        "L3G4200D",
        "LOW_COST",
        "LSM6DSO",
        "MPU_9250",
        "PRESETS",
        "preset",
    ),
    "recordings": ("simulate", "simulate_to_file"),
    "writing": ("write_chunks",),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Load what is asked for on first use: the command line needs the names of motions and sensors only."""
    if name not in _HOME:
        raise AttributeError(f"module 'northdown.simulation' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"northdown.simulation.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
