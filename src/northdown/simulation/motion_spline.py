"""`SplineTurning`: attitude along a cumulative B-spline, smooth to any order and with rests that begin smoothly.

With control attitudes c_j, their increments d_j = log(c_{j−1}⁻¹ c_j) and B-splines N_j of degree p,

    R(t) = c_{i−p} Π_{j=i−p+1..i} exp(λ_j(t) d_j),   λ_j = Σ_{s ≥ j} N_s(t),

where i is the interval of knots that holds t (M.-J. Kim, M.-S. Kim, S. Y. Shin, "A general construction scheme for
unit quaternion curves with simple high order derivatives", SIGGRAPH 1995). Rate and angular acceleration follow from
the same product, factor by factor (C. Sommer et al., "Efficient derivative computation for cumulative B-splines on
Lie groups", CVPR 2020). Degree five has a continuous fourth derivative. Where p + 1 neighbouring control attitudes
are equal the body rests, and it leaves that rest with vanishing rate and angular acceleration.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray
from northdown.simulation import _quaternions as quaternions
from northdown.simulation.motion import Turning

DEGREE = 5


def find_intervals(knots: FloatArray, degree: int, time: FloatArray) -> npt.NDArray[np.intp]:
    """Index i with knots[i] ≤ t < knots[i+1] for times (N,) inside the spline's domain; its end counts as inside."""
    last = len(knots) - degree - 2
    return np.clip(np.searchsorted(knots, time, side="right") - 1, degree, last)


def basis(knots: FloatArray, degree: int, time: FloatArray, interval: npt.NDArray[np.intp]) -> FloatArray:
    """The B-splines N_{i−p} … N_i, (p + 1, N), that are not zero at each time (de Boor's recursion)."""
    value = np.zeros((degree + 1, len(time)))
    value[0] = 1.0
    left = [time - knots[interval + 1 - k] for k in range(1, degree + 1)]
    right = [knots[interval + k] - time for k in range(1, degree + 1)]
    for d in range(1, degree + 1):
        carried = np.zeros(len(time))
        for r in range(d):
            share = value[r] / (right[r] + left[d - r - 1])
            value[r] = carried + right[r] * share
            carried = left[d - r - 1] * share
        value[d] = carried
    return value


class SplineTurning(Turning):
    """Attitude along a cumulative B-spline.

    Parameters
    ----------
    knots : (n + degree + 1,) array
        Not decreasing, s; the domain is from knots[degree] to knots[n].
    start : (4, 1) array
        First control attitude c₀, quaternion w, x, y, z, body to NED.
    increments : (3, n − 1) array
        Rotation vectors d₁ … d_{n−1} from each control attitude to the next, rad; may be longer than π.
    rests : bool
        Whether the body stays at its first and last attitude outside the domain, which otherwise is its span.
    degree : int
        2 or more.
    """

    def __init__(
        self, knots: FloatArray, start: FloatArray, increments: FloatArray, *, rests: bool, degree: int = DEGREE
    ) -> None:
        self.knots, self.increments, self.degree = knots, increments, degree
        self.controls = quaternions.cumulative(np.concatenate([start, quaternions.exp(increments)], axis=1))
        self._domain = float(knots[degree]), float(knots[-degree - 1])
        if not rests:
            self.span = self._domain

    def quat(self, time: FloatArray) -> FloatArray:
        """See `Turning`."""
        p = self.degree
        t = np.clip(time, *self._domain)
        i = find_intervals(self.knots, p, t)
        value = basis(self.knots, p, t, i)
        blend = np.cumsum(value[:0:-1], axis=0)[::-1]
        q: FloatArray = self.controls[:, i - p]
        for k in range(p):
            q = quaternions.multiply(q, quaternions.exp(blend[k] * self.increments[:, i - p + k]))
        return q

    def evaluate(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `Turning`."""
        p = self.degree
        t = np.clip(time, *self._domain)
        i = find_intervals(self.knots, p, t)
        blend, first, second = self._blends(t, i)
        q: FloatArray = self.controls[:, i - p]
        rate, acceleration = np.zeros((3, len(t))), np.zeros((3, len(t)))
        for k in range(p):
            d = self.increments[:, i - p + k]
            turn = quaternions.exp(blend[k] * d)
            q = quaternions.multiply(q, turn)
            rate = quaternions.rotate_inverse(turn, rate) + first[k] * d
            acceleration = quaternions.rotate_inverse(turn, acceleration) + second[k] * d
            acceleration += first[k] * quaternions.cross(rate, d)
        return q, rate, acceleration

    def _blends(self, t: FloatArray, i: npt.NDArray[np.intp]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """λ_j and its first two derivatives for j = i − p + 1 … i, each (p, N)."""
        p, knots = self.degree, self.knots
        blend = np.cumsum(basis(knots, p, t, i)[:0:-1], axis=0)[::-1]
        lower = basis(knots, p - 1, t, i)
        lowest = basis(knots, p - 2, t, i)
        first, second = np.empty_like(blend), np.empty_like(blend)
        for k in range(p):
            j = i - p + 1 + k
            # the sum over s ≥ j of N_s' has one term left, of degree p − 1
            scale = p / (knots[j + p] - knots[j])
            first[k] = scale * lower[k]
            slope = np.zeros(len(t))
            if k > 0:
                slope += lowest[k - 1] / (knots[j + p - 1] - knots[j])
            if k < p - 1:
                slope -= lowest[k] / (knots[j + p] - knots[j + 1])
            second[k] = scale * (p - 1) * slope
        return blend, first, second
