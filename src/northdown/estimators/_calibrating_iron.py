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

The filter does not correct for a small h: a field that varies from place to place looks much the same, and correcting
for it made headings worse. But a large ψ tells that one of both is there. Of a large h, see `_calibrating_hard_iron`.
"""

from __future__ import annotations

import math
from typing import Any, Final

from northdown.estimators._calibrating_layout import IRON, IRON_HEADING, IRON_KNOWN, IRON_TURN, Terms
from northdown.kernels.jit import inline
from northdown.kernels.quaternion import dot, rotate_inverse
from northdown.kernels.symmetric import inverse3, product3
from northdown.kernels.turn import columns

# The sums: weight, Σ R by columns, Σ m, Σ Rᵀ m.
_TURN: Final = 1
_FIELD: Final = 10
_BODY_FIELD: Final = 13
N_SUMS: Final = 16

EXPECTED: Final = 0.1
"""Weight of the expectation that there is no iron, s."""
SEEN: Final = 0.01
"""Heading (rad) by which the iron seen has to turn the field to count as much as iron not seen."""
LEAST_DOUBT: Final = 0.04
"""Part of the variance of `heading_sigma` that stays, however well iron has been ruled out."""


@inline
def heading_doubt(t: Terms, s: Any) -> float:
    """Variance of heading that iron may cause, found or not, rad²."""
    seen = s[IRON_TURN] / SEEN
    variance: float = t.heading_floor * (max(LEAST_DOUBT, 1.0 - s[IRON_KNOWN]) + seen * seen)
    return variance + float(s[IRON_HEADING])


@inline
def forget_iron(s: Any) -> None:
    """Begin anew: the navigation axes, or the field of the place, have changed."""
    for j in range(N_SUMS):
        s[IRON + j] = 0.0
    s[IRON_TURN] = s[IRON_KNOWN] = 0.0


@inline
def add_to_sums(s: Any, at: int, weight: float, field: Any) -> None:
    """Take an epoch's mean field (navigation axes) into the sums that begin at `at`."""
    q = (s[0], s[1], s[2], s[3])
    c = columns(q)
    body = rotate_inverse(q, field)
    s[at] += weight
    for i in range(3):
        for j in range(3):
            s[at + _TURN + 3 * i + j] += weight * c[i][j]
        s[at + _FIELD + i] += weight * field[i]
        s[at + _BODY_FIELD + i] += weight * body[i]


@inline
def fit(s: Any, at: int, expected: float, centre: Any) -> Any:
    """Whether there is a fit; h, its pull, the mean field m̄, the inverse in h, ψ and d, by the sums at `at`.

    `expected` is the weight (s) of the expectation that the iron is `centre`.
    """
    zero = (0.0, 0.0, 0.0)
    if not s[at] > 0.0:
        return False, zero, zero, zero, zero + zero, 0.0, 1.0
    k = 1.0 / s[at]
    m = (s[at + _FIELD] * k, s[at + _FIELD + 1] * k, s[at + _FIELD + 2] * k)
    x, y = m[0], m[1]
    square = x * x + y * y
    if not square > 0.0:
        return False, zero, zero, zero, zero + zero, 0.0, 1.0
    level = math.sqrt(square)
    r = at + _TURN
    a = (s[r] * k, s[r + 1] * k, s[r + 2] * k)
    b = (s[r + 3] * k, s[r + 4] * k, s[r + 5] * k)
    c = (s[r + 6] * k, s[r + 7] * k, s[r + 8] * k)
    across = ((x * a[1] - y * a[0]) / level, (x * b[1] - y * b[0]) / level, (x * c[1] - y * c[0]) / level)
    e = expected * k
    inverse = inverse3(
        (1.0 + e - dot(a, a), -dot(a, b), -dot(a, c), 1.0 + e - dot(b, b), -dot(b, c), 1.0 + e - dot(c, c))
    )
    r = at + _BODY_FIELD
    pull = (s[r] * k - dot(a, m), s[r + 1] * k - dot(b, m), s[r + 2] * k - dot(c, m))
    with_centre = (pull[0] + e * centre[0], pull[1] + e * centre[1], pull[2] + e * centre[2])
    h = product3(inverse, with_centre)
    return True, h, pull, m, inverse, dot(across, h) / level, e * dot(across, product3(inverse, across))


@inline
def look_for_iron(s: Any, field: Any, weight: float) -> None:
    """Take an epoch's mean field (navigation axes) into the sums, and find ψ and 1 − d."""
    add_to_sums(s, IRON, weight, field)
    known, _, _, _, _, turn, still_open = fit(s, IRON, EXPECTED, (0.0, 0.0, 0.0))
    if known:
        s[IRON_TURN] = turn
        s[IRON_KNOWN] = 1.0 - still_open
