"""The start of the calibrating filter, and what it reports of a sample."""

from __future__ import annotations

import math
from typing import Any, Final

from northdown.estimators._calibrating_epoch import clear_sums
from northdown.estimators._calibrating_hard_iron import keep_iron
from northdown.estimators._calibrating_iron import forget_iron, heading_doubt
from northdown.estimators._calibrating_layout import (
    ACC_BIAS,
    ACC_TILT,
    ATTITUDE,
    BIAS,
    CLIPPING,
    COV,
    DEPARTURE,
    HOLD,
    MAG_DELAY,
    MAG_IRON,
    MOTION,
    RATE,
    STILL,
    VELOCITY,
    N,
    Terms,
)
from northdown.kernels.jit import inline
from northdown.kernels.kalman import symmetric3
from northdown.kernels.quaternion import length, multiply, rotate
from northdown.kernels.rows import WIDTH
from northdown.kernels.so3 import exp
from northdown.kernels.weighting import REJECTED
from northdown.orientation import Flag

_ACC_REJECTED = int(Flag.ACC_REJECTED)
_GYRO_CLIPPED = int(Flag.GYRO_CLIPPED)
_MAG_REJECTED = int(Flag.MAG_REJECTED)
DIAGONAL: Final = WIDTH + 1
"""From one diagonal entry of a covariance to the next."""
START_SPEED: Final = 0.1  # m/s, standard deviation of the velocity that the first samples do not show


@inline
def doubts(t: Terms, s: Any) -> Any:
    """Variances of tilt and heading beside those of the filter, rad²: accelerometer's bias, iron."""
    return t.tilt_floor + s[ACC_TILT], heading_doubt(t, s)


@inline
def covariance_of(t: Terms, p: Any, rate_n: Any, doubt: Any) -> Any:
    """Covariance that is reported, nine entries by rows, for that of the filter (upper triangle) and the rate.

    `doubt` are the variances of `doubts`.
    """
    x, y, z = rate_n
    tilt, heading = doubt
    k, f = t.inflation, t.time_floor
    return symmetric3(
        k * p[0] + tilt + f * x * x,
        k * p[1] + f * x * y,
        k * p[2] + f * x * z,
        k * p[3] + tilt + f * y * y,
        k * p[4] + f * y * z,
        k * p[5] + heading + f * z * z,
    )


@inline
def aligned(p: Any, s: Any, q: Any, heading_known: bool) -> Any:
    """State for an attitude found from the sensors: its covariance starts anew, and so does the epoch."""
    t = Terms(*p)
    s[0], s[1], s[2], s[3] = q
    for i in range(3):
        for j in range(N):
            s[COV + (ATTITUDE + i) * WIDTH + j] = 0.0
            s[COV + j * WIDTH + ATTITUDE + i] = 0.0
            s[COV + (VELOCITY + i) * WIDTH + j] = 0.0
            s[COV + j * WIDTH + VELOCITY + i] = 0.0
        s[COV + (VELOCITY + i) * DIAGONAL] = START_SPEED * START_SPEED
    s[COV] = t.start_tilt
    s[COV + DIAGONAL] = t.start_tilt
    # the heading was found with the iron in it
    without = s[MAG_IRON] == 0.0 and s[MAG_IRON + 1] == 0.0 and s[MAG_IRON + 2] == 0.0
    s[COV + 2 * DIAGONAL] = t.start_heading if heading_known and without else math.pi * math.pi / 3.0
    clear_sums(s)
    forget_iron(s)
    keep_iron(s)
    return s


@inline
def ahead(t: Terms, q: Any, rate_n: Any) -> Any:
    """Attitude at the time of the sample, by which the gyroscope is late."""
    if t.gyr_delay == 0.0:
        return q
    d = t.gyr_delay
    return multiply(exp((d * rate_n[0], d * rate_n[1], d * rate_n[2])), q)


@inline
def output(p: Any, s: Any) -> Any:
    """Attitude, bias, covariance of the attitude, sigma of the bias, and the diagnostics."""
    t = Terms(*p)
    row = COV + WIDTH
    p_upper = (s[COV], s[COV + 1], s[COV + 2], s[row + 1], s[row + 2], s[row + WIDTH + 2])
    rate_n = rotate((s[0], s[1], s[2], s[3]), (s[RATE], s[RATE + 1], s[RATE + 2]))
    covariance = covariance_of(t, p_upper, rate_n, doubts(t, s))
    at = COV + BIAS * DIAGONAL
    sigma = (math.sqrt(s[at]), math.sqrt(s[at + DIAGONAL]), math.sqrt(s[at + 2 * DIAGONAL]))
    q = ahead(t, (s[0], s[1], s[2], s[3]), rate_n)
    nominal = q + (s[4], s[5], s[6])
    iron = length((s[MAG_IRON], s[MAG_IRON + 1], s[MAG_IRON + 2]))
    bias = length((s[ACC_BIAS], s[ACC_BIAS + 1], s[ACC_BIAS + 2]))
    seen = (s[DEPARTURE], s[MAG_DELAY], s[STILL], math.sqrt(s[MOTION]), iron, bias)
    return nominal + covariance + sigma + seen


@inline
def flagged(p: Any, s: Any) -> int:
    """Whether the field of the last epoch was all but rejected, the gyroscope clips, acceleration lasts."""
    flags = _MAG_REJECTED if s[DEPARTURE] > REJECTED else 0
    if s[CLIPPING] > 0.0:
        flags |= _GYRO_CLIPPED
    if s[HOLD] > 0.0:
        flags |= _ACC_REJECTED
    return flags
