"""Quaternion algebra on tuples (w, x, y, z), Hamilton product, and vectors on tuples of three."""

from __future__ import annotations

import math
from typing import TypeAlias

from northdown.kernels.jit import inline

Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]


@inline
def dot(a: Vector, b: Vector) -> float:
    """Scalar product a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline
def length(a: Vector) -> float:
    """Norm of a vector."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@inline
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product a × b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@inline
def scale(k: float, a: Vector) -> Vector:
    """Product k a of a number and a vector."""
    return (k * a[0], k * a[1], k * a[2])


@inline
def add(a: Vector, b: Vector) -> Vector:
    """Sum a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@inline
def unit(a: Vector) -> Vector:
    """Unit vector along a; the zero vector stays zero."""
    square = dot(a, a)
    k = 1.0 / math.sqrt(square) if square > 0.0 else 0.0
    return (k * a[0], k * a[1], k * a[2])


@inline
def multiply(p: Quaternion, q: Quaternion) -> Quaternion:
    """Hamilton product p ⊗ q."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


@inline
def conjugate(q: Quaternion) -> Quaternion:
    """Conjugate, for unit q the inverse."""
    return (q[0], -q[1], -q[2], -q[3])


@inline
def inverse_norm(q: Quaternion) -> float:
    """1/‖q‖.

    After a filter's step q is nearly of unit norm: there 1/√(1 + d) by its series, whose first neglected term is
    under 0.25 d⁵ = 3e-21, is ready sooner than a square root and a division.
    """
    square = (q[0] * q[0] + q[1] * q[1]) + (q[2] * q[2] + q[3] * q[3])
    d = square - 1.0
    if -1e-4 < d < 1e-4:
        return 1.0 - d * (0.5 - d * (0.375 - d * (0.3125 - d * 0.2734375)))
    return 1.0 / math.sqrt(square)


@inline
def normalize(q: Quaternion) -> Quaternion:
    """Quaternion of unit norm."""
    k = inverse_norm(q)
    return (k * q[0], k * q[1], k * q[2], k * q[3])


@inline
def down_b(q: Quaternion) -> Vector:
    """Down (third NED axis) in body components: the third row of mat_nb."""
    w, x, y, z = q
    return (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y))


@inline
def north_b(q: Quaternion) -> Vector:
    """North (first NED axis) in body components: the first row of mat_nb."""
    w, x, y, z = q
    return (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y))


@inline
def rotate(q: Quaternion, v: Vector) -> Vector:
    """Vector from body to navigation components, v_n = mat_nb v_b, for unit q."""
    w, x, y, z = q
    # v + 2 w (u × v) + 2 u × (u × v): the Hamilton product q ⊗ v ⊗ q* with u = (x, y, z)
    c = cross((x, y, z), v)
    d = cross((x, y, z), c)
    return (v[0] + 2.0 * (w * c[0] + d[0]), v[1] + 2.0 * (w * c[1] + d[1]), v[2] + 2.0 * (w * c[2] + d[2]))


@inline
def rotate_inverse(q: Quaternion, v: Vector) -> Vector:
    """Vector from navigation to body components, v_b = mat_nbᵀ v_n, for unit q."""
    return rotate((q[0], -q[1], -q[2], -q[3]), v)


@inline
def scaled_axes(k: float, q: Quaternion) -> tuple[float, ...]:
    """Nine entries, by rows, of k times the rotation matrix of q."""
    w, x, y, z = q
    k2 = 2.0 * k
    return (
        k - k2 * (y * y + z * z),
        k2 * (x * y - w * z),
        k2 * (x * z + w * y),
        k2 * (x * y + w * z),
        k - k2 * (x * x + z * z),
        k2 * (y * z - w * x),
        k2 * (x * z - w * y),
        k2 * (y * z + w * x),
        k - k2 * (x * x + y * y),
    )


@inline
def whole_axes(q: Quaternion) -> tuple[Vector, Vector, Vector]:
    """Rows of the matrix of a rotation that maps axes on axes: entries of exactly 0, 1 and −1."""
    x, y, z = rotate(q, (1.0, 0.0, 0.0)), rotate(q, (0.0, 1.0, 0.0)), rotate(q, (0.0, 0.0, 1.0))
    return (
        (float(round(x[0])), float(round(y[0])), float(round(z[0]))),
        (float(round(x[1])), float(round(y[1])), float(round(z[1]))),
        (float(round(x[2])), float(round(y[2])), float(round(z[2]))),
    )


@inline
def congruent(m: tuple[Vector, Vector, Vector], c: tuple[float, ...]) -> tuple[float, ...]:
    """Nine entries by rows of M C Mᵀ, for a symmetric C of nine entries and M by rows."""
    rows = ((c[0], c[1], c[2]), (c[3], c[4], c[5]), (c[6], c[7], c[8]))
    a = (dot(rows[0], m[0]), dot(rows[1], m[0]), dot(rows[2], m[0]))
    b = (dot(rows[0], m[1]), dot(rows[1], m[1]), dot(rows[2], m[1]))
    d = (dot(rows[0], m[2]), dot(rows[1], m[2]), dot(rows[2], m[2]))
    xy, xz, yz = dot(a, m[1]), dot(a, m[2]), dot(b, m[2])
    return (dot(a, m[0]), xy, xz, xy, dot(b, m[1]), yz, xz, yz, dot(d, m[2]))


@inline
def from_matrix(
    r00: float, r01: float, r02: float, r10: float, r11: float, r12: float, r20: float, r21: float, r22: float
) -> Quaternion:
    """Unit quaternion of a rotation matrix given by rows, from its largest component (Shepperd 1978)."""
    if r00 + r11 + r22 > 0.0:
        q = (1.0 + r00 + r11 + r22, r21 - r12, r02 - r20, r10 - r01)
    elif r00 >= r11 and r00 >= r22:
        q = (r21 - r12, 1.0 + r00 - r11 - r22, r01 + r10, r02 + r20)
    elif r11 >= r22:
        q = (r02 - r20, r01 + r10, 1.0 - r00 + r11 - r22, r12 + r21)
    else:
        q = (r10 - r01, r02 + r20, r12 + r21, 1.0 - r00 - r11 + r22)
    return normalize(q)
