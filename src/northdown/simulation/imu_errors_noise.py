"""Random processes that go on from block to block: white noise, flicker noise, random walk, gaps.

Flicker noise of coefficient B has the (two-sided) density B²/(2πf). A sum of first-order Gauss–Markov processes of
the same variance σ², whose correlation times are a constant ratio r apart, has the density σ²/(2 f ln r) between the
inverse of the longest and of the shortest, so σ² = B² ln r/π. With r ≤ 4 the ripple is below 1 %.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from northdown._validation import BoolArray, FloatArray
from northdown.simulation.imu_errors import TriadErrors
from northdown.simulation.seeds import generator

_RATIO = 4.0
# Steps per correlation time. What is faster is the part of the next faster process.
_PER_TIME = 16.0


class _Level:
    """A process of first order on a grid of its own, with that of the next slower level added; linear in between."""

    def __init__(
        self,
        step: float,
        decay: float,
        size: FloatArray,
        first: FloatArray,
        rng: np.random.Generator,
        slower: _Level | None,
    ) -> None:
        self._step, self._decay, self._size, self._rng, self._slower = step, decay, size, rng, slower
        self._origin = 0
        self._own = first[None]
        self._sum = first[None] if slower is None else first[None] + slower.at(np.zeros(1))

    def at(self, time: FloatArray) -> FloatArray:
        """Values (N, 3) at increasing times after the start (s), none before the last of the call before."""
        self._extend(math.floor(float(time[-1]) / self._step) + 2)
        grid = (self._origin + np.arange(len(self._sum))) * self._step
        value = np.column_stack([np.interp(time, grid, self._sum[:, k]) for k in range(3)])
        done = math.floor(float(time[-1]) / self._step) - self._origin
        if done > 0:
            self._origin += done
            self._own, self._sum = self._own[-1:], self._sum[done:]
        return value

    def _extend(self, last: int) -> None:
        from scipy.signal import lfilter

        count = last - self._origin - len(self._sum) + 1
        if count <= 0:
            return
        drive = self._size * self._rng.standard_normal((count, 3))
        own: FloatArray
        own, _ = lfilter([1.0], [1.0, -self._decay], drive, axis=0, zi=self._decay * self._own[-1:])
        total = own
        if self._slower is not None:
            first = self._origin + len(self._sum)
            grid = np.arange(first, first + count, dtype=np.float64) * self._step
            total = own + self._slower.at(grid)
        self._own = own[-1:]
        self._sum = np.concatenate([self._sum, total])


class Drift:
    """Flicker noise and random walk of three axes, together.

    Parameters
    ----------
    errors : TriadErrors
        Its `instability`, `correlation_times` and `walk`.
    seed : int
        Of the recording.
    purpose : int
        Numbers that name the stream.
    """

    def __init__(self, errors: TriadErrors, seed: int, *purpose: int) -> None:
        _, instability, walk = errors.coefficients
        level: _Level | None = None
        shortest, longest = errors.correlation_times
        if instability.any():
            count = math.ceil(math.log(longest / shortest) / math.log(_RATIO)) + 1
            ratio = (longest / shortest) ** (1.0 / (count - 1))
            size = instability * math.sqrt(math.log(ratio) / math.pi)
            for k in range(count):
                rng = generator(seed, *purpose, 1 + k)
                decay = math.exp(-1.0 / _PER_TIME)
                step = longest / ratio**k / _PER_TIME
                # from its steady state on, as if the sensor had always been running
                first: FloatArray = size * rng.standard_normal(3)
                level = _Level(step, decay, size * math.sqrt(1.0 - decay * decay), first, rng, level)
        if walk.any():
            # on the finest grid: what is slower is interpolated, which would smooth a walk
            step = (shortest if instability.any() else 1.0) / _PER_TIME
            level = _Level(step, 1.0, walk * math.sqrt(step), np.zeros(3), generator(seed, *purpose, 0), level)
        self._level = level

    def at(self, time: FloatArray) -> FloatArray | None:
        """Values (N, 3) at increasing times after the start (s), none before those of the call before."""
        return None if self._level is None else self._level.at(np.maximum(time, 0.0))


class Gaps:
    """Runs of missing samples whose lengths, and the distances between which, are geometrically distributed.

    Parameters
    ----------
    part : float
        Part of the samples that is missing.
    length : float
        Mean length of a run.
    rng : numpy.random.Generator
        Source of the randomness.
    """

    def __init__(self, part: float, length: float, rng: np.random.Generator) -> None:
        self._part, self._rng = part, rng
        self._missing = 1.0 / length
        self._there = min(1.0, part / (length * (1.0 - part)))
        self._ends = np.zeros(0, np.int64)
        self._done = 0
        if part > 0.0 and rng.random() < part:
            # start within a run; what is left of a geometric run is geometric again
            self._ends = np.array([0, rng.geometric(self._missing)])

    def missing(self, count: int) -> BoolArray:
        """Which of the next samples are missing."""
        if self._part == 0.0:
            return np.zeros(count, np.bool_)
        stop = self._done + count
        while not len(self._ends) or self._ends[-1] < stop:
            lengths = np.empty(64, np.int64)
            lengths[0::2] = self._rng.geometric(self._there, 32)
            lengths[1::2] = self._rng.geometric(self._missing, 32)
            last = self._ends[-1] if len(self._ends) else 0
            self._ends = np.concatenate([self._ends, last + np.cumsum(lengths)])
        # an odd number of runs that have ended before or at a sample puts it inside one that is missing
        index = np.arange(self._done, stop)
        inside: npt.NDArray[np.intp] = np.searchsorted(self._ends, index, side="right")
        keep = int(inside[-1]) // 2 * 2 if count else 0
        self._ends, self._done = self._ends[keep:], stop
        odd: BoolArray = inside % 2 == 1
        return odd
