"""`TriadErrors` and `SensorErrors`: what a sensor adds to the truth, in SI units.

Noise coefficients are those of the Allan deviation σ(τ), IEEE Std 952-1997, annex C:

====== =================== ============================ =========================================
symbol name                Allan deviation              unit (u: the sensor's, rad/s, m/s² or µT)
====== =================== ============================ =========================================
N      ``noise``           N/√τ                         u/√Hz = u √s
B      ``instability``     B √(2 ln 2/π) = 0.664 B      u
K      ``walk``            K √(τ/3)                     u/√s
====== =================== ============================ =========================================

A sample at rate f has a white noise of N √f. Data sheets give a *one-sided* density, √2 N: see `datasheet`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray, as_float_array, check_number
from northdown.errors import InputError, expected
from northdown.simulation.motion import vector

FLOOR: Final = math.sqrt(2.0 * math.log(2.0) / math.pi)
"""Allan deviation of flicker noise of B = 1, and so the minimum that data sheets call bias stability."""


def _sizes(name: str, value: npt.ArrayLike) -> FloatArray:
    array = as_float_array(name, value)
    if array.shape not in ((), (3,)) or not (np.isfinite(array) & (array >= 0.0)).all():
        raise InputError(expected(f"one or three numbers of at least 0 for {name}", f"{array.tolist()}"))
    return np.broadcast_to(array, 3).copy()


def _matrix(value: npt.ArrayLike) -> FloatArray:
    array = as_float_array("matrix", value)
    if array.shape != (3, 3) or not np.isfinite(array).all():
        raise InputError(expected("matrix of shape (3, 3), finite", f"shape {array.shape}"))
    return array


def _check_correlation(times: tuple[float, float]) -> None:
    if len(times) != 2 or not 0.0 < times[0] < times[1] < math.inf:
        raise InputError(expected("two increasing correlation times (s)", f"{times}"))


def check_burst(name: str, part: float, length: float) -> None:
    """Check the part of samples that are missing, and the mean length of the gaps."""
    if check_number(name, part, low=0.0) >= 1.0:
        raise InputError(expected(f"{name} of less than 1", f"{part:g}"))
    check_number(f"{name}_length", length, low=1.0)
    # runs that are there must be one sample long at least
    if part * (length + 1.0) > length + 1e-12:
        raise InputError(
            expected(f"{name} of at most {length / (length + 1.0):.3g} with runs of {length:g}", f"{part:g}")
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class TriadErrors:
    """Errors of one three-axis sensor; by default none.

    Parameters
    ----------
    noise, instability, walk : float or (3,) array
        N, B and K of the table above, for all axes or each.
    correlation : (float, float), optional
        Shortest and longest correlation time of the flicker noise, s. Its Allan deviation is flat within 6 % from
        five times the first to half the second. By default from a twentieth of the time at which white noise falls
        below the floor (0.01 s at least) over four decades, and to 10⁴ s at least.
    bias : float or (3,) array
        Standard deviation of the constant bias drawn at turn-on, u.
    scale : float
        Standard deviation of the scale factor's relative error.
    misalignment : float
        Standard deviation of the angles (rad) by which each axis leans to each other.
    g_sensitivity : float
        Standard deviation of the response of each axis to specific force along each axis, u/(m/s²); for gyroscopes.
    offset : (3,) array
        Known constant added to all samples, u; of a magnetometer, its hard iron.
    matrix : (3, 3) array
        Known matrix that multiplies the truth; of a magnetometer, its soft iron.
    resolution : float
        Step of quantisation, u; 0 for none.
    limit : float
        Samples saturate at ± this, u.
    bandwidth : float
        −3 dB frequency of the low-pass filter through which truth and noise pass, Hz; infinite for none.
    order : {1, 2}
        Order of that filter; of second order it is a Butterworth filter.
    delay : float
        Pure delay between truth and sample, s.
    rate : float, optional
        Own sampling rate (Hz) of an accelerometer or magnetometer on its own clock: each row holds its newest sample,
        or NaN if there was none since the row before. The recording's rate when not given.
    phase : float
        First time on that clock, s after the start.
    dropout : float
        Part of the samples that are missing (NaN), 0 or more and less than 1.
    dropout_length : float
        Mean number of samples missing in a row, 1 or more.
    """

    noise: npt.ArrayLike = 0.0
    instability: npt.ArrayLike = 0.0
    walk: npt.ArrayLike = 0.0
    correlation: tuple[float, float] | None = None
    bias: npt.ArrayLike = 0.0
    scale: float = 0.0
    misalignment: float = 0.0
    g_sensitivity: float = 0.0
    offset: npt.ArrayLike = (0.0, 0.0, 0.0)
    matrix: npt.ArrayLike = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    resolution: float = 0.0
    limit: float = math.inf
    bandwidth: float = math.inf
    order: int = 1
    delay: float = 0.0
    rate: float | None = None
    phase: float = 0.0
    dropout: float = 0.0
    dropout_length: float = 1.0

    def __post_init__(self) -> None:
        for name in ("noise", "instability", "walk", "bias"):
            object.__setattr__(self, name, _sizes(name, getattr(self, name)))
        object.__setattr__(self, "offset", vector("offset", self.offset))
        object.__setattr__(self, "matrix", _matrix(self.matrix))
        for name in ("scale", "misalignment", "g_sensitivity", "resolution", "phase"):
            check_number(name, getattr(self, name), low=0.0)
        check_number("delay", self.delay, unit="s")
        for name in ("limit", "bandwidth"):
            if getattr(self, name) != math.inf:
                check_number(name, getattr(self, name), above=0.0)
        if self.order not in (1, 2):
            raise InputError(expected("order to be 1 or 2", repr(self.order)))
        if self.rate is not None:
            check_number("rate", self.rate, above=0.0, unit="Hz")
        if self.correlation is not None:
            _check_correlation(self.correlation)
        check_burst("dropout", self.dropout, self.dropout_length)

    @property
    def coefficients(self) -> FloatArray:
        """N, B and K of each axis, (3, 3), one row for each coefficient."""
        return np.stack([np.asarray(x, dtype=np.float64) for x in (self.noise, self.instability, self.walk)])

    @property
    def correlation_times(self) -> tuple[float, float]:
        """Shortest and longest correlation time of the flicker noise, s."""
        if self.correlation is not None:
            return self.correlation
        noise, instability = self.coefficients[:2]
        crossing = max(
            ((n / (FLOOR * b)) ** 2 for n, b in zip(noise, instability, strict=True) if b > 0.0), default=0.0
        )
        # What is faster than a twentieth is missing beside white noise of five times its size at least. A finer grid
        # than for 0.01 s would cost more than all else.
        shortest = min(max(0.01, crossing / 20.0), 1000.0)
        return shortest, 1e4 * max(1.0, shortest)

    def calibrated(self, remaining: float = 0.02) -> TriadErrors:
        """The same sensor after calibration: the constant errors are `remaining` of what they were."""
        k = check_number("remaining", remaining, low=0.0, high=1.0)
        identity = np.eye(3)
        return replace(
            self,
            bias=k * np.asarray(self.bias),
            scale=k * self.scale,
            misalignment=k * self.misalignment,
            offset=k * np.asarray(self.offset),
            matrix=identity + k * (np.asarray(self.matrix) - identity),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class SensorErrors:
    """Errors of a gyroscope, an accelerometer and a magnetometer that share a clock; by default none.

    Parameters
    ----------
    gyr, acc, mag : TriadErrors or None
        Of each sensor, in rad/s, m/s² and µT; None where there is no such sensor.
    jitter : float
        Standard deviation of the sampling instants about their regular times, s; time stamps show it.
    stamp_noise : float
        Standard deviation of the time stamps about the sampling instants, s. Both together are cut off at 0.45 of a
        period, so that order is kept.
    loss : float
        Part of the rows that are lost altogether, 0 or more and less than 1.
    loss_length : float
        Mean number of rows lost at a time, 1 or more.
    """

    gyr: TriadErrors | None = TriadErrors()
    acc: TriadErrors | None = TriadErrors()
    mag: TriadErrors | None = TriadErrors()
    jitter: float = 0.0
    stamp_noise: float = 0.0
    loss: float = 0.0
    loss_length: float = 1.0

    def __post_init__(self) -> None:
        for name in ("gyr", "acc", "mag"):
            value = getattr(self, name)
            if value is not None and not isinstance(value, TriadErrors):
                raise InputError(expected(f"{name} as TriadErrors or None", type(value).__name__))
        if self.gyr is None and self.acc is None and self.mag is None:
            raise InputError(expected("at least one of gyr, acc and mag", "none"))
        if self.gyr is not None and self.gyr.rate is not None:
            raise InputError(expected("a gyroscope at the recording's rate", f"{self.gyr.rate:g} Hz of its own"))
        check_number("jitter", self.jitter, low=0.0, unit="s")
        check_number("stamp_noise", self.stamp_noise, low=0.0, unit="s")
        check_burst("loss", self.loss, self.loss_length)

    def calibrated(self, remaining: float = 0.02) -> SensorErrors:
        """The same sensors after calibration: constant errors are `remaining` of what they were."""
        gyr, acc, mag = (None if s is None else s.calibrated(remaining) for s in (self.gyr, self.acc, self.mag))
        return replace(self, gyr=gyr, acc=acc, mag=mag)
