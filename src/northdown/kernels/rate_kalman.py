"""Covariance of (attitude error, angular rate), for filters that have the rate as a state instead of a gyroscope.

The attitude error δ is a rotation vector in navigation axes, R = exp(δ) R̂; the rate is in body axes. Covariances are
tuples of the upper triangle (21 entries), as in `kernels.kalman`.
"""

from __future__ import annotations

import math
from typing import Any

from northdown.kernels.jit import inline
from northdown.kernels.kalman import correct6, propagate_attitude_bias
from northdown.kernels.quaternion import Quaternion, Vector, add, cross, dot, scale

# Squared angle below which the first neglected term of the series is under one unit in the last place.
_SERIES_LIMIT = 1e-4


@inline
def dot6(a: Any, b: Any) -> float:
    """Scalar product of six entries."""
    return (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) + (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])  # type: ignore[no-any-return]


@inline
def correct_row(p: Any, d: Any, h: Any, y: float, r: float) -> Any:
    """Scalar update with the row h (six entries) and the residual y at d = 0; returns (P, correction)."""
    h0, h1, h2, h3, h4, h5 = h
    ph = (
        h0 * p[0] + h1 * p[1] + h2 * p[2] + h3 * p[3] + h4 * p[4] + h5 * p[5],
        h0 * p[1] + h1 * p[6] + h2 * p[7] + h3 * p[8] + h4 * p[9] + h5 * p[10],
        h0 * p[2] + h1 * p[7] + h2 * p[11] + h3 * p[12] + h4 * p[13] + h5 * p[14],
        h0 * p[3] + h1 * p[8] + h2 * p[12] + h3 * p[15] + h4 * p[16] + h5 * p[17],
        h0 * p[4] + h1 * p[9] + h2 * p[13] + h3 * p[16] + h4 * p[18] + h5 * p[19],
        h0 * p[5] + h1 * p[10] + h2 * p[14] + h3 * p[17] + h4 * p[19] + h5 * p[20],
    )
    return correct6(p, d, ph, dot6(h, ph) + r, y - dot6(h, d))


@inline
def correct_attitude_row(p: Any, d: Any, h: Vector, y: float, r: float) -> Any:
    """Scalar update with the row (h, 0) of the attitude error alone, likewise."""
    h0, h1, h2 = h
    ph = (
        h0 * p[0] + h1 * p[1] + h2 * p[2],
        h0 * p[1] + h1 * p[6] + h2 * p[7],
        h0 * p[2] + h1 * p[7] + h2 * p[11],
        h0 * p[3] + h1 * p[8] + h2 * p[12],
        h0 * p[4] + h1 * p[9] + h2 * p[13],
        h0 * p[5] + h1 * p[10] + h2 * p[14],
    )
    return correct6(p, d, ph, h0 * ph[0] + h1 * ph[1] + h2 * ph[2] + r, y - (h0 * d[0] + h1 * d[1] + h2 * d[2]))


@inline
def change_rate(p: Any, x: Any, y: Any, z: Any, noise: Any) -> Any:
    """Covariance after the rate has become (x, y, z) · (δ, ω), rows of six entries, plus noise (a triangle's six)."""
    rows = (
        (p[0], p[1], p[2], p[3], p[4], p[5]),
        (p[1], p[6], p[7], p[8], p[9], p[10]),
        (p[2], p[7], p[11], p[12], p[13], p[14]),
        (p[3], p[8], p[12], p[15], p[16], p[17]),
        (p[4], p[9], p[13], p[16], p[18], p[19]),
        (p[5], p[10], p[14], p[17], p[19], p[20]),
    )
    u, v, w = _times(rows, x), _times(rows, y), _times(rows, z)
    return (
        p[0],
        p[1],
        p[2],
        u[0],
        v[0],
        w[0],
        p[6],
        p[7],
        u[1],
        v[1],
        w[1],
        p[11],
        u[2],
        v[2],
        w[2],
        dot6(x, u) + noise[0],
        dot6(x, v) + noise[1],
        dot6(x, w) + noise[2],
        dot6(y, v) + noise[3],
        dot6(y, w) + noise[4],
        dot6(z, w) + noise[5],
    )


@inline
def _times(rows: Any, x: Any) -> Any:
    return (
        dot6(rows[0], x),
        dot6(rows[1], x),
        dot6(rows[2], x),
        dot6(rows[3], x),
        dot6(rows[4], x),
        dot6(rows[5], x),
    )


@inline
def turn_attitude(p: Any, m: Any, dt: float) -> Any:
    """Covariance after the attitude has turned for dt with the rate: δ' = δ + Δt mat_nb δω; m holds mat_nb's rows."""
    k = -dt
    a = (
        k * m[0][0],
        k * m[0][1],
        k * m[0][2],
        k * m[1][0],
        k * m[1][1],
        k * m[1][2],
        k * m[2][0],
        k * m[2][1],
        k * m[2][2],
    )
    return propagate_attitude_bias(p, a, 0.0, 0.0)


@inline
def matrix_nb(q: Quaternion) -> tuple[Vector, Vector, Vector]:
    """Rows of mat_nb: north, east and down in body components."""
    w, x, y, z = q
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@inline
def products(l: Any, w: Vector) -> Vector:
    """Sum of l's columns (3 rows of 6, as 18 entries) with ωx², ωy², ωz², ωxωy, ωxωz, ωyωz."""
    x, y, z = w
    c = (x * x, y * y, z * z, x * y, x * z, y * z)
    return (dot6(l[:6], c), dot6(l[6:12], c), dot6(l[12:], c))


@inline
def products_slope(l: Any, w: Vector) -> tuple[Vector, Vector, Vector]:
    """Derivative of `products` by ω, rows."""
    return (product_slope(l[:6], w), product_slope(l[6:12], w), product_slope(l[12:], w))


@inline
def product_slope(l: Any, w: Vector) -> Vector:
    """The same for one row of six."""
    x, y, z = w
    return (
        2.0 * l[0] * x + l[3] * y + l[4] * z,
        2.0 * l[1] * y + l[3] * x + l[5] * z,
        2.0 * l[2] * z + l[4] * x + l[5] * y,
    )


@inline
def times3(m: Any, v: Vector) -> Vector:
    """Product of a matrix (nine entries by rows) and a vector."""
    return (dot((m[0], m[1], m[2]), v), dot((m[3], m[4], m[5]), v), dot((m[6], m[7], m[8]), v))


@inline
def from_prior(h: Vector, d: Vector) -> Vector:
    """Row h of a small error about exp(d) R̂ as one of the error about R̂ itself, near d: h J_l(d).

    J_l = 1 + (1 − cos θ)/θ² [d×] + (θ − sin θ)/θ³ [d×]², θ = ‖d‖, is the left Jacobian of the rotations.
    """
    s = dot(d, d)
    if s < _SERIES_LIMIT:
        b = 0.5 - s * (1.0 / 24.0 - s * (1.0 / 720.0))
        c = 1.0 / 6.0 - s * (1.0 / 120.0 - s * (1.0 / 5040.0))
    else:
        t = math.sqrt(s)
        b = (1.0 - math.cos(t)) / s
        c = (t - math.sin(t)) / (s * t)
    once = cross(h, d)
    return add(h, add(scale(b, once), scale(c, cross(once, d))))
