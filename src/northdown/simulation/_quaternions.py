"""Algebra of many quaternions at once: arrays of shape (4, N), rows w, x, y, z; vectors of shape (3, N).

SciPy's `Rotation` is the public type. Simulation needs several products for each sample of hours at 1 kHz, and these
are ten times as fast on rows that lie together in memory.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from northdown._validation import FloatArray

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

# Below this angle (rad) the first neglected term of the series, angle⁴/1920, is under half a unit in the last place.
_SMALL = 1e-4


def multiply(p: FloatArray, q: FloatArray) -> FloatArray:
    """Hamilton product p ⊗ q."""
    return np.stack(
        [
            p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
            p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
            p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
            p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
        ]
    )


def conjugate(q: FloatArray) -> FloatArray:
    """Inverse of unit quaternions."""
    return np.stack([q[0], -q[1], -q[2], -q[3]])


def normalize(q: FloatArray) -> FloatArray:
    """Quaternions of unit norm."""
    unit: FloatArray = q / np.sqrt((q * q).sum(axis=0))
    return unit


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Vector product a × b."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def rotate(q: FloatArray, v: FloatArray) -> FloatArray:
    """Vectors from body to navigation components, v_n = mat_nb v_b."""
    c = cross(q[1:], v)
    turned: FloatArray = v + 2.0 * (q[0] * c + cross(q[1:], c))
    return turned


def rotate_inverse(q: FloatArray, v: FloatArray) -> FloatArray:
    """Vectors from navigation to body components, v_b = mat_nbᵀ v_n."""
    c = cross(q[1:], v)
    turned: FloatArray = v - 2.0 * (q[0] * c - cross(q[1:], c))
    return turned


def exp(v: FloatArray) -> FloatArray:
    """Unit quaternions of rotation vectors (rad)."""
    angle = np.sqrt((v * v).sum(axis=0))
    small = angle < _SMALL
    k = np.where(small, 0.5 - angle * angle / 48.0, np.sin(0.5 * angle) / np.where(small, 1.0, angle))
    return np.concatenate([np.cos(0.5 * angle)[None], k * v])


def log(q: FloatArray) -> FloatArray:
    """Rotation vectors (rad) of unit quaternions, of length at most π."""
    sine = np.sqrt((q[1:] * q[1:]).sum(axis=0))
    small = sine < _SMALL
    sign = np.where(q[0] < 0.0, -1.0, 1.0)
    # 2 asin(s)/s = 2 + s²/3
    k = np.where(small, 2.0 + sine * sine / 3.0, 2.0 * np.arctan2(sine, sign * q[0]) / np.where(small, 1.0, sine))
    vector: FloatArray = sign * k * q[1:]
    return vector


def cumulative(q: FloatArray) -> FloatArray:
    """Products q₀, q₀ ⊗ q₁, q₀ ⊗ q₁ ⊗ q₂ …, normalised.

    In log₂ N passes over the whole array (Hillis and Steele 1986), so that errors of rounding grow with log₂ N too.
    """
    product = q.copy()
    shift = 1
    while shift < product.shape[1]:
        product[:, shift:] = multiply(product[:, :-shift], product[:, shift:])
        shift *= 2
    return normalize(product)


def from_rotation(rotation: Rotation) -> FloatArray:
    """Quaternions (4, N) of a SciPy `Rotation`, of one or of N."""
    return np.ascontiguousarray(np.roll(np.atleast_2d(rotation.as_quat()), 1, axis=-1).T)


def to_rotation(q: FloatArray) -> Rotation:
    """SciPy `Rotation` of length N."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(np.roll(q.T, -1, axis=-1))
