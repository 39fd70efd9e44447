"""The low-pass filter of a sensor: truth and white noise pass through it.

It runs on a clock at least ten times as fast as its bandwidth. There the truth is taken as linear between ticks
(first-order hold), and the *difference* that the filter makes is read off at the sampling instants, so that a wide
filter leaves the exact samples as they are. Against the filter of continuous time the gain at −3 dB is off by 1.6 %.
The noise at the ticks has exactly the covariance of white noise behind the filter of continuous time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeAlias, cast

import numpy as np

from northdown._validation import FloatArray
from northdown.errors import InputError, expected
from northdown.simulation.imu_errors import TriadErrors

Signal: TypeAlias = Callable[[FloatArray], FloatArray]
"""From times (N,) to (N, 3); of an integrating sensor, from edges (N + 1,) to the means in between."""

_TICKS = 10.0
_MOST = 100


class Lag:
    """What the filter of one sensor adds to its exact samples, noise included.

    Parameters
    ----------
    errors : TriadErrors
        Its `bandwidth`, `order` and `noise`.
    signal : callable
        The truth.
    integrates : bool
        Whether samples are means since the sample before, as of a gyroscope.
    period : float
        Sampling period, s.
    start : float
        Time of the first sample, s.
    rng : numpy.random.Generator
        Of the white noise.
    """

    def __init__(
        self,
        errors: TriadErrors,
        signal: Signal,
        integrates: bool,
        period: float,
        start: float,
        rng: np.random.Generator,
    ) -> None:
        from scipy.signal import cont2discrete

        ticks = max(1, math.ceil(_TICKS * errors.bandwidth * period))
        if ticks > _MOST:
            raise InputError(
                expected(
                    f"a bandwidth of at most {_MOST / _TICKS / period:g} Hz at a rate of {1.0 / period:g} Hz",
                    f"{errors.bandwidth:g} Hz",
                    do="leave the bandwidth out",
                )
            )
        w = 2.0 * math.pi * errors.bandwidth
        denominator = [1.0, w] if errors.order == 1 else [1.0, math.sqrt(2.0) * w, w * w]
        self._tick = period / ticks
        digital: Any = cont2discrete(cast("Any", (denominator[-1:], denominator)), self._tick, "foh")
        self._b, self._a = np.ravel(digital[0]), np.ravel(digital[1])
        self._noise = _FilteredNoise(errors.coefficients[0], denominator, self._tick, rng)
        self._signal, self._integrates = signal, integrates
        self._state: FloatArray | None = None
        # jitter, and the start of the first mean, may be up to two periods early
        self._time = np.array([start - 2.0 * period])
        self._value = np.zeros((1, 3))

    def at(self, time: FloatArray) -> FloatArray:
        """Difference (N, 3) at increasing times (N,), or of the means between edges (N + 1,)."""
        self._extend(float(time[-1]))
        value = np.column_stack([np.interp(time, self._time, self._value[:, k]) for k in range(3)])
        keep = max(0, int(np.searchsorted(self._time, time[-1])) - 2)
        self._time, self._value = self._time[keep:], self._value[keep:]
        return np.diff(value, axis=0) / np.diff(time)[:, None] if self._integrates else value

    def _extend(self, last: float) -> None:
        from scipy.signal import lfilter, lfilter_zi

        count = math.ceil((last - self._time[-1]) / self._tick) + 1
        if count <= 0:
            return
        ticks = self._time[-1] + self._tick * np.arange(count + 1)
        truth = self._signal(ticks if self._integrates else ticks[1:])
        if self._state is None:
            self._state = lfilter_zi(self._b, self._a)[:, None] * truth[0]
        filtered, self._state = lfilter(self._b, self._a, truth, axis=0, zi=self._state)
        difference: FloatArray = filtered - truth + self._noise.next(count)
        if self._integrates:
            difference = self._value[-1] + np.cumsum(difference, axis=0) * self._tick
        self._time = np.concatenate([self._time, ticks[1:]])
        self._value = np.concatenate([self._value, difference])


class _FilteredNoise:
    """White noise behind a filter, at regular ticks.

    With poles λᵢ and rᵢ the residues of the filter, noise has the covariance Σ −rᵢ r̄ⱼ exp(λᵢ t)/(λᵢ + λ̄ⱼ) over a time
    t. At ticks Δ apart that is an autoregressive process of the filter's order, with poles exp(λᵢ Δ), driven by a
    moving average of white noise over one tick less (P. J. Brockwell, Handbook of Statistics 19, 2001, chapter 9).
    """

    def __init__(self, size: FloatArray, denominator: list[float], tick: float, rng: np.random.Generator) -> None:
        self._size, self._rng = size, rng
        poles = np.roots(denominator)
        # partial fractions of H(s) = d_n/Π(s − λᵢ): its response to an impulse is Σ rᵢ exp(λᵢ t)
        residues = [denominator[-1] / np.prod([p - q for q in poles if q != p]) for p in poles]
        decay = np.exp(poles * tick)
        pairs = poles[:, None] + poles.conj()[None, :]
        shape = np.outer(residues, np.conj(residues)) / pairs
        self._a: FloatArray = np.real(np.poly(decay)).astype(np.float64)
        # the modes' steps, of covariance `step`, are driven together: what drives their sum is a moving average
        step = shape * np.expm1(pairs * tick)
        other = decay[::-1] if len(decay) == 2 else np.zeros(1)
        now, then = float(step.sum().real), float((other @ step @ other.conj()).real)
        between = -float((step @ other.conj()).sum().real)
        ratio = between / (now + then)
        theta = 2.0 * ratio / (1.0 + math.sqrt(max(0.0, 1.0 - 4.0 * ratio * ratio)))
        variance = (now + then) / (1.0 + theta * theta)
        self._b: FloatArray = math.sqrt(variance) * np.array([1.0, theta])[: len(poles)]
        # the filter's state is what is known of the next value, and −a₂ times the last one
        covariance = np.array([[-float(shape.sum().real) - variance]])
        if len(poles) == 2:
            height, next_to = (-float((np.exp(poles * t) @ shape).sum().real) for t in (0.0, tick))
            cross = -self._a[2] * next_to
            covariance = np.array([[height - variance, cross], [cross, self._a[2] ** 2 * height]])
        values, vectors = np.linalg.eigh(covariance)
        self._state: FloatArray = vectors * np.sqrt(np.maximum(values, 0.0)) @ rng.standard_normal((len(poles), 3))

    def next(self, count: int) -> FloatArray:
        """Noise (count, 3) at the next ticks."""
        from scipy.signal import lfilter

        if not self._size.any():
            return np.zeros((count, 3))
        noise: FloatArray
        noise, self._state = lfilter(self._b, self._a, self._rng.standard_normal((count, 3)), axis=0, zi=self._state)
        noise *= self._size
        return noise
