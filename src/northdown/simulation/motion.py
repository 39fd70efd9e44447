"""Smooth random motion of a rigid body, from splines, with exact derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from northdown._validation import FloatArray

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of a body, sampled.

    Parameters
    ----------
    time : (N,) array
        Time, s.
    rotation : Rotation of length N
        Body → NED.
    acceleration : (N, 3) array
        Acceleration of the body's origin, NED, m/s².
    """

    time: FloatArray
    rotation: Rotation
    acceleration: FloatArray


def random_motion(
    duration: float,
    rate: float,
    rng: np.random.Generator,
    *,
    turn: float = 0.8,
    reach: float = 0.15,
    period: float = 1.5,
    rest: float = 5.0,
) -> Motion:
    """Handheld-like motion: rest, then smooth random turns and shifts, then rest.

    Parameters
    ----------
    duration, rate : float
        Length in s and sampling rate in Hz.
    rng : numpy.random.Generator
        Source of the randomness.
    turn : float
        Standard deviation (rad) of the turn from one knot to the next. Raising it makes the motion faster.
    reach : float
        Standard deviation (m) of the position at the knots. Raising it makes for more linear acceleration.
    period : float
        Time between knots, s. Raising it makes the motion slower.
    rest : float
        Rest at both ends, s; shortened to a quarter of the duration where that is less.

    Notes
    -----
    Attitude is a `scipy.spatial.transform.RotationSpline` through random knots, position a quintic spline
    with vanishing velocity and acceleration at its ends.
    """
    from scipy.interpolate import make_interp_spline
    from scipy.spatial.transform import Rotation, RotationSpline

    n = int(np.floor(duration * rate + 1e-9)) + 1
    time = np.arange(n) / rate
    rest = min(rest, 0.25 * duration)
    count = max(3, round((duration - 2.0 * rest) / period) + 1)
    knots = np.linspace(rest, duration - rest, count)
    turns = Rotation.from_rotvec(rng.normal(0.0, turn, (count, 3)))
    attitude = [Rotation.from_euler("ZYX", [rng.uniform(-np.pi, np.pi), 0.1, -0.05])]
    for k in range(1, count):
        attitude.append(attitude[-1] * turns[k])
    # the first and last knots stand twice, so that the spline leaves and arrives at rest
    ends = 0.5 * period
    rotations = Rotation.concatenate([attitude[0], *attitude, attitude[-1]])
    spline = RotationSpline(np.concatenate([[knots[0] - ends], knots, [knots[-1] + ends]]), rotations)
    inside = np.clip(time, knots[0] - ends, knots[-1] + ends)
    position = rng.normal(0.0, reach, (count, 3))
    position[[0, -1]] = 0.0
    free = [(1, np.zeros(3)), (2, np.zeros(3))]
    path = make_interp_spline(knots, position, k=5, bc_type=(free, free))  # type: ignore[arg-type]
    moving = (time > knots[0]) & (time < knots[-1])
    acceleration = np.where(moving[:, None], path.derivative(2)(np.clip(time, knots[0], knots[-1])), 0.0)
    return Motion(time, spline(inside), acceleration)
