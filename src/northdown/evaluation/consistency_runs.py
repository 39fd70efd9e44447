"""Monte Carlo test of a filter's covariance, on data that are just as its model supposes.

Each run draws a motion, white noise of each sensor, a gyroscope bias and its random walk (or the biases of an
array's accelerometers), and the error of the attitude at the start, all from the distributions that the filter is
told. Turns only, as linear acceleration is not part of the model. What then departs from the χ² distribution is the
filter's own doing.

Errors of one run are correlated over time, so that not samples but runs count as independent: at each time the mean
over runs is compared with χ², and the interval of the overall mean follows from the spread of the runs' means.

Source: Y. Bar-Shalom, X.-R. Li, T. Kirubarajan, Estimation with Applications to Tracking and Navigation, Wiley 2001,
section 5.4, doi:10.1002/0471221279.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from northdown._validation import FloatArray, check_number
from northdown.errors import InputError, expected
from northdown.evaluation.chi_square import check_confidence, chi2_bounds
from northdown.evaluation.consistency import (
    DEGREES_OF_FREEDOM,
    NormalizedError,
    nees,
    within_sigma,
)
from northdown.evaluation.consistency_conditions import Conditions
from northdown.evaluation.matching import find_reference

if TYPE_CHECKING:
    from northdown.estimators import Estimator
    from northdown.orientation import Orientation

# Departure of sigma that nobody needs to care about, though many runs can prove it.
_LITTLE: Final = 0.05


@dataclass(frozen=True, eq=False)
class ConsistencyResult:
    """Figures of `monte_carlo`.

    Parameters
    ----------
    name : str
        The estimator's name.
    runs, seed : int
        How many, and from which seed.
    confidence : float
        Probability of the intervals.
    time : (N,) array
        Time in a run, s.
    mean_nees : (N,) array
        Mean over the runs of the normalised error squared at each time; 3 is right.
    bounds : (float, float)
        Interval in which it lies with probability `confidence` at each time.
    inside : float
        Share of the times at which it does.
    anees : float
        Mean over all runs and times.
    interval : (float, float)
        Interval of the true mean, from the spread of the runs' means: it holds for correlated errors too.
    share : (3, 3) array
        Share of samples within 1, 2, 3 σ (rows) for each axis of NED (columns).
    rms_error, rms_sigma : (3,) arrays
        Root mean square of errors and of predicted σ for each axis, rad.
    bias : (3,) array, optional
        Mean square of the bias error over σ for each body axis, 1 is right; None where no bias is estimated.
    bias_bounds : (float, float), optional
        Interval of it for errors that stay the same throughout a run, so that it is rather too wide.
    mean_nis : (N,) array, optional
        Mean over the runs of the normalised innovation squared per degree of freedom at each time, NaN where nothing
        was measured; 1 is right. None where the filter does not tell its innovations.
    nis_interval : (float, float), optional
        Interval of the true mean over all times, from the spread of the runs' means.
    nis_bounds : (float, float), optional
        Interval in which that mean lies with probability `confidence` if innovations are independent over time, as
        those of a right filter are.
    nis_time_bounds : (float, float), optional
        Interval in which `mean_nis` lies with probability `confidence` at a time with the median number of
        measurements.
    anis : float, optional
        Mean over all runs and times.
    example : NormalizedError
        The first run.
    """

    name: str
    runs: int
    seed: int
    confidence: float
    time: FloatArray
    mean_nees: FloatArray
    bounds: tuple[float, float]
    inside: float
    anees: float
    interval: tuple[float, float]
    share: FloatArray
    rms_error: FloatArray
    rms_sigma: FloatArray
    bias: FloatArray | None
    bias_bounds: tuple[float, float] | None
    mean_nis: FloatArray | None
    nis_interval: tuple[float, float] | None
    nis_bounds: tuple[float, float] | None
    nis_time_bounds: tuple[float, float] | None
    anis: float | None
    example: NormalizedError

    @property
    def consistent(self) -> bool:
        """Whether the interval of the mean NEES holds 3."""
        return self.interval[0] <= DEGREES_OF_FREEDOM <= self.interval[1]

    @property
    def factor(self) -> float:
        """How many times as large the errors are as the covariance says, √(ANEES / 3)."""
        return math.sqrt(self.anees / DEGREES_OF_FREEDOM)

    @property
    def verdict(self) -> str:
        """The result in words.

        A right filter fails the interval by chance once in 1 / (1 − confidence) times, then by little.
        """
        if self.consistent:
            return "consistent: the errors are as large as the covariance says"
        if abs(self.factor - 1.0) < _LITTLE:
            side = "small" if self.factor > 1.0 else "large"
            return f"nearly consistent: sigma is {100.0 * abs(1.0 / self.factor - 1.0):.1f} % too {side}"
        if self.factor > 1.0:
            return f"overconfident by a factor {self.factor:.2f}: the errors are so many times what sigma says"
        return f"too cautious by a factor {1.0 / self.factor:.2f}: sigma is so many times what the errors are"

    def __repr__(self) -> str:
        low, high = self.interval
        return (
            f"<ConsistencyResult {self.name}: {self.runs} runs, mean NEES {self.anees:.3f} "
            f"({low:.3f} to {high:.3f}), {self.verdict.partition(':')[0]}>"
        )


def monte_carlo(
    estimator: type[Estimator],
    runs: int = 50,
    seed: int = 0,
    *,
    conditions: Conditions | None = None,
    parameters: Mapping[str, Any] | None = None,
    confidence: float = 0.95,
    progress: Callable[[int], object] | None = None,
) -> ConsistencyResult:
    """Run a filter on data that are as its model supposes, and compare its errors with its covariance.

    Parameters
    ----------
    estimator : type of Estimator
        A Kalman filter, such as `MEKF`; it is told the noise of `conditions`, and no disturbance weighting.
    runs : int
        Number of runs, 2 or more.
    seed : int
        The same seed gives the same figures.
    conditions : Conditions, optional
        Noise, motion, length and rate.
    parameters : mapping, optional
        Parameters of the estimator that shall be others than `conditions` say: what does a wrong figure do?
    confidence : float
        Probability of the intervals.
    progress : callable, optional
        Called before each run with the number of runs done.

    Returns
    -------
    ConsistencyResult

    Raises
    ------
    InputError
        When the estimator has no covariance, a parameter is unknown to it, or a number is out of range.
    """
    from northdown.simulation.seeds import check_seed

    world = Conditions() if conditions is None else conditions
    filter_ = _check_filter(estimator, world, parameters)
    count = int(check_number("runs", runs, low=2.0))
    check_confidence(confidence)
    biased = any(f.name == "start_bias" for f in fields(filter_))
    tally = _Tally()
    # one seed for each run, and no run of one seed the same as one of another
    seeds = np.random.SeedSequence(check_seed(seed)).generate_state(count, np.uint64)
    for k, number in enumerate(seeds):
        if progress is not None:
            progress(k)
        recording, start = world.draw(int(number), bias=biased, array="array" in filter_.needs)
        # the truth itself, as the mask of the recording would leave out its rests
        result = filter_.run(recording, initial=start)
        tally.add(nees(result, find_reference(recording)), result)
    return tally.result(estimator.name, check_seed(seed), confidence)


def _check_filter(
    estimator: type[Estimator], conditions: Conditions, parameters: Mapping[str, Any] | None
) -> Estimator:
    from northdown.estimators import registry

    if not (isinstance(estimator, type) and "covariance" in getattr(estimator, "outputs", ())):
        able = [n for n, e in registry().items() if "covariance" in e.outputs]
        got = getattr(estimator, "name", None) or repr(estimator)
        raise InputError(expected(f"the class of an estimator with a covariance out of {', '.join(able)}", got))
    known = [f.name for f in fields(estimator)]
    unknown = [name for name in parameters or () if name not in known]
    if unknown:
        raise InputError(
            expected(f"parameters of {estimator.name} out of {', '.join(known)}", ", ".join(map(repr, unknown)))
        )
    return conditions.configured(estimator, parameters)


class _Tally:
    """Sums over runs, so that memory does not grow with their number."""

    def __init__(self) -> None:
        self._first: NormalizedError | None = None
        self._means: list[float] = []
        self._nees: FloatArray = np.zeros(1)
        self._share, self._error, self._sigma, self._bias = np.zeros((3, 3)), np.zeros(3), np.zeros(3), np.zeros(3)
        self._nis_means: list[float] = []
        self._nis: FloatArray = np.zeros(1)
        self._dof: FloatArray = np.zeros(1)

    def add(self, run: NormalizedError, result: Orientation) -> None:
        if self._first is None:
            self._first = run
        self._means.append(float(run.nees.mean()))
        self._nees = self._nees + run.nees
        self._share += within_sigma(run)
        self._error += np.mean(run.error**2, axis=0)
        self._sigma += np.mean(run.sigma**2, axis=0)
        if run.bias is not None:
            self._bias += np.mean(run.bias**2, axis=0)
        if "nis" in result.diagnostics:
            nis, dof = result.diagnostics["nis"], result.diagnostics["nis_dof"]
            self._nis, self._dof = self._nis + nis, self._dof + dof
            self._nis_means.append(float(nis.sum() / dof.sum()))

    def result(self, name: str, seed: int, confidence: float) -> ConsistencyResult:
        from scipy.stats import t

        if self._first is None:
            raise InputError(expected("at least one run", "none"))
        means, runs = np.array(self._means), len(self._means)
        mean_nees: FloatArray = self._nees / runs
        low, high = chi2_bounds(DEGREES_OF_FREEDOM, runs, confidence)
        anees = float(means.mean())
        spread = float(t.ppf(0.5 + 0.5 * confidence, runs - 1)) / math.sqrt(runs)
        half = spread * float(means.std(ddof=1))
        has_bias = self._first.bias is not None
        return ConsistencyResult(
            name=name,
            runs=runs,
            seed=seed,
            confidence=confidence,
            time=self._first.time,
            mean_nees=mean_nees,
            bounds=(low, high),
            inside=float(np.mean((mean_nees >= low) & (mean_nees <= high))),
            anees=anees,
            interval=(anees - half, anees + half),
            share=self._share / runs,
            rms_error=np.sqrt(self._error / runs),
            rms_sigma=np.sqrt(self._sigma / runs),
            bias=self._bias / runs if has_bias else None,
            bias_bounds=chi2_bounds(1, runs, confidence) if has_bias else None,
            example=self._first,
            **self._innovations(spread, confidence),
        )

    def _innovations(self, spread: float, confidence: float) -> dict[str, Any]:
        if not self._nis_means:
            return dict.fromkeys(("mean_nis", "nis_interval", "nis_bounds", "nis_time_bounds", "anis"))
        means = np.array(self._nis_means)
        anis, half = float(means.mean()), spread * float(means.std(ddof=1))
        mean_nis = np.full(len(self._nis), np.nan)
        np.divide(self._nis, self._dof, out=mean_nis, where=self._dof > 0.0)
        at_a_time = float(np.median(self._dof[self._dof > 0.0]))
        return {
            "mean_nis": mean_nis,
            "nis_interval": (anis - half, anis + half),
            "nis_bounds": _bounds_per_degree(float(self._dof.sum()), confidence),
            "nis_time_bounds": _bounds_per_degree(at_a_time, confidence),
            "anis": anis,
        }


def _bounds_per_degree(dof: float, confidence: float) -> tuple[float, float]:
    """Interval of χ² with `dof` degrees of freedom, over their number."""
    low, high = chi2_bounds(dof, 1, confidence)
    return low / dof, high / dof
