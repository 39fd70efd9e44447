"""How many errors are within three reported sigmas, for the benchmark of the calibrating filter."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

GRID = {
    "inflation": (1.0, 1.5, 2.0),
    "tilt_sigma": (0.001, 0.002, 0.003, 0.005),
    "heading_sigma": (0.005, 0.01, 0.015, 0.02, 0.03),
    "time_sigma": (0.0005, 0.001, 0.0015, 0.002, 0.0025),
}
"""What the constants of the reported covariance are chosen from."""
WITHIN = (95.0, 99.9)
POOLED = 5
"""How many shares of single trials a pooled one counts for in the choice."""


@dataclasses.dataclass(frozen=True)
class Band:
    """Errors of one estimate, rad, and what its covariance is made of: (N, 3) squares of sigma, one per axis."""

    error: np.ndarray
    filter: np.ndarray
    heading: np.ndarray
    late: np.ndarray

    def variance(self, inflation: float, tilt: float, heading: float, late: float) -> np.ndarray:
        """What is reported with these constants."""
        sum_ = inflation**2 * self.filter + heading**2 * self.heading + late**2 * self.late
        return sum_ + tilt**2 * np.array([1.0, 1.0, 0.0])

    def share(self, *constants: float) -> np.ndarray:
        """Share (%) of samples within three sigmas, per axis."""
        return 100.0 * (self.error**2 < 9.0 * self.variance(*constants)).mean(axis=0)


def words(pair: np.ndarray) -> list[str]:
    return [f"{s[0]:.1f}  {s[1]:.1f}  {s[2]:.1f}" for s in pair]


def count(values: np.ndarray) -> tuple[int, int, int]:
    """How many shares are within, below and above what is asked for."""
    low, high = int((values < WITHIN[0]).sum()), int((values > WITHIN[1]).sum())
    return values.size - low - high, low, high


def pooled(bands: list[list[Band]], values: np.ndarray, groups: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Over all samples of each group of trials, and the mean over all trials."""
    size = np.array([len(pair[0].error) for pair in bands], float)
    found = {name: np.average(values[mask], axis=0, weights=size[mask]) for name, mask in groups.items()}
    return found | {"mean over trials": values.mean(axis=0)}


def chosen_without(bands: list[list[Band]], groups: dict[str, np.ndarray]) -> list[tuple[float, ...]]:
    """For each trial the constants that bring most shares of the other trials within; pooled ones count `POOLED`."""
    thin = [[Band(*(v[::10] for v in dataclasses.astuple(b))) for b in pair] for pair in bands]
    points = list(itertools.product(*GRID.values()))
    shares = np.array([[[b.share(*point) for b in pair] for pair in thin] for point in points])
    chosen = []
    for k in range(len(bands)):
        others = np.arange(len(bands)) != k
        among = [pair for pair, other in zip(thin, others, strict=True) if other]
        left = {name: mask[others] for name, mask in groups.items() if mask[others].any()}
        scores = [
            POOLED * count(np.array(list(pooled(among, v, left).values())))[0] + count(v)[0]
            for v in shares[:, others]
        ]
        chosen.append(points[int(np.argmax(scores))])
    return chosen
