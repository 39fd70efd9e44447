"""The numerical side of `clock`: the offset at which two series of mean rates agree best."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from northdown._validation import FloatArray
from northdown.orientation import Orientation

# Step (s) of the first search, and of the derivative with respect to the offset.
_COARSE, _STEP = 0.01, 0.005
# Further off (s), the noise of that derivative goes with the residuals' and draws the offset to one side.
_SAME_SLOPE = 1e-5
_MOST_COARSE = 5_000
# Sigma comes from parts of about this long (s) that are taken to err independently; between so many of them.
_PART, _FEWEST_PARTS, _MOST_PARTS = 2.0, 10, 200
# Cauchy's loss with this many standard deviations has 95 % of the efficiency of least squares on normal errors.
_CAUCHY = 2.3849
_MEDIAN_LENGTH = 1.5382  # of a vector of three standard normal numbers


@dataclass(frozen=True, eq=False)
class Rates:
    """Mean rates of the reference over windows, and the integrated gyroscope to compare them with.

    Parameters
    ----------
    gyroscope : Orientation
        Integrated gyroscope.
    begin, end : (N,) arrays
        Ends of the windows, s.
    mean : (N, 3) array
        Mean rate of the reference in its body axes, rad/s.
    """

    gyroscope: Orientation
    begin: FloatArray
    end: FloatArray
    mean: FloatArray

    def __len__(self) -> int:
        return len(self.mean)

    def at(self, later: float) -> FloatArray:
        """Mean rates (N, 3) of the gyroscope over the windows moved by so much (s)."""
        first, last = self.gyroscope.at(self.begin + later), self.gyroscope.at(self.end + later)
        rates: FloatArray = (first.rotation.inv() * last.rotation).as_rotvec() / (self.end - self.begin)[:, None]
        return rates


class Fit(NamedTuple):
    """Offset and standard deviation, s; how far rates are from their mean, rad/s, and what part is left over."""

    offset: float
    sigma: float
    change: float
    left_over: float


def coarse_offset(rates: Rates, limit: float) -> float:
    """Offset (s) within ±limit at which the sizes of the rates are most alike; any rotation between them is free."""
    every = -(-len(rates) // _MOST_COARSE)
    begin, end = rates.begin[::every], rates.end[::every]
    size = np.linalg.norm(rates.mean[::every], axis=1)
    half = 0.5 * float(np.median(end - begin))
    grid = np.arange(begin[0] - limit - half, end[-1] + limit + half, _COARSE)
    inside = (grid - half > rates.gyroscope.time[0]) & (grid + half < rates.gyroscope.time[-1])
    grid = grid[inside]
    there = Rates(rates.gyroscope, grid - half, grid + half, np.zeros((len(grid), 3)))
    other = np.linalg.norm(there.at(0.0), axis=1)
    lags = _COARSE * np.arange(-int(limit / _COARSE), int(limit / _COARSE) + 1)
    middle = 0.5 * (begin + end)
    alike = [_correlation(size, np.interp(middle + lag, grid, other)) for lag in lags]
    return float(lags[int(np.argmax(alike))])


def fit_offset(rates: Rates, start: float, limit: float) -> Fit:
    """Gauss–Newton steps on the offset; matrix and bias are eliminated at each, weights follow the residuals."""
    offset, weight, known_at = start, np.ones(len(rates)), math.inf
    for _ in range(20):
        measured = rates.at(offset)
        if abs(offset - known_at) > _SAME_SLOPE:
            slope, known_at = (rates.at(offset + _STEP) - rates.at(offset - _STEP)) / (2.0 * _STEP), offset
        others = np.column_stack([measured, np.ones(len(rates))])
        matrix = _solve(others, rates.mean, weight)
        residual = rates.mean - others @ matrix
        # what the offset changes that neither matrix nor bias can
        pull = slope @ matrix[:3]
        pull -= others @ _solve(others, pull, weight)
        square = float(np.einsum("n,ni,ni->", weight, pull, pull))
        along: FloatArray = weight * np.einsum("ni,ni->n", pull, residual)
        if not square > 0.0:
            return Fit(offset, np.inf, 0.0, 1.0)
        step = float(along.sum()) / square
        size = np.linalg.norm(residual, axis=1)
        spread = float(np.median(size)) / _MEDIAN_LENGTH
        # the floor keeps rounding errors of noise-free data from being taken for outliers
        weight = 1.0 / (1.0 + np.square(size / (_CAUCHY * max(spread, 1e-9))))
        moved = float(np.clip(offset + step, -limit - _COARSE, limit + _COARSE))
        done, offset = abs(moved - offset) < 1e-7, moved
        if done:
            break
    about = np.linalg.norm(rates.mean - np.median(rates.mean, axis=0), axis=1)
    change = float(np.median(about))
    return Fit(offset, _sigma(rates, along, square), change, float(np.median(size)) / max(change, 1e-9))


def _sigma(rates: Rates, along: FloatArray, square: float) -> float:
    """Standard deviation from how far parts of the data pull apart: neighbours err alike, parts hardly."""
    moving = float(rates.end[-1] - rates.begin[0])
    parts = int(np.clip(moving / _PART, _FEWEST_PARTS, _MOST_PARTS))
    sums = np.array([float(part.sum()) for part in np.array_split(along, parts)])
    return float(np.sqrt(np.sum(np.square(sums - sums.mean())) * parts / (parts - 1.0))) / square


def _solve(columns: FloatArray, wanted: FloatArray, weight: FloatArray) -> FloatArray:
    root: FloatArray = np.sqrt(weight)[:, None]
    return np.asarray(np.linalg.lstsq(columns * root, wanted * root, rcond=None)[0], dtype=np.float64)


def _correlation(a: FloatArray, b: FloatArray) -> float:
    x: FloatArray = a - float(a.mean())
    y: FloatArray = b - float(b.mean())
    size = float(np.sqrt((x @ x) * (y @ y)))
    return float(x @ y) / size if size > 0.0 else 0.0
