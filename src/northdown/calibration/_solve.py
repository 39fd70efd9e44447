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
_INDEPENDENT = 8.0

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


def _tukey(scale: float) -> Cost:
    """Tukey's bisquare cost for residuals of that scale."""

    def cost(residual: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        u = np.minimum((residual / (_TUKEY * scale)) ** 2, 1.0)
        inside = 1.0 - u
        # in the unit of ½ Σ r², which it is for small residuals
        value = (_TUKEY * scale) ** 2 / 6.0 * float((1.0 - inside**3).sum())
        return value, inside**2, inside * (1.0 - 5.0 * u)

    return cost


def _curvature(jacobian: FloatArray, weight: FloatArray, slope: FloatArray) -> FloatArray:
    """Second derivative of the cost; that of the weighted squares where outliers take its definiteness."""
    plain: FloatArray = (jacobian * weight[:, None]).T @ jacobian
    if slope is weight:
        return plain
    true: FloatArray = (jacobian * slope[:, None]).T @ jacobian
    return true if np.linalg.eigvalsh(true)[0] > 0.1 * np.linalg.eigvalsh(plain)[0] else plain


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of the unknowns beforehand: `root` · (x − `mean`) is about 0, each row with its 1-σ `scale`.

    Its tails are those of Student's t with `freedom` degrees of freedom, so that the data may contradict it: what
    they say clearly is hardly shrunk. The largest posterior is found by alternating it with the variance (Lange,
    Little, Taylor, J. Am. Stat. Assoc. 84, 1989).
    """

    mean: FloatArray
    root: FloatArray
    scale: float
    freedom: float
    counts: bool = True
    """Whether it makes the unknowns more certain. One that does not only shrinks them."""

    def precision(self, x: FloatArray) -> FloatArray:
        """Inverse covariance (P, P) at these unknowns."""
        off = self.root @ (x - self.mean)
        variance = (self.freedom * self.scale**2 + float(off @ off)) / (self.freedom + len(off))
        result: FloatArray = self.root.T @ self.root / variance
        return result


def descend(
    model: Model,
    x: FloatArray,
    cost: Cost,
    valid: Callable[[FloatArray], bool] | None = None,
    pull: tuple[FloatArray, FloatArray] | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Levenberg–Marquardt to convergence; returns the unknowns, residuals and derivatives there.

    The cost grows by ½ (x − m)ᵀ M (x − m) where `pull` is (m, M).
    """
    mean, matrix = pull if pull is not None else (x, np.zeros((len(x), len(x))))

    def total(x: FloatArray, residual: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        value, weight, slope = cost(residual)
        return value + 0.5 * float((x - mean) @ matrix @ (x - mean)), weight, slope

    def derivatives(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        gradient = jacobian.T @ (weight * residual) + matrix @ (x - mean)
        return _curvature(jacobian, weight, slope) + matrix, gradient

    residual, jacobian = model(x)
    value, weight, slope = total(x, residual)
    hessian, gradient = derivatives(x)
    damping = 1e-4
    for _ in range(60):
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
            damping = max(damping * 0.1, 1e-12)
        else:
            damping *= 10.0
        # near the minimum, rounding decides whether the cost falls
        if damping > _MOST_DAMPING or bool((np.abs(step) <= 1e-9 * (1e-2 + np.abs(x))).all()):
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
    priors: Sequence[Prior] = (),
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
    priors : sequence of Prior
        What is known beforehand, with one `mean`. It weighs as its σ says beside data whose errors persist.

    Returns
    -------
    Solution
        The covariance is the sandwich of an M estimator, from the residuals as they are, without supposing that they
        are of equal size; to it is added that of persistent errors.

    Raises
    ------
    NoFitError
        When the iteration ends where even the shortest step leaves what is valid.
    """
    n, p = len(prepare(x, floor)(x)[0]), len(x)
    apart = components * (1 + shared)
    scale = max(robust_scale(prepare(x, floor)(x)[0], p), floor)
    pull, noise = np.zeros((p, p)), 0.0
    for _ in range(30):
        if not scale < _LARGEST_SCALE:
            raise NoFitError
        given = (priors[0].mean, pull) if priors else None
        x, residual, jacobian = descend(prepare(x, scale), x, _tukey(scale), valid, given)
        new = max(robust_scale(residual, p), floor)
        settled = abs(new - scale) <= 1e-7 * scale
        scale = new
        _, weight, slope = _tukey(scale)(residual)
        persistent = scale if all_persistent else _persistent(residual, weight, scale, apart)
        # variance of one residual as if they were independent
        noise = scale**2 + n * persistent**2 / _INDEPENDENT
        if priors:
            new_pull = noise * np.sum([prior.precision(x) for prior in priors], axis=0)
            settled = settled and bool(np.abs(new_pull - pull).max() <= 1e-5 * np.abs(new_pull).max())
            pull = new_pull
        if settled:
            break
    plain = (jacobian * weight[:, None]).T @ jacobian
    counted = np.zeros((p, p))
    for prior in priors:
        counted += noise * prior.precision(x) if prior.counts else 0.0
    bread = inverse(_curvature(jacobian, weight, slope) + counted)
    covariance = bread
    if np.isfinite(bread).all():
        score = (jacobian * (weight * residual)[:, None]).reshape(-1, components, p).sum(axis=1)
        covariance = bread @ (_meat(score, shared) + noise * counted) @ bread
        from_errors = bread @ plain @ bread if priors else inverse(plain)
        covariance = covariance + (n * persistent**2 / _INDEPENDENT) * from_errors
    return Solution(x, covariance, scale, weight, persistent, condition(plain))


def _meat(score: FloatArray, shared: int) -> FloatArray:
    """Covariance (P, P) of the sum of scores (M, P), of which neighbours up to `shared` apart are correlated."""
    n, p = score.shape
    alone: FloatArray = score.T @ score * (n / max(n - p, 1))
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


def _persistent(residual: FloatArray, weight: FloatArray, scale: float, apart: int) -> float:
    """σ of the part that an observation's residuals have in common with the next one's.

    The covariance of residuals so many apart, less what it may be by chance (2 σ of white noise).
    """
    if len(residual) <= apart:
        return 0.0
    pair = weight[:-apart] * weight[apart:]
    total = float(pair.sum())
    if total <= 0.0:
        return 0.0
    common = float((pair * residual[:-apart] * residual[apart:]).sum()) / total
    return math.sqrt(max(0.0, common - 2.0 * scale**2 / math.sqrt(total)))


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
