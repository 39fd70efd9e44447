"""Exponential and logarithm between rotation vectors and unit quaternions."""

from __future__ import annotations

import math

from northdown.kernels.jit import inline
from northdown.kernels.quaternion import Quaternion, Vector, inverse_norm, multiply

# Below this squared half angle the series' first neglected term is under one unit in the last place.
_SERIES_LIMIT = 1e-5


@inline
def _cosine_and_factor(v: Vector) -> tuple[float, float]:
    """cos(h) and sin(h)/(2h) with h = ‖v‖/2.

    Near zero by their series: there the quotient loses its digits, and the series needs neither a square root nor a
    trigonometric function.
    """
    s = 0.25 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if s < _SERIES_LIMIT:
        c = 1.0 - s * (0.5 - s * (1.0 / 24.0 - s * (1.0 / 720.0)))
        k = 0.5 - s * (1.0 / 12.0 - s * (1.0 / 240.0 - s * (1.0 / 10080.0)))
    else:
        h = math.sqrt(s)
        c = math.cos(h)
        k = 0.5 * math.sin(h) / h
    return c, k


@inline
def exp(v: Vector) -> Quaternion:
    """Unit quaternion of the rotation vector v (rad)."""
    c, k = _cosine_and_factor(v)
    return (c, k * v[0], k * v[1], k * v[2])


@inline
def turn_body(q: Quaternion, v: Vector) -> Quaternion:
    """Turn q by v in body axes: q ⊗ exp(v), of unit norm.

    What a filter's chain from sample to sample waits for is kept short: the norm is that of q, and the product with v
    does not wait for the series.
    """
    c, k = _cosine_and_factor(v)
    n = inverse_norm(q)
    c, k = c * n, k * n
    w, x, y, z = multiply(q, (0.0, v[0], v[1], v[2]))
    return (c * q[0] + k * w, c * q[1] + k * x, c * q[2] + k * y, c * q[3] + k * z)


@inline
def turn_navigation(v: Vector, q: Quaternion) -> Quaternion:
    """Turn q by v in navigation axes: exp(v) ⊗ q, of the norm of q; likewise."""
    c, k = _cosine_and_factor(v)
    w, x, y, z = multiply((0.0, v[0], v[1], v[2]), q)
    return (c * q[0] + k * w, c * q[1] + k * x, c * q[2] + k * y, c * q[3] + k * z)


@inline
def log(q: Quaternion) -> Vector:
    """Rotation vector (rad) of the unit quaternion q, of length at most π."""
    w = math.fabs(q[0])
    sign = 1.0 if q[0] >= 0.0 else -1.0
    square = q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    if square < _SERIES_LIMIT * w * w:
        # 2 atan(n/w)/n = (2/w)(1 − r/3 + r²/5 − r³/7), r = (n/w)²
        r = square / (w * w)
        k = 2.0 / w * (1.0 - r * (1.0 / 3.0 - r * (0.2 - r * (1.0 / 7.0))))
    else:
        n = math.sqrt(square)
        k = 2.0 * math.atan2(n, w) / n
    return (sign * k * q[1], sign * k * q[2], sign * k * q[3])
