r"""Overlapping Allan variance from sums, and the covariance of its estimates at different cluster times.

With x the running sum of a signal y sampled at a constant rate and m the number of samples in a cluster, the
overlapping estimate is the mean of squared second differences

.. math:: \hat\sigma^2(m) = \frac{1}{2 m^2 M_m} \sum_{i=0}^{M_m - 1} D_m(i)^2, \qquad
          D_m(i) = x_{i+2m} - 2 x_{i+m} + x_i .

For Gaussian noise the covariance of two such estimates follows from Cov(D_m(i), D_n(j)), which depends on j − i only:

.. math:: \operatorname{Cov}(\hat\sigma^2(m), \hat\sigma^2(n))
          = \frac{\sum_{i,j} 2 C_{mn}(j-i)^2 + 4 \mu_m \mu_n C_{mn}(j-i)}{4 m^2 n^2 M_m M_n} .

The time unit is one sample throughout. A signal of the variance
3q/m² + n/m + (2 ln 2/π) b + k m/3 + r m²/2 has the generalised covariance (that is, up to polynomials which second
differences remove) q δ(t) − n|t|/2 + b t² ln|t|/(2π) + k|t|³/12 and the mean second difference √r m².

Sources: IEEE Std 952-1997, annex C (terms of the variance); C. A. Greenhall, W. J. Riley, "Uncertainty of stability
variances based on finite differences", PTTI 2003 (covariance of second differences), here for mixtures of noises.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np
import numpy.typing as npt

from northdown.kernels.jit import compiled, inline

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

# Between breakpoints further apart than this the sum over lags is taken as an integral; its error is of the order
# of the inverse square.
_EXACT = 48
_POINTS = 15

PRODUCTS: Array = np.outer([1.0, -2.0, 1.0], [1.0, -2.0, 1.0]).ravel()
"""Products of the weights of two second differences."""


def _sums(values: Array, starts: Indices, stops: Indices, sizes: Indices, total: Array, count: Indices) -> None:
    """Add up squared second differences within each run of samples.

    `total` and `count` (one entry for each cluster size) are added to: the sum of D_m², and how many there are.
    """
    for run in range(len(starts)):
        first = starts[run]
        n = stops[run] - first
        mean = 0.0
        for i in range(n):
            mean += values[first + i]
        mean /= n
        # without its mean the running sum stays small, and so does the rounding of its differences
        x = np.empty(n + 1)
        x[0] = 0.0
        for i in range(n):
            x[i + 1] = x[i] + (values[first + i] - mean)
        for j in range(len(sizes)):
            m = sizes[j]
            terms = n - 2 * m + 1
            if terms <= 0:
                continue
            # four partial sums, because each addition waits for the one before it
            s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
            i = 0
            while i + 4 <= terms:
                d0 = x[i + 2 * m] - 2.0 * x[i + m] + x[i]
                d1 = x[i + 1 + 2 * m] - 2.0 * x[i + 1 + m] + x[i + 1]
                d2 = x[i + 2 + 2 * m] - 2.0 * x[i + 2 + m] + x[i + 2]
                d3 = x[i + 3 + 2 * m] - 2.0 * x[i + 3 + m] + x[i + 3]
                s0 += d0 * d0
                s1 += d1 * d1
                s2 += d2 * d2
                s3 += d3 * d3
                i += 4
            while i < terms:
                d0 = x[i + 2 * m] - 2.0 * x[i + m] + x[i]
                s0 += d0 * d0
                i += 1
            total[j] += (s0 + s1) + (s2 + s3)
            count[j] += terms


@inline
def _breakpoints(m: float, n: float, low: float, high: float, turn: float, shift: Array, points: Array) -> None:
    """Lags between which covariance times number of pairs is smooth, in order, cut to [low, high].

    `turn`: lag at which the number of pairs (i, j) of one lag changes its slope, besides zero.
    """
    # only flicker reaches beyond the overlap of both differences, and falls with the square of the lag
    reach = m + n
    points[9], points[10] = -2.0 * n - reach, 2.0 * m + reach
    points[11], points[12] = -2.0 * n - 6.0 * reach, 2.0 * m + 6.0 * reach
    points[13], points[14] = 0.0, turn
    for i in range(_POINTS):
        value = -shift[i] if i < 9 else points[i]
        if value < low:
            value = low
        if value > high:
            value = high
        # sorted by insertion: numba's own sort takes seconds to compile
        j = i
        while j > 0 and points[j - 1] > value:
            points[j] = points[j - 1]
            j -= 1
        points[j] = value


@inline
def _lags(points: Array, rule: Array, lags: Array, weights: Array) -> int:
    """Lags at which to evaluate, and their weights, so that the weighted sum is that over all whole lags."""
    count = 0
    for i in range(_POINTS):
        left = points[i]
        right = points[i + 1] if i + 1 < _POINTS else left + 1.0
        if right - left <= _EXACT:
            for step in range(int(right - left)):
                lags[count], weights[count] = left + step, 1.0
                count += 1
        else:
            half = 0.5 * (right - left)
            for k in range(len(rule)):
                lags[count], weights[count] = left + half * (1.0 + rule[k, 0]), half * rule[k, 1]
                count += 1
    return count


@inline
def _difference_covariance(t: float, shift: Array, weight: Array, c: Array) -> tuple[float, float]:
    """Cov(D_m(i), D_n(i + t)): its smooth part, and quantisation, which is zero except at nine lags."""
    smooth, spike = 0.0, 0.0
    for k in range(9):
        s = math.fabs(t + shift[k])
        if s > 0.0:
            flicker = c[2] / (2.0 * math.pi) * math.log(s)
            smooth += weight[k] * s * (s * (flicker + s * (c[3] / 12.0)) - 0.5 * c[1])
        else:
            spike += weight[k] * c[0]
    return smooth, spike


def _covariance(
    sizes: Array, lengths: Array, counts: Array, c: Array, rule: Array, weight: Array, out: Array
) -> None:
    """Covariance of the estimates; see `covariance`."""
    shift, points = np.empty(9), np.empty(_POINTS)
    room = _POINTS * (_EXACT + len(rule)) + _POINTS
    lags, weights = np.empty(room), np.empty(room)
    for index in range(len(sizes) * len(sizes) * len(lengths)):
        j = index // len(lengths) % len(sizes)
        i = index // len(lengths) // len(sizes)
        m, n, length = sizes[i], sizes[j], lengths[index % len(lengths)]
        terms_m, terms_n = length - 2.0 * m + 1.0, length - 2.0 * n + 1.0
        if j > i or terms_m <= 0.0 or terms_n <= 0.0:
            continue
        for k in range(9):
            shift[k] = (k % 3) * n - (k // 3) * m
        _breakpoints(m, n, 1.0 - terms_m, terms_n - 1.0, terms_n - terms_m, shift, points)
        number = _lags(points, rule, lags, weights)
        # quantisation's spikes, which stand at breakpoints, come after the smooth part
        for k in range(_POINTS):
            lags[number + k] = points[k]
        cross = 4.0 * c[4] * m * m * n * n
        total = 0.0
        for k in range(number + _POINTS):
            t = lags[k]
            if k > number and t == lags[k - 1]:
                continue
            # i runs over terms_m places and j = i + t over terms_n; as n ≤ m, fewer of m
            pairs = terms_m if t <= terms_n - terms_m else terms_n - t
            if t < 0.0:
                pairs += t
            smooth, spike = _difference_covariance(t, shift, weight, c)
            if k < number:
                total += weights[k] * pairs * smooth * (2.0 * smooth + cross)
            else:
                total += pairs * spike * (4.0 * smooth + 2.0 * spike + cross)
        out[i, j] += total / (4.0 * (m * n) ** 2 * counts[i] * counts[j])
        out[j, i] = out[i, j]


@cache
def sums() -> Callable[..., None]:
    """Compiled ``sums(values, starts, stops, sizes, total, count)``, see the module's docstring."""
    return compiled(_sums, "allan-sums", "(f8[::1], i8[::1], i8[::1], i8[::1], f8[::1], i8[::1])")


@cache
def covariance() -> Callable[..., None]:
    """Compiled ``covariance(sizes, lengths, counts, c, rule, weight, out)``.

    Adds to `out` the covariance (T, T) of the estimates at the cluster sizes (T,) from runs of those lengths, with
    counts (T,) second differences in all, for the noise c = (q, n, b, k, r) of the module's docstring. `rule` holds
    nodes and weights (P, 2) of a Gauss–Legendre rule on [−1, 1], `weight` is `PRODUCTS`.
    """
    signature = "(f8[::1], f8[::1], f8[::1], f8[::1], f8[:,::1], f8[::1], f8[:,::1])"
    return compiled(_covariance, "allan-covariance", signature)
