r"""Fit of noise coefficients to an Allan variance, by generalised least squares of its logarithm.

The model is a sum of five terms with coefficients that cannot be negative,

.. math:: \sigma^2(\tau) = \frac{3 Q^2}{\tau^2} + \frac{N^2}{\tau} + \frac{2\ln 2}{\pi} B^2 + \frac{K^2 \tau}{3}
          + \frac{R^2 \tau^2}{2} .

Estimates at neighbouring τ share the same samples, so they are correlated, by up to 0.7 from octave to octave. Their
covariance follows from the noise itself (`northdown.kernels.allan`); it is found in turns with the coefficients. An
estimate with ν equivalent degrees of freedom is σ² χ²_ν/ν, whose logarithm has the mean ψ(ν/2) − ln(ν/2) and the
variance ψ'(ν/2), with which logarithms are compared.

Intervals are those of the profile likelihood: all values with which the best fit of the other coefficients is not
worse by more than a quantile of χ²₁. A coefficient whose interval reaches zero is not determined. Near such a limit
the profile alone would be too narrow for the *others*, so their intervals also cover the fit without what is not
determined.

Everything here counts time in samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from northdown._validation import BoolArray, FloatArray

QUANTISATION, WHITE, FLICKER, WALK, RAMP = range(5)

_LEAST_FREEDOM = 2.0
"""Estimates with fewer degrees of freedom are left out: χ² of so few says next to nothing."""
_LEAST_SPREAD = 1e-6
"""Smallest relative deviation of an estimate."""
_MISFIT, _GOOD = 1e-3, 0.05
"""Probability of a χ² below which the model is held not to fit, and the one it must reach when clusters are left out:
what is left of a low-pass filter's effect must not show either."""


@dataclass(frozen=True, eq=False)
class AxisFit:
    """Result of a fit, in units of samples.

    Attributes
    ----------
    values, low, high : (5,) arrays
        Squares of the coefficients Q, N, B, K, R of the best fit, and their intervals.
    determined : (5,) array of bool
        Whether the interval excludes zero.
    needed : bool
        Whether some of the slow ones (B, K, R) that are not determined must nevertheless be there, as the fit without
        any of them is worse than chance allows.
    freedom : (T,) array
        Equivalent degrees of freedom of each estimate.
    used : (T,) array of bool
        Estimates in the fit.
    widening : float
        Factor by which the misfit exceeds the noise, at least 1; intervals are wider by about that.
    lag : float
        What a low-pass filter takes away from the curve, as a square like Q's; 0 when no clusters are left out.
    """

    values: FloatArray
    low: FloatArray
    high: FloatArray
    determined: BoolArray
    needed: bool
    freedom: FloatArray
    used: BoolArray
    widening: float
    lag: float


@dataclass(frozen=True, eq=False)
class _Problem:
    """Weighted comparison of logarithms: z (T,) with ln(fixed + design · c)."""

    z: FloatArray
    design: FloatArray
    whiten: FloatArray
    fixed: FloatArray

    def cost(self, c: FloatArray) -> float:
        model = self.fixed + self.design @ c
        if not (model > 0.0).all():
            return float("inf")
        residual = self.whiten @ (self.z - np.log(model))
        return float(residual @ residual)

    def solve(self) -> tuple[FloatArray, float]:
        """Gauss–Newton steps, each a least-squares problem under c ≥ 0. The cost is infinite when nothing fits."""
        from scipy.optimize import nnls

        if not self.design.shape[1]:
            return np.zeros(0), self.cost(np.zeros(0))
        variance = np.exp(self.z)
        relative = self.design / variance[:, None]
        scale = 1.0 / np.linalg.norm(relative, axis=0)
        c: FloatArray = nnls(relative * scale, np.maximum(1.0 - self.fixed / variance, 0.0))[0] * scale
        cost = self.cost(c)
        if not np.isfinite(cost):
            c = np.where(relative.min(axis=0) > 0.0, scale, 0.0)
            cost = self.cost(c)
        if not np.isfinite(cost):
            return c, cost
        for _ in range(50):
            model = self.fixed + self.design @ c
            slope = self.whiten @ (self.design / model[:, None])
            residual = self.whiten @ (self.z - np.log(model))
            scale = 1.0 / np.linalg.norm(slope, axis=0)
            step = nnls(slope * scale, residual + slope @ c)[0] * scale - c
            length = 1.0
            while (new := self.cost(c + length * step)) >= cost and length > 1e-4:
                length *= 0.5
            if new >= cost:
                break
            settled = cost - new < 1e-9 * (1.0 + cost)
            c, cost = c + length * step, new
            if settled:
                break
        return c, cost


def design_matrix(size: Any) -> FloatArray:
    """The five terms (T, 5) of the variance at clusters of `size` samples (T,)."""
    m = np.asarray(size, dtype=np.float64)
    return np.column_stack([3.0 / m**2, 1.0 / m, np.full(len(m), 2.0 * np.log(2.0) / np.pi), m / 3.0, m**2 / 2.0])


def estimate_covariance(size: Any, lengths: Any, values: FloatArray) -> FloatArray:
    """Covariance (T, T) of overlapping Allan variances from runs of `lengths` samples, for noise of those values."""
    from northdown.kernels import allan

    m, n = np.array(size, dtype=np.float64), np.array(lengths, dtype=np.float64)
    count = np.maximum(n[None, :] - 2.0 * m[:, None] + 1.0, 0.0).sum(axis=1)
    rule = np.ascontiguousarray(np.column_stack(np.polynomial.legendre.leggauss(12)))
    covariance = np.zeros((len(m), len(m)))
    allan.covariance()(m, n, count, np.ascontiguousarray(values), rule, allan.PRODUCTS, covariance)
    return covariance


def fit_axis(
    variance: FloatArray, size: Any, lengths: Any, *, terms: Sequence[int], confidence: float, longest_skip: float
) -> AxisFit:
    """Fit the terms to the Allan variance (T,) of one axis.

    `longest_skip`: clusters of up to so many samples may be left out, shortest first, when the model does not fit
    with them: a low-pass filter or interpolation inside the sensor takes away its fastest noise. What a filter of the
    delay T still takes from longer clusters is nearly 3 N² T/(2 τ²) (exactly for one pole), so then the term of
    quantisation counts with the opposite sign.
    """
    from scipy.stats import chi2

    # of size 1, so that no square over- or underflows
    unit = float(variance[0])
    variance = variance / unit
    most_skipped = min(int((np.asarray(size) <= longest_skip).sum()), len(variance) - len(terms) - 2)
    tried: list[tuple[float, _Fitted]] = []
    for skip in range(max(most_skipped, 0) + 1):
        fitted = _fit(variance, size, lengths, list(terms), skip)
        if float(chi2.sf(fitted.cost, fitted.surplus)) >= (_GOOD if skip else _MISFIT):
            tried = [(1.0, fitted)]
            break
        tried.append((fitted.cost / fitted.surplus, fitted))
    # where nothing fits, no more is left out than makes a difference
    limit = 2.0 * min(ratio for ratio, _ in tried)
    ratio, fitted = next((r, f) for r, f in tried if r <= limit)
    fit = _intervals(fitted, max(ratio, 1.0), confidence)
    scaled = {name: getattr(fit, name) * unit for name in ("values", "low", "high", "lag")}
    return replace(fit, **scaled)


@dataclass(frozen=True, eq=False)
class _Fitted:
    problem: _Problem
    terms: list[int]
    lag: float | None
    values: FloatArray
    cost: float
    surplus: int
    freedom: FloatArray
    used: BoolArray


def _fit(variance: FloatArray, size: Any, lengths: Any, terms: list[int], skip: int) -> _Fitted:
    """Coefficients and the covariance of the estimates, in turns until neither changes."""
    from scipy.special import digamma, polygamma

    plain = design_matrix(size)
    design = plain.copy()
    if skip:
        design[:, QUANTISATION] *= -1.0
    # a first guess of the noise: white, from the shortest clusters
    values = np.zeros(5)
    values[WHITE] = variance[skip] * float(size[skip])
    for _ in range(8):
        covariance = estimate_covariance(size, lengths, values)
        model = plain @ values
        # without noise, as on a pure ramp, nothing would be left to weigh with
        spread = np.maximum(np.sqrt(np.diag(covariance)), _LEAST_SPREAD * model)
        freedom = 2.0 * (model / spread) ** 2
        used: BoolArray = freedom >= _LEAST_FREEDOM
        used[:skip] = False
        # never fewer estimates than unknowns
        used[skip : skip + len(terms) + 1] = True
        nu = 0.5 * freedom[used]
        deviation = np.sqrt(polygamma(1, nu))
        correlation = (covariance / np.outer(spread, spread))[used][:, used]
        np.fill_diagonal(correlation, 1.0 + _LEAST_SPREAD)
        root = np.linalg.cholesky(correlation * np.outer(deviation, deviation))
        z = np.log(variance[used]) - (digamma(nu) - np.log(nu))
        problem = _Problem(z, design[used][:, terms], np.linalg.inv(root), np.zeros(int(used.sum())))
        c, cost = problem.solve()
        values = np.zeros(5)
        values[terms] = c
        lag = float(values[QUANTISATION]) if skip else None
        if skip:
            values[QUANTISATION] = 0.0
        if np.abs(np.log(plain @ values / model)).max() < 1e-3:
            break
    surplus = max(int(used.sum()) - int((c > 0.0).sum()), 1)
    return _Fitted(problem, terms, lag, values, cost, surplus, freedom, used)


def _intervals(fitted: _Fitted, ratio: float, confidence: float) -> AxisFit:
    """Profile intervals of all terms, and which of them are determined."""
    from scipy.stats import chi2

    problem, terms = fitted.problem, fitted.terms
    limit = ratio * float(chi2.ppf(confidence, 1))
    values = fitted.values
    low, high = np.zeros(5), np.full(5, np.inf)
    # the lag of a low-pass filter takes part, but is no result
    wanted = [(c, t) for c, t in enumerate(terms) if t != QUANTISATION or fitted.lag is None]
    always = {t for t in terms if t == QUANTISATION and fitted.lag is not None}
    for column, term in wanted:
        low[term], high[term] = _profile(problem, column, values[term], fitted.cost, limit)
    first: BoolArray = low > 0.0
    for column, term in wanted:
        others = [c for c, t in enumerate(terms) if first[t] or t in always or c == column]
        if len(others) == len(terms):
            continue
        reduced = replace(problem, design=problem.design[:, others])
        coefficients, cost = reduced.solve()
        place = others.index(column)
        a, b = _profile(reduced, place, coefficients[place], cost, limit)
        low[term], high[term] = min(low[term], a), max(high[term], b)
    determined: BoolArray = low > 0.0
    slow = [t for t in terms if t > WHITE and not determined[t]]
    needed = False
    if len(slow) > 1:
        without = replace(problem, design=problem.design[:, [c for c, t in enumerate(terms) if t not in slow]])
        needed = without.solve()[1] - fitted.cost > ratio * float(chi2.ppf(confidence, len(slow)))
    widening = float(np.sqrt(ratio))
    lag = 0.0 if fitted.lag is None else fitted.lag
    return AxisFit(values, low, high, determined, needed, fitted.freedom, fitted.used, widening, lag)


def _profile(problem: _Problem, column: int, best: float, cost: float, limit: float) -> tuple[float, float]:
    """Interval of one squared coefficient: where the best fit of the others costs at most `limit` more."""
    from scipy.optimize import brentq

    direction = problem.design[:, column]
    rest = np.delete(problem.design, column, axis=1)

    def excess(root: float) -> float:
        part = replace(problem, design=rest, fixed=direction * root**2)
        return min(part.solve()[1] - cost - limit, 1e6)

    root = float(np.sqrt(best))
    low = 0.0
    if root > 0.0 and excess(0.0) > 0.0:
        low = float(brentq(excess, 0.0, root, xtol=1e-4 * root, rtol=1e-4))
    # what fits under the whole curve is the scale of a coefficient that is itself zero
    scale = float(np.sqrt((np.exp(problem.z) / direction).min()))
    end = max(1.2 * root, 0.1 * scale)
    while excess(end) < 0.0:
        end *= 1.5
    high = float(brentq(excess, root, end, xtol=1e-4 * end, rtol=1e-4))
    return low**2, high**2
