"""Choice of parameters by the cross-entropy method: the middle of the best of many random points.

A search that goes step by step ends where its first steps lead it. Here points are drawn around a start, log-normal;
the mean and the scatter of the best ones (of the logarithms of their parameters) are where the next are drawn; the
mean of the best of these is the choice. Nothing depends on the order of the parameters, and none is decided by one
point or one trial. Source: R. Y. Rubinstein, D. P. Kroese, "The Cross-Entropy Method", Springer 2004, section 5.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

SCATTER = np.log(2.5)
"""Standard deviation of the first points' parameters about the start: a factor of 2.5 either way."""
FIRST, SECOND = 1500, 300
"""Points of the two rounds."""
BEST_FIRST, BEST_SECOND = 0.05, 0.1
"""Parts of them that count."""

Point = dict[str, float]


def draw(
    centre: np.ndarray, scatter: np.ndarray, n: int, allowed: Callable[[np.ndarray], bool], seed: int
) -> np.ndarray:
    """Points (n, k) around a centre, all logarithms; those that are not allowed are drawn again."""
    rng = np.random.default_rng(seed)
    found: list[np.ndarray] = []
    while len(found) < n:
        point = centre + scatter * rng.standard_normal(len(centre))
        if allowed(point):
            found.append(point)
    return np.array(found)


def best(points: np.ndarray, cost: np.ndarray, part: float) -> tuple[np.ndarray, np.ndarray]:
    """Mean and scatter of the part of the points that cost least."""
    chosen = points[np.argsort(cost, kind="stable")[: max(2, round(part * len(points)))]]
    return chosen.mean(axis=0), chosen.std(axis=0)


class Search:
    """Choices by the same first points for all weights of the trials.

    `costs` gives those of all trials at a point; `allowed` whether the filter takes it.
    """

    def __init__(
        self, start: Point, costs: Callable[[Point], np.ndarray], allowed: Callable[[Point], bool], seed: int
    ) -> None:
        self._seed = seed
        self._names = tuple(start)
        self._costs = costs
        self._allowed = lambda logs: allowed(self.point(logs))
        centre = np.log(list(start.values()))
        self._points = draw(centre, np.full(len(centre), SCATTER), FIRST, self._allowed, seed)
        self._first = np.array([costs(self.point(p)) for p in self._points])

    def point(self, logs: np.ndarray) -> Point:
        return dict(zip(self._names, np.exp(logs).tolist(), strict=True))

    def choose(self, weight: np.ndarray) -> Point:
        """What the weighed sum of the trials' costs leads to."""
        points = draw(*best(self._points, self._first @ weight, BEST_FIRST), SECOND, self._allowed, self._seed)
        cost = np.array([self._costs(self.point(p)) @ weight for p in points])
        return self.point(best(points, cost, BEST_SECOND)[0])
