"""Points of a magnetometer's samples, and the sphere through them, robust against disturbed ones."""

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
    sphere_prepare,
    start_sphere,
)
from northdown.calibration._known_noise import ignored
from northdown.calibration._solve import NoFitError, Solution, robust
from northdown.errors import InputError, expected
from northdown.recording import Recording

# Successive samples within this angle (rad) of each other become one point: lying still must not outvote turning,
# and a mean over 2° falls short of the sphere by 0.01 % only.
_RUN: Final = math.radians(2.0)
HOW: Final = "turn the sensor slowly about all three axes, away from iron, and calibrate again"
FEWEST_SPHERE: Final = 20
FEWEST_ELLIPSOID: Final = 50
# Smallest scale of residuals relative to the radius, for data without noise.
FLOOR: Final = 1e-9
# Soft iron (1-σ of each element) that a sensor may have which only hard iron is corrected for.
USUAL_SOFT_IRON: Final = 0.03
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
    shrink: FloatArray | None = None
    """What the prior does to what the points alone tell, (9, 9)."""


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
            sphere_prepare(scaled), unknowns, floor=FLOOR, valid=lambda x: 0.05 < float(x[3]) < _LARGEST
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
    return ignored(own, derivatives[:, 3:], weights, USUAL_SOFT_IRON)
