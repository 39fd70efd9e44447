"""Covariances and measurement updates of filters with seven states: quaternion and gyroscope bias.

Covariances are those of (e, bias), where δq = e ⊗ q is the error of the quaternion. That is a change of orthogonal
axes only, no other state: e's scalar part e₀ lies along q, its vector part is half the rotation vector δ in
navigation axes. In these axes the attitude's own turning leaves P alone, gravity and field see one or two entries
each, and e₀ is correlated with nothing: it is driven by noise of its own and seen by itself. So P is kept as the
variance of e₀, one number, and the 6 × 6 covariance of (δ, bias) as in `kernels.kalman`.
"""

from __future__ import annotations

from typing import Any

from northdown.kernels.jit import inline
from northdown.kernels.kalman import correct_east, correct_north, correct_north_down, correct_tilt


@inline
def correct_scale(p: float, y: float, r: float) -> Any:
    """Scalar update with e₀, of variance p; returns (p, correction, normalised innovation squared)."""
    g = y / (p + r)
    return p - p * p / (p + r), p * g, y * g


@inline
def with_nis(d: Any, nis: float) -> Any:
    """Corrections with what another scalar update adds to the normalised innovation squared."""
    return d[:6] + (d[6] + nis,)


@inline
def seen_up(y: Any) -> Any:
    """e₀, δ_x and δ_y according to up, for y the measured less the true unit vector in navigation axes.

    The derivative of q* u q, with δq = e ⊗ q, is 2 e₀ u + u × δ in these axes, and u = (0, 0, −1).
    """
    return (-0.5 * y[2], -y[1], y[0])


@inline
def seen_field(y: Any, north: float, down: float) -> Any:
    """e₀, the combination down δ_x − north δ_z, and δ_y according to u = (north, 0, down), likewise."""
    return (0.5 * (north * y[0] + down * y[2]), y[1], north * y[2] - down * y[0])


@inline
def correct_up(p: float, cov: Any, d: Any, y: Any, r: float) -> Any:
    """Update with up, y being measured less true, its three components of variance r.

    Returns the variance of e₀, P of (δ, bias), and the corrections of e₀ and of (δ, bias).
    """
    p, scale, nis = correct_scale(p, seen_up(y)[0], 0.25 * r)
    cov, d = correct_tilt(cov, d, y, r)
    return p, cov, scale, with_nis(d, nis)


@inline
def correct_field(p: float, cov: Any, d: Any, y: Any, north: float, down: float, r: float) -> Any:
    """Update with the unit vector (north, 0, down), likewise."""
    e = seen_field(y, north, down)
    p, scale, nis = correct_scale(p, e[0], 0.25 * r)
    cov, d = correct_east(cov, d, e[2], r)
    cov, d = correct_north_down(cov, d, down, -north, e[1], r)
    return p, cov, scale, with_nis(d, nis)


@inline
def correct_both(
    p: float, cov: Any, d: Any, up: Any, r_up: float, field: Any, north: float, down: float, r: float
) -> Any:
    """Update with up and the field at once.

    Both see e₀ and δ_y by themselves: two measurements of one quantity are one, their mean weighted by 1/r. So six
    scalar updates become four without any approximation. Only the normalised innovation squared also has their
    difference in it.
    """
    a, b = seen_up(up), seen_field(field, north, down)
    k = 1.0 / (r_up + r)
    v, w = k * r, k * r_up
    mean = v * r_up
    p, scale, nis = correct_scale(p, v * a[0] + w * b[0], 0.25 * mean)
    cov, d = correct_north(cov, d, a[1], r_up)
    cov, d = correct_east(cov, d, v * a[2] + w * b[2], mean)
    cov, d = correct_north_down(cov, d, down, -north, b[1], r)
    y0, y2 = a[0] - b[0], a[2] - b[2]
    return p, cov, scale, with_nis(d, nis + k * (4.0 * y0 * y0 + y2 * y2))
