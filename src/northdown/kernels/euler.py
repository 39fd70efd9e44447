"""Aerospace Euler angles (roll, pitch, yaw) of a quaternion: R = Rz(yaw) Ry(pitch) Rx(roll)."""

from __future__ import annotations

import math

from northdown.kernels.jit import inline
from northdown.kernels.quaternion import Quaternion, Vector


@inline
def to_zyx(q: Quaternion) -> Vector:
    """Roll, pitch, yaw (rad) of the unit quaternion q (K06 (2.15)); pitch from both legs, precise near ±90°.

    At pitch ±90° only yaw ∓ roll is defined, and roll is set to 0.
    """
    w, x, y, z = q
    r00, r10 = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z)
    r20 = 2.0 * (x * z - w * y)
    cos_pitch = math.sqrt(r00 * r00 + r10 * r10)
    pitch = math.atan2(-r20, cos_pitch)
    if cos_pitch < 1e-9:
        return (0.0, pitch, math.atan2(-2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z)))
    roll = math.atan2(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y))
    return (roll, pitch, math.atan2(r10, r00))


@inline
def from_zyx(angles: Vector) -> Quaternion:
    """Unit quaternion of roll, pitch, yaw in rad (W section 2, M20 6.2.1)."""
    sr, cr = math.sin(0.5 * angles[0]), math.cos(0.5 * angles[0])
    sp, cp = math.sin(0.5 * angles[1]), math.cos(0.5 * angles[1])
    sy, cy = math.sin(0.5 * angles[2]), math.cos(0.5 * angles[2])
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


@inline
def wrap(angle: float) -> float:
    """The same angle between −π and π."""
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)
