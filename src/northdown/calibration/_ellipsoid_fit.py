"""Ellipsoid through a magnetometer's points, robust against disturbed ones, with a prior on soft iron."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from northdown._validation import FloatArray
from northdown.calibration._ellipsoid import (
    elements,
    ellipsoid_prepare,
    normalised,
    normalised_sigma,
    symmetric,
)
from northdown.calibration._magnetometer_fit import FLOOR, USUAL_SOFT_IRON, Fitted
from northdown.calibration._prior import Prior
from northdown.calibration._solve import NoFitError, Solution, robust, tukey
from northdown.calibration._uneven import points_alone

# Axes of the ellipsoid that differ by more are no soft iron, but a fit to a flat set of points.
_MOST_FLATTENED: Final = 2.5
# Size relative to the sphere's below which, and above whose inverse, an ellipsoid has run away on a flat set.
_SMALLEST: Final = 0.25
# Degrees of freedom of soft iron's distribution: few, so that ten times the usual is believed when the data show it.
_SOFT_FREEDOM: Final = 3.0
# A sphere of radius 1 about the origin.
_SPHERE: Final = np.concatenate([np.zeros(3), elements(np.eye(3))])
# Most rounds in which the prior's spread and the unknowns follow each other, and the change that ends them.
_ROUNDS: Final = 100
_SETTLED: Final = 1e-10
# Accuracy of a fit, and of one that only tells how it does on points that were left out.
_FINE, _ROUGH = 1e-7, 1e-3
# Spread of soft iron about what it is held at, relative to the residuals.
_HELD: Final = 1e-4


def _is_ellipsoid(x: FloatArray) -> bool:
    values = np.linalg.eigvalsh(symmetric(x[3:]))
    shaped = values[0] > 0.0 and values[2] < _MOST_FLATTENED * values[0]
    return bool(np.isfinite(x).all() and shaped and _SMALLEST < values[1] < 1.0 / _SMALLEST)


def _soft_iron_prior() -> Prior:
    """Soft iron of a usual sensor is small.

    The six rows are the elements of A − ⅓ tr(A) I, those off the diagonal times √2, so that the sum of squares is
    that of all nine elements and does not depend on how the axes lie. Five of them are free.
    """
    root = np.zeros((6, 9))
    root[:, 3:] = np.diag([1.0, 1.0, 1.0, np.sqrt(2.0), np.sqrt(2.0), np.sqrt(2.0)])
    root[:3, 3:6] -= 1.0 / 3.0
    return Prior(_SPHERE, root, USUAL_SOFT_IRON, _SOFT_FREEDOM)


def fit_ellipsoid(points: FloatArray, near: Fitted) -> Fitted | None:
    """Ellipsoid with the prior on soft iron; `near` is a fit whose offset and radius are about right.

    First the prior weighs as if the points' errors were independent, so that it decides only what they say nothing
    of. Then it is weighed against what the points tell when the errors of an uneven field are counted, and hard iron
    is fitted anew. There is no prior on hard iron: of a raw sensor it may be anything, and what is added to all
    samples is found again exactly. The σ are those of the points alone.
    """
    scaled = (points - near.offset) / near.radius
    try:
        solution = _first(scaled)
        alone = _alone(scaled, solution)
        shrink = _shrinkage(solution.x, alone)
        final = _second(scaled, solution, shrink)
    except NoFitError:
        return None
    return _fitted(near, replace(final, covariance=alone), shrink)


def refit_ellipsoid(points: FloatArray, near: Fitted) -> Fitted | None:
    """The same for a part of the points that `near` was fitted to, with its weight of the prior; without σ."""
    scaled = (points - near.offset) / near.radius
    start = np.concatenate([np.zeros(3), elements(near.matrix)])
    try:
        solution = _first(scaled, start, _ROUGH)
        return _fitted(near, _second(scaled, solution, near.shrink, _ROUGH), near.shrink)
    except NoFitError:
        return None


def _first(scaled: FloatArray, start: FloatArray = _SPHERE, accuracy: float = _FINE) -> Solution:
    """What the points tell, the prior on soft iron only where they do not."""
    return robust(
        ellipsoid_prepare(scaled),
        start,
        floor=FLOOR,
        valid=_is_ellipsoid,
        prior=_soft_iron_prior(),
        accuracy=accuracy,
    )


def _second(scaled: FloatArray, solution: Solution, shrink: FloatArray | None, accuracy: float = _FINE) -> Solution:
    """Hard iron and size for soft iron that is shrunk."""
    if shrink is None:
        return solution
    x = _SPHERE + shrink @ (solution.x - _SPHERE)
    held = Prior(x, _soft_iron_prior().root, _HELD * solution.scale, math.inf)
    return robust(ellipsoid_prepare(scaled), x, floor=FLOOR, valid=_is_ellipsoid, prior=held, accuracy=accuracy)


def _shrinkage(x: FloatArray, alone: FloatArray) -> FloatArray | None:
    """Matrix (9, 9) from what the points alone tell to what they and the prior do; none when they tell nothing."""
    if not np.isfinite(alone).all():
        return None
    prior = _soft_iron_prior()
    root, estimate = prior.root, x
    for _ in range(_ROUNDS):
        spread = prior.variance(estimate) * np.eye(len(root))
        gain = alone @ root.T @ np.linalg.inv(root @ alone @ root.T + spread)
        shrink: FloatArray = np.eye(len(x)) - gain @ root
        new = _SPHERE + shrink @ (x - _SPHERE)
        settled = bool(np.abs(new - estimate).max() <= _SETTLED)
        estimate = new
        if settled:
            break
    return shrink


def _alone(scaled: FloatArray, solution: Solution) -> FloatArray:
    """Covariance (9, 9) from the points alone."""
    x = solution.x
    residual, jacobian = ellipsoid_prepare(scaled)(x, solution.scale)(x)
    _, weight, slope = tukey(solution.scale)(residual)
    unit = (scaled - x[:3]) @ symmetric(x[3:])
    return points_alone(unit, residual, jacobian, weight, slope, solution.scale)


def _fitted(near: Fitted, solution: Solution, shrink: FloatArray | None) -> Fitted:
    """The fit in the unit at hand, with a matrix of determinant 1."""
    matrix, mean = normalised(solution.x)
    finite = np.isfinite(solution.covariance).all()
    inverse = np.linalg.inv(symmetric(solution.x[3:])).astype(np.float64)
    # d ln(mean) = −tr(A⁻¹ dA)/3
    derivative = elements(inverse) * np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0]) / 3.0
    variance = float(derivative @ solution.covariance[3:, 3:] @ derivative) if finite else math.inf
    return Fitted(
        "ellipsoid",
        solution,
        near.offset + near.radius * solution.x[:3],
        matrix,
        near.radius * solution.sigma[:3],
        normalised_sigma(solution.x, solution.covariance) if finite else np.full((3, 3), np.inf),
        near.radius * mean,
        near.radius * mean * math.sqrt(max(variance, 0.0)),
        shrink,
    )
