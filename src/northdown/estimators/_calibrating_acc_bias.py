r"""Bias of the accelerometer, found by turning and taken out of its samples.

A bias b of the accelerometer tilts the attitude by up to b/g, and nothing contradicts it while the body lies still.
But when the body turns, gravity's norm varies with the direction u of up in body axes: with the specific force f
averaged in navigation axes over `FORCE_WINDOW`, in which motion to and fro cancels, and u averaged likewise,

.. math::

    n = \|\bar f\| = N + b^T u + \text{noise}

to first order in b/g. Weighted least squares give b, with `USUAL` as its standard deviation where nothing is known:

.. math::

    b = (C + \epsilon I)^{-1} d, \qquad C = \overline{u u^T} - \bar u \bar u^T, \qquad
    d = \overline{n u} - \bar n \bar u, \qquad \epsilon = \frac{T_L \sigma^2}{W \sigma_b^2}

W being the time seen (s), σ² the variance of n that b does not explain, and T_L (`LASTING`) the time for
which that lasts.

Where b explains more than `acc_share` of the variance of n, differs from zero by `SURE` sigmas, and the body has
leaned about two axes, it is taken out of the samples from then on and found anew every `BETWEEN`; velocity, attitude
and the gyroscope's bias get the variance of what b may have done to them. A vehicle that leans into its turns has a
norm that varies with u, too, but leans about one axis only. Until b is found the sums forget, afterwards they do not.
Less than `LEAST_BIAS` is left in, and more than `MOST_BIAS` is none. `smooth` goes through the recording once more,
with what was found by its end.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

from northdown._validation import FloatArray
from northdown.estimators._calibrating_acceleration import FORCE_WINDOW, LEARNT, LOST_WITHIN, UNKNOWN_SPEED
from northdown.estimators._calibrating_layout import (
    ACC_BIAS,
    ACC_CENTRE,
    ACC_STATE,
    ACC_TILT,
    ACC_VARIANCE,
    ATTITUDE,
    BIAS,
    COV,
    FIELD,
    LAST_FORCE,
    LOW_FORCE,
    LOW_UP,
    MISSED,
    NORM,
    NORM_LEFT,
    NORM_SUMS,
    UNTRIED,
    VELOCITY,
)
from northdown.kernels.jit import inline
from northdown.kernels.quaternion import dot, rotate, rotate_inverse
from northdown.kernels.rows import WIDTH
from northdown.kernels.symmetric import inverse3, product3

NONE: Final = 0.0
FOUND: Final = 1.0
GIVEN_BIAS: Final = -1.0
USUAL: Final = 0.5
"""Bias (m/s²) that is expected where nothing is known: that of a cheap sensor as delivered."""
LEAST_BIAS: Final = 0.1
"""Least bias (m/s²) that is taken out: 1 % of gravity. Scale and misalignment of a good sensor look like less."""
MOST_BIAS: Final = 1.5
"""Largest bias (m/s²) that is believed."""
SURE: Final = 3.5
"""Sigmas by which the bias must differ from zero."""
LEAST_SPREAD: Final = 0.1
"""Scatter (rad) of the direction of up about the second axis of its ellipsoid: a vehicle leans about one only."""
LEAST_TIME: Final = 20.0
"""Time (s) before which nothing is decided."""
LEAST_NOISE: Final = 0.03
"""Least scatter (m/s²) of the norm: scale and misalignment of a good accelerometer."""
LASTING: Final = 5.0
"""Time (s) for which what the bias does not explain lasts."""
BETWEEN: Final = 5.0
"""Time (s) between one look for a bias and the next."""
FORGET: Final = 300.0
"""Time constant (s) with which the sums forget while no bias has been found."""
TINY: Final = 1e-300

_NORM: Final = 1
_SQUARE: Final = 2
_UP: Final = 3
_NORM_UP: Final = 6
_UP_UP: Final = 9
N_SUMS: Final = 15


class Fit(NamedTuple):
    """What the sums say."""

    known: bool
    bias: Any
    norm: float  # N less gravity
    varies: float  # variance of n
    left: float  # what b leaves of it
    inverse: Any  # (C + ε I)⁻¹, upper triangle
    pull: float  # bᵀ (C + ε I) b
    spread: float  # scatter of u about the second axis of its ellipsoid


@inline
def correct_acc_bias(p: Any, s: Any, time: float) -> None:
    """Take an epoch's mean force and direction of up; now and then find the bias, and whether it counts."""
    if s[ACC_STATE] == GIVEN_BIAS or not p.acc_share < 1.0:
        return
    q = (s[0], s[1], s[2], s[3])
    up = rotate_inverse(q, (0.0, 0.0, -1.0))
    learnt = s[NORM + 1]  # with this epoch
    gain = min(1.0, time / min(FORCE_WINDOW, learnt)) if learnt > 0.0 else 1.0
    for a in range(3):
        s[LOW_UP + a] += gain * (up[a] - s[LOW_UP + a])
    if not learnt > LEARNT:
        return
    found = bool(s[ACC_STATE] == FOUND)
    if s[MISSED] > 0.0 and not found:  # so was the direction of up
        for j in range(N_SUMS):
            s[NORM_SUMS + j] = 0.0
        return
    _add(p, s, time, 1.0 if found else 1.0 - min(1.0, time / FORGET))
    s[UNTRIED] += time
    if s[UNTRIED] < BETWEEN:
        return
    s[UNTRIED] = 0.0
    fit = fit_bias(s)
    if not fit.known:
        return
    s[NORM_LEFT] = fit.left
    b = fit.bias
    square = dot(b, b)
    if found and not square < MOST_BIAS * MOST_BIAS:
        _forget(s)
        return
    if not found:
        counts = learnt > LEAST_TIME and LEAST_BIAS * LEAST_BIAS < square < MOST_BIAS * MOST_BIAS
        sure = fit.spread > LEAST_SPREAD and fit.pull * s[NORM_SUMS] > SURE * SURE * _noise(s)
        if not (counts and sure and fit.left < (1.0 - p.acc_share) * fit.varies):
            return
        _begin_without(s, q, b, p.gravity + fit.norm)
    for a in range(3):
        s[ACC_BIAS + a] = b[a]
    s[ACC_TILT] = _tilt_variance(s, fit.inverse) / p.gravity**2


@inline
def _add(p: Any, s: Any, time: float, keep: float) -> None:
    """Take an epoch into the sums, with the bias in it; `keep` is the part of the earlier ones that stays."""
    for j in range(N_SUMS):
        s[NORM_SUMS + j] *= keep
    u = (s[LOW_UP], s[LOW_UP + 1], s[LOW_UP + 2])
    f = (s[LOW_FORCE], s[LOW_FORCE + 1], s[LOW_FORCE + 2])
    # less gravity, so that no digits are lost
    n = math.sqrt(dot(f, f)) - p.gravity + dot((s[ACC_BIAS], s[ACC_BIAS + 1], s[ACC_BIAS + 2]), u)
    s[NORM_SUMS] += time
    s[NORM_SUMS + _NORM] += time * n
    s[NORM_SUMS + _SQUARE] += time * n * n
    at = NORM_SUMS + _UP_UP
    for a in range(3):
        s[NORM_SUMS + _UP + a] += time * u[a]
        s[NORM_SUMS + _NORM_UP + a] += time * n * u[a]
        for b in range(a, 3):
            s[at] += time * u[a] * u[b]
            at += 1


@inline
def _tilt_variance(s: Any, inverse: Any) -> float:
    """Of horizontal force on each axis, from what the bias may be wrong by, mean over the attitudes so far."""
    k = 1.0 / s[NORM_SUMS]
    at = NORM_SUMS + _UP_UP
    all_axes = inverse[0] + inverse[3] + inverse[5]
    upwards = inverse[0] * s[at] + inverse[3] * s[at + 3] + inverse[5] * s[at + 5]
    upwards += 2.0 * (inverse[1] * s[at + 1] + inverse[2] * s[at + 2] + inverse[4] * s[at + 4])
    variance: float = 0.5 * k * _noise(s) * max(0.0, all_axes - k * upwards)
    return variance


@inline
def _noise(s: Any) -> float:
    """σ² T_L, (m/s²)² s."""
    noise: float = LASTING * max(s[NORM_LEFT], LEAST_NOISE * LEAST_NOISE)
    return noise


@inline
def fit_bias(s: Any) -> Fit:
    """Least squares, by the sums so far."""
    zero = (0.0, 0.0, 0.0)
    if not s[NORM_SUMS] > 0.0:
        return Fit(False, zero, 0.0, 0.0, 0.0, zero + zero, 0.0, 0.0)
    k = 1.0 / s[NORM_SUMS]
    n = s[NORM_SUMS + _NORM] * k
    varies = max(0.0, s[NORM_SUMS + _SQUARE] * k - n * n)
    at = NORM_SUMS + _UP
    u = (s[at] * k, s[at + 1] * k, s[at + 2] * k)
    at = NORM_SUMS + _NORM_UP
    d = (s[at] * k - n * u[0], s[at + 1] * k - n * u[1], s[at + 2] * k - n * u[2])
    at = NORM_SUMS + _UP_UP
    c = (
        s[at] * k - u[0] * u[0],
        s[at + 1] * k - u[0] * u[1],
        s[at + 2] * k - u[0] * u[2],
        s[at + 3] * k - u[1] * u[1],
        s[at + 4] * k - u[1] * u[2],
        s[at + 5] * k - u[2] * u[2],
    )
    e = _noise(s) * k / min(USUAL * USUAL, s[ACC_VARIANCE])
    inverse = inverse3((c[0] + e, c[1], c[2], c[3] + e, c[4], c[5] + e))
    centre = (s[ACC_CENTRE], s[ACC_CENTRE + 1], s[ACC_CENTRE + 2])
    b = product3(inverse, (d[0] + e * centre[0], d[1] + e * centre[1], d[2] + e * centre[2]))
    quadratic = dot(b, product3(c, b))
    left = max(0.0, varies - 2.0 * dot(d, b) + quadratic)
    minors = c[0] * c[3] - c[1] * c[1] + c[0] * c[5] - c[2] * c[2] + c[3] * c[5] - c[4] * c[4]
    spread = math.sqrt(max(0.0, minors) / max(c[0] + c[3] + c[5], TINY))
    return Fit(True, b, n - dot(b, u), varies, left, inverse, quadratic + e * dot(b, b), spread)


@inline
def _forget(s: Any) -> None:
    """What was found is no bias of a sensor."""
    s[ACC_STATE] = s[ACC_TILT] = 0.0
    s[ACC_VARIANCE] = math.inf
    for a in range(3):
        s[ACC_BIAS + a] = s[ACC_CENTRE + a] = 0.0
    for j in range(N_SUMS):
        s[NORM_SUMS + j] = 0.0


@inline
def _begin_without(s: Any, q: Any, b: Any, usual: float) -> None:
    """A bias has been found: what it has done to velocity, attitude and the gyroscope's bias is not known."""
    s[ACC_STATE] = FOUND
    force = rotate(q, b)
    s[NORM] = usual
    tilt = 0.5 * dot(b, b) / (usual * usual)
    for a in range(3):
        s[LOW_FORCE + a] -= force[a]
        s[LAST_FORCE + a] -= force[a]
        s[COV + (VELOCITY + a) * (WIDTH + 1)] += UNKNOWN_SPEED
        s[COV + (BIAS + a) * (WIDTH + 1)] += tilt / LOST_WITHIN**2
    s[COV + ATTITUDE * (WIDTH + 1)] += tilt
    s[COV + (ATTITUDE + 1) * (WIDTH + 1)] += tilt
    if s[FIELD] > 0.0:  # a tilt turns heading by as much as the field dips
        s[COV + (ATTITUDE + 2) * (WIDTH + 1)] += tilt * (s[FIELD + 1] / s[FIELD]) ** 2


def acc_bias_sigma(s: FloatArray) -> FloatArray:
    """Standard deviations (3,) of the bias in a state; of none taken out, by what the norm shows of it as well."""
    import numpy as np

    usual = min(math.sqrt(s[ACC_VARIANCE]), USUAL)
    fit = fit_bias(s)
    if not fit.known:
        return np.full(3, usual)
    inverse = fit.inverse
    variance = _noise(s) / s[NORM_SUMS] * np.array([inverse[0], inverse[3], inverse[5]])
    if s[ACC_STATE] == NONE:
        variance = variance + np.square(fit.bias)
    sigma: FloatArray = np.minimum(np.sqrt(variance), usual)
    return sigma


def begin_with_acc_bias(s: FloatArray, bias: FloatArray, sigma: FloatArray) -> None:
    """Put a bias (3,) and its standard deviations (3,) into a new state."""
    s[ACC_BIAS : ACC_BIAS + 3] = s[ACC_CENTRE : ACC_CENTRE + 3] = bias
    s[ACC_VARIANCE] = float((sigma @ sigma) / 3.0)
    s[ACC_TILT] = s[ACC_VARIANCE] / 9.80665**2 if bias.any() else 0.0
    if s[ACC_VARIANCE] == 0.0:
        s[ACC_STATE] = GIVEN_BIAS
    elif bias.any():
        s[ACC_STATE] = FOUND
