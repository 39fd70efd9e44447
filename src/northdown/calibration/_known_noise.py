"""Least squares for few observations whose noise is known."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from northdown._validation import BoolArray, FloatArray
from northdown.calibration._solve import Cost, Model, Solution, condition, descend, inverse

# Largest share of the observations that may be left out, and how many σ away one must be.
_OUT_SHARE: Final = 0.2
_OUT_SIGMA: Final = 4.0


def _squares(kept: BoolArray) -> Cost:
    """Sum of squares of some of the residuals."""
    weight = kept.astype(np.float64)

    def cost(residual: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        return float((residual[kept] ** 2).sum()), weight, weight

    return cost


def known_noise(
    model: Model, x: FloatArray, groups: FloatArray | None = None, *, may_leave_out: bool = True
) -> Solution:
    """Fit residuals that are already divided by their σ and uncorrelated.

    Parameters
    ----------
    model : callable
        From the unknowns to standardised residuals and derivatives.
    x : (P,) array
        Where to start.
    groups : (M,) array of int, optional
        Residuals of one observation share a number, and are left out together.
    may_leave_out : bool
        Whether observations that contradict the others may be left out.

    Returns
    -------
    Solution
        When the residuals exceed the noise beyond what chance allows (5 %) even then, the covariance grows by
        χ² over its degrees of freedom (Birge's ratio), whose root is `scale`.
    """
    residual, _ = model(x)
    group = np.arange(len(residual)) if groups is None else groups
    kept: BoolArray = np.ones(len(residual), dtype=np.bool_)
    names = np.unique(group)
    out_left = int(_OUT_SHARE * len(names)) if may_leave_out else 0
    while True:
        x, residual, jacobian = descend(model, x, _squares(kept))
        freedom = int(kept.sum()) - len(x)
        square = float((residual[kept] ** 2).sum())
        good = freedom <= 0 or square <= chi2_limit(freedom)
        if good or not out_left:
            break
        sizes = np.array([np.sqrt((residual[(group == g) & kept] ** 2).sum()) for g in names])
        # relative to the others, so that a noise known too small leaves nothing out
        typical = max(1.0, float(np.median(sizes[sizes > 0.0])))
        worst = int(np.argmax(sizes))
        if sizes[worst] <= _OUT_SIGMA * typical or freedom - int((group == names[worst]).sum()) < 3:
            break
        kept = kept & (group != names[worst])
        out_left -= 1
    scale = 1.0 if good else math.sqrt(square / freedom)
    hessian = jacobian[kept].T @ jacobian[kept]
    return Solution(x, inverse(hessian) * scale**2, scale, kept.astype(np.float64), 0.0, condition(hessian))


def chi2_limit(freedom: int) -> float:
    """95 % quantile of χ² (Wilson and Hilferty 1931, good to 1 %)."""
    a = 2.0 / (9.0 * freedom)
    return freedom * (1.0 - a + 1.6449 * math.sqrt(a)) ** 3


def ignored(own: FloatArray, others: FloatArray, weights: FloatArray, usual: float) -> FloatArray:
    """Covariance (P, P) of unknowns from others that were left out of the fit.

    Parameters
    ----------
    own : (M, P) array
        Derivatives of the residuals with respect to the unknowns.
    others : (M, Q) array
        Those with respect to what was left out.
    weights : (M,) array
        Of the residuals.
    usual : float
        1-σ of each that was left out.
    """
    weighted = own * weights[:, None]
    moved = np.linalg.lstsq(weighted.T @ own, weighted.T @ others, rcond=None)[0]
    covariance: FloatArray = usual**2 * moved @ moved.T
    return covariance
