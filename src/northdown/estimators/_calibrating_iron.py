r"""By how much iron on the body may turn the calibrating filter's heading, for the covariance that it reports.

Iron that turns with the body adds a constant h to the field in body axes. In navigation axes the fields of the epochs
are m_i = m_0 + R_i h, and m_0 cannot be told from h while the body hardly turns. With means (bars) over the epochs so
far, weighed as their headings are, least squares give

.. math::

    h = \bigl((1 + \epsilon) I - \bar R^T \bar R\bigr)^{-1} \bigl(\overline{R^T m} - \bar R^T \bar m\bigr), \qquad
    \psi = e^T \bar R h / \bar m_h, \qquad
    d = \epsilon\, e^T \bar R \bigl((1 + \epsilon) I - \bar R^T \bar R\bigr)^{-1} \bar R^T e

with e the horizontal direction across the field and m̄_h the field's horizontal part. ψ is what h does to the heading
on average. d is the part of its variance that is still open: 1 while the body has not turned, 0 once all is known.
ε = (0.1 s) / time expects iron of about 5 % of the field, among disturbances of 1.6 % that last for a second.

The filter does not correct for h: a field that varies from place to place looks much the same, and correcting for it
made headings worse. But a large ψ tells that one of both is there.
"""

from __future__ import annotations

import math
from typing import Any, Final

from northdown.estimators._calibrating_layout import IRON, IRON_KNOWN, IRON_TURN, Terms
from northdown.kernels.jit import inline
from northdown.kernels.quaternion import dot, rotate_inverse
from northdown.kernels.turn import columns

# The sums, from IRON on: weight, Σ R by columns, Σ m, Σ Rᵀ m.
_TURN: Final = IRON + 1
_FIELD: Final = IRON + 10
_BODY_FIELD: Final = IRON + 13
N_SUMS: Final = 16

EXPECTED: Final = 0.1
"""Weight of the expectation that there is no iron, s."""
SEEN: Final = 0.01
"""Heading (rad) by which the iron seen has to turn the field to count as much as iron not seen."""
LEAST_DOUBT: Final = 0.04
"""Part of the variance of `heading_sigma` that stays, however well iron has been ruled out."""


@inline
def heading_doubt(t: Terms, s: Any) -> float:
    """Variance of heading that iron may cause, rad²."""
    seen = s[IRON_TURN] / SEEN
    variance: float = t.heading_floor * (max(LEAST_DOUBT, 1.0 - s[IRON_KNOWN]) + seen * seen)
    return variance


@inline
def forget_iron(s: Any) -> None:
    """Begin anew: the navigation axes, or the field of the place, have changed."""
    for j in range(N_SUMS):
        s[IRON + j] = 0.0
    s[IRON_TURN] = s[IRON_KNOWN] = 0.0


@inline
def look_for_iron(s: Any, field: Any, weight: float) -> None:
    """Take an epoch's mean field (navigation axes) into the sums, and find ψ and 1 − d."""
    q = (s[0], s[1], s[2], s[3])
    c = columns(q)
    body = rotate_inverse(q, field)
    s[IRON] += weight
    for i in range(3):
        for j in range(3):
            s[_TURN + 3 * i + j] += weight * c[i][j]
        s[_FIELD + i] += weight * field[i]
        s[_BODY_FIELD + i] += weight * body[i]
    k = 1.0 / s[IRON]
    x, y = s[_FIELD] * k, s[_FIELD + 1] * k
    square = x * x + y * y
    if not square > 0.0:
        return
    h = math.sqrt(square)
    m = (x, y, s[_FIELD + 2] * k)
    a = (s[_TURN] * k, s[_TURN + 1] * k, s[_TURN + 2] * k)
    b = (s[_TURN + 3] * k, s[_TURN + 4] * k, s[_TURN + 5] * k)
    d = (s[_TURN + 6] * k, s[_TURN + 7] * k, s[_TURN + 8] * k)
    across = ((x * a[1] - y * a[0]) / h, (x * b[1] - y * b[0]) / h, (x * d[1] - y * d[0]) / h)
    e = EXPECTED * k
    v = _solve(
        1.0 + e - dot(a, a), -dot(a, b), -dot(a, d), 1.0 + e - dot(b, b), -dot(b, d), 1.0 + e - dot(d, d), across
    )
    pull = (
        s[_BODY_FIELD] * k - dot(a, m),
        s[_BODY_FIELD + 1] * k - dot(b, m),
        s[_BODY_FIELD + 2] * k - dot(d, m),
    )
    s[IRON_TURN] = dot(v, pull) / h
    s[IRON_KNOWN] = 1.0 - e * dot(v, across)


@inline
def _solve(xx: float, xy: float, xz: float, yy: float, yz: float, zz: float, v: Any) -> Any:
    """Solution of a symmetric positive definite system of three equations, by its adjugate."""
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    d, e, f = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    k = 1.0 / (xx * a + xy * b + xz * c)
    return (
        k * (a * v[0] + b * v[1] + c * v[2]),
        k * (b * v[0] + d * v[1] + e * v[2]),
        k * (c * v[0] + e * v[1] + f * v[2]),
    )
