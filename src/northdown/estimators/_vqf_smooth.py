"""VQF over a whole recording: bias, acceleration and heading from past and future.

1. The filter runs forward, and over the recording reversed in time with the sign of the rate changed. The two biases
   are weighted by their inverse covariances. A body is at rest where either finds it so, the field is disturbed
   where both do.
2. With that bias the rate is integrated once more, and specific force in the free frame is low-passed forward and
   then backward, so that nothing is delayed.
3. Inclination is corrected as in the filter, and heading is smoothed by the filter's correction forward, and by the
   same over that result backward.

Between samples of a slower sensor its correction is held; before the first sample it is that of the first.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, Final, TypeAlias

import numba
import numpy as np
import numpy.typing as npt

from northdown.estimators import _vqf_layout as at
from northdown.estimators._vqf_layout import N_PARAMS
from northdown.estimators._vqf_step import PARALLEL, heading_gain, turned
from northdown.kernels.butterworth import SAME_STEP, gains, vector
from northdown.kernels.jit import compiled, inline
from northdown.kernels.quaternion import conjugate, dot, multiply, normalize, rotate, unit
from northdown.kernels.so3 import exp
from northdown.kernels.symmetric import inverse3, product3
from northdown.kernels.tuples import to_fixed_tuple
from northdown.kernels.wahba import arc_to_up

Array: TypeAlias = npt.NDArray[np.float64]
Marks: TypeAlias = npt.NDArray[np.uint8]

N_RECORDED: Final = 15
"""Columns of what the filter records: attitude, bias, its sigma, rest, bound of the sigma, rest of the covariance."""


@inline
def information(row: Any) -> Any:
    """Inverse covariance of the bias from a recorded row."""
    return inverse3((row[7] * row[7], row[12], row[13], row[8] * row[8], row[14], row[9] * row[9]))


@inline
def fuse(ahead: Any, back: Any) -> Any:
    """Bias, its sigma and bound from recorded rows of the same time; in `back` the bias has the other sign."""
    i, j = information(ahead), information(back)
    c = inverse3((i[0] + j[0], i[1] + j[1], i[2] + j[2], i[3] + j[3], i[4] + j[4], i[5] + j[5]))
    a, b = product3(i, (ahead[4], ahead[5], ahead[6])), product3(j, (back[4], back[5], back[6]))
    bias = product3(c, (a[0] - b[0], a[1] - b[1], a[2] - b[2]))
    x, y, z = math.fabs(c[1]), math.fabs(c[2]), math.fabs(c[4])
    bound = math.sqrt(max(c[0] + x + y, c[3] + x + z, c[5] + y + z))
    return bias + (math.sqrt(c[0]), math.sqrt(c[3]), math.sqrt(c[5])), bound


@inline
def row4(a: Array, i: int) -> Any:
    return (a[i, 0], a[i, 1], a[i, 2], a[i, 3])


@inline
def row3(a: Array, i: int) -> Any:
    return (a[i, 0], a[i, 1], a[i, 2])


@inline
def put(a: Array, i: int, values: Any) -> None:
    for j in range(len(values)):
        a[i, j] = values[j]


@inline
def integrate(
    time: Array, gyr: Array, acc: Array, ahead: Array, back: Array, out: Array, force: Array, q: Any
) -> None:
    """Free attitude from q on with the fused bias into `out`, and specific force in its frame into `force`."""
    n = len(time)
    held = (0.0, 0.0, 0.0)
    for i in range(n):
        fused, bound = fuse(to_fixed_tuple(ahead[i], N_RECORDED), to_fixed_tuple(back[n - 1 - i], N_RECORDED))
        rate = row3(gyr, i)
        # a rate that is not there is the last one
        rate = rate if rate[0] + rate[1] + rate[2] == rate[0] + rate[1] + rate[2] else held
        held = rate
        if i > 0:
            dt = time[i] - time[i - 1]
            q = normalize(
                multiply(q, exp((dt * (rate[0] - fused[0]), dt * (rate[1] - fused[1]), dt * (rate[2] - fused[2]))))
            )
        put(out, i, q + fused + (max(ahead[i, 10], back[n - 1 - i, 10]), bound))
        put(force, i, rotate(q, row3(acc, i)))


@inline
def low_pass(p: Any, time: Array, force: Array, back: bool) -> None:
    """The filter's low-pass of specific force, in place; `back` from the last row to the first.

    Forward it begins with means, as the filter does; backward, where its input is smooth, at rest.
    """
    f = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    gain = (0.0, 0.0, 0.0)
    count, begin, last = 0.0, 0.0, 0.0
    for j in range(len(time)):
        i = len(time) - 1 - j if back else j
        u = row3(force, i)
        if not dot(u, u) > 0.0:
            continue
        if count == 0.0:
            begin = last = time[j]
        dt = time[j] - last
        last = time[j]
        count += 1.0
        if count == 1.0 or (not back and last - begin < p[at.ACC_FULL]):
            f = vector((True, 1.0, 1.0 / count, 0.0), f, u)
        elif dt > 0.0:
            gain, ratio = gains(gain, dt, p[at.ACC_OMEGA])
            f = vector((False, ratio, gain[1], gain[2]), f, u)
        put(force, i, (f[0], f[3], f[6]))


@inline
def level_all(force: Array, mag: Array, out: Array, heading: Array) -> Any:
    """Correct the inclination of `out`, and write what the field then says of heading; how many rows had a sample."""
    n = len(out)
    level = (1.0, 0.0, 0.0, 0.0)
    levelled, headed = 0, 0
    for i in range(n):
        u = row3(force, i)
        if dot(u, u) > 0.0:
            level = normalize(multiply(arc_to_up(unit(rotate(level, u))), level))
            if levelled == 0:
                for j in range(i):
                    put(out, j, multiply(level, row4(out, j)))
            levelled += 1
        q = normalize(multiply(level, row4(out, i)))
        put(out, i, q)
        h = rotate(q, row3(mag, i))
        across = h[0] * h[0] + h[1] * h[1]
        heading[i] = math.nan
        if across > PARALLEL * dot(h, h):
            heading[i] = -math.atan2(h[1], h[0])
            headed += 1
    return levelled, headed


@inline
def smooth_heading(p: Any, time: Array, disturbed: Marks, heading: Array, back: bool) -> None:
    """The filter's correction of heading, in place; `back` from the last row to the first."""
    psi, last, rejected, least, k, step, begin = 0.0, math.nan, 0.0, 1.0, 0.0, 0.0, 0.0
    for j in range(len(time)):
        i = len(time) - 1 - j if back else j
        if math.isnan(heading[i]):
            continue
        dt = time[j] - last
        if math.isnan(last):
            psi, dt = heading[i], 0.0
            begin = float(disturbed[i])
        last = time[j]
        if math.fabs(dt - step) > SAME_STEP * dt:
            # the first sample's step, not known then, is taken for the second's
            rejected += begin * dt if step == 0.0 else 0.0
            step = dt
            k = 1.0 - math.exp(-dt / p[at.TAU_MAG])
        gain, least, rejected = heading_gain(p, k, least, rejected, float(disturbed[i]), step if dt > 0.0 else 0.0)
        off = heading[i] - psi
        psi += gain * (off - 2.0 * math.pi * math.floor(off / (2.0 * math.pi) + 0.5))
        heading[i] = psi


@inline
def turn_all(heading: Array, frame: Any, out: Array) -> None:
    """Turn `out` by its headings, those that are there, and then by the constant rotation `frame`."""
    n = len(out)
    psi = 0.0
    for i in range(n - 1, -1, -1):
        psi = heading[i] if not math.isnan(heading[i]) else psi
    for i in range(n):
        psi = heading[i] if not math.isnan(heading[i]) else psi
        out_i = turned((math.cos(0.5 * psi), math.sin(0.5 * psi)), row4(out, i))
        put(out, i, multiply(frame, out_i))


def _smooth(
    params: Array,
    turn: Array,
    time: Array,
    back_time: Array,
    gyr: Array,
    acc: Array,
    mag: Array,
    ahead: Array,
    back: Array,
    disturbed: Marks,
    out: Array,
) -> Any:
    n = len(time)
    p = to_fixed_tuple(params, N_PARAMS)
    frame = to_fixed_tuple(turn, 4)
    force, heading = np.empty((n, 3)), np.empty(n)
    start = normalize(multiply(conjugate(frame), row4(ahead, 0)))
    integrate(time, gyr, acc, ahead, back, out, force, start)
    low_pass(p, time, force, False)
    low_pass(p, back_time, force, True)
    levelled, headed = level_all(force, mag, out, heading)
    smooth_heading(p, time, disturbed, heading, False)
    smooth_heading(p, back_time, disturbed, heading, True)
    turn_all(heading, frame, out)
    return levelled, headed


@cache
def kernel() -> Callable[..., tuple[int, int]]:
    """The compiled loops: ``(params, turn, time, back_time, gyr, acc, mag, ahead, back, disturbed, out)``.

    `turn` is the quaternion from NED to the frame of the result, and `ahead` and `back` are what the filter records
    forward in that frame and, from the last row on, at `back_time`, backward. Written to `out` (N, 12): attitude,
    bias, its sigma, rest, bound of the sigma. Returned: how many samples corrected inclination, and heading.
    """
    times = numba.types.Array(numba.float64, 1, "C", readonly=True)
    rows = numba.types.Array(numba.float64, 2, "C", readonly=True)
    vec, mat = numba.float64[::1], numba.float64[:, ::1]
    return compiled(
        _smooth, "vqf-smooth", (vec, vec, times, times, rows, rows, rows, mat, mat, numba.uint8[::1], mat)
    )
