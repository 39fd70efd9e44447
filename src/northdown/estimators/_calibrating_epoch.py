"""The end of an epoch of the calibrating filter: covariance, measurements, correction.

The equations are those of the docstring of `calibrating_ekf`.
"""

from __future__ import annotations

import math
from typing import Any, Final

from northdown.estimators._calibrating_acc_bias import correct_acc_bias
from northdown.estimators._calibrating_acceleration import (
    LOST_WITHIN,
    coasted,
    speed_is_of_rest,
    watch_acceleration,
)
from northdown.estimators._calibrating_field import judge_field
from northdown.estimators._calibrating_hard_iron import correct_iron, keep_iron, turn_sums
from northdown.estimators._calibrating_iron import forget_iron, look_for_iron
from northdown.estimators._calibrating_layout import (
    ACC_SQUARE,
    AGE_MAG,
    ATTITUDE,
    BIAS,
    BLOCK,
    BLOCK_HEAD,
    BLOCKS,
    CLIPPED,
    CLOSED,
    COASTED,
    COUNT_MAG,
    COV,
    DELAY,
    DENSITY,
    DEPARTURE,
    ERROR,
    FIELD,
    FIELD_SLOPE,
    FIELD_SUM,
    FORCE,
    GIVEN,
    GYR_BIAS,
    GYR_MATRIX,
    HEADING_SLOPE,
    IRON_TURNED,
    LAST_FORCE,
    LOST,
    LOW_FORCE,
    MAG_DELAY,
    MATRIX,
    MEAN_DEPARTURE,
    MISSED,
    MOTION,
    N_BLOCK,
    N_BLOCKS,
    NEW_HEADING,
    OFFSET,
    RATE_SQUARE,
    REST_OFFSET,
    REST_TURN,
    SCALED,
    SHIFT,
    SPEED,
    STILL,
    SUMS,
    SUMS_END,
    TIME,
    TIME_ACC,
    TURN,
    UNSEEN,
    VELOCITY,
    WIDENED,
    WORK,
    N,
)
from northdown.estimators._calibrating_take import forget_taken, take_heading, take_rest, take_velocity
from northdown.kernels.jit import inline
from northdown.kernels.quaternion import multiply, normalize, rotate
from northdown.kernels.rows import WIDTH, add_row, copy_row, mirror_row
from northdown.kernels.so3 import exp
from northdown.kernels.stillness import CONTRADICTED, is_near, is_quiet, kind_of_rest, noise_density

LONGEST_FIELD: Final = 1.0
"""The same for the magnetometer: a field seen rarely is worth no more than one seen once a second."""
LARGEST_DELAY: Final = 0.05
REST_GATE: Final = 4.0
"""Sigmas by which an epoch's mean rate may miss that of rest."""
PARALLEL: Final = 1e-6


@inline
def clear_sums(s: Any) -> None:
    """Begin an epoch. What was summed over the last one stays readable until then."""
    for j in range(SUMS, SUMS_END):
        s[j] = 0.0
    s[CLOSED] = 0.0


@inline
def close_epoch(p: Any, s: Any) -> None:
    """End of an epoch: propagate the covariance, take the measurements, correct the nominal values."""
    time = s[TIME]
    s[COASTED], s[LOST] = coasted(s, time), s[MISSED]
    s[NEW_HEADING] = s[IRON_TURNED]
    s[MISSED] = s[IRON_TURNED] = 0.0
    propagate(p, s, time)
    for a in range(3):
        s[SPEED + a] += s[SHIFT + a]
    if s[GIVEN] < 0.0:
        s[STILL] = _rest_in_window(p, s)
    rest = max(p.rest_bias, s[DENSITY]) / time
    s[WIDENED] = 0.0
    still = s[STILL] > 0.0 and speed_is_of_rest(p, s) and (_rate_is_of_rest(s, rest) or _bias_is_contradicted(p, s))
    s[STILL] = 1.0 if still else 0.0
    for j in range(WIDTH):
        s[ERROR + j] = 0.0
    forget_taken(s)
    if s[TIME_ACC] > 0.0:
        r = p.rest_speed if still else p.speed * (1.0 + p.speed_motion * s[MOTION])
        r /= s[TIME_ACC]
        watch_acceleration(p, s, time, r, still)
        correct_acc_bias(p, s, time)
        for a in range(3):
            take_velocity(s, a, r, -s[SPEED + a])
    if s[COUNT_MAG] > 0.0:
        _weigh_heading(p, s)
    if still:
        for a in range(3):
            take_rest(s, a, rest, _rest_innovation(s, a))
    _correct(s)
    s[CLOSED] = 1.0


@inline
def _rest_innovation(s: Any, a: int) -> float:
    """Mean rate of the epoch about one axis, less what it should be at rest."""
    innovation: float = s[BLOCK + 1 + a] / s[BLOCK] - s[GYR_BIAS + a] - s[REST_OFFSET + a]
    return innovation


@inline
def _rate_is_of_rest(s: Any, variance: float) -> bool:
    """Whether the mean rate of the epoch itself agrees with a body at rest, within `REST_GATE` sigmas."""
    if not s[BLOCK] > 0.0:
        return False
    square, total = 0.0, 3.0 * variance
    for a in range(3):
        at = COV + (BIAS + a) * WIDTH
        total += s[at + BIAS + a] + 2.0 * s[at + OFFSET + a] + s[COV + (OFFSET + a) * (WIDTH + 1)]
        square += _rest_innovation(s, a) ** 2
    return bool(3.0 * square < REST_GATE * REST_GATE * total)


@inline
def _bias_is_contradicted(p: Any, s: Any) -> bool:
    """Whether the body is at rest and the bias thought known is wrong, which then gets the variance of its miss."""
    k = 1.0 / s[BLOCK] if s[BLOCK] > 0.0 else 0.0
    mean = (s[BLOCK + 1] * k, s[BLOCK + 2] * k, s[BLOCK + 3] * k)
    if s[STILL] != CONTRADICTED or k == 0.0 or not is_near(mean, (0.0, 0.0, 0.0), p.rest_mean):
        return False
    for a in range(3):
        s[COV + (BIAS + a) * (WIDTH + 1)] += _rest_innovation(s, a) ** 2
    s[WIDENED] = 1.0
    return True


@inline
def propagate(p: Any, s: Any, time: float) -> None:
    """P ← F P Fᵀ + Q over an epoch; only the rows of attitude and velocity of F differ from the identity."""
    fx, fy, fz = s[FORCE], s[FORCE + 1], s[FORCE + 2]
    theta, speed = WORK, WORK + 3 * WIDTH
    row = COV + ATTITUDE * WIDTH
    for a in range(3):
        copy_row(s, speed + a * WIDTH, COV + (VELOCITY + a) * WIDTH)
        copy_row(s, theta + a * WIDTH, row + a * WIDTH)
    add_row(s, speed, fz, row + WIDTH)
    add_row(s, speed + WIDTH, -fz, row)
    add_row(s, speed + 2 * WIDTH, fy, row)
    add_row(s, speed + 2 * WIDTH, -fx, row + WIDTH)
    for a in range(3):
        for j in range(3):
            add_row(s, theta + a * WIDTH, -s[TURN + 3 * a + j], COV + (BIAS + j) * WIDTH)
            if s[REST_TURN] != 0.0 or s[REST_TURN + 1] != 0.0:
                add_row(s, theta + a * WIDTH, -s[REST_TURN + 3 * a + j], COV + (OFFSET + j) * WIDTH)
            for k in range(3):
                add_row(s, theta + a * WIDTH, -s[SCALED + 9 * k + 3 * a + j], COV + (MATRIX + 3 * k + j) * WIDTH)
    # the columns of attitude and velocity, of these six rows only; the others follow by symmetry
    for a in range(6):
        y = WORK + a * WIDTH
        x0, x1 = s[y], s[y + 1]
        s[y + VELOCITY] += fz * x1
        s[y + VELOCITY + 1] -= fz * x0
        s[y + VELOCITY + 2] += fy * x0 - fx * x1
        for c in range(3):
            change = 0.0
            for j in range(3):
                change += s[TURN + 3 * c + j] * s[y + BIAS + j] + s[REST_TURN + 3 * c + j] * s[y + OFFSET + j]
                for k in range(3):
                    change += s[SCALED + 9 * k + 3 * c + j] * s[y + MATRIX + 3 * k + j]
            s[y + c] -= change
    for a in range(3):
        copy_row(s, row + a * WIDTH, theta + a * WIDTH)
        copy_row(s, COV + (VELOCITY + a) * WIDTH, speed + a * WIDTH)
    for a in range(3):
        mirror_row(s, COV, N, ATTITUDE + a)
        mirror_row(s, COV, N, VELOCITY + a)
    angle = p.gyr * time + p.scale * s[RATE_SQUARE] + s[LOST] + s[UNSEEN]
    for a in range(3):
        for b in range(3):
            s[COV + (ATTITUDE + a) * WIDTH + ATTITUDE + b] += s[CLIPPED + a] * s[CLIPPED + b]
    drift = p.velocity * (time + p.velocity_motion * s[ACC_SQUARE])
    drift += s[COASTED]
    forget = time / p.calibration_time
    for a in range(3):
        s[COV + (ATTITUDE + a) * (WIDTH + 1)] += angle
        s[COV + (BIAS + a) * (WIDTH + 1)] += p.walk * time + s[LOST] / LOST_WITHIN**2
        s[COV + (VELOCITY + a) * (WIDTH + 1)] += drift
        s[COV + (OFFSET + a) * (WIDTH + 1)] += p.offset * forget
        for k in range(3):
            s[COV + (MATRIX + 3 * k + a) * (WIDTH + 1)] += p.matrix * forget
    s[COV + (ATTITUDE + 2) * (WIDTH + 1)] += s[NEW_HEADING]
    s[COV + DELAY * (WIDTH + 1)] += p.delay * forget


@inline
def _rest_in_window(p: Any, s: Any) -> float:
    """Kind of rest in the epochs of the last window, this one included; 0 for none."""
    head = (int(s[BLOCK_HEAD]) + 1) % N_BLOCKS
    s[BLOCK_HEAD] = float(head)
    for j in range(N_BLOCK):
        s[BLOCKS + head * N_BLOCK + j] = s[BLOCK + j]
    w = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for k in range(N_BLOCKS):
        at = BLOCKS + ((head - k + N_BLOCKS) % N_BLOCKS) * N_BLOCK
        w = (
            w[0] + s[at],
            w[1] + s[at + 1],
            w[2] + s[at + 2],
            w[3] + s[at + 3],
            w[4] + s[at + 4],
            w[5] + s[at + 5],
            w[6] + s[at + 6],
            w[7] + s[at + 7],
            w[8] + s[at + 8],
            w[9] + s[at + 9],
        )
        if w[0] >= 0.999 * p.rest_window:
            mean = (w[1] / w[0], w[2] / w[0], w[3] / w[0])
            x, y, z = s[REST_OFFSET], s[REST_OFFSET + 1], s[REST_OFFSET + 2]
            bias = (s[GYR_BIAS] + x, s[GYR_BIAS + 1] + y, s[GYR_BIAS + 2] + z)
            s[DENSITY] = noise_density(w)
            return kind_of_rest(mean, bias, p.rest_mean) if is_quiet(w, p.rest_gyr, p.rest_acc) else 0.0
    return 0.0


@inline
def _weigh_heading(p: Any, s: Any) -> None:
    """Take the heading of the epoch's mean field, weighed by how far the field is from its reference."""
    k = 1.0 / s[COUNT_MAG]
    x, y, z = s[FIELD_SUM] * k, s[FIELD_SUM + 1] * k, s[FIELD_SUM + 2] * k
    square = x * x + y * y
    age = min(s[AGE_MAG], LONGEST_FIELD)
    s[AGE_MAG] = 0.0
    if not age > 0.0:
        return
    learnt = s[FIELD + 2] + age
    u = judge_field(p, s, math.sqrt(square), z, age)
    if s[FIELD + 2] != learnt:  # another field has become the reference
        forget_iron(s)
        keep_iron(s)
    # A disturbed field has the norm and the dip of the reference now and then, by chance.
    u = max(u, s[MEAN_DEPARTURE])
    s[DEPARTURE] = u
    if not square > PARALLEL * (square + z * z):
        return
    hx, hy = x * z / square, y * z / square
    lag = (y * s[FIELD_SLOPE] - x * s[FIELD_SLOPE + 1]) * k / square
    s[HEADING_SLOPE], s[HEADING_SLOPE + 1], s[HEADING_SLOPE + 2] = hx, hy, lag
    doubt = (1.0 + u) ** p.gate_power
    if correct_iron(p, s, (x, y, z), age, u):
        return
    look_for_iron(s, (x, y, z), age / doubt)
    take_heading(s, p.mag / age * doubt, math.atan2(y, x))


@inline
def _correct(s: Any) -> None:
    """Put the error into the nominal values."""
    d = (s[ERROR], s[ERROR + 1], s[ERROR + 2])
    turn = exp(d)
    q = normalize(multiply(turn, (s[0], s[1], s[2], s[3])))
    s[0], s[1], s[2], s[3] = q
    for at in (LOW_FORCE, LAST_FORCE):
        s[at], s[at + 1], s[at + 2] = rotate(turn, (s[at], s[at + 1], s[at + 2]))
    for a in range(3):
        s[GYR_BIAS + a] += s[ERROR + BIAS + a]
        s[SPEED + a] += s[ERROR + VELOCITY + a]
        s[REST_OFFSET + a] += s[ERROR + OFFSET + a]
    turn_sums(s, d[2])
    # the error of heading turns the velocity with it
    c, n, x = math.cos(d[2]), math.sin(d[2]), s[SPEED]
    s[SPEED] = c * x - n * s[SPEED + 1]
    s[SPEED + 1] = n * x + c * s[SPEED + 1]
    for j in range(9):
        s[GYR_MATRIX + j] += s[ERROR + MATRIX + j]
    s[MAG_DELAY] = max(-LARGEST_DELAY, min(LARGEST_DELAY, s[MAG_DELAY] + s[ERROR + DELAY]))
