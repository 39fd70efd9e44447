"""Inertial navigation with its covariance: strapdown integration, zero-velocity and zero-rate updates.

All in NED. The nominal state is (q, p, v, b_a, b_g); the error state, true = nominal + error, has 15 components

======= ============================================ ==================================================
place   error                                        its rate of change
======= ============================================ ==================================================
0 – 2   δp, m                                        δv
3 – 5   δv, m/s                                      δθ × f_n − R δb_a + R w_a
6 – 8   δθ, rad: true R = exp(δθ) R                  −R δb_g − R w_g
9 – 11  δb_a, accelerometer bias, m/s²               random walk
12 – 14 δb_g, gyroscope bias, rad/s                  random walk
======= ============================================ ==================================================

with f_n = R (f_b − b_a) (J. Solà, arXiv:1711.02508, section 7, global angular errors; without the Earth's rotation).

Scheme: a gyroscope sample is the mean rate since the sample before it, q_k = q_{k−1} exp((ω_k − b_g) Δt), which is
exact for it. An accelerometer sample is the specific force at its time. Each is turned by the attitude of its own
time, and the acceleration is linear in between:

    v_k = v_{k−1} + Δt (a_{k−1} + a_k) / 2,    p_k = p_{k−1} + Δt v_{k−1} + Δt² (2 a_{k−1} + a_k) / 6

of second order in Δt, sculling included. `forward` writes down all that the smoother needs, a row for each sample.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from northdown.kernels.jit import compiled, inline
from northdown.kernels.quaternion import Quaternion, Vector, dot, multiply, normalize, rotate
from northdown.kernels.runner import start_tilt
from northdown.kernels.so3 import exp
from northdown.kernels.turn import columns
from northdown.kernels.wahba import has_heading, heading_error, turn_about_down

Array = npt.NDArray[np.float64]

N_ERROR: Final = 15
POSITION: Final = 0
VELOCITY: Final = 3
ATTITUDE: Final = 6
ACC_BIAS: Final = 9
GYR_BIAS: Final = 12

# The state between two calls: the nominal state, the time of the last sample (NaN before the first), its acc.
N_NOMINAL: Final = 16
LAST_TIME: Final = 16
LAST_ACC: Final = 17
N_STATE: Final = 20

# A row of the trace: nominal state; step (Δt, f_n, R by columns); six updates (y / s, 1 / s, gain); covariance.
STEP: Final = 16
UPDATES: Final = 29
N_UPDATE: Final = 2 + N_ERROR
COVARIANCE: Final = UPDATES + 6 * N_UPDATE
N_TRACE: Final = COVARIANCE + N_ERROR * N_ERROR

MOVING: Final = 0
STILL: Final = 1
RESTING: Final = 2


@inline
def transition(x: Any, dt: float, f: Vector, mat: tuple[Vector, Vector, Vector]) -> Any:
    """F x for one error vector, with f = f_n and the columns of mat_nb, both of the middle of the step."""
    tilt, a, g = (x[6], x[7], x[8]), (x[9], x[10], x[11]), (x[12], x[13], x[14])
    cx, cy, cz = mat
    ax = tilt[1] * f[2] - tilt[2] * f[1] - (cx[0] * a[0] + cy[0] * a[1] + cz[0] * a[2])
    ay = tilt[2] * f[0] - tilt[0] * f[2] - (cx[1] * a[0] + cy[1] * a[1] + cz[1] * a[2])
    az = tilt[0] * f[1] - tilt[1] * f[0] - (cx[2] * a[0] + cy[2] * a[1] + cz[2] * a[2])
    h = 0.5 * dt * dt
    return (
        x[0] + dt * x[3] + h * ax,
        x[1] + dt * x[4] + h * ay,
        x[2] + dt * x[5] + h * az,
        x[3] + dt * ax,
        x[4] + dt * ay,
        x[5] + dt * az,
        x[6] - dt * (cx[0] * g[0] + cy[0] * g[1] + cz[0] * g[2]),
        x[7] - dt * (cx[1] * g[0] + cy[1] * g[1] + cz[1] * g[2]),
        x[8] - dt * (cx[2] * g[0] + cy[2] * g[1] + cz[2] * g[2]),
        *a,
        *g,
    )


@inline
def load(x: Any) -> Any:
    """Tuple of an array's first 15 entries."""
    return (x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9], x[10], x[11], x[12], x[13], x[14])


@inline
def store(x: Any, values: Any) -> None:
    """Write 15 values into an array."""
    for i in range(N_ERROR):
        x[i] = values[i]


@inline
def symmetrize(p: Array) -> None:
    """Copy the upper triangle to the lower one, so that rounding does not pull them apart."""
    for i in range(N_ERROR):
        for j in range(i):
            p[i, j] = p[j, i]


@inline
def _propagate(p: Array, c: Any, dt: float, force: Vector, rate: Vector, f: Vector, mat: Any) -> None:
    """P ← F P Fᵀ + Q; c is the tuple of parameters."""
    for j in range(N_ERROR):
        store(p[:, j], transition(load(p[:, j]), dt, f, mat))
    for i in range(N_ERROR):
        store(p[i], transition(load(p[i]), dt, f, mat))
    symmetrize(p)
    q_velocity = (c[1] + c[3] * dot(force, force)) * dt
    q_attitude = (c[2] + c[4] * dot(rate, rate)) * dt
    for i in range(3):
        p[VELOCITY + i, VELOCITY + i] += q_velocity
        p[ATTITUDE + i, ATTITUDE + i] += q_attitude
        p[ACC_BIAS + i, ACC_BIAS + i] += c[5] * dt
        p[GYR_BIAS + i, GYR_BIAS + i] += c[6] * dt


@inline
def _measure(p: Array, d: Array, place: int, value: float, variance: float, row: Array) -> None:
    """Scalar update with the measured error of one component; the correction is added to `d`."""
    inverse = 1.0 / (p[place, place] + variance)
    weighted = (value - d[place]) * inverse
    row[0] = weighted
    row[1] = inverse
    for i in range(N_ERROR):
        row[2 + i] = p[i, place]
    for i in range(N_ERROR):
        d[i] += row[2 + i] * weighted
        k = row[2 + i] * inverse
        for j in range(N_ERROR):
            p[i, j] -= k * row[2 + j]
    for i in range(N_ERROR):
        row[2 + i] *= inverse


@inline
def correct(s: Array, d: Any) -> None:
    """Take an error vector into the nominal state."""
    q = normalize(multiply(exp((d[6], d[7], d[8])), (s[0], s[1], s[2], s[3])))
    for i in range(4):
        s[i] = q[i]
    for i in range(3):
        s[4 + i] += d[POSITION + i]
        s[7 + i] += d[VELOCITY + i]
        s[10 + i] += d[ACC_BIAS + i]
        s[13 + i] += d[GYR_BIAS + i]


@inline
def _advance(s: Array, dt: float, gravity: float, rate: Vector, acc: Any) -> tuple[Vector, Any]:
    """Strapdown step of the nominal state; returns f_n and the columns of mat_nb of the middle of the step."""
    q0 = (s[0], s[1], s[2], s[3])
    half = exp((0.5 * dt * rate[0], 0.5 * dt * rate[1], 0.5 * dt * rate[2]))
    middle = multiply(q0, half)
    q1 = normalize(multiply(middle, half))
    f0 = rotate(q0, (s[LAST_ACC] - s[10], s[LAST_ACC + 1] - s[11], s[LAST_ACC + 2] - s[12]))
    f1 = rotate(q1, (acc[0] - s[10], acc[1] - s[11], acc[2] - s[12]))
    for i in range(4):
        s[i] = q1[i]
    for i in range(3):
        down = gravity if i == 2 else 0.0
        a0, a1 = f0[i] + down, f1[i] + down
        s[4 + i] += dt * (s[7 + i] + dt * (2.0 * a0 + a1) / 6.0)
        s[7 + i] += 0.5 * dt * (a0 + a1)
    return (0.5 * (f0[0] + f1[0]), 0.5 * (f0[1] + f1[1]), 0.5 * (f0[2] + f1[2])), columns(middle)


def _forward(
    params: Array,
    time: Array,
    gyr: Array,
    acc: Array,
    stance: npt.NDArray[np.uint8],
    state: Array,
    cov: Array,
    trace: Array,
) -> None:
    c = (params[0], params[1], params[2], params[3], params[4], params[5], params[6])
    velocity_var, rate_var, correlated = params[7], params[8], params[9]
    d = np.zeros(N_ERROR)
    for k in range(len(time)):
        row = trace[k]
        row[STEP:COVARIANCE] = 0.0
        last = state[LAST_TIME]
        dt = time[k] - last if last == last else 0.0
        if dt > 0.0:
            rate = (gyr[k, 0] - state[13], gyr[k, 1] - state[14], gyr[k, 2] - state[15])
            force = (acc[k, 0] - state[10], acc[k, 1] - state[11], acc[k, 2] - state[12])
            f, mat = _advance(state, dt, c[0], rate, acc[k])
            _propagate(cov, c, dt, force, rate, f, mat)
            row[STEP] = dt
            for i in range(3):
                row[STEP + 1 + i] = f[i]
                for j in range(3):
                    row[STEP + 4 + 3 * j + i] = mat[j][i]
            if stance[k] != MOVING:
                longer = max(1.0, correlated / dt)
                d[:] = 0.0
                for i in range(3):
                    place = UPDATES + i * N_UPDATE
                    update = row[place : place + N_UPDATE]
                    _measure(cov, d, VELOCITY + i, -state[7 + i], velocity_var * longer, update)
                if stance[k] == RESTING:
                    for i in range(3):
                        place = UPDATES + (3 + i) * N_UPDATE
                        update = row[place : place + N_UPDATE]
                        error = gyr[k, i] - state[13 + i]
                        _measure(cov, d, GYR_BIAS + i, error, c[2] / dt + rate_var * longer, update)
                correct(state, d)
        state[LAST_TIME] = time[k]
        for i in range(3):
            state[LAST_ACC + i] = acc[k, i]
        for i in range(N_NOMINAL):
            row[i] = state[i]
        for i in range(N_ERROR):
            for j in range(N_ERROR):
                row[COVARIANCE + i * N_ERROR + j] = cov[i, j]


def _level(acc: Array, mag: Array, out: Array) -> int:
    q: Quaternion = start_tilt((1.0, 0.0, 0.0, 0.0), (acc[0], acc[1], acc[2]))
    m = (mag[0], mag[1], mag[2])
    force = (acc[0], acc[1], acc[2])
    known = has_heading((-force[0], -force[1], -force[2]), m)
    if known:
        q = turn_about_down(heading_error(q, m), q)
    for i in range(4):
        out[i] = q[i]
    return 1 if known and math.isfinite(q[0]) else 0


@cache
def forward() -> Callable[..., None]:
    """Compiled ``forward(params, time, gyr, acc, stance, state, cov, trace)``.

    Goes on from `state` (20,) and `cov` (15, 15), which it changes, over n samples, of which it writes a row each
    into `trace`. `params` are gravity; variance densities of accelerometer and gyroscope, then the squares of their
    relative parts; of their biases' walks; variances of the velocity and of the rate at rest, and the time (s) over
    which these are correlated. `stance` holds MOVING, STILL (zero velocity) or RESTING (zero rate too).
    """
    vectors = "f8[:,::1], f8[:,::1]"
    return compiled(
        _forward, "navigation-forward", f"(f8[::1], f8[::1], {vectors}, u1[::1], f8[::1], f8[:,::1], f8[:,::1])"
    )


@cache
def level() -> Callable[..., int]:
    """Compiled ``level(acc, mag, out)``: attitude (w, x, y, z) in NED from the two; 1 if its heading is known."""
    return compiled(_level, "navigation-level", "(f8[::1], f8[::1], f8[::1])")
