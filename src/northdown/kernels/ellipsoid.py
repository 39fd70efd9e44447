"""Runs of successive points that are near each other."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from northdown.kernels.jit import compiled

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


def _runs(points: Array, limit: float, label: Indices) -> int:
    """Number each point's run; a run ends when a point is further than the limit from the run's first."""
    run = -1
    fx = 0.0
    fy = 0.0
    fz = 0.0
    for i in range(len(points)):
        x = points[i, 0] - fx
        y = points[i, 1] - fy
        z = points[i, 2] - fz
        if run < 0 or x * x + y * y + z * z > limit * limit:
            run += 1
            fx = points[i, 0]
            fy = points[i, 1]
            fz = points[i, 2]
        label[i] = run
    return run + 1


@cache
def runs() -> Callable[..., Any]:
    """Compiled ``runs(points, limit, label) -> number``; `label` (N,) is written."""
    return compiled(_runs, "ellipsoid-runs", "i8(f8[:,::1], f8, i8[::1])")
