r"""The Kalman filter of VQF for the gyroscope's bias.

The bias b is a random walk that reaches the standard deviation 0.1 °/s after `bias_forgetting_time`; its covariance P
never grows beyond that of the start. Each sample of the accelerometer brings one measurement of three components,
each with a variance w of its own. At rest it is the low-passed rate itself. In motion it is the inclination
correction: a bias that is δb too small turns the free integration by −R δb, and the horizontal part of that is what
the accelerometer has to correct; heading's part is not seen, and gets a measurement of no bias, with a variance so
large that it only keeps the filter from drifting.

For a standard deviation σ in the steady state the variance of a measurement is w = σ⁴/V + σ², with V what the walk
adds in a step.
"""

from __future__ import annotations

from typing import Any

from northdown.kernels.jit import inline
from northdown.kernels.quaternion import Vector, dot


@inline
def clip(v: Vector, limit: float) -> Vector:
    """Each component cut to ±limit."""
    return (
        min(max(v[0], -limit), limit),
        min(max(v[1], -limit), limit),
        min(max(v[2], -limit), limit),
    )


@inline
def rows_ned(q: Any) -> Any:
    """Rows of the matrix body → NED of a unit quaternion: north, east and down in body axes."""
    w, x, y, z = q
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@inline
def grow(cov: Any, start: float, walk: float) -> Any:
    """Add the walk's variance to each diagonal entry that is below the variance of the start."""
    xx, xy, xz, yy, yz, zz = cov
    return (
        xx + walk if xx < start else xx,
        xy,
        xz,
        yy + walk if yy < start else yy,
        yz,
        zz + walk if zz < start else zz,
    )


@inline
def correct(cov: Any, d: Vector, row: Vector, e: float, variance: float) -> Any:
    """One component, row · b = … + e, after the bias has been moved by d from where e was taken; new P and d."""
    xx, xy, xz, yy, yz, zz = cov
    h0 = xx * row[0] + xy * row[1] + xz * row[2]
    h1 = xy * row[0] + yy * row[1] + yz * row[2]
    h2 = xz * row[0] + yz * row[1] + zz * row[2]
    k = 1.0 / (row[0] * h0 + row[1] * h1 + row[2] * h2 + variance)
    y = k * (e - dot(row, d))
    k0, k1, k2 = k * h0, k * h1, k * h2
    cov = (xx - k0 * h0, xy - k0 * h1, xz - k0 * h2, yy - k1 * h1, yz - k1 * h2, zz - k2 * h2)
    return cov, (d[0] + h0 * y, d[1] + h1 * y, d[2] + h2 * y)


@inline
def update(bias: Vector, cov: Any, rows: Any, e: Vector, variances: Vector, limit: float) -> Any:
    """All three components; innovations and bias cut to ±limit. Returns bias and covariance."""
    e = clip(e, limit)
    d = (0.0, 0.0, 0.0)
    cov, d = correct(cov, d, rows[0], e[0], variances[0])
    cov, d = correct(cov, d, rows[1], e[1], variances[1])
    cov, d = correct(cov, d, rows[2], e[2], variances[2])
    return clip((bias[0] + d[0], bias[1] + d[1], bias[2] + d[2]), limit), cov
