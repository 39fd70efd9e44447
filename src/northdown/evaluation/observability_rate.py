"""The body rate of a motion as a Taylor series at given times: what a perfect gyroscope tells, now and next.

Laws written with NumPy's arithmetic are evaluated on series as they stand. Splines are piecewise polynomials in time,
whose derivatives have a recursion of their own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray
from northdown.errors import InputError, expected
from northdown.evaluation.observability_series import Series, as_series
from northdown.simulation import _quaternions as quaternions
from northdown.simulation.motion import Turning
from northdown.simulation.motion_from_rate import FromRate
from northdown.simulation.motion_spline import SplineTurning, basis, find_intervals

Indices = npt.NDArray[np.intp]


def rate_series(turning: Turning, time: FloatArray, order: int) -> Series:
    """Body rate (rad/s, body axes) around given times, as series of shape (3, N).

    Parameters
    ----------
    turning : Turning
        Law of the attitude.
    time : (N,) array
        Times, s, inside its span.
    order : int
        Highest derivative.

    Raises
    ------
    InputError
        For a law of one's own that does with the time what a `Series` does not know.
    """
    if isinstance(turning, SplineTurning):
        return _spline_rate(turning, time, order)
    clock: Any = Series.of_time(time, order)
    try:
        rate = turning.law(clock)[0] if isinstance(turning, FromRate) else turning.evaluate(clock)[1]
    except (TypeError, AttributeError) as problem:
        raise InputError(
            expected(
                "a motion made of sums, products, quotients, roots, sines and exponentials of time",
                f"{type(turning).__name__}, which cannot be differentiated ({problem})",
                do="follow it by a spline: observability(motion.orientation(rate=200.0))",
            )
        ) from None
    return as_series(rate, order)


def _spline_rate(turning: SplineTurning, time: FloatArray, order: int) -> Series:
    """Rate of a cumulative B-spline, ω ← Rᵀ(λ d) ω + λ̇ d, factor by factor."""
    knots, p = turning.knots, turning.degree
    t = np.clip(time, knots[p], knots[-p - 1])
    interval = find_intervals(knots, p, t)
    rate = Series.constant(np.zeros((3, len(t))), order)
    for k, blend in enumerate(_blends(knots, p, t, interval, order + 1, moving=t == time)):
        d = turning.increments[:, interval - p + k]
        rate = _turned_back(rate, d, blend) + blend.derivative() * d
    return rate


def _turned_back(vector: Series, axis: FloatArray, part: Series) -> Series:
    """Vectors (3, N) in axes that have turned by `part` of the rotation vector `axis` (Rodrigues' formula)."""
    length = np.sqrt((axis * axis).sum(axis=0))
    unit = axis / np.where(length > 0.0, length, 1.0)
    sine, cosine = np.sin(part * length), np.cos(part * length)
    along = unit[0] * vector[0] + unit[1] * vector[1] + unit[2] * vector[2]
    turned: Series = vector * cosine - quaternions.cross(unit, vector) * sine + along * (1.0 - cosine) * unit  # type: ignore[arg-type]
    return turned


def _blends(
    knots: FloatArray, p: int, t: FloatArray, interval: Indices, order: int, *, moving: npt.NDArray[np.bool_]
) -> list[Series]:
    """The sums λ_j of B-splines that act at each time, j = i − p + 1 … i, as series; constant where not `moving`."""
    values = np.cumsum(basis(knots, p, t, interval)[:0:-1], axis=0)[::-1]
    found = []
    for k in range(p):
        j = interval - p + 1 + k
        # of the sum over s ≥ j of N_s′ one term is left, of degree p − 1
        scale = p / (knots[j + p] - knots[j]) * moving
        coefficients, factorial = [values[k]], 1.0
        for m in range(1, order + 1):
            factorial *= m
            coefficients.append(scale / factorial * _basis_derivative(knots, p - 1, m - 1, j, t, interval))
        found.append(Series(coefficients))
    return found


def _basis_derivative(
    knots: FloatArray, degree: int, m: int, s: Indices, t: FloatArray, interval: Indices
) -> FloatArray:
    """Derivative m of the B-splines N_s of a degree, (N,); one index s for each time."""
    if m > degree:
        return np.zeros(len(t))
    if m == 0:
        row = s - (interval - degree)
        there = (row >= 0) & (row <= degree)
        chosen = np.clip(row, 0, degree)
        return np.where(there, basis(knots, degree, t, interval)[chosen, np.arange(len(t))], 0.0)

    def share(k: Indices) -> FloatArray:
        width = knots[k + degree] - knots[k]
        lower = _basis_derivative(knots, degree - 1, m - 1, k, t, interval)
        return np.divide(lower, width, out=np.zeros(len(t)), where=width > 0.0)

    return degree * (share(s) - share(s + 1))
