"""Scalar measurement updates of filters with seven states, as in `kernels.kalman`.

Covariances of size seven are those of (e, gyroscope bias), where δq = e ⊗ q is the error of the quaternion. That is a
change of orthogonal axes only, no other state: e's scalar part lies along q, its vector part is half the rotation
vector in navigation axes. In these axes the attitude's own turning leaves P alone, and gravity and field see one or
two entries each.
"""

from __future__ import annotations

from typing import Any

from northdown.kernels.jit import inline
from northdown.kernels.kalman import symmetric3
from northdown.kernels.quaternion import conjugate, multiply


@inline
def reduce7(p: Any, h: Any, inverse_s: float) -> Any:
    """P − h hᵀ / s for the upper triangle (28 entries) of a 7 × 7 covariance, h = P Hᵀ."""
    h0, h1, h2, h3, h4, h5, h6 = h
    k0, k1, k2, k3 = h0 * inverse_s, h1 * inverse_s, h2 * inverse_s, h3 * inverse_s
    k4, k5, k6 = h4 * inverse_s, h5 * inverse_s, h6 * inverse_s
    return (
        p[0] - k0 * h0,
        p[1] - k0 * h1,
        p[2] - k0 * h2,
        p[3] - k0 * h3,
        p[4] - k0 * h4,
        p[5] - k0 * h5,
        p[6] - k0 * h6,
        p[7] - k1 * h1,
        p[8] - k1 * h2,
        p[9] - k1 * h3,
        p[10] - k1 * h4,
        p[11] - k1 * h5,
        p[12] - k1 * h6,
        p[13] - k2 * h2,
        p[14] - k2 * h3,
        p[15] - k2 * h4,
        p[16] - k2 * h5,
        p[17] - k2 * h6,
        p[18] - k3 * h3,
        p[19] - k3 * h4,
        p[20] - k3 * h5,
        p[21] - k3 * h6,
        p[22] - k4 * h4,
        p[23] - k4 * h5,
        p[24] - k4 * h6,
        p[25] - k5 * h5,
        p[26] - k5 * h6,
        p[27] - k6 * h6,
    )


@inline
def correct7(p: Any, d: Any, ph: Any, s: float, y: float) -> Any:
    """One scalar update of a state (4 + 3) from ph = P Hᵀ, s = H P Hᵀ + r and the residual y at the point reached.

    d is the correction gathered so far. Returns (P, d).
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
        d[6] + g * ph[6],
    )
    return reduce7(p, ph, k), d


@inline
def correct_entry0(p: Any, d: Any, y: float, r: float) -> Any:
    """Scalar update with e₀."""
    return correct7(p, d, (p[0], p[1], p[2], p[3], p[4], p[5], p[6]), p[0] + r, y - d[0])


@inline
def correct_entry1(p: Any, d: Any, y: float, r: float) -> Any:
    """Scalar update with e₁."""
    return correct7(p, d, (p[1], p[7], p[8], p[9], p[10], p[11], p[12]), p[7] + r, y - d[1])


@inline
def correct_entry2(p: Any, d: Any, y: float, r: float) -> Any:
    """Scalar update with e₂."""
    return correct7(p, d, (p[2], p[8], p[13], p[14], p[15], p[16], p[17]), p[13] + r, y - d[2])


@inline
def correct_entries13(p: Any, d: Any, a: float, b: float, y: float, r: float) -> Any:
    """Scalar update with a e₁ + b e₃."""
    ph = (
        a * p[1] + b * p[3],
        a * p[7] + b * p[9],
        a * p[8] + b * p[14],
        a * p[9] + b * p[18],
        a * p[10] + b * p[19],
        a * p[11] + b * p[20],
        a * p[12] + b * p[21],
    )
    return correct7(p, d, ph, a * ph[1] + b * ph[3] + r, y - (a * d[1] + b * d[3]))


@inline
def seen_up(y: Any) -> Any:
    """Entries e₀, e₁, e₂ according to up, for y the measured less the true unit vector in navigation axes.

    The derivative of q* u q, with δq = e ⊗ q, is 2 e₀ u + 2 u × (e₁, e₂, e₃) in these axes, and u = (0, 0, −1).
    """
    return (-0.5 * y[2], -0.5 * y[1], 0.5 * y[0])


@inline
def seen_field(y: Any, north: float, down: float) -> Any:
    """Entry e₀, the combination down e₁ − north e₃, and entry e₂ according to u = (north, 0, down), likewise."""
    return (0.5 * (north * y[0] + down * y[2]), 0.5 * y[1], 0.5 * (north * y[2] - down * y[0]))


@inline
def correct_up(p: Any, d: Any, y: Any, r: float) -> Any:
    """Update with up, y being measured less true, its three components of variance r; returns (P, correction)."""
    e, r = seen_up(y), 0.25 * r
    p, d = correct_entry0(p, d, e[0], r)
    p, d = correct_entry1(p, d, e[1], r)
    return correct_entry2(p, d, e[2], r)


@inline
def correct_field(p: Any, d: Any, y: Any, north: float, down: float, r: float) -> Any:
    """Update with the unit vector (north, 0, down), likewise."""
    e, r = seen_field(y, north, down), 0.25 * r
    p, d = correct_entry0(p, d, e[0], r)
    p, d = correct_entry2(p, d, e[2], r)
    return correct_entries13(p, d, down, -north, e[1], r)


@inline
def correct_both(p: Any, d: Any, up: Any, r_up: float, field: Any, north: float, down: float, r: float) -> Any:
    """Update with up and the field at once.

    Both see e₀ and e₂ by themselves: two measurements of one quantity are one, their mean weighted by 1/r. So six
    scalar updates become four without any approximation.
    """
    a, b = seen_up(up), seen_field(field, north, down)
    k = 1.0 / (r_up + r)
    v, w = k * r, k * r_up
    mean = 0.25 * v * r_up
    p, d = correct_entry1(p, d, a[1], 0.25 * r_up)
    p, d = correct_entry0(p, d, v * a[0] + w * b[0], mean)
    p, d = correct_entry2(p, d, v * a[2] + w * b[2], mean)
    return correct_entries13(p, d, down, -north, b[1], 0.25 * r)


@inline
def propagate_quaternion_bias(p: Any, q: Any, after: Any, dt: float, q_quat: float, q_bias: float) -> Any:
    """Covariance of (quaternion error e, gyroscope bias) after the step from q to `after` = q ⊗ exp((gyr − bias) Δt).

    With δq = e ⊗ q the step leaves e as it is, but for the bias: e' = e + L b, L e_j = −½ Δt q ⊗ (0, e_j) ⊗ after*
    the derivative by the bias to first order in Δt. Noise of variance q_quat is added to each component of e, q_bias
    to each of the bias.
    """
    c = (p[22], p[23], p[24], p[25], p[26], p[27])
    w, x, y, z = scale4(-0.5 * dt, q)
    back = conjugate(after)
    l0, l1, l2 = multiply((-x, w, z, -y), back), multiply((-y, -z, w, x), back), multiply((-z, y, -x, w), back)
    m0, m1, m2 = (p[4], p[10], p[15], p[19]), (p[5], p[11], p[16], p[20]), (p[6], p[12], p[17], p[21])
    n0 = combine4(m0, l0, l1, l2, c[0], c[1], c[2])
    n1 = combine4(m1, l0, l1, l2, c[1], c[3], c[4])
    n2 = combine4(m2, l0, l1, l2, c[2], c[4], c[5])
    f = ((m0, m1, m2), (l0, l1, l2), (n0, n1, n2))
    return (
        p[0] + cross_term(f, 0, 0) + q_quat,
        p[1] + cross_term(f, 0, 1),
        p[2] + cross_term(f, 0, 2),
        p[3] + cross_term(f, 0, 3),
        n0[0],
        n1[0],
        n2[0],
        p[7] + cross_term(f, 1, 1) + q_quat,
        p[8] + cross_term(f, 1, 2),
        p[9] + cross_term(f, 1, 3),
        n0[1],
        n1[1],
        n2[1],
        p[13] + cross_term(f, 2, 2) + q_quat,
        p[14] + cross_term(f, 2, 3),
        n0[2],
        n1[2],
        n2[2],
        p[18] + cross_term(f, 3, 3) + q_quat,
        n0[3],
        n1[3],
        n2[3],
        c[0] + q_bias,
        c[1],
        c[2],
        c[3] + q_bias,
        c[4],
        c[5] + q_bias,
    )


@inline
def cross_term(f: Any, i: int, j: int) -> Any:
    """Entry (i, j) of (M B) Lᵀ + L Nᵀ, with N = M B + L C."""
    m, l, n = f
    return (
        (m[0][i] * l[0][j] + l[0][i] * n[0][j])
        + (m[1][i] * l[1][j] + l[1][i] * n[1][j])
        + (m[2][i] * l[2][j] + l[2][i] * n[2][j])
    )


@inline
def scale4(k: float, q: Any) -> Any:
    """Product of a number and a quaternion."""
    return (k * q[0], k * q[1], k * q[2], k * q[3])


@inline
def combine4(m: Any, l0: Any, l1: Any, l2: Any, c0: float, c1: float, c2: float) -> Any:
    """Sum m + c0 l0 + c1 l1 + c2 l2 of quaternions."""
    return (
        m[0] + l0[0] * c0 + l1[0] * c1 + l2[0] * c2,
        m[1] + l0[1] * c0 + l1[1] * c1 + l2[1] * c2,
        m[2] + l0[2] * c0 + l1[2] * c1 + l2[2] * c2,
        m[3] + l0[3] * c0 + l1[3] * c1 + l2[3] * c2,
    )


@inline
def attitude_covariance(p: Any) -> Any:
    """Covariance (9 entries) of the rotation vector δ in navigation axes: e = (part along q, ½ δ)."""
    return symmetric3(4.0 * p[7], 4.0 * p[8], 4.0 * p[9], 4.0 * p[13], 4.0 * p[14], 4.0 * p[18])


@inline
def quaternion_covariance(tilt: float, heading: float, bias: float) -> Any:
    """Upper triangle (28) of P for an attitude of given variances (rad²) about north and east, and about down.

    The part along q is set to a hundredth of the smaller, so that P is positive definite.
    """
    t, h, r = 0.25 * tilt, 0.25 * heading, 0.0025 * min(tilt, heading)
    zero6, zero5, zero4 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)
    zero3 = (0.0, 0.0, 0.0)
    return (r, *zero6, t, *zero5, t, *zero4, h, *zero3, bias, 0.0, 0.0, bias, 0.0, bias)
