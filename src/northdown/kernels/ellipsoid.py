"""Runs of successive points that are seen from a centre in nearly the same direction."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from northdown.kernels.jit import compiled

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


def _runs(points: Array, centre: Array, cos_limit: float, label: Indices) -> int:
    """Number each point's run; a run ends when the direction is further than the limit from the run's first."""
    run = -1
    fx = 0.0
    fy = 0.0
    fz = 0.0
    for i in range(len(points)):
        x = points[i, 0] - centre[0]
        y = points[i, 1] - centre[1]
        z = points[i, 2] - centre[2]
        size = math.sqrt(x * x + y * y + z * z)
        # also true for a point at the centre, whose direction is NaN
        if run < 0 or not (x * fx + y * fy + z * fz >= cos_limit * size):
            run += 1
            fx = x / size
            fy = y / size
            fz = z / size
        label[i] = run
    return run + 1


@cache
def runs() -> Callable[..., Any]:
    """Compiled ``runs(points, centre, cos_limit, label) -> number``; `label` (N,) is written."""
    return compiled(_runs, "ellipsoid-runs", "i8(f8[:,::1], f8[::1], f8, i8[::1])")
