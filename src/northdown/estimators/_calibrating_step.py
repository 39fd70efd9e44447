"""The step of the calibrating filter: what is summed up at every sample.

The equations are those of the docstring of `calibrating_ekf`.
"""

from __future__ import annotations

from typing import Any, Final

from northdown.estimators._calibrating_clip import add_lacking, unclipped
from northdown.estimators._calibrating_epoch import clear_sums, close_epoch
from northdown.estimators._calibrating_layout import (
    ACC_BIAS,
    ACC_SQUARE,
    AGE_ACC,
    AGE_MAG,
    BLOCK,
    CLIPPING,
    CLOCK,
    CLOSED,
    COUNT_MAG,
    FIELD_SLOPE,
    FIELD_SUM,
    FORCE,
    GIVEN,
    GYR_BIAS,
    GYR_MATRIX,
    HEAD,
    MAG_DELAY,
    MAG_IRON,
    MOTION,
    N_RING,
    RATE,
    RATE_SQUARE,
    REST_OFFSET,
    REST_TURN,
    RING,
    SCALED,
    SHIFT,
    STILL,
    TIME,
    TIME_ACC,
    TURN,
    TURNED,
    UNSEEN,
    Terms,
)
from northdown.kernels.direction_error import is_sample
from northdown.kernels.jit import inline
from northdown.kernels.quaternion import cross, dot, multiply, normalize, rotate
from northdown.kernels.so3 import exp
from northdown.kernels.stillness import add_to_block
from northdown.kernels.turn import columns

LONGEST_FORCE: Final = 0.1
"""Longest time (s) for which one accelerometer sample is taken to stand."""
LONGEST_STEP: Final = 0.15
"""Time (s) between samples beyond which half of the turn may not have been seen."""
RING_STEP: Final = 2e-3
"""Shortest time (s) between the attitudes that are kept for the magnetometer's delay."""


@inline
def step(p: Any, s: Any, dt: float, gyr: Any, acc: Any, mag: Any) -> Any:
    """Take one sample, in place."""
    p = Terms(*p)
    if s[CLOSED] > 0.0:
        clear_sums(s)
    s[TIME] += dt
    gyr, lost = unclipped(s, dt, gyr)
    rate = _rate(s, dt, gyr, lost)
    s[RATE], s[RATE + 1], s[RATE + 2] = rate
    q = (s[0], s[1], s[2], s[3])
    if dt > 0.0:
        turn = (rate[0] * dt + lost[0], rate[1] * dt + lost[1], rate[2] * dt + lost[2])
        q = normalize(multiply(q, exp(turn)))
        s[0], s[1], s[2], s[3] = q
        c = columns(q)
        _add_turn(s, dt, c, gyr)
        if s[CLIPPING] > 0.0:
            add_lacking(s, dt, c)
        square = dot(rate, rate)
        s[RATE_SQUARE] += square * dt
        if dt > LONGEST_STEP:
            s[UNSEEN] += 0.25 * square * dt * dt
    s[AGE_ACC] += dt
    s[AGE_MAG] += dt
    if is_sample(acc):
        force = rotate(q, (acc[0] - s[ACC_BIAS], acc[1] - s[ACC_BIAS + 1], acc[2] - s[ACC_BIAS + 2]))
        age = min(s[AGE_ACC], LONGEST_FORCE)
        up = force[2] + p.gravity
        square = force[0] * force[0] + force[1] * force[1] + up * up
        s[TIME_ACC] += age
        s[ACC_SQUARE] += square * age
        s[MOTION] += (square - s[MOTION]) * min(1.0, s[AGE_ACC] / p.motion_window)
        for a in range(3):
            s[FORCE + a] += force[a] * age
        s[SHIFT] += force[0] * age
        s[SHIFT + 1] += force[1] * age
        s[SHIFT + 2] += up * age
        s[AGE_ACC] = 0.0
        add_to_block(s, BLOCK, age, gyr, acc)
    if is_sample(mag):
        _add_field(s, q, rate, (mag[0] - s[MAG_IRON], mag[1] - s[MAG_IRON + 1], mag[2] - s[MAG_IRON + 2]))
    if s[TIME] + 0.5 * dt >= p.epoch:
        close_epoch(p, s)
    return s


@inline
def _rate(s: Any, dt: float, gyr: Any, lost: Any) -> Any:
    """Angular rate; also remembers the turn for the magnetometer's delay."""
    if s[GIVEN] >= 0.0:
        s[STILL] = s[GIVEN]
    x, y, z = gyr[0] - s[GYR_BIAS], gyr[1] - s[GYR_BIAS + 1], gyr[2] - s[GYR_BIAS + 2]
    if s[STILL] > 0.0:
        rate = (x - s[REST_OFFSET], y - s[REST_OFFSET + 1], z - s[REST_OFFSET + 2])
    else:
        m = GYR_MATRIX
        rate = (
            x - (s[m] * gyr[0] + s[m + 3] * gyr[1] + s[m + 6] * gyr[2]),
            y - (s[m + 1] * gyr[0] + s[m + 4] * gyr[1] + s[m + 7] * gyr[2]),
            z - (s[m + 2] * gyr[0] + s[m + 5] * gyr[1] + s[m + 8] * gyr[2]),
        )
    s[CLOCK] += dt
    for a in range(3):
        s[TURNED + a] += rate[a] * dt + lost[a]
    head = int(s[HEAD])
    if s[CLOCK] - s[RING + 4 * head] >= RING_STEP:
        head = (head + 1) % N_RING
        s[HEAD] = float(head)
        s[RING + 4 * head] = s[CLOCK]
        for a in range(3):
            s[RING + 4 * head + 1 + a] = s[TURNED + a]
    return rate


@inline
def _add_turn(s: Any, dt: float, c: Any, gyr: Any) -> None:
    """Σ R dt and, in motion, Σ R r_k dt, with the columns c of R."""
    if s[STILL] > 0.0:
        for i in range(3):
            for j in range(3):
                s[TURN + 3 * i + j] += c[j][i] * dt
                s[REST_TURN + 3 * i + j] += c[j][i] * dt
        return
    for i in range(3):
        for j in range(3):
            r = c[j][i] * dt
            s[TURN + 3 * i + j] += r
            s[SCALED + 3 * i + j] += r * gyr[0]
            s[SCALED + 9 + 3 * i + j] += r * gyr[1]
            s[SCALED + 18 + 3 * i + j] += r * gyr[2]


@inline
def _add_field(s: Any, q: Any, rate: Any, mag: Any) -> None:
    """Field in navigation axes by the attitude of `MAG_DELAY` ago, and its derivative with respect to that delay."""
    delay = s[MAG_DELAY]
    then = rate
    d = (rate[0] * delay, rate[1] * delay, rate[2] * delay)
    if delay > 0.0:
        # the two moments that are known and lie around the one asked for
        time = s[CLOCK] - delay
        young, young_turn = s[CLOCK], (s[TURNED], s[TURNED + 1], s[TURNED + 2])
        k = int(s[HEAD])
        for _ in range(N_RING - 1):
            at = RING + 4 * k
            if s[at] <= time:
                break
            young, young_turn = s[at], (s[at + 1], s[at + 2], s[at + 3])
            k = (k - 1 + N_RING) % N_RING
        at = RING + 4 * k
        span = young - s[at]
        if s[at] <= time and span > 0.0:
            then = (
                (young_turn[0] - s[at + 1]) / span,
                (young_turn[1] - s[at + 2]) / span,
                (young_turn[2] - s[at + 3]) / span,
            )
            u = young - time
            d = (
                s[TURNED] - young_turn[0] + u * then[0],
                s[TURNED + 1] - young_turn[1] + u * then[1],
                s[TURNED + 2] - young_turn[2] + u * then[2],
            )
    b = _turned_back(d, mag)
    h = rotate(q, b)
    slope = rotate(q, cross(b, then))
    for a in range(3):
        s[FIELD_SUM + a] += h[a]
        s[FIELD_SLOPE + a] += slope[a]
    s[COUNT_MAG] += 1.0


@inline
def _turned_back(d: Any, v: Any) -> Any:
    """exp(−d) v, by series for the small turns that occur in practice."""
    t = dot(d, d)
    if t > 0.25:
        return rotate(exp((-d[0], -d[1], -d[2])), v)
    a = 1.0 - t * (1.0 / 6.0) * (1.0 - t * (1.0 / 20.0) * (1.0 - t * (1.0 / 42.0) * (1.0 - t * (1.0 / 72.0))))
    b = 0.5 - t * (1.0 / 24.0) * (1.0 - t * (1.0 / 30.0) * (1.0 - t * (1.0 / 56.0) * (1.0 - t * (1.0 / 90.0))))
    c = cross(d, v)
    e = cross(d, c)
    return (v[0] - a * c[0] + b * e[0], v[1] - a * c[1] + b * e[1], v[2] - a * c[2] + b * e[2])
