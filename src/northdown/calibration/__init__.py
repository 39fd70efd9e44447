"""Calibration: what a sensor unit's samples are corrected by, found from recordings, with its uncertainty.

Each function looks at recordings and returns a `Calibration`, or refuses with the reason when the motion does not fix
what it should find. Calibrations are applied, joined and saved:

>>> import numpy as np
>>> import northdown as nd
>>> from northdown.calibration import calibrate_gyroscope
>>> recording = nd.Recording(np.arange(1000) / 100.0, gyr=np.random.default_rng(0).normal(0.02, 1e-3, (1000, 3)))
>>> calibration = calibrate_gyroscope(recording)
>>> calibration.gyr.offset.round(3).tolist()
[0.02, 0.02, 0.02]
>>> corrected = calibration.apply(recording)

========================================= ==================================================================
function                                  finds
========================================= ==================================================================
`calibrate_magnetometer`                  hard and soft iron, from turning in a constant field
`calibrate_accelerometer`                 offset, scale, cross-axis sensitivity, from several positions of rest
`calibrate_gyroscope`                     bias, from rest; scale and alignment, from turns between rests
`calibrate_gyroscope_temperature`         bias by temperature
`align_magnetometer`                      rotation of the magnetometer to the other sensors
`local_field`                             size and dip of the field
`magnetometer_lag`                        time by which the magnetometer is late
========================================= ==================================================================

In this order: accelerometer, gyroscope, magnetometer, alignment; each with what was found before applied.

How noisy a sensor is, `identify_noise` finds from rest, and `noise_parameters` gives it to filters.
"""

from northdown.calibration.accelerometer import calibrate_accelerometer
from northdown.calibration.alignment import align_magnetometer, magnetometer_lag
from northdown.calibration.allan import AllanCurve, allan_deviation
from northdown.calibration.coverage import Coverage, coverage
from northdown.calibration.field import LocalField, local_field
from northdown.calibration.files import load, save
from northdown.calibration.gyroscope import calibrate_gyroscope
from northdown.calibration.magnetometer import calibrate_magnetometer
from northdown.calibration.model import Calibration
from northdown.calibration.noise import identify_noise
from northdown.calibration.noise_model import AllanResult, Coefficient, NoiseModel
from northdown.calibration.noise_parameters import noise_parameters, noise_toml, write_noise_toml
from northdown.calibration.part import Evidence, SensorCalibration, TemperatureSlope
from northdown.calibration.rest import Rest, find_rests
from northdown.calibration.temperature import calibrate_gyroscope_temperature

__all__ = [
    "AllanCurve",
    "AllanResult",
    "Calibration",
    "Coefficient",
    "Coverage",
    "Evidence",
    "LocalField",
    "NoiseModel",
    "Rest",
    "SensorCalibration",
    "TemperatureSlope",
    "align_magnetometer",
    "allan_deviation",
    "calibrate_accelerometer",
    "calibrate_gyroscope",
    "calibrate_gyroscope_temperature",
    "calibrate_magnetometer",
    "coverage",
    "find_rests",
    "identify_noise",
    "load",
    "local_field",
    "magnetometer_lag",
    "noise_parameters",
    "noise_toml",
    "save",
    "write_noise_toml",
]
