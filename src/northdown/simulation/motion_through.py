"""Motions through given attitudes and positions: waypoints, and the replay of an `Orientation`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray, check_number, check_time, check_vectors
from northdown.errors import InputError, expected
from northdown.orientation import Orientation
from northdown.simulation import _quaternions as quaternions
from northdown.simulation.motion import Motion, Path
from northdown.simulation.motion_fit import fit_turning
from northdown.simulation.motion_paths import SplinePath, Still
from northdown.simulation.motion_spline import DEGREE, SplineTurning

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


def waypoints(time: npt.ArrayLike, attitude: Rotation, position: npt.ArrayLike | None = None) -> Motion:
    """Motion that is at given attitudes and places at given times, and rests at the first and the last.

    Parameters
    ----------
    time : (N,) array
        Increasing, two or more, s.
    attitude : Rotation of length N
        Body to NED. From one to the next the body turns the short way round.
    position : (N, 3) array, optional
        NED, m; still at the origin when not given.

    Raises
    ------
    InputError
        On wrong shapes, or times that do not increase.

    Notes
    -----
    Polynomials of degree five in pieces. At a waypoint rate and angular acceleration, velocity and acceleration are
    those of parabolas through it and its neighbours; nothing jumps.
    """
    t = check_time(time)
    n = len(t)
    if n < 2 or (np.diff(t) <= 0.0).any():
        raise InputError(expected("two increasing times or more", f"{n} times"))
    quat = quaternions.from_rotation(attitude)
    if quat.shape[1] != n:
        raise InputError(expected(f"{n} attitudes, one for each time", f"{quat.shape[1]}"))
    places = np.zeros((n, 3))
    if position is not None:
        places = check_vectors("position", position, n)
        if not np.isfinite(places).all():
            raise InputError(expected("finite positions", "NaN", at=int(np.argmax(np.isnan(places).any(axis=1)))))
    return Motion(_turning(t, quat), _path(t, places), float(t[0]), float(t[-1]), "waypoints")


def _slopes(time: FloatArray, steps: FloatArray) -> tuple[FloatArray, FloatArray]:
    """First and second derivative at N points, of parabolas through three neighbours; zero at both ends."""
    h = np.diff(time)
    v = steps / h
    first, second = np.zeros((3, len(time))), np.zeros((3, len(time)))
    both = h[:-1] + h[1:]
    first[:, 1:-1] = (h[1:] * v[:, :-1] + h[:-1] * v[:, 1:]) / both
    second[:, 1:-1] = 2.0 * (v[:, 1:] - v[:, :-1]) / both
    return first, second


def _path(time: FloatArray, places: FloatArray) -> Path:
    if not places.any():
        return Still()
    from scipy.interpolate import BPoly

    velocity, acceleration = _slopes(time, np.diff(places, axis=0).T)
    return SplinePath(BPoly.from_derivatives(time, np.stack([places, velocity.T, acceleration.T], axis=1)), time)


def _turning(time: FloatArray, quat: FloatArray) -> SplineTurning:
    """Cumulative Bézier curves: their outer increments follow from the derivatives at the waypoints."""
    turns = quaternions.multiply(quaternions.conjugate(quat[:, :-1]), quat[:, 1:])
    steps = quaternions.log(turns)
    # a turn's vector is the same in body axes before and after it, so that neighbours can be combined
    rate, acceleration = _slopes(time, steps)
    h = np.diff(time)
    d1 = 0.2 * h * rate[:, :-1]
    d2 = d1 + h * h * acceleration[:, :-1] / 20.0
    d5 = 0.2 * h * rate[:, 1:]
    d4 = quaternions.rotate(quaternions.exp(d5), d5 - h * h * acceleration[:, 1:] / 20.0)
    early = quaternions.multiply(quaternions.exp(d1), quaternions.exp(d2))
    late = quaternions.multiply(quaternions.exp(d4), quaternions.exp(d5))
    middle = quaternions.multiply(
        quaternions.conjugate(early), quaternions.multiply(turns, quaternions.conjugate(late))
    )
    d3 = _nearest(quaternions.log(middle), steps - d1 - d2 - d4 - d5)
    increments = np.stack([d1, d2, d3, d4, d5, np.zeros_like(d1)], axis=-1).reshape(3, -1)[:, :-1]
    return SplineTurning(np.repeat(time, DEGREE + 1), quat[:, :1], increments, rests=True)


def _nearest(vector: FloatArray, wanted: FloatArray) -> FloatArray:
    """Of the rotation vectors of the same rotation, the one nearest to another vector."""
    length = np.sqrt((vector * vector).sum(axis=0))
    other = vector * (1.0 - 2.0 * np.pi / np.where(length > 0.0, length, 1.0))
    closer = ((other - wanted) ** 2).sum(axis=0) < ((vector - wanted) ** 2).sum(axis=0)
    return np.where(closer & (length > 0.0), other, vector)


def replay(orientation: Orientation, *, bandwidth: float = 10.0) -> Motion:
    """Motion whose attitude follows an `Orientation`, such as a recording's reference; its position stays.

    Parameters
    ----------
    orientation : Orientation
        Eight samples or more; in any frame.
    bandwidth : float
        Above this frequency (Hz) the orientation is smoothed. Where it has fewer than two samples per period of that
        frequency the motion passes through all samples, with their noise.

    Raises
    ------
    InputError
        When there are too few samples, or they turn by about 180° from one to the next.

    Notes
    -----
    Least squares fit of a spline of degree five, its knots spaced by half a period of `bandwidth`. Gaps are bridged.
    """
    bandwidth = check_number("bandwidth", bandwidth, above=0.0, unit="Hz")
    ned = orientation.to_frame("NED")
    fresh = np.concatenate([[True], np.diff(ned.time) > 0.0]) if len(ned) else np.zeros(0, np.bool_)
    time, quat = ned.time[fresh], np.ascontiguousarray(ned.quat[fresh].T)
    if len(time) < DEGREE + 3:
        raise InputError(expected(f"an orientation of {DEGREE + 3} samples or more", f"{len(time)}"))
    every = max(1, round(0.5 / (bandwidth * float(np.median(np.diff(time))))))
    # inner knots at samples, away from the ends, so that every spline has samples of its own
    inner = time[3 : max(4, len(time) - 3) : every]
    inner = inner[inner < time[-3]]
    knots = np.concatenate([np.full(DEGREE + 1, time[0]), inner, np.full(DEGREE + 1, time[-1])])
    turning = fit_turning(time, quat, knots)
    return Motion(turning, Still(), float(time[0]), float(time[-1]), ned.name or "replay")
