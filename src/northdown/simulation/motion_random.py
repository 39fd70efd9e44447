"""Smooth random motion between two rests, like that of a device in a hand."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from northdown._validation import check_number
from northdown.simulation import _quaternions as quaternions
from northdown.simulation.motion import Motion
from northdown.simulation.motion_paths import SplinePath, Still
from northdown.simulation.motion_spline import DEGREE, SplineTurning
from northdown.simulation.seeds import Seed, generator

# Half-power frequency, as a part of one over the knots' spacing, of a rate made of B-splines of degree four with
# independent random weights: sinc⁵(f T) = √½.
_HALF_POWER = 0.2032


@cache
def _mean_square(degree: int) -> float:
    """∫ N(u)² du of the B-spline with knots at whole numbers, which is the one of degree 2p + 1 at its middle."""
    from scipy.interpolate import BSpline

    double = 2 * degree + 1
    return float(BSpline.basis_element(np.arange(double + 2.0))(0.5 * (double + 1)))


def random_motion(
    duration: float,
    seed: Seed = 0,
    *,
    turn: float = 0.6,
    reach: float = 0.12,
    bandwidth: float = 0.25,
    rest: float = 5.0,
) -> Motion:
    """Rest, then smooth random turns and shifts, then rest.

    Parameters
    ----------
    duration : float
        Length, s.
    seed : int or numpy.random.Generator
        Another seed, another motion.
    turn : float
        Angular rate of each axis, root of its mean square in the middle of the motion, rad/s.
    reach : float
        Position of each axis likewise, m; with the bandwidth it sets the acceleration.
    bandwidth : float
        Half-power frequency of the angular rate, Hz. Raising it makes turns shorter and accelerations larger.
    rest : float
        Rest at both ends, s; shortened to a quarter of the duration where that is less.

    Notes
    -----
    Attitude and position are splines of degree five, with four continuous derivatives everywhere, also where rest
    begins and ends. In a motion of less than about five over the bandwidth, the bandwidth is raised to fit, and the
    reach lowered so that rate and acceleration keep their size.
    """
    duration = check_number("duration", duration, above=0.0, unit="s")
    turn = check_number("turn", turn, low=0.0, unit="rad/s")
    reach = check_number("reach", reach, low=0.0, unit="m")
    bandwidth = check_number("bandwidth", bandwidth, above=0.0, unit="Hz")
    rest = min(check_number("rest", rest, low=0.0, unit="s"), 0.25 * duration)
    rng = generator(seed)
    moving = duration - 2.0 * rest
    count = max(2, round(moving * bandwidth / _HALF_POWER) - DEGREE + 1)
    period = moving / (count + DEGREE - 1)
    reach *= min(1.0, (period * bandwidth / _HALF_POWER) ** 2)
    # `count` increments that are not zero, between as many zeros on both sides as the splines overlap
    controls = count + 2 * DEGREE - 1
    knots = rest + period * (np.arange(controls + DEGREE + 1, dtype=np.float64) - DEGREE)
    increments = np.zeros((3, controls - 1))
    size = turn * period / math.sqrt(_mean_square(DEGREE - 1))
    increments[:, DEGREE - 1 : DEGREE - 1 + count] = size * rng.standard_normal((3, count))
    yaw = rng.uniform(-math.pi, math.pi)
    # close to level, but on no axis
    start = quaternions.multiply(
        quaternions.exp(np.array([[0.0], [0.0], [yaw]])), quaternions.exp(np.array([[-0.05], [0.1], [0.0]]))
    )
    turning = SplineTurning(knots, start, increments, rests=True)
    places = np.zeros((controls, 3))
    places[DEGREE : controls - DEGREE] = rng.standard_normal((count - 1, 3)) * (
        reach / math.sqrt(_mean_square(DEGREE))
    )
    if reach == 0.0:
        return Motion(turning, Still(), 0.0, duration, "random")
    from scipy.interpolate import BSpline

    path = SplinePath(BSpline(knots, places, DEGREE), (rest, duration - rest))
    return Motion(turning, path, 0.0, duration, "random")
