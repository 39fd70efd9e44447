"""When samples are taken, and what their time stamps say."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from northdown._validation import BoolArray, FloatArray, check_number, check_time
from northdown.errors import InputError, expected
from northdown.simulation.imu_errors import SensorErrors
from northdown.simulation.imu_errors_noise import Gaps
from northdown.simulation.motion import Motion
from northdown.simulation.seeds import generator

# Samples that are made together. Always the same number, so that the result does not depend on how it is cut up.
BLOCK: Final = 8192
_TIMING: Final = 3
_JITTER, _STAMPS, _LOSS = range(3)
# Of the time to the nearest neighbour: more could change the order.
_FURTHEST: Final = 0.45


@dataclass(frozen=True, eq=False)
class Clock:
    """Nominal sampling times: regular, or given.

    Attributes
    ----------
    start : float
        First time, s.
    rate : float
        Samples per second, the inverse of the median period, Hz.
    count : int
        Number of samples.
    given : (N,) array or None
        Times, if they are not regular.
    """

    start: float
    rate: float
    count: int
    given: FloatArray | None = None

    @classmethod
    def of(cls, motion: Motion, rate: float, time: npt.ArrayLike | None) -> Clock:
        """Clock that covers a motion at a rate (Hz), or ticks at given times within its span."""
        if time is None:
            rate = check_number("rate", rate, above=0.0, high=100_000.0, unit="Hz")
            return cls(motion.start, rate, int(np.floor(motion.duration * rate + 1e-9)) + 1)
        given = check_time(time)
        if len(given) < 2 or (np.diff(given) <= 0.0).any():
            raise InputError(expected("two increasing times or more", f"{len(given)} times, not increasing"))
        low, high = motion.span
        if given[0] < low or given[-1] > high:
            raise InputError(expected(f"times from {low:g} to {high:g} s", f"{given[0]:g} to {given[-1]:g} s"))
        return cls(float(given[0]), 1.0 / float(np.median(np.diff(given))), len(given), given)

    @property
    def period(self) -> float:
        """Median time between samples, s."""
        return 1.0 / self.rate

    def nominal(self, first: int, stop: int) -> FloatArray:
        """Times of samples `first` to `stop` − 1."""
        if self.given is not None:
            return self.given[first:stop]
        return self.start + np.arange(first, stop) / self.rate

    def room(self, first: int, stop: int) -> FloatArray | float:
        """How far each sample may be moved without changing the order, s."""
        if self.given is None:
            return _FURTHEST * self.period
        around = np.diff(self.given[max(first - 1, 0) : stop + 1], prepend=-np.inf, append=np.inf)
        around = around[1:] if first > 0 else around
        n = stop - first
        nearest: FloatArray = _FURTHEST * np.minimum(around[:n], around[1 : n + 1])
        return nearest


class Timing:
    """Sampling instants, time stamps and lost rows of a recording, block by block.

    Parameters
    ----------
    clock : Clock
        Nominal times.
    errors : SensorErrors
        Its jitter, noise of the stamps and losses.
    seed : int
        Of the recording.
    """

    def __init__(self, clock: Clock, errors: SensorErrors, seed: int) -> None:
        self._clock, self._errors = clock, errors
        self._jitter = generator(seed, _TIMING, _JITTER)
        self._stamps = generator(seed, _TIMING, _STAMPS)
        self._gaps = Gaps(errors.loss, errors.loss_length, generator(seed, _TIMING, _LOSS))

    def block(self, first: int, stop: int) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Instants, stamps and whether the row is lost, for samples `first` to `stop` − 1."""
        nominal = self._clock.nominal(first, stop)
        room = self._clock.room(first, stop)
        shift = np.zeros(len(nominal))
        if self._errors.jitter > 0.0:
            shift = np.clip(self._errors.jitter * self._jitter.standard_normal(len(nominal)), -room, room)
        moved = shift
        if self._errors.stamp_noise > 0.0:
            moved = shift + self._errors.stamp_noise * self._stamps.standard_normal(len(nominal))
            moved = np.clip(moved, -room, room)
        return nominal + shift, nominal + moved, self._gaps.missing(len(nominal))
