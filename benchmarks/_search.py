"""Choice of parameters by steepest descent on a grid, with no step that one or two trials bring about."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

LEAST_GAIN = 1e-3
"""Least gain for which a step is taken, as a part of the error."""

Point = dict[str, float]


def step(name: str, value: float, direction: int) -> float:
    """Neighbour of a value on the grid 1, 2, 5, 10, …; of the exponent among whole numbers."""
    if name == "gate_power":
        return max(1.0, value + direction)
    grid = [m * 10.0**e for e in range(-7, 5) for m in (1.0, 2.0, 5.0)]
    return grid[int(np.argmin(np.abs(np.log(np.array(grid) / value)))) + direction]


def neighbours(point: Point, allowed: Callable[[Point], bool]) -> list[Point]:
    """Every point one step away in one parameter."""
    found = [point | {name: step(name, point[name], direction)} for name in point for direction in (-1, 1)]
    return [other for other in found if other != point and allowed(other)]


def gain(now: np.ndarray, then: np.ndarray, weight: np.ndarray) -> float:
    """By how much the weighed sum of the trials' costs falls; 0 where that is too little, or not sure enough.

    Sure enough is more than the standard error of the sum over the trials.
    """
    falls = now - then
    total = float(weight @ falls)
    doubt = float(np.linalg.norm(weight * (falls - total / weight.sum())))
    return total if total > max(LEAST_GAIN, doubt) else 0.0


def descend(
    start: Point, costs: Callable[[Point], np.ndarray], weight: np.ndarray, allowed: Callable[[Point], bool]
) -> Point:
    """End of the way from `start` on which each step is, of all that are sure enough, the one that gains most."""
    point, now = dict(start), costs(start)
    while True:
        others = neighbours(point, allowed)
        gains = [gain(now, costs(other), weight) for other in others]
        best = int(np.argmax(gains))
        if gains[best] == 0.0:
            return point
        point, now = others[best], costs(others[best])
