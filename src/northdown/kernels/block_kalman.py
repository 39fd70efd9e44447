"""Covariance of twelve error states in blocks of three, written out block by block.

The states are attitude error t, angular rate w, bias a of angular acceleration and bias f of specific force. The
covariance is the tuple of blocks (tt, tw, ta, tf, ww, wa, wf, aa, af, ff), six entries (upper triangle by rows) for
those on the diagonal, nine by rows for the others: 78 in all when flat.
"""

from __future__ import annotations

from typing import Any

from northdown.kernels.jit import inline
from northdown.kernels.kalman import symmetric3
from northdown.kernels.quaternion import Vector, add, dot, scale
from northdown.kernels.rate_kalman import times3


@inline
def blocks(p: Any) -> Any:
    """The ten blocks of the flat tuple."""
    return (p[:6], p[6:15], p[15:24], p[24:33], p[33:39], p[39:48], p[48:57], p[57:63], p[63:72], p[72:78])


@inline
def flat(p: Any) -> Any:
    """The blocks one after the other."""
    return p[0] + p[1] + p[2] + p[3] + p[4] + p[5] + p[6] + p[7] + p[8] + p[9]


@inline
def full(b: Any) -> Any:
    """All nine entries of a block on the diagonal."""
    return symmetric3(b[0], b[1], b[2], b[3], b[4], b[5])


@inline
def upper(m: Any) -> Any:
    """Six of the nine entries of a symmetric matrix."""
    return (m[0], m[1], m[2], m[4], m[5], m[8])


@inline
def transposed(m: Any) -> Any:
    """Mᵀ."""
    return (m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8])


@inline
def product(a: Any, b: Any) -> Any:
    """A B."""
    c0, c1, c2 = (b[0], b[3], b[6]), (b[1], b[4], b[7]), (b[2], b[5], b[8])
    r0, r1, r2 = (a[0], a[1], a[2]), (a[3], a[4], a[5]), (a[6], a[7], a[8])
    return (
        dot(r0, c0),
        dot(r0, c1),
        dot(r0, c2),
        dot(r1, c0),
        dot(r1, c1),
        dot(r1, c2),
        dot(r2, c0),
        dot(r2, c1),
        dot(r2, c2),
    )


@inline
def total(a: Any, b: Any) -> Any:
    """A + B."""
    return (
        a[0] + b[0],
        a[1] + b[1],
        a[2] + b[2],
        a[3] + b[3],
        a[4] + b[4],
        a[5] + b[5],
        a[6] + b[6],
        a[7] + b[7],
        a[8] + b[8],
    )


@inline
def times(k: float, m: Any) -> Any:
    """The product k M."""
    return (k * m[0], k * m[1], k * m[2], k * m[3], k * m[4], k * m[5], k * m[6], k * m[7], k * m[8])


@inline
def raised(b: Any, k: float, c: Any) -> Any:
    """B + k C for blocks on the diagonal."""
    return (b[0] + k * c[0], b[1] + k * c[1], b[2] + k * c[2], b[3] + k * c[3], b[4] + k * c[4], b[5] + k * c[5])


@inline
def seen_attitude(p: Any, h: Vector) -> Any:
    """P Hᵀ, a vector for each state, for a row h of the attitude error."""
    return (
        times3(full(p[0]), h),
        times3(transposed(p[1]), h),
        times3(transposed(p[2]), h),
        times3(transposed(p[3]), h),
    )


@inline
def seen_rate(p: Any, h: Vector) -> Any:
    """The same for a row of the rate."""
    return (times3(p[1], h), times3(full(p[4]), h), times3(transposed(p[5]), h), times3(transposed(p[6]), h))


@inline
def seen_force_bias(p: Any, h: Vector) -> Any:
    """The same for a row of the bias of specific force."""
    return (times3(p[3], h), times3(p[6], h), times3(p[8], h), times3(full(p[9]), h))


@inline
def joined(a: Any, b: Any) -> Any:
    """Sum of two such."""
    return (add(a[0], b[0]), add(a[1], b[1]), add(a[2], b[2]), add(a[3], b[3]))


@inline
def gain(p: Any, d: Any, ph: Any, s: float, y: float) -> Any:
    """Scalar update from P Hᵀ, s = H P Hᵀ + r and the residual y at the point reached: returns (P, d).

    Last in d is the normalised innovation squared Σ y²/s of the updates that it came from.
    """
    k = 1.0 / s
    g = y * k
    t, w, a, f = ph
    d = (add(d[0], scale(g, t)), add(d[1], scale(g, w)), add(d[2], scale(g, a)), add(d[3], scale(g, f)), d[4] + g * y)
    kt, kw, ka, kf = scale(k, t), scale(k, w), scale(k, a), scale(k, f)
    return (
        (
            less_square(p[0], kt, t),
            less(p[1], kt, w),
            less(p[2], kt, a),
            less(p[3], kt, f),
            less_square(p[4], kw, w),
            less(p[5], kw, a),
            less(p[6], kw, f),
            less_square(p[7], ka, a),
            less(p[8], ka, f),
            less_square(p[9], kf, f),
        ),
        d,
    )


@inline
def less(b: Any, g: Vector, h: Vector) -> Any:
    """B − g hᵀ."""
    return (
        b[0] - g[0] * h[0],
        b[1] - g[0] * h[1],
        b[2] - g[0] * h[2],
        b[3] - g[1] * h[0],
        b[4] - g[1] * h[1],
        b[5] - g[1] * h[2],
        b[6] - g[2] * h[0],
        b[7] - g[2] * h[1],
        b[8] - g[2] * h[2],
    )


@inline
def less_square(b: Any, g: Vector, h: Vector) -> Any:
    """B − g hᵀ on the diagonal, g along h."""
    return (
        b[0] - g[0] * h[0],
        b[1] - g[0] * h[1],
        b[2] - g[0] * h[2],
        b[3] - g[1] * h[1],
        b[4] - g[1] * h[2],
        b[5] - g[2] * h[2],
    )


@inline
def change_rate(p: Any, xt: Any, xw: Any, h: float, xf: Any, noise: Any, n: float) -> Any:
    """Covariance after ω' = xt δ + xw ω − h a + xf f, with noise n times six entries."""
    tt, tw, ta, tf, ww, wa, wf, aa, af, ff = p
    # rows of ω' with each of the old states
    with_t = total(total(product(xt, full(tt)), product(xw, transposed(tw))), _biases(h, xf, ta, tf))
    with_w = total(total(product(xt, tw), product(xw, full(ww))), _biases(h, xf, wa, wf))
    with_a = total(total(product(xt, ta), product(xw, wa)), _biases(h, xf, full(aa), af))
    with_f = total(total(product(xt, tf), product(xw, wf)), _biases(h, xf, transposed(af), full(ff)))
    square = total(
        total(product(xt, transposed(with_t)), product(xw, transposed(with_w))), _biases(h, xf, with_a, with_f)
    )
    return (tt, transposed(with_t), ta, tf, raised(upper(square), n, noise), with_a, with_f, aa, af, ff)


@inline
def _biases(h: float, xf: Any, a: Any, f: Any) -> Any:
    """Rows −h aᵀ + xf fᵀ, where a and f are covariances of some state with the two biases."""
    return total(times(-h, transposed(a)), product(xf, transposed(f)))


@inline
def turn_attitude(p: Any, m: Any) -> Any:
    """Covariance after δ' = δ + M δω."""
    tt, tw, ta, tf, ww, wa, wf, aa, af, ff = p
    after = total(tw, product(m, full(ww)))
    turned = total(full(tt), total(product(m, transposed(tw)), product(after, transposed(m))))
    return (
        upper(turned),
        after,
        total(ta, product(m, wa)),
        total(tf, product(m, wf)),
        ww,
        wa,
        wf,
        aa,
        af,
        ff,
    )
