"""Levenberg–Marquardt iteration, and the robust fit of many points whose noise is not known.

Thousands of points tell their noise themselves, and may hold some that do not belong: Tukey's weights with the
residuals' own scale (an MM estimator; Maronna, Martin, Yohai, Robust Statistics, 2006, chapter 5). A dozen means,
each with a known σ, cannot; see `northdown.calibration._known_noise`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from northdown._validation import FloatArray
from northdown.calibration._prior import Prior

Model = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""From the unknowns (P,) to residuals (M,) and their derivatives (M, P)."""

# Tukey's constant for 95 % efficiency under normal noise.
_TUKEY = 4.685
# From the median of |residual| to σ of normal noise.
_MAD = 1.482602218505602
# Errors that persist from one observation to the next, such as those of an uneven field, do not average out. They are
# taken to have this many independent values over all the data. As a function of direction, what the nine unknowns of
# an ellipsoid can absorb are spherical harmonics of degree 0 to 2; if the degrees seen in the residuals (3 and 4, 16
# coefficients) are half as strong as these, 8 is right.
INDEPENDENT = 8.0

# Steps of the iteration before the scale is found anew, and how often it is at most.
_STEPS, _MOST_ROUNDS = 3, 100
_MOST_STEPS = 60
# Rows of a product of tall matrices at a time.
_ROWS = 2048
_MOST_DAMPING = 1e6
# Residuals are in units in which the unknowns are of order one.
_LARGEST_SCALE = 1e3


class NoFitError(Exception):
    """The iteration ran away: the data do not fix the unknowns."""


@dataclass(frozen=True, eq=False)
class Solution:
    """Result of a fit.

    Attributes
    ----------
    x : (P,) array
        Unknowns.
    covariance : (P, P) array
        Their covariance; infinite where the data say nothing.
    scale : float
        σ of the residuals (robust fit), or the factor by which they exceed the known noise (1 when they do not).
    weights : (M,) array
        Between 0 (left out) and 1.
    persistent : float
        σ of the part of the residuals that persists from one observation to the next.
    condition : float
        Condition number of the weighted derivatives.
    """

    x: FloatArray
    covariance: FloatArray
    scale: float
    weights: FloatArray
    persistent: float
    condition: float

    @property
    def sigma(self) -> FloatArray:
        """1-σ of the unknowns, (P,)."""
        deviation: FloatArray = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        return deviation

    @property
    def used(self) -> float:
        """Share of the residuals whose weight is above 0."""
        return float((self.weights > 0.0).mean())


def robust_scale(residual: FloatArray, unknowns: int = 0) -> float:
    """σ of normal noise from the median of |residual|, corrected for the number of unknowns."""
    n = len(residual)
    correction = math.sqrt(n / (n - unknowns)) if n > unknowns else math.inf
    return _MAD * float(np.median(np.abs(residual))) * correction


Cost = Callable[[FloatArray], tuple[float, FloatArray, FloatArray]]
"""From residuals (M,) to the cost, the weights ψ(r)/r and the slopes ψ′(r)."""


def tukey(scale: float) -> Cost:
    """Tukey's bisquare cost for residuals of that scale."""

    def cost(residual: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        u = np.minimum((residual / (_TUKEY * scale)) ** 2, 1.0)
        inside = 1.0 - u
        # in the unit of ½ Σ r², which it is for small residuals
        value = (_TUKEY * scale) ** 2 / 6.0 * float((1.0 - inside**3).sum())
        return value, inside**2, inside * (1.0 - 5.0 * u)

    return cost


def gram(left: FloatArray, right: FloatArray) -> FloatArray:
    """leftᵀ · right (P, Q) of tall matrices (M, P) and (M, Q).

    In parts that a BLAS library does in one thread: for so few columns several threads take a hundred times as long.
    """
    total = np.zeros((left.shape[1], right.shape[1]))
    for at in range(0, len(left), _ROWS):
        total += left[at : at + _ROWS].T @ right[at : at + _ROWS]
    return total


def curvature_of_cost(jacobian: FloatArray, weight: FloatArray, slope: FloatArray) -> FloatArray:
    """Second derivative of the cost; that of the weighted squares where outliers take its definiteness."""
    plain = gram(jacobian * weight[:, None], jacobian)
    if slope is weight:
        return plain
    true = gram(jacobian * slope[:, None], jacobian)
    return true if np.linalg.eigvalsh(true)[0] > 0.1 * np.linalg.eigvalsh(plain)[0] else plain


def descend(
    model: Model,
    x: FloatArray,
    cost: Cost,
    valid: Callable[[FloatArray], bool] | None = None,
    pull: tuple[FloatArray, FloatArray] | None = None,
    most: int = _MOST_STEPS,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Levenberg–Marquardt to convergence, or for `most` good steps.

    Returns the unknowns, and the residuals and derivatives there. The cost grows by ½ (x − m)ᵀ M (x − m) where `pull`
    is (m, M).
    """
    mean, matrix = pull if pull is not None else (x, np.zeros((len(x), len(x))))

    def total(x: FloatArray, residual: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        value, weight, slope = cost(residual)
        return value + 0.5 * float((x - mean) @ matrix @ (x - mean)), weight, slope

    def derivatives(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        gradient = jacobian.T @ (weight * residual) + matrix @ (x - mean)
        return curvature_of_cost(jacobian, weight, slope) + matrix, gradient

    residual, jacobian = model(x)
    value, weight, slope = total(x, residual)
    hessian, gradient = derivatives(x)
    damping, good = 1e-4, 0
    for _ in range(_MOST_STEPS):
        diagonal = np.diag(hessian) + 1e-12 * max(float(np.trace(hessian)), 1e-300)
        step = -np.linalg.solve(hessian + damping * np.diag(diagonal), gradient)
        if valid is not None and not valid(x + step):
            damping *= 10.0
            if damping > _MOST_DAMPING:
                raise NoFitError
            continue
        new_residual, new_jacobian = model(x + step)
        new_value, weight, slope = total(x + step, new_residual)
        if np.isfinite(new_value) and new_value <= value:
            x, value, residual, jacobian = x + step, new_value, new_residual, new_jacobian
            hessian, gradient = derivatives(x)
            damping, good = max(damping * 0.1, 1e-12), good + 1
        else:
            damping *= 10.0
        # near the minimum, rounding decides whether the cost falls
        if good == most or damping > _MOST_DAMPING or bool((np.abs(step) <= 1e-9 * (1e-2 + np.abs(x))).all()):
            break
    return x, residual, jacobian


def robust(
    prepare: Callable[[FloatArray, float], Model],
    x: FloatArray,
    *,
    floor: float,
    components: int = 1,
    shared: int = 0,
    all_persistent: bool = False,
    valid: Callable[[FloatArray], bool] | None = None,
    prior: Prior | None = None,
    accuracy: float = 1e-7,
) -> Solution:
    """Fit with Tukey's weights; the scale of the noise is found from the residuals.

    Parameters
    ----------
    prepare : callable
        From present unknowns and scale to the model; called anew whenever the scale changes.
    x : (P,) array
        Where to start: its residuals must be small for most of the points.
    floor : float
        Smallest scale, for data without noise.
    components : int
        Number of successive residuals that belong to one observation.
    shared : int
        Number of observations that follow one and share noise with it.
    all_persistent : bool
        Take the residuals for persistent errors altogether, where neighbours do not tell.
    valid : callable
        Whether unknowns are sensible; steps that lead to others are shortened.
    prior : Prior, optional
        What is known beforehand. It weighs as its σ says beside points whose errors are independent.
    accuracy : float
        Relative change of the scale, and a hundredth of it of the unknowns, at which the iteration ends.

    Returns
    -------
    Solution
        The covariance leaves the prior out. It is the sandwich of an M estimator, from the residuals as they are,
        without supposing that they are of equal size; to it is added that of persistent errors.

    Raises
    ------
    NoFitError
        When the iteration ends where even the shortest step leaves what is valid.
    """
    p = len(x)
    scale = max(robust_scale(prepare(x, floor)(x)[0], p), floor)
    for _ in range(_MOST_ROUNDS):
        if not scale < _LARGEST_SCALE:
            raise NoFitError
        pull = None if prior is None else (prior.mean, scale**2 * prior.precision(x))
        before = x
        x, residual, jacobian = descend(prepare(x, scale), x, tukey(scale), valid, pull, _STEPS)
        new = max(robust_scale(residual, p), floor)
        change = max(abs(new / scale - 1.0), 1e2 * float(np.abs(x - before).max()))
        scale = new
        if change <= accuracy:
            break
    _, weight, slope = tukey(scale)(residual)
    persistent = scale if all_persistent else persistence(residual, weight, scale, [components * (1 + shared)])
    plain = gram(jacobian * weight[:, None], jacobian)
    bread = inverse(curvature_of_cost(jacobian, weight, slope))
    covariance = bread
    if np.isfinite(bread).all():
        score = (jacobian * (weight * residual)[:, None]).reshape(-1, components, p).sum(axis=1)
        covariance = bread @ _meat(score, shared) @ bread
        covariance = covariance + (len(residual) * persistent**2 / INDEPENDENT) * inverse(plain)
    return Solution(x, covariance, scale, weight, persistent, condition(plain))


def _meat(score: FloatArray, shared: int) -> FloatArray:
    """Covariance (P, P) of the sum of scores (M, P), of which neighbours up to `shared` apart are correlated."""
    n, p = score.shape
    alone: FloatArray = gram(score, score) * (n / max(n - p, 1))
    if not shared:
        return alone
    total = alone.copy()
    for apart in range(1, shared + 1):
        product = score[:-apart].T @ score[apart:]
        total += product + product.T
    # estimated correlation may exceed what is possible; in units of `alone`, no direction falls below a tenth
    lower = np.linalg.cholesky(alone + 1e-12 * np.trace(alone) * np.eye(p))
    left = np.linalg.solve(lower, total)
    values, vectors = np.linalg.eigh(np.linalg.solve(lower, left.T))
    whole = lower @ vectors
    meat: FloatArray = (whole * np.maximum(values, 0.1)) @ whole.T
    return meat


def persistence(residual: FloatArray, weight: FloatArray, scale: float, lags: Sequence[int]) -> float:
    """σ of the part that an observation's residuals have in common with those of the next ones.

    The mean product of residuals so many apart; 0 where it may be by chance (2 σ of white noise).
    """
    product, total = 0.0, 0.0
    for apart in lags:
        pair = weight[:-apart] * weight[apart:]
        product += float((pair * residual[:-apart] * residual[apart:]).sum())
        total += float(pair.sum())
    if total <= 0.0:
        return 0.0
    common = product / total
    return math.sqrt(common) if common > 2.0 * scale**2 / math.sqrt(total) else 0.0


def inverse(mat: FloatArray) -> FloatArray:
    """Inverse of a symmetric positive matrix; infinite on the diagonal when there is none."""
    scaling = np.sqrt(np.maximum(np.diag(mat), 0.0))
    if not (np.isfinite(mat).all() and (scaling > 0.0).all()):
        return np.diag(np.full(len(mat), np.inf))
    values, vectors = np.linalg.eigh(mat / np.outer(scaling, scaling))
    if values[0] <= 1e-14 * values[-1]:
        return np.diag(np.full(len(mat), np.inf))
    result: FloatArray = (vectors / values) @ vectors.T / np.outer(scaling, scaling)
    return result


def condition(hessian: FloatArray) -> float:
    """Condition number of derivatives whose square is `hessian`."""
    values = np.linalg.eigvalsh(hessian)
    return math.sqrt(float(values[-1]) / float(values[0])) if values[0] > 1e-30 * values[-1] else math.inf
