"""Bias of a gyroscope by temperature, from samples at rest with the temperature at each."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from northdown._validation import FloatArray, as_float_array, check_number, check_vectors
from northdown.calibration.model import Calibration
from northdown.calibration.part import Evidence, SensorCalibration, TemperatureSlope
from northdown.errors import InputError, expected

# Parts of the recording whose means are fitted: few enough to be nearly independent, enough for a polynomial.
_BLOCKS: Final = 60
# Range of temperature (°C) for each degree of the polynomial.
_RANGE: Final = 3.0
_MOST: Final = 4


def calibrate_gyroscope_temperature(
    temperature: Any, gyr: Any, *, degree: int = 2, reference: float = 25.0
) -> Calibration:
    """Bias of a gyroscope as a polynomial of temperature.

    Parameters
    ----------
    temperature : (N,) array
        Temperature of the sensor at each sample, °C.
    gyr : (N, 3) array
        Samples at rest, in order of time, rad/s; rows of NaN are passed over. Take them out of a recording with
        `find_rests`.
    degree : int
        Degree of the polynomial, 1 to 4.
    reference : float
        Temperature (°C) at which ``offset`` is stated.

    Returns
    -------
    Calibration
        Its part `gyr`, with a `TemperatureSlope`. It is applied with
        ``calibration.apply(recording, temperature=…)``, or made constant by ``at_temperature``.

    Raises
    ------
    InputError
        When lengths differ, or the temperature ranges over less than 3 °C for each degree of the polynomial.

    Notes
    -----
    Means over 60 successive parts are fitted; their scatter about the polynomial, which holds noise and bias
    instability, gives the σ.
    """
    if isinstance(degree, bool) or degree not in range(1, _MOST + 1):
        raise InputError(expected(f"a degree from 1 to {_MOST}", repr(degree)))
    reference = check_number("reference", reference, low=-100.0, high=200.0, unit="°C")
    t = as_float_array("temperature", temperature)
    if t.ndim != 1:
        raise InputError(expected("temperature of shape (N,)", f"shape {t.shape}"))
    rates = check_vectors("gyr", gyr, len(t))
    there = np.isfinite(t) & ~np.isnan(rates).any(axis=1)
    t, rates = t[there], rates[there]
    low, high = (float(t.min()), float(t.max())) if len(t) else (math.nan, math.nan)
    blocks = min(_BLOCKS, len(t) // 4)
    if blocks < degree + 4:
        raise InputError(expected(f"at least {4 * (degree + 4)} samples", f"{len(t)}"))
    if not high - low >= _RANGE * degree:
        raise InputError(
            expected(
                f"temperatures over a range of at least {_RANGE * degree:g} °C for degree {degree}",
                f"{low:.1f} to {high:.1f} °C",
                do="warm the sensor while it lies still, or lower the degree",
            )
        )
    return Calibration(gyr=_fit(t, rates, blocks, degree, reference))


def _fit(t: FloatArray, rates: FloatArray, blocks: int, degree: int, reference: float) -> SensorCalibration:
    low, high = float(t.min()), float(t.max())
    groups = np.array_split(np.arange(len(t)), blocks)
    x = np.array([t[g].mean() for g in groups])
    y = np.array([rates[g].mean(axis=0) for g in groups])
    # in the middle of the range, in halves of it, powers are nearly independent
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    design = ((x - middle) / half)[:, None] ** np.arange(degree + 1)
    solution, _, rank, singular = np.linalg.lstsq(design, y, rcond=1e-9)
    if rank <= degree:
        raise InputError(
            expected(
                "a temperature that changes over the recording",
                "one that stays at few values",
                do="warm the sensor slowly while it lies still",
            )
        )
    residual = y - design @ solution
    variance = (residual**2).sum(axis=0) / (blocks - degree - 1)
    # where the reference lies outside the range, the offset stated is that of the nearer end
    at = min(max(reference, low), high)
    mat = _shift(middle, half, at, degree)
    coefficients = mat @ solution
    shape = mat @ np.linalg.inv(design.T @ design) @ mat.T
    sigma = np.sqrt(np.outer(np.diag(shape), variance))
    notes = [f"{low:.1f} to {high:.1f} °C, polynomial of degree {degree}"]
    if at != reference:
        notes.append(f"{reference:g} °C was not measured: the offset is stated at {at:.1f} °C")
    slopes = np.abs(coefficients[1])
    if (slopes < 2.0 * sigma[1]).all():
        notes.append("the bias hardly depends on temperature: the slope is less than 2 σ")
    constant = y - y.mean(axis=0)
    return SensorCalibration(
        "gyr",
        coefficients[0],
        offset_sigma=sigma[0],
        temperature=TemperatureSlope(at, coefficients[1:], low, high),
        evidence=Evidence(
            "bias by temperature",
            "scatter of the bias, without and with temperature",
            "rad/s",
            float(np.sqrt((constant**2).sum(axis=1).mean())),
            float(np.sqrt((residual**2).sum(axis=1).mean())),
            blocks,
            condition=float(singular[0] / singular[-1]),
            notes=tuple(notes),
        ),
    )


def _shift(middle: float, half: float, reference: float, degree: int) -> FloatArray:
    """Matrix from coefficients of ((t − middle)/half)^k to those of (t − reference)^k."""
    mat = np.zeros((degree + 1, degree + 1))
    away = reference - middle
    for k in range(degree + 1):
        for j in range(k + 1):
            mat[j, k] = math.comb(k, j) * away ** (k - j) / half**k
    return mat
