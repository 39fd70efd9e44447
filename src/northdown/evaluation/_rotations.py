"""The numerical side of alignment: offsets between two sequences of rotations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from northdown._validation import FloatArray

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

_MOST_PAIRS = 1_000
# Relative rotations (rad) worth using: below, noise dominates; above, the axis flips where the angle passes π.
_SMALLEST, _LARGEST = 0.05, 2.8
# Number of parts of the data that are taken to err independently.
_PARTS = 10
# Median length of a vector of three standard normal numbers.
_MEDIAN_LENGTH = 1.5382
# Cauchy's loss with this many standard deviations has 95 % of the efficiency of least squares on normal errors.
_CAUCHY = 2.3849


def heading_offset(estimate: Rotation, truth: Rotation) -> float:
    """Angle ψ (rad) about +z that minimises Σ‖truth − Rz(ψ) estimate‖² over the rotation matrices."""
    _, _, z, w = (estimate * truth.inv()).as_quat().T
    # trace(Rz(ψ) E) = cos ψ (E00 + E11) + sin ψ (E01 − E10) + E22, in terms of the quaternion of E
    return float(np.arctan2(-2.0 * np.sum(w * z), np.sum(w * w - z * z)))


def richness(rotation: Rotation) -> float:
    """Smallest eigenvalue of I − M̄ᵀM̄, M̄ the mean matrix: zero when all rotation is about one axis.

    It is the smallest eigenvalue of the normal equations of `refine` after `left` has been eliminated.
    """
    mean = rotation.as_matrix().mean(axis=0)
    return float(np.linalg.eigvalsh(np.eye(3) - mean.T @ mean)[0])


def thin(rotation: Rotation, most: int) -> Rotation:
    """At most so many of the rotations, evenly spaced."""
    return rotation[:: max(1, -(-len(rotation) // most))]


def body_offset(estimate: Rotation, truth: Rotation) -> Rotation | None:
    """Rotation R of the body frame from relative rotations, Aᵢⱼ = Rᵀ Bᵢⱼ R; None where they do not determine it."""
    from scipy.spatial.transform import Rotation

    est, ref = thin(estimate, _MOST_PAIRS), thin(truth, _MOST_PAIRS)
    n = len(ref)
    lags = [2**k for k in range(max(n - 1, 0).bit_length()) if 2**k < n]
    if not lags:
        return None
    first = np.concatenate([np.arange(n - k) for k in lags])
    last = np.concatenate([np.arange(k, n) for k in lags])
    a: FloatArray = (ref[first].inv() * ref[last]).as_rotvec()
    b: FloatArray = (est[first].inv() * est[last]).as_rotvec()
    size_a, size_b = np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1)
    use = (np.minimum(size_a, size_b) > _SMALLEST) & (np.maximum(size_a, size_b) < _LARGEST)
    if use.sum() < 3:
        return None
    u, _, vt = np.linalg.svd(b[use].T @ a[use])
    # without the determinant a reflection could come out, where the rotation vectors lie in a plane
    return Rotation.from_matrix(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)


def refine(
    estimate: Rotation, truth: Rotation, left: Rotation, right: Rotation
) -> tuple[Rotation, Rotation, float, float]:
    """Minimise the robust total error of left · estimate · right against the truth.

    Residual r = log(left · estimate · right · truthᵀ); with left → exp(l) left and right → right exp(m) it becomes
    r + l + truth m to first order. The Jacobians of the logarithm are left out: they are 1 in the direction of r, so
    the gradient Σ w Jᵀr, and with it the point of convergence, is exact. As the weights follow the spread of what is
    left, a rough start will do.

    Returns
    -------
    left, right : Rotation
    sigma : float
        Standard deviation (rad) of the worst determined direction of left or right.
    inliers : float
        Share of samples whose residual is no longer than five robust standard deviations of one of its components.
    """
    from scipy.spatial.transform import Rotation

    back = truth.inv()
    mat: FloatArray = truth.as_matrix()
    for _ in range(100):
        residual: FloatArray = (left * estimate * right * back).as_rotvec()
        size = np.linalg.norm(residual, axis=1)
        spread = float(np.median(size)) / _MEDIAN_LENGTH
        weight = _cauchy_weight(size, spread)
        weight /= weight.sum()
        mean: FloatArray = np.tensordot(weight, mat, axes=1)
        normal = np.block([[np.eye(3), mean], [mean.T, np.eye(3)]])
        pull = weight[:, None] * np.hstack([residual, np.einsum("iba,ib->ia", mat, residual)])
        step = -np.linalg.solve(normal, pull.sum(axis=0))
        if float(np.abs(step).max()) < 1e-12:
            break
        left = Rotation.from_rotvec(step[:3]) * left
        right = right * Rotation.from_rotvec(step[3:])
    return left, right, _sigma(normal, pull), float(np.mean(size <= 5.0 * spread + 1e-9))


def _sigma(normal: FloatArray, pull: FloatArray) -> float:
    """Largest standard deviation of left or right, from how far parts of the data pull apart.

    Errors of an estimate go on for seconds, so samples are not independent; long parts nearly are. With the sums of
    `pull` over parts in B, the covariance is N⁻¹ BᵀB N⁻¹ (the 'sandwich' of robust statistics).
    """
    parts = np.array([part.sum(axis=0) for part in np.array_split(pull, _PARTS)])
    parts -= parts.mean(axis=0)
    inverse = np.linalg.inv(normal)
    cov: FloatArray = inverse @ (parts.T @ parts) @ inverse * (_PARTS / (_PARTS - 1.0))
    largest = max(float(np.linalg.eigvalsh(cov[k : k + 3, k : k + 3])[-1]) for k in (0, 3))
    return float(np.sqrt(max(largest, 0.0)))


def _cauchy_weight(size: FloatArray, sigma: float) -> FloatArray:
    # The floor keeps rounding errors of noise-free data from being taken for outliers.
    ratio = size / (_CAUCHY * max(sigma, 1e-9))
    weight: FloatArray = 1.0 / (1.0 + ratio * ratio)
    return weight
