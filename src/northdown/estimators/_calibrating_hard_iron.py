r"""Hard iron on the body, found by turning and taken out of the magnetometer's samples.

With the fields m_i of the epochs and the iron h of `_calibrating_iron`, the variation of the field in navigation axes
is explained by h to the part

.. math::

    \rho = \frac{p^T h}{\overline{|m|^2} - |\bar m|^2}, \qquad
    p = \overline{R^T m} - \bar R^T \bar m

A room explains little in that way, however much its field varies; iron that is larger than the room's variation
explains nearly all. Where ρ is above `iron_share` and the heading that h causes is known (d < 0.05), h is taken out
of the samples from then on and found anew with each epoch; the reference of the field becomes that without iron, and
heading turns by what iron has done to it.

The sums forget with `field_window` until iron has been found, and have all fields in them, unless their norm is less
than half or more than twice the reference's: what iron disturbs would be rejected otherwise. From then on fields
count by the gate, and nothing is forgotten. When heading is corrected, the sums turn with it: iron that is not known
yet makes heading wrong by far more than the gyroscope does. `smooth` goes through the recording once more, with what
was found by its end. Iron without which the field is all but rejected, for `field_new` of motion, is gone: then it is
forgotten.

What iron leaves unexplained is taken to last for five seconds each time; heading is as uncertain as that makes h.
"""

from __future__ import annotations

import math
from typing import Any, Final

from northdown._validation import FloatArray
from northdown.estimators._calibrating_iron import (
    EXPECTED,
    N_SUMS,
    add_to_sums,
    fit,
    forget_iron,
)
from northdown.estimators._calibrating_layout import (
    ERROR,
    FIELD,
    FIELD_SQUARE,
    FIELD_SUMS,
    IRON_CENTRE,
    IRON_HEADING,
    IRON_STATE,
    IRON_TURNED,
    IRON_VARIANCE,
    IRON_WRONG,
    MAG_IRON,
    MEAN_DEPARTURE,
    NEW_FIELD,
    STILL,
)
from northdown.kernels.jit import inline
from northdown.kernels.quaternion import dot, rotate
from northdown.kernels.weighting import REJECTED

NONE: Final = 0.0
FOUND: Final = 1.0
GIVEN_IRON: Final = -1.0
USUAL: Final = 0.05
"""Iron that is expected, as a part of the field, where nothing is known."""
OPEN: Final = 0.05
"""Largest part of the variance of the heading from iron that may still be open."""
LEAST_TIME: Final = 20.0
"""Time (s) before which nothing is decided."""
LEAST_FIELD: Final = 0.1
"""Least field of a place, as a part of the iron: a magnetometer that is stuck shows iron and nothing else."""
LEAST_IRON: Final = 0.005
"""Least iron, as a part of the field: without any noise, the estimate's own errors may look like less."""
LASTING: Final = 5.0
"""Time (s) for which what iron does not explain lasts."""
UNSEEN_SIGMA: Final = 1e3
"""Standard deviation (µT) of the iron when no field has been seen."""
TINY: Final = 1e-300


@inline
def expectation(s: Any, square: float) -> float:
    """Weight (s) of the iron expected, in a field of squared norm `square`."""
    usual = USUAL * USUAL * square
    weight: float = EXPECTED * max(1.0, usual / s[IRON_VARIANCE])
    return weight


@inline
def correct_iron(p: Any, s: Any, field: Any, age: float, u: float) -> bool:
    """Take an epoch's mean field, of departure u; whether it has shown iron that it has still in it."""
    if s[IRON_STATE] == GIVEN_IRON or not p.iron_share < 1.0:
        return False
    found = bool(s[IRON_STATE] == FOUND)
    on_body = (s[MAG_IRON], s[MAG_IRON + 1], s[MAG_IRON + 2])
    iron = rotate((s[0], s[1], s[2], s[3]), on_body)
    whole = (field[0] + iron[0], field[1] + iron[1], field[2] + iron[2])
    square = dot(whole, whole)
    weight = age
    if found:
        weight /= (1.0 + u) ** p.gate_power
        if _is_gone(p, s, age, u):
            return False
    else:
        reference = s[FIELD] * s[FIELD] + s[FIELD + 1] * s[FIELD + 1]
        weight = age if 0.25 * reference < square < 4.0 * reference else 0.0
        keep = 1.0 - min(1.0, age / p.field_window)
        for j in range(N_SUMS + 1):
            s[FIELD_SUMS + j] *= keep
    add_to_sums(s, FIELD_SUMS, weight, whole)
    s[FIELD_SQUARE] += weight * square
    centre = (s[IRON_CENTRE], s[IRON_CENTRE + 1], s[IRON_CENTRE + 2])
    expected = expectation(s, square)
    known, h, pull, mean, _, _, still_open = fit(s, FIELD_SUMS, expected, centre)
    if not known:
        return False
    varies = s[FIELD_SQUARE] / s[FIELD_SUMS] - dot(mean, mean)
    if not found:
        if not (s[FIELD_SUMS] > LEAST_TIME and still_open < OPEN and dot(pull, h) > p.iron_share * varies):
            return False
        place = _field_without(s, h, mean)
        field_square, iron_square = dot(place, place), dot(h, h)
        if not (field_square > LEAST_FIELD**2 * iron_square and iron_square > LEAST_IRON**2 * field_square):
            return False
        _begin_without(s, place)
    noise = max(EXPECTED * USUAL * USUAL * square, LASTING * (varies - dot(pull, h)))
    s[IRON_HEADING] = min(1.0, noise * still_open / (expected * max(s[FIELD] * s[FIELD], TINY)))
    for a in range(3):
        s[MAG_IRON + a] = h[a]
    return not found


@inline
def _is_gone(p: Any, s: Any, age: float, u: float) -> bool:
    """Whether the field without the iron has been rejected for `field_new` of motion; the iron is forgotten then."""
    if s[STILL] == 0.0:
        s[IRON_WRONG] = max(0.0, s[IRON_WRONG] + (age if u > REJECTED else -age))
    if not s[IRON_WRONG] > p.field_new:
        return False
    s[IRON_STATE] = s[IRON_WRONG] = s[IRON_HEADING] = 0.0
    s[IRON_VARIANCE] = math.inf
    for a in range(3):
        s[MAG_IRON + a] = s[IRON_CENTRE + a] = 0.0
    for j in range(N_SUMS + 1):
        s[FIELD_SUMS + j] = 0.0
    return True


@inline
def _field_without(s: Any, h: Any, mean: Any) -> Any:
    """Field of the place, navigation axes, when the mean one has iron h in it."""
    k = 1.0 / s[FIELD_SUMS]
    r = FIELD_SUMS + 1
    return (
        mean[0] - k * (s[r] * h[0] + s[r + 3] * h[1] + s[r + 6] * h[2]),
        mean[1] - k * (s[r + 1] * h[0] + s[r + 4] * h[1] + s[r + 7] * h[2]),
        mean[2] - k * (s[r + 2] * h[0] + s[r + 5] * h[1] + s[r + 8] * h[2]),
    )


@inline
def _begin_without(s: Any, place: Any) -> None:
    """Iron has been found: the field of the place is another one, and heading turns by what iron has done to it."""
    x, y, z = place
    s[IRON_STATE] = FOUND
    square = x * x + y * y
    s[FIELD], s[FIELD + 1] = math.sqrt(square), z
    s[MEAN_DEPARTURE] = s[NEW_FIELD + 2] = 0.0
    forget_iron(s)
    if square > 0.0:
        turn = math.atan2(y, x)
        s[ERROR + 2] -= turn
        vx, vy, vz = iron_variances(s)
        s[IRON_TURNED] = turn * turn + (vx + vy + vz) / (3.0 * square)


@inline
def turn_sums(s: Any, angle: float) -> None:
    """Turn the sums about the vertical, as heading has just been: what it was before is taken to be as wrong."""
    c, n = math.cos(angle), math.sin(angle)
    for k in range(4):
        at = FIELD_SUMS + 1 + 3 * k
        x, y = s[at], s[at + 1]
        s[at], s[at + 1] = c * x - n * y, n * x + c * y


@inline
def keep_iron(s: Any) -> None:
    """The navigation axes or the field of the place have changed: only what is known of the iron stays."""
    if s[IRON_STATE] == GIVEN_IRON:
        return
    if s[IRON_STATE] == FOUND:
        for a in range(3):
            s[IRON_CENTRE + a] = s[MAG_IRON + a]
        x, y, z = iron_variances(s)
        s[IRON_VARIANCE] = (x + y + z) / 3.0
    for j in range(N_SUMS + 1):
        s[FIELD_SUMS + j] = 0.0


@inline
def iron_variances(s: Any) -> Any:
    """Of the iron on each axis, as far as the field has shown it."""
    known = s[IRON_VARIANCE]
    if not s[FIELD_SUMS] > 0.0:
        return known, known, known
    square = s[FIELD_SQUARE] / s[FIELD_SUMS]
    found, _, _, _, inverse, _, _ = fit(s, FIELD_SUMS, expectation(s, square), (0.0, 0.0, 0.0))
    if not found:
        return known, known, known
    k = EXPECTED * USUAL * USUAL * square / s[FIELD_SUMS]
    return k * inverse[0], k * inverse[3], k * inverse[5]


def iron_sigma(s: FloatArray) -> FloatArray:
    """Standard deviations (3,) of the iron in a state; of none taken out, by what the field shows of it as well."""
    import numpy as np

    square = s[FIELD] ** 2 + s[FIELD + 1] ** 2
    if not square > 0.0:
        return np.full(3, min(math.sqrt(s[IRON_VARIANCE]), UNSEEN_SIGMA))
    variance = np.minimum(iron_variances(s), min(float(s[IRON_VARIANCE]), USUAL**2 * square))
    if s[IRON_STATE] == NONE and s[FIELD_SUMS] > 0.0:
        centre = tuple(s[IRON_CENTRE : IRON_CENTRE + 3])
        _, h, *_ = fit(s, FIELD_SUMS, expectation(s, s[FIELD_SQUARE] / s[FIELD_SUMS]), centre)
        variance = variance + np.square(h)
    sigma: FloatArray = np.sqrt(variance)
    return sigma


def begin_with_iron(s: FloatArray, iron: FloatArray, sigma: FloatArray) -> None:
    """Put iron (3,) and its standard deviations (3,) into a new state."""
    s[MAG_IRON : MAG_IRON + 3] = s[IRON_CENTRE : IRON_CENTRE + 3] = iron
    s[IRON_VARIANCE] = float((sigma @ sigma) / 3.0)
    if s[IRON_VARIANCE] == 0.0:
        s[IRON_STATE] = GIVEN_IRON
    elif iron.any():
        s[IRON_STATE] = FOUND
