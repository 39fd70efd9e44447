"""Sensors from the units of data sheets.

A data sheet's noise density D (such as 0.01 °/s/√Hz) is *one-sided*: the noise within a bandwidth f has the root mean
square D √f. The coefficient N of the Allan deviation is smaller by √2; angle random walk is N by definition. The
ADIS16470 states both: 60 · 0.008 °/s/√Hz / √2 is its 0.34 °/√h. Bias stability in a data sheet is the minimum of the
Allan deviation, 0.664 B. A typical tolerance is taken as a standard deviation.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray, as_float_array
from northdown.errors import InputError, expected
from northdown.simulation.imu_errors import FLOOR, TriadErrors
from northdown.simulation.motion import STANDARD_GRAVITY

_DEG: Final = math.pi / 180.0
_HOUR: Final = 3600.0
_G: Final = STANDARD_GRAVITY
_SIDES: Final = math.sqrt(2.0)


def _one_of(
    first: npt.ArrayLike, first_factor: float, second: npt.ArrayLike, second_factor: float, names: str
) -> FloatArray:
    a, b = as_float_array(names, first), as_float_array(names, second)
    if a.any() and b.any():
        raise InputError(expected(f"one of {names}", "both"))
    result: FloatArray = a * first_factor + b * second_factor
    return result


def gyroscope(
    *,
    noise_density_deg: npt.ArrayLike = 0.0,
    angle_random_walk_deg: npt.ArrayLike = 0.0,
    bias_stability_deg: npt.ArrayLike = 0.0,
    rate_random_walk_deg: npt.ArrayLike = 0.0,
    bias_deg: npt.ArrayLike = 0.0,
    scale_percent: float = 0.0,
    cross_axis_percent: float = 0.0,
    g_sensitivity_deg: float = 0.0,
    range_deg: float = math.inf,
    lsb_deg: float = 0.0,
    **other: Any,
) -> TriadErrors:
    """Gyroscope from a data sheet.

    Parameters
    ----------
    noise_density_deg : float or (3,) array
        One-sided, °/s/√Hz; or else
    angle_random_walk_deg : float or (3,) array
        °/√h.
    bias_stability_deg : float or (3,) array
        Minimum of the Allan deviation, °/h.
    rate_random_walk_deg : float or (3,) array
        °/h/√h.
    bias_deg : float or (3,) array
        Zero-rate level at turn-on, °/s.
    scale_percent, cross_axis_percent : float
        Tolerance of the sensitivity, and of the response to the other axes.
    g_sensitivity_deg : float
        °/s/g.
    range_deg, lsb_deg : float
        Full scale and step of quantisation, °/s.
    **other
        Further parameters of `TriadErrors`, in its units.
    """
    return TriadErrors(
        noise=_one_of(
            noise_density_deg,
            _DEG / _SIDES,
            angle_random_walk_deg,
            _DEG / math.sqrt(_HOUR),
            "noise_density_deg and angle_random_walk_deg",
        ),
        instability=np.multiply(bias_stability_deg, _DEG / _HOUR / FLOOR),
        walk=np.multiply(rate_random_walk_deg, _DEG / _HOUR**1.5),
        bias=np.multiply(bias_deg, _DEG),
        scale=0.01 * scale_percent,
        misalignment=0.01 * cross_axis_percent,
        g_sensitivity=g_sensitivity_deg * _DEG / _G,
        limit=range_deg * _DEG,
        resolution=lsb_deg * _DEG,
        **other,
    )


def accelerometer(
    *,
    noise_density_ug: npt.ArrayLike = 0.0,
    velocity_random_walk: npt.ArrayLike = 0.0,
    bias_stability_ug: npt.ArrayLike = 0.0,
    bias_mg: npt.ArrayLike = 0.0,
    scale_percent: float = 0.0,
    cross_axis_percent: float = 0.0,
    range_g: float = math.inf,
    lsb_mg: float = 0.0,
    **other: Any,
) -> TriadErrors:
    """Accelerometer from a data sheet.

    Parameters
    ----------
    noise_density_ug : float or (3,) array
        One-sided, µg/√Hz; or else
    velocity_random_walk : float or (3,) array
        m/s/√h.
    bias_stability_ug : float or (3,) array
        Minimum of the Allan deviation, µg.
    bias_mg : float or (3,) array
        Zero-g level, mg.
    scale_percent, cross_axis_percent : float
        Tolerance of the sensitivity, and of the response to the other axes.
    range_g, lsb_mg : float
        Full scale, g, and step of quantisation, mg.
    **other
        Further parameters of `TriadErrors`, in its units.
    """
    return TriadErrors(
        noise=_one_of(
            noise_density_ug,
            1e-6 * _G / _SIDES,
            velocity_random_walk,
            1.0 / math.sqrt(_HOUR),
            "noise_density_ug and velocity_random_walk",
        ),
        instability=np.multiply(bias_stability_ug, 1e-6 * _G / FLOOR),
        bias=np.multiply(bias_mg, 1e-3 * _G),
        scale=0.01 * scale_percent,
        misalignment=0.01 * cross_axis_percent,
        limit=range_g * _G,
        resolution=lsb_mg * 1e-3 * _G,
        **other,
    )


def magnetometer(
    *,
    noise_density_ut: npt.ArrayLike = 0.0,
    noise_rms_ut: npt.ArrayLike = 0.0,
    rate: float | None = None,
    bias_ut: npt.ArrayLike = 0.0,
    scale_percent: float = 0.0,
    cross_axis_percent: float = 0.0,
    range_ut: float = math.inf,
    lsb_ut: float = 0.0,
    **other: Any,
) -> TriadErrors:
    """Magnetometer from a data sheet.

    Parameters
    ----------
    noise_density_ut : float or (3,) array
        One-sided, µT/√Hz; or else
    noise_rms_ut : float or (3,) array
        Of its samples at `rate`, which then must be given, µT.
    rate : float, optional
        Output data rate, Hz.
    bias_ut : float or (3,) array
        Zero-field level, hard iron of the circuit board included, µT.
    scale_percent, cross_axis_percent : float
        Tolerance of the sensitivity, and of the response to the other axes.
    range_ut, lsb_ut : float
        Full scale and step of quantisation, µT.
    **other
        Further parameters of `TriadErrors`, in its units.
    """
    if rate is None and np.any(noise_rms_ut):
        raise InputError(expected("the rate of the samples with noise_rms_ut", "none"))
    root_period = 0.0 if rate is None else 1.0 / math.sqrt(rate)
    names = "noise_density_ut and noise_rms_ut"
    return TriadErrors(
        noise=_one_of(noise_density_ut, 1.0 / _SIDES, noise_rms_ut, root_period, names),
        bias=bias_ut,
        scale=0.01 * scale_percent,
        misalignment=0.01 * cross_axis_percent,
        limit=range_ut,
        resolution=lsb_ut,
        rate=rate,
        **other,
    )
