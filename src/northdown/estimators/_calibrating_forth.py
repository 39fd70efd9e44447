"""The calibrating filter over a whole recording, keeping what its smoother needs on the way back."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, Final

import numba
import numpy as np
import numpy.typing as npt

from northdown.estimators._calibrating_layout import (
    ACC_BIAS,
    CLOSED,
    COUNT_MAG,
    COV,
    DENSITY,
    DEPARTURE,
    ERROR,
    FIELD_SUM,
    GAINS,
    GIVEN,
    GYR_BIAS,
    HOLD,
    MAG_DELAY,
    MAG_IRON,
    MOTION,
    N_MOVE,
    N_TAKEN,
    RATE,
    REST_OFFSET,
    STILL,
    TAKEN,
    TIME,
    N,
)
from northdown.kernels.jit import compiled, inline
from northdown.kernels.quaternion import conjugate, length, multiply, rotate
from northdown.kernels.rows import WIDTH
from northdown.kernels.runner import (
    MAX_GAP,
    N_RUNNER,
    NOT_FINITE,
    OK,
    PENDING,
    TIME_BACKWARDS,
    Kernel,
    is_attitude,
    make_tick,
)
from northdown.kernels.so3 import exp
from northdown.kernels.stillness import kind_of_rest
from northdown.kernels.tuples import to_fixed_tuple

Array = npt.NDArray[np.float64]

RATE_N: Final = 7
"""Where the rate in navigation axes stands in the output on the way forth; on the way back the covariance does."""
DIAGNOSTICS: Final = 19
"""Where departure of the field, delay, stillness, acceleration, iron and accelerometer bias stand in the output."""

# What is kept of an epoch.
END: Final = 0  # index of its last sample
FRESH: Final = 1  # whether the attitude was found anew in it, so that nothing before bears on it
BEFORE: Final = 2  # attitude before the measurements
AFTER: Final = 6
NOMINAL_BIAS: Final = 10
MOVE: Final = 13  # sums from time and squares to Σ R dt, Σ R r dt, Σ R dt at rest, Σ R a dt
MEASURED: Final = MOVE + N_MOVE  # from 1/S and y/S of seven measurements to their noise
CORRECTION: Final = MEASURED + N_TAKEN  # of the nominal values, by the measurements
MEAN: Final = CORRECTION + N  # error that is left after it, of attitude and bias: that of a second pass
SEEN: Final = MEAN + 6  # sum of the field (NED), its samples, departure by which it was weighed, stillness, hold
KEPT_GAINS: Final = SEEN + 7
KEPT_COV: Final = KEPT_GAINS + 7 * N  # rows of attitude and bias
N_RECORD: Final = KEPT_COV + 6 * N

# What is kept of the beginning.
LATE: Final = 4  # whether the attitude was set from the sensors later than at the first sample
BEGIN: Final = 5  # covariance
N_START: Final = BEGIN + N * WIDTH


_VECTOR: Any = numba.float64[::1]
_ARRAY: Any = numba.float64[:, ::1]
# A recording's arrays may be read-only.
_TIMES: Any = numba.types.Array(numba.float64, 1, "C", readonly=True)
_ROWS: Any = numba.types.Array(numba.float64, 2, "C", readonly=True)


def _make_forth(kernel: Kernel) -> Callable[..., Any]:
    tick = make_tick(kernel)
    n_params = kernel.n_params

    def forth(
        params: Array,
        state: Array,
        limit: float,
        time: Array,
        gyr: Array,
        acc: Array,
        mag: Array,
        rate: Array,
        out: Array,
        flags: npt.NDArray[np.uint8],
        records: Array,
        start: Array,
    ) -> tuple[int, int, int]:
        """Filter; returns code, samples done and epochs kept.

        `rate` is that of `quiet_windows`. `start` (N_START) gets the rotation, as a quaternion, by which the attitude
        was set from the sensors later than at the first sample, whether it was, and the covariance after that sample.
        """
        p = to_fixed_tuple(params, n_params)
        s = state[N_RUNNER:]
        r = (state[PENDING], state[1], state[2], state[3], state[4], state[MAX_GAP])
        epochs = 0
        fresh = True
        for j in range(BEGIN):
            start[j] = 1.0 if j == 0 else 0.0
        for i in range(len(time)):
            dt = time[i] - time[i - 1] if i > 0 else 0.0
            if dt < 0.0:
                return TIME_BACKWARDS, i, epochs
            mean = (rate[i, 0], rate[i, 1], rate[i, 2])
            bias = (s[GYR_BIAS], s[GYR_BIAS + 1], s[GYR_BIAS + 2])
            at_rest = (bias[0] + s[REST_OFFSET], bias[1] + s[REST_OFFSET + 1], bias[2] + s[REST_OFFSET + 2])
            s[GIVEN] = kind_of_rest(mean, at_rest, limit)
            s[DENSITY] = rate[i, 3]
            pending = r[0]
            q = (s[0], s[1], s[2], s[3])
            code, flag, s, r = tick(
                p,
                s,
                r,
                dt,
                (gyr[i, 0], gyr[i, 1], gyr[i, 2]),
                (acc[i, 0], acc[i, 1], acc[i, 2]),
                (mag[i, 0], mag[i, 1], mag[i, 2]),
                (),
            )
            flags[i] = flag
            if code != OK:
                return code, i, epochs
            if not is_attitude(s[0], s[1], s[2], s[3]):
                return NOT_FINITE, i, epochs
            if i == 0:
                for j in range(N * WIDTH):
                    start[BEGIN + j] = s[COV + j]
            for j in range(4):
                out[i, j] = s[j]
            out[i, DIAGNOSTICS] = s[DEPARTURE]
            out[i, DIAGNOSTICS + 1] = s[MAG_DELAY]
            out[i, DIAGNOSTICS + 2] = s[STILL]
            out[i, DIAGNOSTICS + 3] = math.sqrt(s[MOTION])
            out[i, DIAGNOSTICS + 4] = length((s[MAG_IRON], s[MAG_IRON + 1], s[MAG_IRON + 2]))
            out[i, DIAGNOSTICS + 5] = length((s[ACC_BIAS], s[ACC_BIAS + 1], s[ACC_BIAS + 2]))
            rate_n = rotate((s[0], s[1], s[2], s[3]), (s[RATE], s[RATE + 1], s[RATE + 2]))
            for j in range(3):
                out[i, RATE_N + j] = rate_n[j]
            if r[0] != pending:
                fresh = True
                if i > 0:
                    v = ((r[1] - bias[0]) * dt, (r[2] - bias[1]) * dt, (r[3] - bias[2]) * dt)
                    turned = multiply((s[0], s[1], s[2], s[3]), conjugate(multiply(q, exp(v))))
                    turned = multiply(turned, (start[0], start[1], start[2], start[3]))
                    for j in range(4):
                        start[j] = turned[j]
                    start[LATE] = 1.0
            if s[CLOSED] > 0.0 and r[0] == pending:
                _keep(s, i, fresh, records[epochs])
                epochs += 1
                fresh = False
        return OK, len(time), epochs

    return forth


@inline
def _keep(s: Array, i: int, fresh: bool, row: Array) -> None:
    """What the way back needs of the epoch that has just been closed."""
    row[END] = float(i)
    row[FRESH] = 1.0 if fresh else 0.0
    after = (s[0], s[1], s[2], s[3])
    before = multiply(exp((-s[ERROR], -s[ERROR + 1], -s[ERROR + 2])), after)
    for j in range(4):
        row[BEFORE + j] = before[j]
        row[AFTER + j] = after[j]
    for a in range(3):
        row[NOMINAL_BIAS + a] = s[GYR_BIAS + a]
    for j in range(N_MOVE):
        row[MOVE + j] = s[TIME + j]
    for j in range(N):
        row[CORRECTION + j] = s[ERROR + j]
    for j in range(6):
        row[MEAN + j] = 0.0
    for a in range(3):
        row[SEEN + a] = s[FIELD_SUM + a]
    row[SEEN + 3], row[SEEN + 4], row[SEEN + 5], row[SEEN + 6] = s[COUNT_MAG], s[DEPARTURE], s[STILL], s[HOLD]
    keep_taken(s, row)


@inline
def keep_taken(s: Array, row: Array) -> None:
    """The measurements of an epoch, their gains, and the covariance after them."""
    for j in range(N_TAKEN):
        row[MEASURED + j] = s[TAKEN + j]
    for k in range(7):
        for j in range(N):
            row[KEPT_GAINS + k * N + j] = s[GAINS + k * WIDTH + j]
    for k in range(6):
        for j in range(N):
            row[KEPT_COV + k * N + j] = s[COV + k * WIDTH + j]


@cache
def forth(kernel: Kernel) -> Callable[..., tuple[int, int, int]]:
    """Compiled ``forth(params, state, limit, time, gyr, acc, mag, rate, out, flags, records, start)``."""
    signature = (
        *(_VECTOR, _VECTOR, numba.float64),
        *(_TIMES, _ROWS, _ROWS, _ROWS),
        *(_ARRAY, _ARRAY, numba.uint8[::1], _ARRAY, _VECTOR),
    )
    return compiled(_make_forth(kernel), f"{kernel.name}-forth", signature)
