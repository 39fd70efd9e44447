"""Scalar measurement updates of symmetric covariances, written out.

A covariance is the tuple of its upper triangle by rows. With ph = P Hᵀ for one scalar measurement of variance r and
s = H P Hᵀ + r, the update is x + ph (y / s), P − ph phᵀ / s. Vector measurements with uncorrelated noise are taken
one component after the other, which is the same thing and needs no matrix inverse.
"""

from __future__ import annotations

from typing import Any

from northdown.kernels.jit import inline
from northdown.kernels.quaternion import multiply


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
def correct7(p: Any, d: Any, h: Any, y: float, r: float) -> Any:
    """One scalar update of a state (4 + 3) of which only the first four enter the measurement.

    h holds the four non-zero entries of H, y the residual at the linearisation point, r its variance; d is the
    correction gathered so far. Returns (P, d).
    """
    a, b, c, e = h
    ph = (
        p[0] * a + p[1] * b + p[2] * c + p[3] * e,
        p[1] * a + p[7] * b + p[8] * c + p[9] * e,
        p[2] * a + p[8] * b + p[13] * c + p[14] * e,
        p[3] * a + p[9] * b + p[14] * c + p[18] * e,
        p[4] * a + p[10] * b + p[15] * c + p[19] * e,
        p[5] * a + p[11] * b + p[16] * c + p[20] * e,
        p[6] * a + p[12] * b + p[17] * c + p[21] * e,
    )
    k = 1.0 / (a * ph[0] + b * ph[1] + c * ph[2] + e * ph[3] + r)
    g = (y - (a * d[0] + b * d[1] + c * d[2] + e * d[3])) * k
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
def correct_direction(cov: Any, d: Any, q: Any, measured: Any, north: float, down: float, r: float) -> Any:
    """Three scalar updates with the body components of (north, 0, down); returns (P, correction)."""
    w, x, y, z = q
    a, b = 2.0 * north, 2.0 * down
    hx = (a * w - b * y, a * x + b * z, -a * y - b * w, -a * z + b * x)
    hy = (-a * z + b * x, a * y + b * w, a * x + b * z, -a * w + b * y)
    hz = (a * y + b * w, a * z - b * x, a * w - b * y, a * x + b * z)
    # the components are homogeneous of degree two, so that each is half its derivative times q
    ex = measured[0] - 0.5 * (hx[0] * w + hx[1] * x + hx[2] * y + hx[3] * z)
    ey = measured[1] - 0.5 * (hy[0] * w + hy[1] * x + hy[2] * y + hy[3] * z)
    ez = measured[2] - 0.5 * (hz[0] * w + hz[1] * x + hz[2] * y + hz[3] * z)
    cov, d = correct7(cov, d, hx, ex, r)
    cov, d = correct7(cov, d, hy, ey, r)
    return correct7(cov, d, hz, ez, r)


@inline
def propagate_quaternion_bias(p: Any, q: Any, turn: Any, dt: float, q_quat: float, q_bias: float) -> Any:
    """Covariance of (quaternion, gyroscope bias) after the step q ⊗ turn, with turn = exp((gyr − bias) Δt).

    The transition is [[M, L], [0, I]]: M v = v ⊗ turn, and L e_j = −½ Δt q ⊗ (0, e_j) the derivative by the bias to
    first order in Δt. Noise of variance q_quat is added to each component of the quaternion, q_bias to each of the
    bias.
    """
    c = (p[22], p[23], p[24], p[25], p[26], p[27])
    w, x, y, z = scale4(-0.5 * dt, q)
    l0, l1, l2 = (-x, w, z, -y), (-y, -z, w, x), (-z, y, -x, w)
    m0 = multiply((p[4], p[10], p[15], p[19]), turn)
    m1 = multiply((p[5], p[11], p[16], p[20]), turn)
    m2 = multiply((p[6], p[12], p[17], p[21]), turn)
    n0 = combine4(m0, l0, l1, l2, c[0], c[1], c[2])
    n1 = combine4(m1, l0, l1, l2, c[1], c[3], c[4])
    n2 = combine4(m2, l0, l1, l2, c[2], c[4], c[5])
    a0 = multiply((p[0], p[1], p[2], p[3]), turn)
    a1 = multiply((p[1], p[7], p[8], p[9]), turn)
    a2 = multiply((p[2], p[8], p[13], p[14]), turn)
    a3 = multiply((p[3], p[9], p[14], p[18]), turn)
    # a_k is column k of M P_qq, so its rows times Mᵀ are again products by `turn`
    b0 = multiply((a0[0], a1[0], a2[0], a3[0]), turn)
    b1 = multiply((a0[1], a1[1], a2[1], a3[1]), turn)
    b2 = multiply((a0[2], a1[2], a2[2], a3[2]), turn)
    b3 = multiply((a0[3], a1[3], a2[3], a3[3]), turn)
    f = ((m0, m1, m2), (l0, l1, l2), (n0, n1, n2))
    return (
        b0[0] + cross_term(f, 0, 0) + q_quat,
        b0[1] + cross_term(f, 0, 1),
        b0[2] + cross_term(f, 0, 2),
        b0[3] + cross_term(f, 0, 3),
        n0[0],
        n1[0],
        n2[0],
        b1[1] + cross_term(f, 1, 1) + q_quat,
        b1[2] + cross_term(f, 1, 2),
        b1[3] + cross_term(f, 1, 3),
        n0[1],
        n1[1],
        n2[1],
        b2[2] + cross_term(f, 2, 2) + q_quat,
        b2[3] + cross_term(f, 2, 3),
        n0[2],
        n1[2],
        n2[2],
        b3[3] + cross_term(f, 3, 3) + q_quat,
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
def attitude_covariance(p: Any, q: Any) -> Any:
    """Covariance (6 entries) of the rotation vector δ in navigation axes, from that of the quaternion.

    δq = ½ (0, δ) ⊗ q, so that δ_j = 2 ⟨(0, e_j) ⊗ q, δq⟩.
    """
    w, x, y, z = scale4(2.0, q)
    e0, e1, e2 = (-x, w, -z, y), (-y, z, w, -x), (-z, -y, x, w)
    h0, h1, h2 = block4(p, e0), block4(p, e1), block4(p, e2)
    return (dot4(e0, h0), dot4(e0, h1), dot4(e0, h2), dot4(e1, h1), dot4(e1, h2), dot4(e2, h2))


@inline
def block4(p: Any, v: Any) -> Any:
    """Quaternion block of P times a quaternion."""
    return (
        p[0] * v[0] + p[1] * v[1] + p[2] * v[2] + p[3] * v[3],
        p[1] * v[0] + p[7] * v[1] + p[8] * v[2] + p[9] * v[3],
        p[2] * v[0] + p[8] * v[1] + p[13] * v[2] + p[14] * v[3],
        p[3] * v[0] + p[9] * v[1] + p[14] * v[2] + p[18] * v[3],
    )


@inline
def dot4(a: Any, b: Any) -> Any:
    """Scalar product of two quaternions."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]


@inline
def quaternion_covariance(q: Any, tilt: float, heading: float, bias: float) -> Any:
    """Upper triangle (28) of P for an attitude of given variances (rad²) about north and east, and about down.

    P_qq = ¼ Σ σ_j² E_j E_jᵀ with E_j = (0, e_j) ⊗ q; the part along q is set to a hundredth of the smaller, so that
    P is positive definite.
    """
    w, x, y, z = q
    e0, e1, e2 = (-x, w, -z, y), (-y, z, w, -x), (-z, -y, x, w)
    t, h, r = 0.25 * tilt, 0.25 * heading, 0.0025 * min(tilt, heading)
    f = (e0, e1, e2, q, t, h, r)
    zero3 = (0.0, 0.0, 0.0)
    return (
        (spread(f, 0, 0), spread(f, 0, 1), spread(f, 0, 2), spread(f, 0, 3))
        + zero3
        + (spread(f, 1, 1), spread(f, 1, 2), spread(f, 1, 3))
        + zero3
        + (spread(f, 2, 2), spread(f, 2, 3))
        + zero3
        + (spread(f, 3, 3),)
        + zero3
        + (bias, 0.0, 0.0, bias, 0.0, bias)
    )


@inline
def spread(f: Any, i: int, j: int) -> Any:
    """Entry (i, j) of t (E₀E₀ᵀ + E₁E₁ᵀ) + h E₂E₂ᵀ + r q qᵀ."""
    e0, e1, e2, q, t, h, r = f
    return t * (e0[i] * e0[j] + e1[i] * e1[j]) + h * e2[i] * e2[j] + r * q[i] * q[j]
