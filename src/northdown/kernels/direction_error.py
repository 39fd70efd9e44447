"""Cross products between measured and expected directions of up and of the field, in body axes.

For small errors they are the rotation vector that brings the estimate to the measurement.
"""

from __future__ import annotations

import math

from northdown.kernels.jit import inline
from northdown.kernels.quaternion import Quaternion, Vector, cross, down_b, scale, unit


@inline
def is_sample(v: Vector) -> bool:
    """Whether a vector holds a sample: none of its components is NaN."""
    return v[0] == v[0] and v[1] == v[1] and v[2] == v[2]


@inline
def gravity_error(q: Quaternion, acc: Vector) -> Vector:
    """Measured × expected direction of up, â_b × v̂_b (W section 5; M20 5.1, sign of specific force)."""
    return cross(unit(acc), scale(-1.0, down_b(q)))


@inline
def field_error(q: Quaternion, mag: Vector) -> Vector:
    """Measured × expected direction of the field, m̂_b × ŵ_b (M20 5.2).

    With h = mat_nb m̂_b the expected field is (√(h_x² + h_y²), 0, h_z) in NED: its horizontal part turned to north,
    its vertical part as measured, so that no dip need be known.
    """
    w, x, y, z = q
    m0, m1, m2 = unit(mag)
    r00, r01, r02 = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    r10, r11, r12 = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    r20, r21, r22 = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    hx = r00 * m0 + r01 * m1 + r02 * m2
    hy = r10 * m0 + r11 * m1 + r12 * m2
    hz = r20 * m0 + r21 * m1 + r22 * m2
    b = math.sqrt(hx * hx + hy * hy)
    return cross((m0, m1, m2), (r00 * b + r20 * hz, r01 * b + r21 * hz, r02 * b + r22 * hz))
