"""`Channel`: one three-axis sensor at work, from the truth to its samples."""

from __future__ import annotations

import math

import numpy as np

from northdown._validation import FloatArray
from northdown.simulation.imu_errors import TriadErrors
from northdown.simulation.imu_errors_lag import Lag, Signal
from northdown.simulation.imu_errors_noise import Drift, Gaps
from northdown.simulation.seeds import generator

# Streams of random numbers within a sensor. Adding one does not change the others.
_CONSTANT, _WHITE, _DRIFT, _DROPOUT = range(4)


class Channel:
    """One sensor whose samples are taken in increasing order of time.

    Parameters
    ----------
    errors : TriadErrors
        What it adds to the truth.
    signal : callable
        The truth: (N, 3) at times (N,), or its means between edges (N + 1,) if it integrates.
    integrates : bool
        Whether a sample is the mean since the sample before, as of a gyroscope.
    period, start : float
        Sampling period and time of the first sample, s.
    seed, sensor : int
        Seed of the recording, and number of the sensor.

    Notes
    -----
    Order: sensitivity, bias and drift, response to specific force, filter and noise, saturation, quantisation.
    """

    def __init__(
        self,
        errors: TriadErrors,
        signal: Signal,
        *,
        integrates: bool,
        period: float,
        start: float,
        seed: int,
        sensor: int,
    ) -> None:
        self._errors, self._signal, self._integrates, self._start = errors, signal, integrates, start
        constant = generator(seed, sensor, _CONSTANT)
        lean = errors.misalignment * constant.standard_normal((3, 3))
        np.fill_diagonal(lean, errors.scale * constant.standard_normal(3))
        sensitivity: FloatArray = (np.eye(3) + lean) @ np.asarray(errors.matrix)
        self._sensitivity = None if np.array_equal(sensitivity, np.eye(3)) else np.ascontiguousarray(sensitivity.T)
        self._bias: FloatArray = np.asarray(errors.offset) + np.asarray(errors.bias) * constant.standard_normal(3)
        self._g_sensitivity = errors.g_sensitivity * constant.standard_normal((3, 3)).T
        self._white = generator(seed, sensor, _WHITE)
        self._drift = Drift(errors, seed, sensor, _DRIFT)
        self._gaps = Gaps(errors.dropout, errors.dropout_length, generator(seed, sensor, _DROPOUT))
        self._size: FloatArray = errors.coefficients[0]
        self._root_rate = 1.0 / math.sqrt(period)
        self._lag: Lag | None = None
        if errors.bandwidth != math.inf:
            self._lag = Lag(errors, self._scaled, integrates, period, start, self._white)

    def read(self, time: FloatArray, force: Signal) -> tuple[FloatArray, FloatArray]:
        """Samples at increasing times.

        Parameters
        ----------
        time : (N,) or (N + 1,) array
            Times, or edges of the intervals if it integrates, s; all later than those of the call before, where the
            first edge is the last one.
        force : callable
            Specific force (N, 3) at times (N,), m/s².

        Returns
        -------
        samples, bias : (N, 3) arrays
            NaN where a sample dropped out; and the sum of all that was added to the truth slowly.
        """
        at = time[1:] if self._integrates else time
        value = self._scaled(time)
        bias = np.repeat(self._bias[None], len(at), axis=0)
        drift = self._drift.at(at - self._start) if len(at) else None
        if drift is not None:
            bias += drift
        if len(at):
            value = value + bias + (self._noise(time) if self._lag is None else self._lag.at(time))
        if self._errors.g_sensitivity > 0.0:
            value += force(at) @ self._g_sensitivity
        limit, step = self._errors.limit, self._errors.resolution
        if limit != math.inf:
            value = np.clip(value, -limit, limit)
        if step > 0.0:
            value = np.round(value / step) * step
        if self._errors.dropout > 0.0:
            value[self._gaps.missing(len(at))] = np.nan
        return value, bias

    def _scaled(self, time: FloatArray) -> FloatArray:
        truth = self._signal(time)
        return truth if self._sensitivity is None else truth @ self._sensitivity

    def _noise(self, time: FloatArray) -> FloatArray:
        if not self._size.any():
            return np.zeros(3)
        count = len(time) - self._integrates
        if self._integrates:
            return self._white.standard_normal((count, 3)) * self._size / np.sqrt(np.diff(time))[:, None]
        return self._white.standard_normal((count, 3)) * (self._size * self._root_rate)
