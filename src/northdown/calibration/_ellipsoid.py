"""Fits of a sphere and of an ellipsoid to points, with first-order orthogonal distances.

Points m on an ellipsoid satisfy |A(m − h)| = 1 with A symmetric and positive. The distance of a point from it is to
first order (Sampson 1982; Taubin 1991)

    r = (f − 1)/|∇f|,   f = |A(m − h)|,   ∇f = A²(m − h)/f,

which is what maximum likelihood wants when each axis has the same noise. On the outside of a curved surface there is
more room than on the inside: noise σ makes the mean of r equal to σ²H with H the mean curvature, which is taken off.

Points are worked on in units of the sphere's radius about its centre, so that all unknowns are of order one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from northdown._validation import FloatArray
from northdown.calibration._solve import Model, Solution
from northdown.calibration.coverage import BINS, centres

# Index pairs of the six elements of a symmetric matrix, in the order in which they are unknowns.
PAIRS: Final = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
FULL: Final = tuple(range(9))
DIAGONAL: Final = tuple(range(6))
OFFSET: Final = (0, 1, 2)

# Subsets tried for a start that outliers cannot spoil, and their sizes. With 40 % outliers one subset of 5 in
# 13 is free of them, so that of 120 all are spoilt once in 10⁴ times.
_TRIALS, _SUBSET = 120, 5
# Distances that decide between starts are those of at most this many points.
_JUDGES = 1000


@dataclass(frozen=True, eq=False)
class Sphere:
    """Centre (3,) and radius of a sphere."""

    centre: FloatArray
    radius: float

    def distance(self, points: FloatArray) -> FloatArray:
        """Signed distances (N,) of points from the sphere."""
        difference: FloatArray = np.linalg.norm(points - self.centre, axis=1) - self.radius
        return difference


def symmetric(elements: FloatArray) -> FloatArray:
    """Symmetric matrix (3, 3) from its six elements."""
    mat = np.empty((3, 3))
    for k, (i, j) in enumerate(PAIRS):
        mat[i, j] = mat[j, i] = elements[k]
    return mat


def elements(mat: FloatArray) -> FloatArray:
    """Six elements of a symmetric matrix."""
    return np.array([mat[i, j] for i, j in PAIRS])


def start_sphere(points: FloatArray, seed: int = 0) -> Sphere:
    """Sphere near most of the points: the best of algebraic fits to all and to small subsets.

    It is the one with the least median distance, relative to the radius plus the extent of the points: a plane is
    a sphere of infinite radius, near to any flat set.
    """
    middle = np.median(points, axis=0)
    extent = float(np.median(np.linalg.norm(points - middle, axis=1))) or 1.0
    scaled = (points - middle) / extent
    rng = np.random.default_rng(seed)
    judges = scaled if len(scaled) <= _JUDGES else scaled[rng.choice(len(scaled), _JUDGES, replace=False)]
    subsets: list[FloatArray] = [scaled[None]]
    if len(scaled) > 3 * _SUBSET:
        index = [rng.choice(len(scaled), _SUBSET, replace=False) for _ in range(_TRIALS)]
        subsets.append(scaled[np.array(index)])
    found = np.concatenate([_algebraic(subset) for subset in subsets])
    square = found[:, 3] + (found[:, :3] ** 2).sum(axis=1)
    # a sphere smaller than half the extent would hold fewer than half of the points
    found, square = found[square > 0.25], square[square > 0.25]
    if not len(found):
        return Sphere(middle, extent)
    radius = np.sqrt(square)
    away = np.linalg.norm(judges[None, :, :] - found[:, None, :3], axis=2) - radius[:, None]
    best = int(np.argmin(np.median(np.abs(away), axis=1) * (1.0 + 0.1 * radius)))
    return Sphere(middle + extent * found[best, :3], extent * float(radius[best]))


def _algebraic(points: FloatArray) -> FloatArray:
    """Least squares of |p|² = 2 c·p + d for sets of points (M, N, 3): c and d = R² − |c|² of each, (M, 4)."""
    design = np.concatenate([2.0 * points, np.ones((*points.shape[:2], 1))], axis=2)
    solution: FloatArray = np.einsum("mij,mj->mi", np.linalg.pinv(design, rcond=1e-9), (points**2).sum(axis=2))
    return solution


def _length(vectors: FloatArray) -> FloatArray:
    """Lengths (N,) of vectors (N, 3); several times as fast as NumPy's norm for so few columns."""
    length: FloatArray = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
    return length


def curvature(points: FloatArray, centre: FloatArray, mat: FloatArray) -> FloatArray:
    """Mean curvature (N,) of the surfaces |A(m − h)| = const at points m."""
    v = (points - centre) @ mat
    f = _length(v)
    gradient = v @ mat
    steep = _length(gradient)
    normal = gradient / steep[:, None]
    size = steep / f
    stretched = normal @ mat
    # ½ of the Hessian (A² − ∇f ∇fᵀ)/f traced over the tangent plane, over |∇f|
    trace = float((mat**2).sum()) - (stretched**2).sum(axis=1)
    half: FloatArray = 0.5 * trace / (f * size)
    return half


def ellipsoid_model(
    points: FloatArray, shift: FloatArray | float = 0.0, free: Sequence[int] = FULL, fixed: FloatArray | None = None
) -> Model:
    """Distances of points from an ellipsoid, and their derivatives.

    Parameters
    ----------
    points : (N, 3) array
        Points.
    shift : (N,) array or float
        Mean of each distance, which is taken off.
    free : sequence of int
        Which of h₁ h₂ h₃ A₁₁ A₂₂ A₃₃ A₁₂ A₁₃ A₂₃ are unknown.
    fixed : (9,) array, optional
        Values of those that are not.
    """
    base = np.zeros(9) if fixed is None else fixed
    index = list(free)

    def model(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        full = base.copy()
        full[index] = x
        mat = symmetric(full[3:])
        q = points - full[:3]
        v = q @ mat
        f = _length(v)
        w = v @ mat
        size = np.maximum(_length(w), 1e-300)
        f = np.maximum(f, 1e-300)
        residual = (f * f - f) / size - shift
        rho = (f * f - f) / (size * size)
        unit_w = w / size[:, None]
        # dr = s·(dA q) − s·(A dh) − ρ ŵ·(dA v)
        s = ((2.0 * f - 1.0) / (size * f))[:, None] * v - rho[:, None] * (unit_w @ mat)
        jacobian = np.empty((len(points), 9))
        jacobian[:, :3] = -s @ mat
        left = rho[:, None] * unit_w
        for k, (i, j) in enumerate(PAIRS):
            column = s[:, i] * q[:, j] - left[:, i] * v[:, j]
            if i != j:
                column = column + s[:, j] * q[:, i] - left[:, j] * v[:, i]
            jacobian[:, 3 + k] = column
        return residual, jacobian[:, index]

    return model


def ellipsoid_prepare(points: FloatArray) -> Callable[[FloatArray, float], Model]:
    """Model for the robust fit of an ellipsoid, with the shift that noise of a scale makes."""

    def prepare(x: FloatArray, scale: float) -> Model:
        return ellipsoid_model(points, scale**2 * curvature(points, x[:3], symmetric(x[3:])))

    return prepare


def sphere_prepare(points: FloatArray) -> Callable[[FloatArray, float], Model]:
    """Model for the robust fit of a sphere (centre, radius)."""

    def prepare(x: FloatArray, scale: float) -> Model:
        shift = scale**2 / x[3]

        def model(x: FloatArray) -> tuple[FloatArray, FloatArray]:
            away = points - x[:3]
            size = np.maximum(_length(away), 1e-300)
            return size - x[3] - shift, np.column_stack([-away / size[:, None], -np.ones(len(points))])

        return model

    return prepare


def normalised(x: FloatArray) -> tuple[FloatArray, float]:
    """Matrix of determinant 1 from nine unknowns, and the geometric mean of the ellipsoid's semi-axes."""
    mat = symmetric(x[3:9])
    mean = float(np.linalg.det(mat)) ** (-1.0 / 3.0)
    return mat * mean, mean


def normalised_covariance(x: FloatArray, covariance: FloatArray) -> FloatArray:
    """Covariance (9, 9) of the elements, row by row, of the matrix of determinant 1.

    dB = B·(dA − A tr(A⁻¹dA)/3), as d det A = det A · tr(A⁻¹ dA).
    """
    mat = symmetric(x[3:9])
    mean = float(np.linalg.det(mat)) ** (-1.0 / 3.0)
    inverse = np.linalg.inv(mat)
    derivative = np.empty((9, 6))
    for k, (i, j) in enumerate(PAIRS):
        change = np.zeros((3, 3))
        change[i, j] = change[j, i] = 1.0
        derivative[:, k] = (mean * (change - mat * (np.trace(inverse @ change) / 3.0))).ravel()
    result: FloatArray = derivative @ covariance[3:9, 3:9] @ derivative.T
    return result


def normalised_sigma(x: FloatArray, covariance: FloatArray) -> FloatArray:
    """1-σ (3, 3) of the matrix of determinant 1."""
    variance = np.diag(normalised_covariance(x, covariance))
    sigma: FloatArray = np.sqrt(np.maximum(variance, 0.0)).reshape(3, 3)
    return sigma


def weakest(solution: Solution) -> tuple[FloatArray, float]:
    """Direction (3,) along which the offset is known worst, and its 1-σ."""
    block = solution.covariance[:3, :3]
    if not np.isfinite(block).all():
        return np.full(3, np.nan), np.inf
    values, vectors = np.linalg.eigh(block)
    direction = vectors[:, 2]
    return direction * np.sign(direction[np.argmax(np.abs(direction))]), float(np.sqrt(max(values[2], 0.0)))


def weakest_scale(x: FloatArray, covariance: FloatArray) -> tuple[FloatArray, float]:
    """Direction d (3,) along which the matrix's scale dᵀBd is known worst, of a hundred, and its 1-σ."""
    if not np.isfinite(covariance).all():
        return np.full(3, np.nan), np.inf
    # dᵀB d of opposite directions is the same
    directions = np.vstack([np.eye(3), centres()[: BINS // 2]])
    squares = np.einsum("ni,nj->nij", directions, directions).reshape(-1, 9)
    variance = np.einsum("ni,ij,nj->n", squares, normalised_covariance(x, covariance), squares)
    worst = int(np.argmax(variance))
    return directions[worst], float(np.sqrt(max(variance[worst], 0.0)))
