"""What the points alone tell of an ellipsoid, when the field is not quite even.

Residuals of a real recording are correlated, and do not average out as sensor noise does. Three things follow.

Time: neighbours share the place, and with it the field. Whole stretches are independent, single samples are not:
the scores of the fit are summed over stretches before they are squared (the sandwich with clusters: Liang, Zeger,
Biometrika 73, 1986).

Gradients: where the field's size has the gradient g, a sensor that turns about a point at a lever arm ρ, both in its
own axes, sees the size change by ρ·g. The part of g along the field's direction u gives g∥ ρ·u, to any fit the same
as hard iron −g∥ρ, in all stretches alike. The part across u is not, and remains in the residuals. As no direction of
the gradient is preferred, what is seen tells how large that may be which is not.

Direction: some residuals come back whenever the sensor points one way. They are what an ellipsoid cannot take
in of a smooth function of direction, whose larger part it did.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from northdown._validation import FloatArray
from northdown.calibration._ellipsoid import PAIRS
from northdown.calibration._solve import INDEPENDENT, curvature_of_cost, gram, inverse, persistence
from northdown.calibration.coverage import BINS, nearest

# Stretches of time whose errors are taken for independent.
_STRETCHES: Final = 25
# An error as a function of direction has spherical harmonics of degree 1 (which pass for hard iron), 2 (soft iron), 3
# and more (which remain in the residuals). With amplitudes that halve from degree to degree the power falls by this.
_FALL: Final = 4.0
# Power of degrees 1 and 2 relative to that of all from 3 on: 1 + 1/4 + 1/16 + … = 4/3 of that of degree 3.
_HARD: Final = _FALL**2 * (1.0 - 1.0 / _FALL)
_SOFT: Final = _HARD / _FALL
# Variance of hard iron, along each axis, that a gradient along the field passes for, per variance of the residuals
# that one across it leaves: with variance σ² of each component of the gradient σ²ρ²/3, and twice that, as two are
# across.
_LEVER: Final = 0.5
# Residuals so many apart are compared to find what persists.
_LAGS: Final = 10


def points_alone(
    unit: FloatArray,
    residual: FloatArray,
    jacobian: FloatArray,
    weight: FloatArray,
    slope: FloatArray,
    scale: float,
) -> FloatArray:
    """Covariance (9, 9) of an ellipsoid's unknowns, without any prior.

    Parameters
    ----------
    unit : (N, 3) array
        Corrected directions, in order of time; of length 1.
    residual, jacobian : (N,) and (N, 9) arrays
        Distances from the ellipsoid and their derivatives, relative to its radius.
    weight, slope : (N,) arrays
        Robust weights ψ(r)/r, and ψ′(r).
    scale : float
        σ of the residuals.

    Returns
    -------
    (9, 9) array
        Infinite where the points say nothing.
    """
    n, p = jacobian.shape
    bread = inverse(curvature_of_cost(jacobian, weight, slope))
    if not np.isfinite(bread).all():
        return bread
    score = jacobian * (weight * residual)[:, None]
    meat: FloatArray = gram(score, score) * (n / max(n - p, 1))
    persistent = persistence(residual, weight, scale, range(1, 1 + _LAGS))
    if persistent > 0.0:
        meat = _at_least(meat, _stretches(score))
    covariance: FloatArray = bread @ meat @ bread
    systematic = with_direction(unit, residual, weight, persistent)
    if systematic > 0.0:
        plain = gram(jacobian * weight[:, None], jacobian)
        seen = (n / INDEPENDENT) * bread @ plain @ bread
        covariance = covariance + systematic * (seen + _unseen())
    covariance[:3, :3] += _LEVER * persistent**2 * np.eye(3)
    return covariance


def _stretches(score: FloatArray) -> FloatArray:
    """Covariance (P, P) of the sum of scores (N, P) whose stretches are independent, each as it may be."""
    n, p = score.shape
    label = np.arange(n) * _STRETCHES // n
    total = np.zeros((_STRETCHES, p))
    np.add.at(total, label, score)
    # the fit takes p degrees of freedom from the stretches
    covariance: FloatArray = total.T @ total * (_STRETCHES / (_STRETCHES - p))
    return covariance


def _at_least(least: FloatArray, mat: FloatArray) -> FloatArray:
    """`mat`, but along no direction smaller than `least`."""
    lower = np.linalg.cholesky(least + 1e-12 * np.trace(least) * np.eye(len(least)))
    left = np.linalg.solve(lower, mat)
    values, vectors = np.linalg.eigh(np.linalg.solve(lower, left.T))
    whole = lower @ vectors
    larger: FloatArray = (whole * np.maximum(values, 1.0)) @ whole.T
    return larger


def with_direction(unit: FloatArray, residual: FloatArray, weight: FloatArray, persistent: float) -> float:
    """Variance of that part of the residuals that comes back with the direction, at another time.

    It is the mean product of residuals within 11° of each other, but of different stretches that aren't neighbours.
    What is beyond chance (2 σ) is certain. What is not, but goes from one residual to the next, may be as well when
    directions did not come back often enough to tell.
    """
    n = len(residual)
    label = nearest(unit) * _STRETCHES + np.arange(n) * _STRETCHES // n
    total = np.bincount(label, weight * residual, BINS * _STRETCHES).reshape(BINS, _STRETCHES)
    count = np.bincount(label, weight, BINS * _STRETCHES).reshape(BINS, _STRETCHES)
    apart = np.abs(np.subtract.outer(np.arange(_STRETCHES), np.arange(_STRETCHES))) > 1
    pairs = float(np.einsum("bi,ij,bj->", count, apart, count))
    if pairs <= 0.0:
        return persistent**2
    common = float(np.einsum("bi,ij,bj->", total, apart, total)) / pairs
    # each product counts twice in the sum
    chance = math.sqrt(2.0 * float(np.einsum("bi,ij,bj->", total**2, apart, total**2))) / pairs
    return max(0.0, common - 2.0 * chance, min(persistent**2, common + chance))


def _unseen() -> FloatArray:
    """Covariance (9, 9) of hard and soft iron that errors of degree 1 and 2 pass for, per variance of the others.

    Of degree 1, −h·u, whose mean square over the sphere is |h|²/3. Of degree 2, uᵀSu with S symmetric and of trace
    0, whose mean square is 2/15 ‖S‖²; isotropic, as no direction is preferred.
    """
    covariance = np.zeros((9, 9))
    covariance[:3, :3] = _HARD * np.eye(3)
    size = _SOFT * 15.0 / 2.0 / 5.0
    for a, (i, j) in enumerate(PAIRS):
        covariance[3 + a, 3 + a] = size * (2.0 / 3.0 if i == j else 0.5)
        for b, (k, m) in enumerate(PAIRS):
            if a != b and i == j and k == m:
                covariance[3 + a, 3 + b] = -size / 3.0
    return covariance
