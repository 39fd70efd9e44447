"""Turnings in closed form: fixed attitude, rotation about a fixed axis, coning."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray, check_number
from northdown.errors import InputError, expected
from northdown.simulation import _quaternions as quaternions
from northdown.simulation.motion import Turning, vector

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

AngleLaw: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
"""From times (N,) to angle (rad) and its first and second derivative."""


class Fixed(Turning):
    """The attitude does not change.

    Parameters
    ----------
    attitude : Rotation
        Body to NED.
    """

    def __init__(self, attitude: Rotation) -> None:
        self._quat = quaternions.from_rotation(attitude)

    def evaluate(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `Turning`."""
        nothing = np.zeros((3, len(time)))
        return np.repeat(self._quat, len(time), axis=1), nothing, nothing


class AboutAxis(Turning):
    """Rotation about an axis that is fixed in the body, R(t) = R₀ exp(θ(t) [u×]).

    Parameters
    ----------
    start : Rotation
        Attitude R₀ at angle zero, body to NED.
    axis : (3,) array
        Direction u in the body; its length does not matter.
    angle : callable
        θ, θ̇ and θ̈ (rad, s) at given times; see `swing` and `steady`.
    """

    def __init__(self, start: Rotation, axis: npt.ArrayLike, angle: AngleLaw) -> None:
        self._start = quaternions.from_rotation(start)
        given = vector("axis", axis)
        length = float(np.linalg.norm(given))
        if length == 0.0:
            raise InputError(expected("an axis with a direction", "zeros"))
        self._axis = (given / length)[:, None]
        self._angle = angle

    def evaluate(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `Turning`."""
        angle, rate, acceleration = self._angle(time)
        turn = np.concatenate([np.cos(0.5 * angle)[None], self._axis * np.sin(0.5 * angle)])
        return quaternions.multiply(self._start, turn), self._axis * rate, self._axis * acceleration


def swing(amplitude: float, frequency: float, phase: float = 0.0) -> AngleLaw:
    """Angle θ = A (sin(2π f t + φ) − sin φ): a swing that is at zero at t = 0.

    Parameters
    ----------
    amplitude, phase : float
        A and φ, rad. With φ = −π/2 it starts from rest.
    frequency : float
        f, Hz.
    """
    a = check_number("amplitude", amplitude, unit="rad")
    w = 2.0 * math.pi * check_number("frequency", frequency, above=0.0, unit="Hz")
    p = check_number("phase", phase, unit="rad")

    def law(time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        sine, cosine = np.sin(w * time + p), np.cos(w * time + p)
        return a * (sine - math.sin(p)), a * w * cosine, -a * w * w * sine

    return law


def steady(rate: float) -> AngleLaw:
    """Angle θ = rate · t, as of a turntable; rate in rad/s."""
    w = check_number("rate", rate, unit="rad/s")

    def law(time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        return w * time, np.full_like(time, w), np.zeros_like(time)

    return law


class Coning(Turning):
    """The body's z axis goes round a cone while the body does not turn about it.

    Parameters
    ----------
    start : Rotation
        Attitude around which it cones, body to NED.
    half_angle : float
        Angle a between the z axis and the axis of the cone, rad.
    frequency : float
        Turns per second, Hz.

    Notes
    -----
    q = (cos a/2, sin a/2 cos Ωt, sin a/2 sin Ωt, 0) and ω = Ω (−sin a sin Ωt, sin a cos Ωt, cos a − 1). The mean rate
    about z is not zero though the attitude returns: the classical test of strapdown integration (J. E. Bortz, "A New
    Mathematical Formulation for Strapdown Inertial Navigation", 1971).
    """

    def __init__(self, start: Rotation, half_angle: float, frequency: float) -> None:
        self._start = quaternions.from_rotation(start)
        self._half = check_number("half_angle", half_angle, low=0.0, high=math.pi, unit="rad")
        self._omega = 2.0 * math.pi * check_number("frequency", frequency, above=0.0, unit="Hz")

    def evaluate(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `Turning`."""
        a, w = self._half, self._omega
        sine, cosine = np.sin(w * time), np.cos(w * time)
        one, nothing = np.ones_like(time), np.zeros_like(time)
        c, s = math.cos(0.5 * a), math.sin(0.5 * a)
        turn = np.stack([c * one, s * cosine, s * sine, nothing])
        # cos a − 1 without cancellation for small cones
        rate = w * np.stack([-math.sin(a) * sine, math.sin(a) * cosine, -2.0 * s * s * one])
        acceleration = w * w * math.sin(a) * np.stack([-cosine, -sine, nothing])
        return quaternions.multiply(self._start, turn), rate, acceleration
