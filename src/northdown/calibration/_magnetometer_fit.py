"""Sphere and ellipsoid through a magnetometer's samples, robust against disturbed ones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from northdown._validation import FloatArray
from northdown.calibration._ellipsoid import (
    Sphere,
    elements,
    ellipsoid_model,
    ellipsoid_prepare,
    normalised,
    normalised_sigma,
    sphere_prepare,
    start_sphere,
    symmetric,
)
from northdown.calibration._known_noise import ignored
from northdown.calibration._solve import NoFitError, Prior, Solution, robust
from northdown.errors import InputError, expected
from northdown.recording import Recording

# Successive samples within this angle (rad) of each other become one point: lying still must not outvote turning,
# and a mean over 2° falls short of the sphere by 0.01 % only.
_RUN: Final = math.radians(2.0)
HOW: Final = "turn the sensor slowly about all three axes, away from iron, and calibrate again"
FEWEST_SPHERE: Final = 20
FEWEST_ELLIPSOID: Final = 50
# Axes of the ellipsoid that differ by more are no soft iron, but a fit to a flat set of points.
_MOST_FLATTENED: Final = 2.5
# Size relative to the sphere's below which, and above whose inverse, an ellipsoid has run away on a flat set.
_SMALLEST: Final = 0.25
# Smallest scale of residuals relative to the radius, for data without noise.
_FLOOR: Final = 1e-9
# Soft iron (1-σ of each element) that a sensor may have which only hard iron is corrected for.
_USUAL_SOFT_IRON: Final = 0.03
# Degrees of freedom of its distribution: few, so that soft iron of ten times this is believed when the data show it.
_SOFT_FREEDOM: Final = 3.0
# The same of hard iron, relative to the field: of a calibrated sensor it is some %, of a raw one anything.
_USUAL_HARD_IRON: Final = 0.03
_HARD_FREEDOM: Final = 1.0
# Radius of a sphere, relative to the first guess, beyond which it is a plane.
_LARGEST: Final = 20.0


@dataclass(frozen=True, eq=False)
class Fitted:
    """A fit in µT (or the unit at hand)."""

    model: str
    solution: Solution
    offset: FloatArray
    matrix: FloatArray
    offset_sigma: FloatArray
    matrix_sigma: FloatArray
    radius: float
    radius_sigma: float


def gather_points(recordings: Sequence[Recording]) -> tuple[FloatArray, Sphere]:
    """Means over runs of samples from one direction, and a sphere near most of them."""
    from northdown.kernels.ellipsoid import runs

    samples = []
    for r in recordings:
        if r.mag is not None:
            samples.append(r.mag[~np.isnan(r.mag).any(axis=1)])
    everything = np.ascontiguousarray(np.concatenate(samples))
    distinct = len(np.unique(everything, axis=0))
    if distinct < FEWEST_SPHERE:
        got = f"{distinct} different ones"
        raise InputError(expected(f"at least {FEWEST_SPHERE} samples of the magnetometer", got, do=HOW))
    # A constant can be added to any axis: all must stay finite when squared.
    if np.abs(everything).max() > 1e9:
        at = int(np.argmax(np.abs(everything).max(axis=1)))
        raise InputError(expected("a field below 1e9", f"{np.abs(everything).max():.3g}", at=at))
    # For samples all around it is the field's size, and at most twice that.
    extent = float(np.quantile(np.linalg.norm(everything - everything.mean(axis=0), axis=1), 0.99))
    label = np.empty(len(everything), dtype=np.int64)
    number = runs()(everything, _RUN * extent, label)
    size = np.bincount(label, minlength=number)
    points = np.column_stack([np.bincount(label, everything[:, i], number) / size for i in range(3)])
    if len(points) < FEWEST_SPHERE:
        got = f"{len(points)} that are 2° apart"
        raise InputError(expected(f"at least {FEWEST_SPHERE} directions of the field", got, do=HOW))
    return points, start_sphere(points)


def fit_sphere(points: FloatArray, start: Sphere) -> Fitted | None:
    scaled = (points - start.centre) / start.radius
    unknowns = np.array([0.0, 0.0, 0.0, 1.0])
    try:
        solution = robust(
            sphere_prepare(scaled), unknowns, floor=_FLOOR, valid=lambda x: 0.05 < float(x[3]) < _LARGEST
        )
    except NoFitError:
        return None
    centre, size = solution.x[:3], float(solution.x[3])
    if np.isfinite(solution.covariance).all():
        extra = _ignored_soft_iron((scaled - centre) / size, solution.weights) * size**2
        solution = replace(solution, covariance=solution.covariance + extra)
    radius = start.radius * size
    return Fitted(
        "sphere",
        solution,
        start.centre + start.radius * centre,
        np.eye(3),
        start.radius * solution.sigma[:3],
        np.zeros((3, 3)),
        radius,
        start.radius * float(solution.sigma[3]),
    )


def _ignored_soft_iron(points: FloatArray, weights: FloatArray) -> FloatArray:
    """Covariance (4, 4) of centre and radius from soft iron of usual size that a sphere leaves out.

    For directions all around it has no effect on the centre; for those of a small part of the sphere it has.
    """
    unit_sphere = np.concatenate([np.zeros(3), elements(np.eye(3))])
    derivatives = ellipsoid_model(points)(unit_sphere)[1]
    own = np.column_stack([derivatives[:, :3], -np.ones(len(points))])
    return ignored(own, derivatives[:, 3:], weights, _USUAL_SOFT_IRON)


def _is_ellipsoid(x: FloatArray) -> bool:
    values = np.linalg.eigvalsh(symmetric(x[3:]))
    shaped = values[0] > 0.0 and values[2] < _MOST_FLATTENED * values[0]
    return bool(np.isfinite(x).all() and shaped and _SMALLEST < values[1] < 1.0 / _SMALLEST)


def _priors(no_offset: FloatArray) -> tuple[Prior, Prior]:
    """Hard and soft iron of a usual sensor are small; `no_offset` (3,) is the centre without hard iron.

    The six rows for soft iron are the elements of A − ⅓ tr(A) I, those off the diagonal times √2, so that the sum of
    squares is that of all nine elements and does not depend on how the axes lie. Five of them are free.

    Hard iron may be anything, but along an axis that the data say little of it is likely to be as large as along the
    others: of a sensor that was calibrated before, small. What is not known must not spoil that. This does not count
    as knowledge, so that the σ say what the data tell.
    """
    mean = np.concatenate([no_offset, elements(np.eye(3))])
    soft = np.zeros((6, 9))
    soft[:, 3:] = np.diag([1.0, 1.0, 1.0, np.sqrt(2.0), np.sqrt(2.0), np.sqrt(2.0)])
    soft[:3, 3:6] -= 1.0 / 3.0
    return (
        Prior(mean, soft, _USUAL_SOFT_IRON, _SOFT_FREEDOM),
        Prior(mean, np.eye(3, 9), _USUAL_HARD_IRON, _HARD_FREEDOM, counts=False),
    )


def fit_ellipsoid(points: FloatArray, near: Fitted) -> Fitted | None:
    """Ellipsoid with the prior on soft iron; `near` is a fit whose offset and radius are about right."""
    scaled = (points - near.offset) / near.radius
    start = np.concatenate([np.zeros(3), elements(np.eye(3))])
    try:
        solution = robust(
            ellipsoid_prepare(scaled),
            start,
            floor=_FLOOR,
            valid=_is_ellipsoid,
            priors=_priors(-near.offset / near.radius),
        )
    except NoFitError:
        return None
    mat = symmetric(solution.x[3:])
    matrix, mean = normalised(solution.x)
    finite = np.isfinite(solution.covariance).all()
    inverse = np.linalg.inv(mat).astype(np.float64)
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
    )
