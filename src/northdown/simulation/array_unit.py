"""`ArrayUnit`: an array of accelerometers at work, from the motion to its samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from northdown._validation import FloatArray
from northdown.arrays import AccelerometerArray
from northdown.simulation.array_errors import ArrayErrors
from northdown.simulation.imu_errors_channel import Channel
from northdown.simulation.imu_errors_noise import Gaps
from northdown.simulation.seeds import generator

# Numbers of the streams of random numbers; those of the other sensors are below.
_ARRAY: Final = 100
_GEOMETRY, _DROPOUT, _CHANNELS = range(3)

State = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
"""From times (N,) to body rate, its derivative, and specific force at the body's origin, (3, N) in body axes."""


class ArrayUnit:
    """Accelerometers of an array whose samples are taken in increasing order of time.

    Parameters
    ----------
    array : AccelerometerArray
        Their geometry as stated.
    errors : ArrayErrors
        What they add to the truth, and how far the true geometry differs.
    state : callable
        What the body does.
    period, start : float
        Sampling period and time of the first sample, s.
    seed : int
        Of the recording.
    """

    def __init__(
        self,
        array: AccelerometerArray,
        errors: ArrayErrors,
        state: State,
        *,
        period: float,
        start: float,
        seed: int,
    ) -> None:
        self._count, self._delay, self._state = len(array), errors.delay, state
        true = errors.true_geometry(array, seed, _ARRAY, _GEOMETRY)
        self._matrix, self._products = true.matrix, true.products
        self._channels = [
            Channel(
                own,
                self._part(j),
                integrates=False,
                period=period,
                start=start,
                seed=seed,
                sensor=_ARRAY + _CHANNELS + j,
            )
            for j, own in enumerate(errors.triads(len(array)))
        ]
        self._gaps = Gaps(errors.dropout, errors.dropout_length, generator(seed, _ARRAY, _DROPOUT))
        self._dropout = errors.dropout
        self._last: FloatArray = np.zeros(0)
        self._last_truth: FloatArray = np.zeros((0, 3 * len(self._channels)))

    def read(self, time: FloatArray) -> FloatArray:
        """Samples (N, K) at times later than those of the call before, m/s²; NaN where the array dropped out."""
        parts = [channel.read(time, _no_force)[0] for channel in self._channels]
        values: FloatArray = np.ascontiguousarray(np.hstack(parts)[:, : self._count])
        if self._dropout > 0.0:
            values[self._gaps.missing(len(time))] = np.nan
        return values

    def _part(self, j: int) -> Callable[[FloatArray], FloatArray]:
        """Truth of the j-th three channels."""
        return lambda time: self._truth(time)[:, 3 * j : 3 * j + 3]

    def _truth(self, time: FloatArray) -> FloatArray:
        """Truth of all channels, with zeros up to a multiple of three; made once for all of them."""
        if not np.array_equal(self._last, time):
            rate, acceleration, force = self._state(time - self._delay if self._delay else time)
            x, y, z = rate
            products = np.stack([x * x, y * y, z * z, x * y, x * z, y * z])
            felt = self._matrix @ np.concatenate([acceleration, force]) + self._products @ products
            self._last_truth = np.zeros((len(time), 3 * len(self._channels)))
            self._last_truth[:, : self._count] = felt.T
            self._last = time
        return self._last_truth


def _no_force(time: FloatArray) -> FloatArray:
    return np.zeros((len(time), 3))
