"""The second pass of the calibrating filter's smoother: its epochs once more, with other noise.

The epochs are filtered about the nominal values of the first pass, without a look at the samples. The first pass
corrected its nominal values by d after each epoch, so that of an error m then m − d is left. Headings have the
weights of `_calibrating_weights`, and the bias its own random walk: in the first pass the bias also makes up for what
is not yet known of the calibration. Velocity is left alone for some seconds before and after an acceleration that
lasts.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, Final

import numba
import numpy as np
import numpy.typing as npt

from northdown.estimators._calibrating_epoch import propagate
from northdown.estimators._calibrating_forth import CORRECTION, MEAN, MEASURED, MOVE, keep_taken
from northdown.estimators._calibrating_layout import (
    ATTITUDE,
    BIAS,
    COV,
    ERROR,
    FORCE,
    HEADING_SLOPE,
    MATRIX,
    N_MOVE,
    N_STATE,
    OFFSET,
    RAW,
    REST_TURN,
    SCALED,
    TAKEN,
    TIME,
    TURN,
    VELOCITY,
    WIDENED,
    N,
    Terms,
)
from northdown.estimators._calibrating_take import forget_taken, take_heading, take_rest, take_velocity
from northdown.kernels.jit import compiled, inline
from northdown.kernels.rows import WIDTH
from northdown.kernels.tuples import to_fixed_tuple

Array = npt.NDArray[np.float64]
N_TERMS: Final = len(Terms._fields)


def _again(params: Array, begin: Array, records: Array) -> None:
    """Filter the epochs of `records` again, from the covariance `begin`, with the noise that stands there."""
    p = Terms(*to_fixed_tuple(params, N_TERMS))
    s = np.zeros(N_STATE)
    for j in range(N * WIDTH):
        s[COV + j] = begin[j]
    for k in range(len(records)):
        row = records[k]
        for j in range(N_MOVE):
            s[TIME + j] = row[MOVE + j]
        propagate(p, s, s[TIME])
        _move_mean(s)
        _measure(s, row[MEASURED:])
        for j in range(N):
            s[ERROR + j] -= row[CORRECTION + j]
        for j in range(6):
            row[MEAN + j] = s[ERROR + j]
        keep_taken(s, row)


@inline
def _move_mean(s: Array) -> None:
    """Mean of the error, propagated over an epoch: m ← F m."""
    x, y = s[ERROR], s[ERROR + 1]
    fx, fy, fz = s[FORCE], s[FORCE + 1], s[FORCE + 2]
    for a in range(3):
        change = 0.0
        for j in range(3):
            change += s[TURN + 3 * a + j] * s[ERROR + BIAS + j] + s[REST_TURN + 3 * a + j] * s[ERROR + OFFSET + j]
            for k in range(3):
                change += s[SCALED + 9 * k + 3 * a + j] * s[ERROR + MATRIX + 3 * k + j]
        s[ERROR + ATTITUDE + a] -= change
    s[ERROR + VELOCITY] += fz * y
    s[ERROR + VELOCITY + 1] -= fz * x
    s[ERROR + VELOCITY + 2] += fy * x - fx * y


@inline
def _measure(s: Array, measured: Array) -> None:
    """Take the measurements that the first pass took."""
    raw = RAW - TAKEN
    s[WIDENED] = measured[WIDENED - TAKEN]
    if s[WIDENED] > 0.0:
        for a in range(3):
            s[COV + (BIAS + a) * (WIDTH + 1)] += measured[raw + 2 * (4 + a) + 1] ** 2
    forget_taken(s)
    for a in range(3):
        if measured[2 * a] > 0.0:
            take_velocity(s, a, measured[raw + 2 * a], measured[raw + 2 * a + 1])
    if measured[6] > 0.0:
        for j in range(3):
            s[HEADING_SLOPE + j] = measured[HEADING_SLOPE - TAKEN + j]
        take_heading(s, measured[raw + 6], measured[raw + 7])
    for a in range(3):
        if measured[8 + 2 * a] > 0.0:
            take_rest(s, a, measured[raw + 8 + 2 * a], measured[raw + 9 + 2 * a])


_VECTOR: Any = numba.float64[::1]
_ARRAY: Any = numba.float64[:, ::1]


@cache
def again() -> Callable[..., None]:
    """Compiled ``again(params, begin, records)``."""
    return compiled(_again, "calibrating-again", (_VECTOR, _VECTOR, _ARRAY))
