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

    With ẋ = A x + b w in the modes of A, poles λᵢ, all is known: x at the next tick is exp(λᵢ Δ) xᵢ plus noise of the
    covariance bᵢ b̄ⱼ (exp((λᵢ + λ̄ⱼ) Δ) − 1)/(λᵢ + λ̄ⱼ), and at the start the same for infinite Δ.
    """

    def __init__(self, size: FloatArray, denominator: list[float], tick: float, rng: np.random.Generator) -> None:
        self._size, self._rng = size, rng
        poles = np.roots(denominator)
        # partial fractions of H(s) = d_n/Π(s − λᵢ): its response to an impulse is Σ rᵢ exp(λᵢ t)
        weights = [denominator[-1] / np.prod([p - q for q in poles if q != p]) for p in poles]
        self._decay = np.exp(poles * tick)
        pairs = poles[:, None] + poles.conj()[None, :]
        shape = np.outer(weights, np.conj(weights)) / pairs
        self._mix = self._root(shape * np.expm1(pairs * tick))
        self._state = self._root(-shape) @ rng.standard_normal((len(poles), 3))

    @staticmethod
    def _root(covariance: Any) -> Any:
        """Matrix of as many real columns as modes whose modes' sum has this covariance.

        The modes come in conjugate pairs, so that the real processes Re x₁ and Im x₁ carry all of it.
        """
        if len(covariance) == 1:
            return np.sqrt(covariance)
        to_real = np.array([[0.5, 0.5], [-0.5j, 0.5j]])
        real = (to_real @ covariance @ to_real.conj().T).real
        return np.linalg.inv(to_real) @ np.linalg.cholesky(real)

    def next(self, count: int) -> FloatArray:
        """Noise (count, 3) at the next ticks."""
        from scipy.signal import lfilter

        if not self._size.any():
            return np.zeros((count, 3))
        drive = self._mix @ self._rng.standard_normal((count, len(self._decay), 3))
        total = np.zeros((count, 3))
        for k, decay in enumerate(self._decay):
            mode, _ = lfilter([1.0], [1.0, -decay], drive[:, k], axis=0, zi=decay * self._state[k : k + 1])
            self._state[k] = mode[-1]
            total += mode.real
        return self._size * total
