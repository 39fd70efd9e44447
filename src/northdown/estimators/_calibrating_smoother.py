"""The calibrating filter's smoother: forth, back, and the corrections spread over the samples."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, Final

import numba
import numpy as np
import numpy.typing as npt

from northdown.estimators import _calibrating_acc_bias as acc_bias
from northdown.estimators import _calibrating_hard_iron as hard_iron
from northdown.estimators._calibrating_again import again
from northdown.estimators._calibrating_back import back, residuals
from northdown.estimators._calibrating_forth import (
    AFTER,
    BEFORE,
    BEGIN,
    DIAGNOSTICS,
    END,
    LATE,
    N_RECORD,
    N_START,
    NOMINAL_BIAS,
    RATE_N,
    forth,
)
from northdown.estimators._calibrating_layout import (
    ACC_BIAS,
    ACC_STATE,
    COV,
    FIELD_SQUARE,
    IRON_STATE,
    MAG_IRON,
    UNTRIED,
    Terms,
)
from northdown.estimators._calibrating_result import ahead, covariance_of, doubts
from northdown.estimators._calibrating_weights import leave_travel, reweigh
from northdown.estimators._stream import Stream, all_samples
from northdown.kernels.jit import compiled, inline
from northdown.kernels.quaternion import congruent, conjugate, multiply, normalize, whole_axes
from northdown.kernels.rows import WIDTH
from northdown.kernels.runner import HEADING_UNKNOWN, N_RUNNER, PENDING, TILT_UNKNOWN
from northdown.kernels.so3 import exp, log
from northdown.kernels.stillness import quiet_windows
from northdown.kernels.tuples import to_fixed_tuple
from northdown.recording import Recording

KEPT_IRON: Final = slice(N_RUNNER + MAG_IRON, N_RUNNER + FIELD_SQUARE + 1)
KEPT_BIAS: Final = slice(N_RUNNER + ACC_BIAS, N_RUNNER + UNTRIED)
_FOUND_LATE: Final = 0.3
"""Standard deviation (rad) of the tilt that a late first sample of the accelerometer gives to the beginning."""

Array = npt.NDArray[np.float64]
N_TERMS: Final = len(Terms._fields)
_VECTOR: Any = numba.float64[::1]
_ARRAY: Any = numba.float64[:, ::1]
_PAIR: Any = numba.types.UniTuple(numba.float64, 2)  # type: ignore[no-untyped-call]
_TIMES: Any = numba.types.Array(numba.float64, 1, "C", readonly=True)  # a recording's may be read-only


def smooth(
    stream: Stream,
    recording: Recording,
    first: int,
    window: float,
    rest_gyr: float,
    rest_acc: float,
    rest_rate: float,
    most: float,
    walk: float,
) -> tuple[npt.NDArray[np.uint8], Array]:
    """Flags and output, as the kernel records it, of a recording smoothed by the estimator of a new stream.

    `first` is the number of its first sample, for what is said of bad ones.
    `window`, `rest_gyr`, `rest_acc` and `rest_rate` are the estimator's criteria of rest; the window lies around the
    sample here. `most` and `walk` are those of the second pass, see `_calibrating_again`.
    """
    estimator, work = stream.estimator, stream._work
    kernel, time = estimator.kernel, recording.time
    sensors = all_samples(estimator, recording)[:3]
    n = len(time)
    rate, out, flags = np.empty((n, 4)), np.empty((n, kernel.n_out)), np.zeros(n, np.uint8)
    quiet_windows()(time, *sensors[:2], window, rest_gyr**2, rest_acc**2, rate)
    # An epoch is at least two thirds of its nominal length. Rows that are not needed cost no memory.
    span = (time.max() - time[0]) / work.params[Terms._fields.index("epoch")] if n else 0.0
    records = np.empty((min(n, int(1.5 * span) + 2), N_RECORD))
    state, start = work.state.copy(), np.empty(N_START)

    def go() -> int:
        flags[:] = 0
        code, done, kept = forth(kernel)(
            work.params, work.state, rest_rate, time, *sensors, rate, out, flags, records, start
        )
        if code:
            stream._raise(code, time[done], first + done)
        return int(kept)

    kept = go()
    if work.state[N_RUNNER + ACC_STATE] == acc_bias.FOUND:
        # Once more without the bias of the accelerometer that was found by the end.
        state[KEPT_BIAS] = work.state[KEPT_BIAS]
        state[N_RUNNER + ACC_STATE] = acc_bias.GIVEN_BIAS
        work.state[:] = state
        kept = go()
    if work.state[N_RUNNER + IRON_STATE] == hard_iron.FOUND:
        # Once more without the iron that was found by the end, unless it has not been there from the beginning.
        departure = _mean_departure(out)
        live = state.copy()
        state[KEPT_IRON] = work.state[KEPT_IRON]
        state[N_RUNNER + IRON_STATE] = hard_iron.GIVEN_IRON
        work.state[:] = state
        kept = go()
        if _mean_departure(out) > departure:
            work.state[:] = state = live
            kept = go()
    if start[LATE]:
        # The attitude was found late: once more, with what is now known of the beginning.
        work.state[:] = state
        work.state[PENDING] = flags[-1] & (TILT_UNKNOWN | HEADING_UNKNOWN)
        work.state[N_RUNNER : N_RUNNER + 4] = multiply(tuple(start[:4]), tuple(out[0, :4]))
        tilt = work.state[N_RUNNER + COV :]
        tilt[0] = tilt[WIDTH + 1] = _FOUND_LATE**2
        tilt[2 * WIDTH + 2] = math.pi**2 / 3.0
        kept = go()
    records, smoothed = records[:kept], np.empty((kept, 18))
    if not start[LATE]:
        _second_pass(work.params, start[BEGIN:], records, most, walk)
    back()(records, smoothed)
    doubt = doubts(Terms(*work.params[:N_TERMS]), work.state[N_RUNNER:])
    spread()(work.params, work.turn, doubt, time, records, smoothed, out)
    return flags, out


def _mean_departure(out: Array) -> float:
    """Of the field from its reference, on the way forth: small where the iron taken out is that of the time."""
    return float(np.log1p(out[:, DIAGNOSTICS]).mean())


def _second_pass(params: Array, begin: Array, records: Array, most: float, walk: float) -> None:
    """Filter the epochs again: headings that stand out count less, the bias has its own walk, travel is left out."""
    if most == 0.0 and walk == 1.0:
        return
    if most > 0.0:
        seen = np.empty((len(records), 3))
        residuals()(records, seen)
        reweigh(params, records, seen, most)
    leave_travel(records)
    changed = params.copy()
    changed[Terms._fields.index("walk")] *= walk * walk
    again()(changed, begin, records)


def _spread(
    params: Array, turn: Array, doubt: tuple[float, float], time: Array, records: Array, smoothed: Array, out: Array
) -> None:
    """Correct every sample: between two epochs the correction goes evenly from the one's to the other's."""
    n = len(time)
    p = to_fixed_tuple(params, N_TERMS)
    f = (turn[0], turn[1], turn[2], turn[3])
    axes = whole_axes(f)
    start = 0
    last = np.zeros(18)
    following = np.zeros(18)
    for k in range(len(records)):
        row = records[k]
        end = int(row[END])
        corrected = multiply(
            exp((smoothed[k, 0], smoothed[k, 1], smoothed[k, 2])),
            (row[AFTER], row[AFTER + 1], row[AFTER + 2], row[AFTER + 3]),
        )
        before = log(multiply(corrected, conjugate((row[BEFORE], row[BEFORE + 1], row[BEFORE + 2], row[BEFORE + 3]))))
        for j in range(18):
            following[j] = before[j] if j < 3 else smoothed[k, j]
        for j in range(3):
            following[3 + j] = row[NOMINAL_BIAS + j] + smoothed[k, 3 + j]
        if k == 0:
            for j in range(18):
                last[j] = following[j]
        span = time[end] - time[start]
        first = start if k == 0 else start + 1
        for i in range(first, end + 1):
            u = (time[i] - time[start]) / span if span > 0.0 else 1.0
            _write_sample(p, f, axes, doubt, last, following, u, i == end, corrected, out[i])
        for j in range(3):
            last[j] = smoothed[k, j]
        for j in range(3, 18):
            last[j] = following[j]
        start = end
    for i in range(start if len(records) == 0 else start + 1, n):
        _write_sample(p, f, axes, doubt, last, last, 0.0, False, f, out[i])


@inline
def _write_sample(
    p: Any, f: Any, axes: Any, doubt: Any, a: Array, b: Array, u: float, at_end: bool, end: Any, to: Array
) -> None:
    d = (a[0] + u * (b[0] - a[0]), a[1] + u * (b[1] - a[1]), a[2] + u * (b[2] - a[2]))
    q = end if at_end else multiply(exp(d), (to[0], to[1], to[2], to[3]))
    terms, rate_n = Terms(*p), (to[RATE_N], to[RATE_N + 1], to[RATE_N + 2])
    q = multiply(f, normalize(ahead(terms, q, rate_n)))
    for j in range(4):
        to[j] = q[j]
    for j in range(3):
        to[4 + j] = a[3 + j] + u * (b[3 + j] - a[3 + j])
        to[16 + j] = a[15 + j] + u * (b[15 + j] - a[15 + j])
    upper = (
        a[6] + u * (b[6] - a[6]),
        a[7] + u * (b[7] - a[7]),
        a[8] + u * (b[8] - a[8]),
        a[10] + u * (b[10] - a[10]),
        a[11] + u * (b[11] - a[11]),
        a[14] + u * (b[14] - a[14]),
    )
    c = congruent(axes, covariance_of(terms, upper, rate_n, doubt))
    for j in range(9):
        to[7 + j] = c[j]


@cache
def spread() -> Callable[..., None]:
    """Compiled ``spread(params, turn, doubt, time, records, smoothed, out)``."""
    signature = (_VECTOR, _VECTOR, _PAIR, _TIMES, _ARRAY, _ARRAY, _ARRAY)
    return compiled(_spread, "calibrating-spread", signature)
