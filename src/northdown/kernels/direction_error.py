"""Cross products between measured and expected directions of up and of the field, in body axes.

For small errors they are the rotation vector that brings the estimate to the measurement.
"""

from __future__ import annotations

import math

from northdown.kernels.jit import inline
from northdown.kernels.quaternion import Quaternion, Vector, add, cross, dot, down_b, north_b, scale, unit


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

    The expected field has the horizontal part of the measured one turned to north and its vertical part as measured,
    ŵ_b = |m̂ × d| n + (m̂ · d) d with the directions n of north and d of down, so that no dip need be known.
    """
    m, down = unit(mag), down_b(q)
    c = cross(m, down)
    return add(scale(dot(m, down), c), scale(math.sqrt(dot(c, c)), cross(m, north_b(q))))
