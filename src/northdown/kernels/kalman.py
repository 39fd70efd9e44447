"""Scalar measurement updates of symmetric covariances, written out.

A covariance is the tuple of its upper triangle by rows. With ph = P Hᵀ for one scalar measurement of variance r and
s = H P Hᵀ + r, the update is x + ph (y / s), P − ph phᵀ / s. Vector measurements with uncorrelated noise are taken
one component after the other, which is the same thing and needs no matrix inverse.

Covariances of size six are those of the attitude error δ in navigation axes and of the gyroscope's bias.
"""

from __future__ import annotations

from typing import Any, Final

from northdown.kernels.jit import inline


@inline
def reduce6(p: Any, h: Any, inverse_s: float) -> Any:
    """P − h hᵀ / s for the upper triangle (21 entries) of a 6 × 6 covariance, h = P Hᵀ."""
    p00, p01, p02, p03, p04, p05, p11, p12, p13, p14, p15, p22, p23, p24, p25, p33, p34, p35, p44, p45, p55 = p
    h0, h1, h2, h3, h4, h5 = h
    k0, k1, k2 = h0 * inverse_s, h1 * inverse_s, h2 * inverse_s
    k3, k4, k5 = h3 * inverse_s, h4 * inverse_s, h5 * inverse_s
    return (
        p00 - k0 * h0,
        p01 - k0 * h1,
        p02 - k0 * h2,
        p03 - k0 * h3,
        p04 - k0 * h4,
        p05 - k0 * h5,
        p11 - k1 * h1,
        p12 - k1 * h2,
        p13 - k1 * h3,
        p14 - k1 * h4,
        p15 - k1 * h5,
        p22 - k2 * h2,
        p23 - k2 * h3,
        p24 - k2 * h4,
        p25 - k2 * h5,
        p33 - k3 * h3,
        p34 - k3 * h4,
        p35 - k3 * h5,
        p44 - k4 * h4,
        p45 - k4 * h5,
        p55 - k5 * h5,
    )


NO_CORRECTION: Final = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Where the corrections of `correct6` start from."""


@inline
def correct6(p: Any, d: Any, ph: Any, s: float, y: float) -> Any:
    """One scalar update from ph = P Hᵀ, s = H P Hᵀ + r and the residual y at the point reached.

    d is the correction gathered so far, and as its last entry the normalised innovation squared Σ y²/s of the updates
    that it came from. Returns (P, d).
    """
    k = 1.0 / s
    g = y * k
    d = (
        d[0] + g * ph[0],
        d[1] + g * ph[1],
        d[2] + g * ph[2],
        d[3] + g * ph[3],
        d[4] + g * ph[4],
        d[5] + g * ph[5],
        d[6] + g * y,
    )
    return reduce6(p, ph, k), d


@inline
def correct_north(p: Any, d: Any, y: float, r: float) -> Any:
    """Scalar update with δ_x."""
    return correct6(p, d, (p[0], p[1], p[2], p[3], p[4], p[5]), p[0] + r, y - d[0])


@inline
def correct_east(p: Any, d: Any, y: float, r: float) -> Any:
    """Scalar update with δ_y."""
    return correct6(p, d, (p[1], p[6], p[7], p[8], p[9], p[10]), p[6] + r, y - d[1])


@inline
def correct_tilt(p: Any, d: Any, up: Any, r: float) -> Any:
    """Two scalar updates with the measured up, (δ_y, −δ_x, ·) to first order; returns (P, correction)."""
    p, d = correct_east(p, d, up[0], r)
    return correct_north(p, d, -up[1], r)


@inline
def correct_north_down(p: Any, d: Any, a: float, b: float, y: float, r: float) -> Any:
    """Scalar update with a δ_x + b δ_z."""
    ph = (
        a * p[0] + b * p[2],
        a * p[1] + b * p[7],
        a * p[2] + b * p[11],
        a * p[3] + b * p[12],
        a * p[4] + b * p[13],
        a * p[5] + b * p[14],
    )
    return correct6(p, d, ph, a * ph[0] + b * ph[2] + r, y - (a * d[0] + b * d[2]))


@inline
def propagate_attitude_bias(p: Any, a: Any, q_angle: float, q_bias: float) -> Any:
    """Covariance of (attitude error in navigation axes, gyroscope bias) after one step.

    The transition is [[I, −A], [0, I]] with A = mat_nb Δt, given as nine numbers by rows; isotropic noise of variance
    q_angle and q_bias is added. With B = P_tb and C = P_bb: B' = B − A C, P_tt' = P_tt − A Bᵀ − B' Aᵀ.
    """
    p00, p01, p02, b00, b01, b02, p11, p12, b10, b11, b12, p22, b20, b21, b22, c00, c01, c02, c11, c12, c22 = p
    a00, a01, a02, a10, a11, a12, a20, a21, a22 = a
    n00 = b00 - (a00 * c00 + a01 * c01 + a02 * c02)
    n01 = b01 - (a00 * c01 + a01 * c11 + a02 * c12)
    n02 = b02 - (a00 * c02 + a01 * c12 + a02 * c22)
    n10 = b10 - (a10 * c00 + a11 * c01 + a12 * c02)
    n11 = b11 - (a10 * c01 + a11 * c11 + a12 * c12)
    n12 = b12 - (a10 * c02 + a11 * c12 + a12 * c22)
    n20 = b20 - (a20 * c00 + a21 * c01 + a22 * c02)
    n21 = b21 - (a20 * c01 + a21 * c11 + a22 * c12)
    n22 = b22 - (a20 * c02 + a21 * c12 + a22 * c22)
    return (
        p00 - (a00 * (b00 + n00) + a01 * (b01 + n01) + a02 * (b02 + n02)) + q_angle,
        p01 - (a00 * b10 + a01 * b11 + a02 * b12) - (n00 * a10 + n01 * a11 + n02 * a12),
        p02 - (a00 * b20 + a01 * b21 + a02 * b22) - (n00 * a20 + n01 * a21 + n02 * a22),
        n00,
        n01,
        n02,
        p11 - (a10 * (b10 + n10) + a11 * (b11 + n11) + a12 * (b12 + n12)) + q_angle,
        p12 - (a10 * b20 + a11 * b21 + a12 * b22) - (n10 * a20 + n11 * a21 + n12 * a22),
        n10,
        n11,
        n12,
        p22 - (a20 * (b20 + n20) + a21 * (b21 + n21) + a22 * (b22 + n22)) + q_angle,
        n20,
        n21,
        n22,
        c00 + q_bias,
        c01,
        c02,
        c11 + q_bias,
        c12,
        c22 + q_bias,
    )


@inline
def symmetric3(xx: float, xy: float, xz: float, yy: float, yz: float, zz: float) -> Any:
    """All nine entries of a symmetric matrix by rows."""
    return (xx, xy, xz, xy, yy, yz, xz, yz, zz)
