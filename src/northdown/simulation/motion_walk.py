"""`walk`: a foot that walks around a circle, with stances between the steps."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from northdown._validation import check_number
from northdown.simulation import _quaternions as quaternions
from northdown.simulation.motion import Motion
from northdown.simulation.motion_paths import SplinePath
from northdown.simulation.motion_spline import DEGREE, SplineTurning

# Control points of the swing: part of the stride's way, height (m), pitch (°). Before them the stance has
# `_STANCE` points that are equal; the foot stands still for as many intervals less the spline's degree.
_SWING: Final = (
    (0.03, 0.05, -30.0),
    (0.20, 0.15, -70.0),
    (0.50, 0.10, -40.0),
    (0.80, 0.06, 10.0),
    (0.97, 0.06, 25.0),
)
_STANCE: Final = 11


def walk(duration: float = 60.0, *, stride: float = 1.4, period: float = 1.25, rest: float = 3.0) -> Motion:
    """Let a foot walk once around a circle, back to where it began, with a rest before and after.

    Parameters
    ----------
    duration : float
        Length, s.
    stride : float
        Way from one stance to the next, m.
    period : float
        Time from one stance to the next, s; for three eighths of it the foot stands still.
    rest : float
        Rest at both ends, s; shortened to a quarter of the duration where that is less.

    Notes
    -----
    Splines of degree five with four continuous derivatives. The number of strides is what the duration allows, at
    least one; the circle's circumference follows from it. The foot is flat and points ahead at each stance, to the
    north at the first.
    """
    from scipy.interpolate import BSpline
    from scipy.spatial.transform import Rotation

    duration = check_number("duration", duration, above=0.0, unit="s")
    stride = check_number("stride", stride, low=0.0, unit="m")
    period = check_number("period", period, above=0.0, unit="s")
    rest = min(check_number("rest", rest, low=0.0, unit="s"), 0.25 * duration)
    moving = duration - 2.0 * rest
    count = max(1, math.floor(moving / period))
    shape = np.concatenate([np.zeros((_STANCE, 3)), _SWING])
    end = np.zeros((DEGREE + 1, 3))
    way, height, pitch = np.concatenate([np.tile(shape, (count, 1)), end]).T
    controls = len(way)
    way += np.minimum(np.arange(controls) // len(shape), count)
    yaw = 2.0 * np.pi / count * way
    radius = stride * count / (2.0 * np.pi)
    places = np.column_stack([radius * np.sin(yaw), radius * (1.0 - np.cos(yaw)), -height])
    knots = rest + moving / (controls - DEGREE) * (np.arange(controls + DEGREE + 1.0) - DEGREE)
    angles = np.column_stack([yaw, np.deg2rad(pitch), np.zeros(controls)])
    quat = quaternions.from_rotation(Rotation.from_euler("ZYX", angles))
    increments = quaternions.log(quaternions.multiply(quaternions.conjugate(quat[:, :-1]), quat[:, 1:]))
    turning = SplineTurning(knots, quat[:, :1], increments, rests=True)
    path = SplinePath(BSpline(knots, places, DEGREE), (rest, duration - rest))
    return Motion(turning, path, 0.0, duration, "walk")
