"""Whether a body lies still: over a window the sensors hardly scatter, and the gyroscope's mean is near its bias.

Statistics are kept in blocks of (time, Σ r dt, Σ r·r dt, Σ a dt, Σ a·a dt, samples), r the rate and a the specific
force, so that a window is a sum of blocks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, Final

import numba
import numpy as np
import numpy.typing as npt

from northdown.kernels.jit import compiled, inline

Array = npt.NDArray[np.float64]

# A recording's arrays may be read-only.
_TIMES: Any = numba.types.Array(numba.float64, 1, "C", readonly=True)
_ROWS: Any = numba.types.Array(numba.float64, 2, "C", readonly=True)

CONTRADICTED: Final = 2.0
"""Kind of rest in which the gyroscope reads nearly zero, so that the bias held to be known must be wrong."""
SAMPLES: Final = 10.0
"""A window of fewer samples says nothing."""


@inline
def add_to_block(s: Any, at: int, dt: float, rate: Any, force: Any) -> None:
    """Add one sample of both sensors that stands for `dt` to the block at `at`."""
    s[at] += dt
    s[at + 1] += dt * rate[0]
    s[at + 2] += dt * rate[1]
    s[at + 3] += dt * rate[2]
    s[at + 4] += dt * (rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2])
    s[at + 5] += dt * force[0]
    s[at + 6] += dt * force[1]
    s[at + 7] += dt * force[2]
    s[at + 8] += dt * (force[0] * force[0] + force[1] * force[1] + force[2] * force[2])
    s[at + 9] += 1.0


@inline
def is_quiet(block: Any, rate_square: float, force_square: float) -> bool:
    """Whether both sensors scatter by less than the given variances, summed over the axes, in a window (a tuple)."""
    time, gx, gy, gz, gg, ax, ay, az, aa, samples = block
    if samples < SAMPLES or not time > 0.0:
        return False
    k = 1.0 / time
    gx, gy, gz = gx * k, gy * k, gz * k
    ax, ay, az = ax * k, ay * k, az * k
    quiet: bool = (
        max(gg * k - (gx * gx + gy * gy + gz * gz), 0.0) < rate_square
        and max(aa * k - (ax * ax + ay * ay + az * az), 0.0) < force_square
    )
    return quiet


@inline
def noise_density(block: Any) -> float:
    """Spectral density of the rate's noise, mean of the axes, from its scatter in a window, as if it were white."""
    time, gx, gy, gz, gg, _, _, _, _, samples = block
    if samples < SAMPLES or not time > 0.0:
        return 0.0
    variance: float = gg / time - (gx * gx + gy * gy + gz * gz) / (time * time)
    density: float = max(variance, 0.0) / 3.0 * time / samples
    return density


@inline
def is_near(mean: Any, bias: Any, limit: float) -> bool:
    """Whether a mean rate is within `limit` of the bias."""
    x, y, z = mean[0] - bias[0], mean[1] - bias[1], mean[2] - bias[2]
    near: bool = x * x + y * y + z * z < limit * limit
    return near


@inline
def kind_of_rest(mean: Any, bias: Any, limit: float) -> float:
    """What the mean rate of a quiet window is: 1 near the bias, `CONTRADICTED` near zero instead, 0 a steady turn."""
    if is_near(mean, bias, limit):
        return 1.0
    return CONTRADICTED if is_near(mean, (0.0, 0.0, 0.0), limit) else 0.0


# Larger values would spoil sums from which they are later taken away again.
_MOST_RATE: Final = 100.0
_MOST_FORCE: Final = 1000.0


def _quiet_windows(
    time: Array, gyr: Array, acc: Array, window: float, rate_square: float, force_square: float, rate: Array
) -> None:
    """Mean rate and its noise density over the window around each sample, NaN where not quiet, to `rate` (N, 4)."""
    n = len(time)
    sums = np.zeros(10)
    start = stop = 0
    for i in range(n):
        while stop < n and time[stop] <= time[i] + 0.5 * window:
            _count(sums, 1.0, time, gyr, acc, stop)
            stop += 1
        while time[start] < time[i] - 0.5 * window:
            _count(sums, -1.0, time, gyr, acc, start)
            start += 1
        first = (sums[0], sums[1], sums[2], sums[3], sums[4])
        block = first + (sums[5], sums[6], sums[7], sums[8], sums[9])
        quiet = is_quiet(block, rate_square, force_square)
        for a in range(3):
            rate[i, a] = sums[1 + a] / sums[0] if quiet else math.nan
        rate[i, 3] = noise_density(block)


@inline
def _count(sums: Array, sign: float, time: Array, gyr: Array, acc: Array, i: int) -> None:
    """Add a sample to the sums, or take it away."""
    dt = time[i] - time[i - 1] if i > 0 else 0.0
    g = (gyr[i, 0], gyr[i, 1], gyr[i, 2])
    a = (acc[i, 0], acc[i, 1], acc[i, 2])
    if math.isnan(g[0] + g[1] + g[2] + a[0] + a[1] + a[2]):
        return
    g = (_limit(g[0], _MOST_RATE), _limit(g[1], _MOST_RATE), _limit(g[2], _MOST_RATE))
    a = (_limit(a[0], _MOST_FORCE), _limit(a[1], _MOST_FORCE), _limit(a[2], _MOST_FORCE))
    add_to_block(sums, 0, sign * dt, g, a)
    sums[9] += sign - 1.0


@inline
def _limit(x: float, most: float) -> float:
    return max(-most, min(most, x))


@cache
def quiet_windows() -> Callable[..., None]:
    """Compiled ``quiet_windows(time, gyr, acc, window, rate_square, force_square, rate)``."""
    return compiled(
        _quiet_windows,
        "quiet-windows",
        (_TIMES, _ROWS, _ROWS, numba.float64, numba.float64, numba.float64, numba.float64[:, ::1]),
    )
