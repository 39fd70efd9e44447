"""The scalar measurements of the calibrating filter: their rows of the gain, and the update.

Each is given by the variance of its noise and by y, what it misses the nominal values by; both are kept, so that the
smoother can take the same measurement once more. What those before it in the epoch have found is in `ERROR`.
"""

from __future__ import annotations

from typing import Any

from northdown.estimators._calibrating_layout import (
    BIAS,
    COV,
    DELAY,
    ERROR,
    GAINS,
    HEADING_SLOPE,
    OFFSET,
    RAW,
    TAKEN,
    VELOCITY,
    N,
)
from northdown.kernels.jit import inline
from northdown.kernels.rows import WIDTH, add_row, copy_row, take_measurement


@inline
def forget_taken(s: Any) -> None:
    """No measurement of this epoch has been taken yet."""
    for k in range(14):
        s[TAKEN + k] = 0.0


@inline
def take_velocity(s: Any, a: int, noise: float, y: float) -> None:
    """Take that the velocity along one axis is zero."""
    gain = GAINS + a * WIDTH
    copy_row(s, gain, COV + (VELOCITY + a) * WIDTH)
    _take(s, a, noise, y, s[gain + VELOCITY + a] + noise, y - s[ERROR + VELOCITY + a])


@inline
def take_heading(s: Any, noise: float, y: float) -> None:
    """Take the heading, whose derivatives are in `HEADING_SLOPE`."""
    hx, hy, lag = s[HEADING_SLOPE], s[HEADING_SLOPE + 1], s[HEADING_SLOPE + 2]
    gain = GAINS + 3 * WIDTH
    for j in range(WIDTH):
        s[gain + j] = -s[COV + 2 * WIDTH + j]
    add_row(s, gain, hx, COV)
    add_row(s, gain, hy, COV + WIDTH)
    add_row(s, gain, lag, COV + DELAY * WIDTH)
    variance = hx * s[gain] + hy * s[gain + 1] - s[gain + 2] + lag * s[gain + DELAY] + noise
    known = hx * s[ERROR] + hy * s[ERROR + 1] - s[ERROR + 2] + lag * s[ERROR + DELAY]
    _take(s, 3, noise, y, variance, y - known)


@inline
def take_rest(s: Any, a: int, noise: float, y: float) -> None:
    """Take the mean rate at rest about one axis."""
    gain = GAINS + (4 + a) * WIDTH
    copy_row(s, gain, COV + (BIAS + a) * WIDTH)
    add_row(s, gain, 1.0, COV + (OFFSET + a) * WIDTH)
    variance = s[gain + BIAS + a] + s[gain + OFFSET + a] + noise
    _take(s, 4 + a, noise, y, variance, y - s[ERROR + BIAS + a] - s[ERROR + OFFSET + a])


@inline
def _take(s: Any, k: int, noise: float, y: float, variance: float, innovation: float) -> None:
    s[RAW + 2 * k] = noise
    s[RAW + 2 * k + 1] = y
    s[TAKEN + 2 * k] = 1.0 / variance
    s[TAKEN + 2 * k + 1] = innovation / variance
    take_measurement(s, COV, N, GAINS + k * WIDTH, ERROR, variance, innovation)
