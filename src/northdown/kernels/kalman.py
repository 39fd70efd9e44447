"""Scalar measurement updates of symmetric covariances, written out.

A covariance is the tuple of its upper triangle by rows. With ph = P Hᵀ for one scalar measurement of variance r and
s = H P Hᵀ + r, the update is x + ph (y / s), P − ph phᵀ / s. Vector measurements with uncorrelated noise are taken
one component after the other, which is the same thing and needs no matrix inverse.

Covariances of size seven are those of (e, gyroscope bias), where δq = e ⊗ q is the error of the quaternion. That is a
change of orthogonal axes only, no other state: e's scalar part lies along q, its vector part is half the rotation
vector in navigation axes. In these axes the attitude's own turning leaves P alone, and gravity and field see one or two
entries each.
"""

from __future__ import annotations

from typing import Any

from northdown.kernels.jit import inline
from northdown.kernels.quaternion import conjugate, multiply


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
def correct_up(p: Any, d: Any, y: Any, r: float) -> Any:
    """Three scalar updates with up: y is the measured less the true one in navigation axes; returns (P, correction).

    Up is −(0, 0, 1), so that half of y is (e₂, −e₁, −e₀): every component sees one entry of the state.
    """
    r = 0.25 * r
    p, d = correct7(p, d, (p[0], p[1], p[2], p[3], p[4], p[5], p[6]), p[0] + r, -0.5 * y[2] - d[0])
    p, d = correct7(p, d, (p[1], p[7], p[8], p[9], p[10], p[11], p[12]), p[7] + r, -0.5 * y[1] - d[1])
    return correct7(p, d, (p[2], p[8], p[13], p[14], p[15], p[16], p[17]), p[13] + r, 0.5 * y[0] - d[2])


@inline
def correct_field(p: Any, d: Any, y: Any, north: float, down: float, r: float) -> Any:
    """Three scalar updates with the unit vector (north, 0, down), for y as in `correct_up`.

    Half of y is e₀ along the vector, −e₂ along (down, 0, −north), and down e₁ − north e₃ to the east.
    """
    r = 0.25 * r
    along, across = 0.5 * (north * y[0] + down * y[2]), 0.5 * (north * y[2] - down * y[0])
    p, d = correct7(p, d, (p[0], p[1], p[2], p[3], p[4], p[5], p[6]), p[0] + r, along - d[0])
    p, d = correct7(p, d, (p[2], p[8], p[13], p[14], p[15], p[16], p[17]), p[13] + r, across - d[2])
    ph = (
        down * p[1] - north * p[3],
        down * p[7] - north * p[9],
        down * p[8] - north * p[14],
        down * p[9] - north * p[18],
        down * p[10] - north * p[19],
        down * p[11] - north * p[20],
        down * p[12] - north * p[21],
    )
    return correct7(p, d, ph, down * ph[1] - north * ph[3] + r, 0.5 * y[1] - (down * d[1] - north * d[3]))


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
def relative_to(p: Any, turn: Any) -> Any:
    """Covariance of (e, bias) for the attitude turn ⊗ q instead of q: e ⊗ q = (e ⊗ turn*) ⊗ (turn ⊗ q)."""
    t = conjugate(turn)
    m0 = multiply((p[4], p[10], p[15], p[19]), t)
    m1 = multiply((p[5], p[11], p[16], p[20]), t)
    m2 = multiply((p[6], p[12], p[17], p[21]), t)
    a0 = multiply((p[0], p[1], p[2], p[3]), t)
    a1 = multiply((p[1], p[7], p[8], p[9]), t)
    a2 = multiply((p[2], p[8], p[13], p[14]), t)
    a3 = multiply((p[3], p[9], p[14], p[18]), t)
    # a_k is column k of the product from the left, so its rows times the transpose are again products by t
    b0 = multiply((a0[0], a1[0], a2[0], a3[0]), t)
    b1 = multiply((a0[1], a1[1], a2[1], a3[1]), t)
    b2 = multiply((a0[2], a1[2], a2[2], a3[2]), t)
    b3 = multiply((a0[3], a1[3], a2[3], a3[3]), t)
    return (
        (b0[0], b0[1], b0[2], b0[3], m0[0], m1[0], m2[0])
        + (b1[1], b1[2], b1[3], m0[1], m1[1], m2[1])
        + (b2[2], b2[3], m0[2], m1[2], m2[2])
        + (b3[3], m0[3], m1[3], m2[3])
        + p[22:]
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
    """Covariance (6 entries) of the rotation vector δ in navigation axes: e = (part along q, ½ δ)."""
    return (4.0 * p[7], 4.0 * p[8], 4.0 * p[9], 4.0 * p[13], 4.0 * p[14], 4.0 * p[18])


@inline
def quaternion_covariance(tilt: float, heading: float, bias: float) -> Any:
    """Upper triangle (28) of P for an attitude of given variances (rad²) about north and east, and about down.

    The part along q is set to a hundredth of the smaller, so that P is positive definite.
    """
    t, h, r = 0.25 * tilt, 0.25 * heading, 0.0025 * min(tilt, heading)
    zero6, zero5, zero4 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)
    zero3 = (0.0, 0.0, 0.0)
    return (r, *zero6, t, *zero5, t, *zero4, h, *zero3, bias, 0.0, 0.0, bias, 0.0, bias)
