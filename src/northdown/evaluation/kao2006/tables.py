"""Tables 4.2 to 4.13: the filters' own standard deviations after two seconds, published and made again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from northdown._validation import FloatArray
from northdown.evaluation.kao2006 import derived
from northdown.evaluation.kao2006.constants import DERIVED, DOCUMENTED, Constants
from northdown.evaluation.kao2006.published import ENTRIES, SIGMA, TABLES, UNITS, Row
from northdown.evaluation.kao2006.signals import simulate
from northdown.evaluation.kao2006.thesis_filter import ITERATIONS, estimate
from northdown.simulation.seeds import Seed, generator

RUNS = 8
"""Runs of which a figure is the mean: the filters' P depends a little on the noise of a run."""


@dataclass(frozen=True)
class Entry:
    """One number of the tables.

    Parameters
    ----------
    table : str
        K06's number of it.
    row : Row
        Motion, method and filter.
    name, unit : str
        Of the quantity.
    published : float
        As K06 prints it.
    ours : float
        From K06's filter with `DOCUMENTED` constants.
    derived : float
        From northdown's filters, with `DERIVED` ones.
    """

    table: str
    row: Row
    name: str
    unit: str
    published: float
    ours: float
    derived: float

    @property
    def ratio(self) -> float:
        """Ours over published."""
        return self.ours / self.published

    @property
    def derived_ratio(self) -> float:
        """Derived over published."""
        return self.derived / self.published


@dataclass(frozen=True)
class Agreement:
    """How near all entries are together.

    Parameters
    ----------
    rms : float
        Root mean square of ratio − 1.
    worst : float
        Largest factor by which an entry is off, in either direction.
    """

    rms: float
    worst: float


def agreement(ratios: list[float] | FloatArray) -> Agreement:
    """Agreement of some ratios."""
    r = np.asarray(ratios)
    return Agreement(float(np.sqrt(np.mean((r - 1.0) ** 2))), float(np.maximum(r, 1.0 / r).max()))


def thesis_sigma(row: Row, constants: Constants = DOCUMENTED, *, runs: int = RUNS, seed: Seed = 0) -> FloatArray:
    """Standard deviations (10,) of K06's filter at the end, in the order and units of `ENTRIES`."""
    signals = simulate(constants.motion(row.motion), constants, runs, seed)
    mean: FloatArray = estimate(signals, row.method, ITERATIONS[row.filter]).sigma(-1).mean(axis=0)
    return mean


def derived_sigma(row: Row, constants: Constants = DERIVED, *, runs: int = RUNS, seed: Seed = 0) -> FloatArray:
    """The same of northdown's gyro-free filters."""
    signals = simulate(constants.motion(row.motion), constants, runs, seed)
    count = ITERATIONS[row.filter]
    mean: FloatArray = np.mean(
        [derived.sigma_at_end(derived.run(signals, row.method, count, k)) for k in range(runs)], axis=0
    )
    return mean


def sigma_entries(
    seed: Seed = 0, *, runs: int = RUNS, progress: Callable[[str], object] | None = None
) -> tuple[Entry, ...]:
    """All entries of tables 4.2 to 4.13.

    Parameters
    ----------
    seed : int or numpy.random.Generator
        Of the noise.
    runs : int
        Of which each is the mean.
    progress : callable, optional
        Called with the name of each row before it is made.
    """
    rng, entries = generator(seed), []
    for row, published in SIGMA.items():
        if progress:
            progress(" ".join(row))
        ours, other = thesis_sigma(row, runs=runs, seed=rng), derived_sigma(row, runs=runs, seed=rng)
        numbers = np.repeat(TABLES[row.motion, row.method], (3, 4, 3))
        for k, name in enumerate(ENTRIES):
            entries.append(Entry(str(numbers[k]), row, name, UNITS[k], published[k], float(ours[k]), float(other[k])))
    return tuple(entries)
