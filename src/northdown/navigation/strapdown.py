r"""Strapdown navigation: specific force turned by the attitude, gravity removed, integrated twice (K06 2-4, fig 2.7).

.. math::

    a_n = R_{nb} f_b + g_n, \qquad
    v_k = v_{k-1} + \tfrac{\Delta t}{2}(a_{k-1} + a_k), \qquad
    p_k = p_{k-1} + \Delta t\, v_{k-1} + \tfrac{\Delta t^2}{6}(2 a_{k-1} + a_k)

The acceleration is taken to be linear between two samples: velocity by the trapezoidal rule, and the position that
belongs to it. Both are of second order in Δt, and exact for constant and linearly growing acceleration. Each sample
is turned by the attitude of its own time, so that turning and shaking together (sculling) need no correction.

An accelerometer bias b leaves ½ b t² in the position; a tilt error δ does the same with b = g sin δ. With a constant
bias of the gyroscope the tilt error grows with t and the position error with t³.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from northdown._validation import BoolArray, FloatArray, as_float_array, check_number
from northdown.errors import InputError, expected
from northdown.frames import up_axis
from northdown.navigation.samples import check_sampled, check_steps, fill
from northdown.navigation.trajectory import Trajectory
from northdown.orientation import Orientation
from northdown.recording import Recording

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

GRAVITY = 9.80665


def integrate(
    recording: Recording,
    orientation: Orientation,
    *,
    velocity: npt.ArrayLike = (0.0, 0.0, 0.0),
    position: npt.ArrayLike = (0.0, 0.0, 0.0),
    gravity: float = GRAVITY,
    max_gap: float = 0.1,
) -> Trajectory:
    """Integrate the accelerometer of a recording along an orientation, whichever way that was found.

    Parameters
    ----------
    recording : Recording
        With an accelerometer. Rows without a sample are bridged by linear interpolation of the acceleration.
    orientation : Orientation
        Attitude over the recording's span; interpolated where its times are others. Its frame is the result's.
    velocity, position : (3,) array
        At the first sample, m/s and m, in axes of the orientation's frame.
    gravity : float
        Size of gravity, m/s². Raising it lets a body at rest fall.
    max_gap : float
        Longest time (s) without a sample that is bridged.

    Returns
    -------
    Trajectory
        At the recording's times, without covariance.

    Raises
    ------
    InputError
        Without accelerometer, with gaps that are too long, or when the orientation does not span the recording.
    """
    check_sampled(recording, ("acc",))
    if not isinstance(orientation, Orientation):
        raise InputError(expected("orientation as an Orientation", type(orientation).__name__))
    gravity = check_number("gravity", gravity, low=0.0, unit="m/s²")
    max_gap = check_number("max_gap", max_gap, low=0.0, unit="s")
    v0, p0 = check_start("velocity", velocity), check_start("position", position)
    time, acc = recording.time, recording.acc
    if acc is None:  # for the type checker; `check_sampled` has seen to it
        raise InputError(expected("acc for navigation", "no acc in the recording"))
    if not np.array_equal(orientation.time, time):
        orientation = orientation.at(time)
    there: BoolArray = np.asarray(~np.isnan(acc).any(axis=1))
    known = np.unique(np.concatenate([[0], np.flatnonzero(there), [len(time) - 1]]))
    check_steps(time[known], max_gap, "acc", known)
    force_n = orientation.rotation.apply(np.where(there[:, None], acc, 0.0))
    free = fill(time, force_n - gravity * up_axis(orientation.frame), there)
    dt = np.diff(time)[:, None]
    v = v0 + _running(0.5 * dt * (free[:-1] + free[1:]))
    p = p0 + _running(dt * v[:-1] + dt * dt * (2.0 * free[:-1] + free[1:]) / 6.0)
    return Trajectory(orientation, p, v, name=orientation.name or recording.name)


def strapdown(
    recording: Recording,
    *,
    frame: str | None = None,
    initial: Rotation | None = None,
    velocity: npt.ArrayLike = (0.0, 0.0, 0.0),
    position: npt.ArrayLike = (0.0, 0.0, 0.0),
    gravity: float = GRAVITY,
    max_gap: float = 0.1,
) -> Trajectory:
    """Navigate by gyroscope and accelerometer alone, from a known start; drifts.

    Parameters
    ----------
    recording : Recording
        With gyroscope and accelerometer. A gyroscope sample is the mean rate since the sample before it, and is
        integrated exactly.
    frame : {"NED", "ENU", "NWU"}, optional
        Navigation frame; the recording's when not given.
    initial : scipy.spatial.transform.Rotation, optional
        Attitude (body → frame) at the first sample; when not given, from the first accelerometer and magnetometer
        samples, which is right for a body that does not accelerate then.
    velocity, position, gravity, max_gap
        As for `integrate`.

    Returns
    -------
    Trajectory
        Without covariance; see `navigate` for that.

    Raises
    ------
    InputError
        As for `integrate`, and without gyroscope.
    """
    from northdown.estimators.gyro_integration import GyroIntegration

    check_sampled(recording, ("gyr", "acc"))
    orientation = GyroIntegration().run(recording, frame=frame, initial=initial, max_gap=max_gap)
    return integrate(recording, orientation, velocity=velocity, position=position, gravity=gravity, max_gap=max_gap)


def check_start(name: str, value: npt.ArrayLike) -> FloatArray:
    """Check three finite numbers."""
    array = as_float_array(name, value)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise InputError(expected(f"three finite numbers for {name}", f"{array.tolist()}"))
    return array


def _running(steps: FloatArray) -> FloatArray:
    """Sums of the steps up to each sample, zero at the first."""
    total: FloatArray = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    return total
