"""Attitude from vector observations: tilt, heading and TRIAD, in NED with x to magnetic north.

The accelerometer gives specific force, which at rest points up; where these functions speak of down they have
already changed the sign.
"""

from __future__ import annotations

import math

from northdown.kernels.jit import inline
from northdown.kernels.quaternion import (
    Quaternion,
    Vector,
    cross,
    dot,
    from_matrix,
    multiply,
    normalize,
    rotate,
    unit,
)

# Squared sine of the angle between field and vertical below which the field gives no heading (0.06 degrees).
_PARALLEL = 1e-6


@inline
def arc_to_up(u: Vector) -> Quaternion:
    """Shortest arc in NED from the unit vector u to up; about x where u points down."""
    # from u to up = (0, 0, −1): (1 + u·up, u × up)
    c = 1.0 - u[2]
    if c < 1e-12:
        return (0.0, 1.0, 0.0, 0.0)
    return normalize((c, -u[1], u[0], 0.0))


@inline
def tilt_correction(q: Quaternion, acc_b: Vector) -> Quaternion:
    """Rotation in NED that brings specific force to point straight up, with q the present attitude.

    The shortest arc: its axis is horizontal, so the heading of the down axis' plane is left alone. For specific
    force that points exactly down the axis is x.
    """
    return arc_to_up(unit(rotate(q, acc_b)))


@inline
def has_heading(acc_or_down_b: Vector, mag_b: Vector) -> bool:
    """Whether the field has a horizontal part worth using: not zero, not parallel to the vertical."""
    n = cross(acc_or_down_b, mag_b)
    return dot(n, n) > _PARALLEL * dot(acc_or_down_b, acc_or_down_b) * dot(mag_b, mag_b)


@inline
def has_horizontal(field_n: Vector) -> bool:
    """`has_heading` for a field in navigation axes."""
    square = field_n[0] * field_n[0] + field_n[1] * field_n[1]
    return square > _PARALLEL * (square + field_n[2] * field_n[2])


@inline
def heading_error(q: Quaternion, mag_b: Vector) -> float:
    """Angle (rad) about down by which q must turn so that the horizontal field points to north."""
    h = rotate(q, mag_b)
    return -math.atan2(h[1], h[0])


@inline
def turn_about_down(angle: float, q: Quaternion) -> Quaternion:
    """Turn the attitude q about the down axis of NED by an angle (rad)."""
    return multiply((math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)), q)


@inline
def triad(first_b: Vector, second_b: Vector, first_n: Vector, second_n: Vector) -> Quaternion:
    """TRIAD: attitude that maps `first` exactly and `second` into its half plane (Black 1964)."""
    a0 = unit(first_b)
    a1 = unit(cross(first_b, second_b))
    a2 = cross(a0, a1)
    b0 = unit(first_n)
    b1 = unit(cross(first_n, second_n))
    b2 = cross(b0, b1)
    return from_matrix(
        b0[0] * a0[0] + b1[0] * a1[0] + b2[0] * a2[0],
        b0[0] * a0[1] + b1[0] * a1[1] + b2[0] * a2[1],
        b0[0] * a0[2] + b1[0] * a1[2] + b2[0] * a2[2],
        b0[1] * a0[0] + b1[1] * a1[0] + b2[1] * a2[0],
        b0[1] * a0[1] + b1[1] * a1[1] + b2[1] * a2[1],
        b0[1] * a0[2] + b1[1] * a1[2] + b2[1] * a2[2],
        b0[2] * a0[0] + b1[2] * a1[0] + b2[2] * a2[0],
        b0[2] * a0[1] + b1[2] * a1[1] + b2[2] * a2[1],
        b0[2] * a0[2] + b1[2] * a1[2] + b2[2] * a2[2],
    )
