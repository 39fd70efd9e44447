r"""Weights of the headings in the second pass of the calibrating filter's smoother, and the velocities it leaves out.

The weights differ from those of the first pass in two ways.

The departure u of the field is that by the smoothed attitude, and it counts for its mean over the `gate_window` that
follows too: real time knows that a magnet comes near only when it is there.

What a heading misses the smoothed trajectory by is known without the covariance: with the adjoint λ of
`_calibrating_back` before the measurement of noise R is taken back, it is

.. math::

    r = R\, (K^T \lambda + y / S)

A heading with \|r\| above k times the scale s, which is 1.4826 times the median of all \|r\|, gets the variance
R (r / k s)². Its weight then falls with the square of r, as it does in the tail of Student's t: a field that is
wrong by much bears on little, and headings within k s keep their weight.

Velocity is not taken within `AROUND_HOLD` of a hold (see `_calibrating_acceleration`): an acceleration that lasts is
seen some seconds after it has begun, and a vehicle goes on when it no longer accelerates.

Source: weights as in K. L. Lange, R. J. A. Little, J. M. G. Taylor, J. Amer. Stat. Assoc. 84(408) (1989),
doi:10.1080/01621459.1989.10478852; smoothed residuals: J. Durbin, S. J. Koopman, "Time Series Analysis by State Space
Methods", 2nd ed., Oxford 2012, section 4.5.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, Final

import numba
import numpy as np
import numpy.typing as npt

from northdown.estimators._calibrating_field import follow, judge_field
from northdown.estimators._calibrating_forth import MEASURED, MOVE, SEEN
from northdown.estimators._calibrating_layout import (
    FORCE,
    MEAN_DEPARTURE,
    RAW,
    STILL,
    SUMS,
    TAKEN,
    TIME,
    TIME_ACC,
    Terms,
)
from northdown.kernels.jit import compiled
from northdown.kernels.tuples import to_fixed_tuple

Array = npt.NDArray[np.float64]
N_TERMS: Final = len(Terms._fields)

HEADING_TAKEN: Final = MEASURED + 6  # 1/S, 0 where none was taken
HEADING_NOISE: Final = MEASURED + RAW - TAKEN + 6
_FORCE: Final = MOVE + FORCE - TIME
_TIME_ACC: Final = MOVE + TIME_ACC - TIME
RESTING_FORCE: Final = 0.2
"""Horizontal force (m/s²) above which a body near a hold is not at rest, or tilted by 1.2°."""
AROUND_HOLD: Final = 5.0
"""Time (s) before and after a hold in which the body travels, though its acceleration does not show."""
_NORMAL: Final = 1.4826
"""Standard deviation of a normal distribution whose absolute values have the median 1."""
_LEAST: Final = 0.01
"""Least scale of the residuals, as a part of the noise's standard deviation: without noise, nothing stands out."""


def leave_travel(records: Array) -> None:
    """Take no velocity shortly before and after a hold, as the body travels then, too.

    What looks like rest is left out where horizontal force shows the beginning or the end of a smooth acceleration.
    """
    time: Array = np.cumsum(records[:, MOVE])
    seen = time[records[:, SEEN + 6] > 0.0]
    if not len(seen):
        return
    later = np.searchsorted(seen, time)
    before = np.abs(seen[np.minimum(later, len(seen) - 1)] - time) < AROUND_HOLD
    after = np.abs(time - seen[np.maximum(later - 1, 0)]) < AROUND_HOLD
    force = np.hypot(records[:, _FORCE], records[:, _FORCE + 1]) / np.maximum(records[:, _TIME_ACC], 1e-9)
    near = (before | after) & ((records[:, SEEN + 5] == 0.0) | (force > RESTING_FORCE))
    for a in range(3):
        records[near, MEASURED + 2 * a] = 0.0


def reweigh(params: Array, records: Array, seen: Array, most: float) -> None:
    """Set the noise of the headings in `records` by what has been seen of them on the way back.

    `seen` is that of `residuals`; `most` is the k of the docstring.
    """
    judge()(params, records, seen)
    taken = records[:, HEADING_TAKEN] > 0.0
    if not taken.any():
        return
    noise = records[taken, HEADING_NOISE]
    size: Array = np.abs(seen[taken, 0])
    scale = np.maximum(_NORMAL * float(np.median(size)), _LEAST * np.sqrt(noise))
    records[taken, HEADING_NOISE] = noise * np.maximum(size / (most * scale), 1.0) ** 2


def _judge(params: Array, records: Array, seen: Array) -> None:
    """Noise of the headings by the departure of the field that was seen, with the means before and after."""
    p = Terms(*to_fixed_tuple(params, N_TERMS))
    s = np.zeros(SUMS)
    u = np.zeros((len(records), 2))
    for k in range(len(records)):
        row = records[k]
        if row[HEADING_TAKEN] > 0.0:
            s[STILL] = row[SEEN + 5]
            white = row[HEADING_NOISE] / (1.0 + row[SEEN + 4]) ** p.gate_power
            row[HEADING_NOISE] = white
            u[k, 0] = judge_field(p, s, seen[k, 1], seen[k, 2], p.mag / white)
            u[k, 1] = s[MEAN_DEPARTURE]
    mean = 0.0
    for k in range(len(records) - 1, -1, -1):
        row = records[k]
        if row[HEADING_TAKEN] > 0.0:
            mean = follow(p, mean, u[k, 0], p.mag / row[HEADING_NOISE])
            row[HEADING_NOISE] *= (1.0 + max(u[k, 0], u[k, 1], mean)) ** p.gate_power


_VECTOR: Any = numba.float64[::1]
_ARRAY: Any = numba.float64[:, ::1]


@cache
def judge() -> Callable[..., None]:
    """Compiled ``judge(params, records, seen)``."""
    return compiled(_judge, "calibrating-judge", (_VECTOR, _ARRAY, _ARRAY))
