"""Motions ready to use: each function makes one, and `MOTIONS` names those that need nothing but a duration."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from northdown._validation import check_number
from northdown.errors import InputError, expected
from northdown.simulation.motion import Motion, vector
from northdown.simulation.motion_closed import AboutAxis, Coning, Fixed, swing
from northdown.simulation.motion_from_rate import FromRate, free_body
from northdown.simulation.motion_paths import Still
from northdown.simulation.motion_random import random_motion
from northdown.simulation.motion_walk import walk

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

K06_RATE: Final = (1.0966, 2.1932, 2.1932)
"""Amplitude of the rate of K06's three-axis rotation, rad/s."""


def _attitude(attitude: Rotation | None) -> Rotation:
    from scipy.spatial.transform import Rotation

    if attitude is None:
        return Rotation.identity()
    if not isinstance(attitude, Rotation) or attitude.as_quat().ndim != 1:
        raise InputError(expected("one SciPy Rotation, body to NED", type(attitude).__name__))
    return attitude


def rest(duration: float = 60.0, *, attitude: Rotation | None = None) -> Motion:
    """Rest in one attitude (body to NED); level with x to the north when not given."""
    stop = check_number("duration", duration, above=0.0, unit="s")
    return Motion(Fixed(_attitude(attitude)), Still(), 0.0, stop, "rest")


def k06_sine(
    duration: float = 2.0,
    *,
    amplitude: npt.ArrayLike = K06_RATE,
    frequency: float = 2.0,
    attitude: Rotation | None = None,
) -> Motion:
    """Rotation of K06 section 4-1: ω = amplitude · sin(2π f t) about three axes at once.

    Parameters
    ----------
    duration : float
        s.
    amplitude : (3,) array
        rad/s.
    frequency : float
        Hz.
    attitude : Rotation, optional
        At t = 0, body to NED; K06 does not print it.

    Notes
    -----
    The three sines are in phase, so the rotation is about one axis of the body and the attitude has the closed form
    R₀ exp(amplitude (1 − cos 2πft)/(2πf)).
    """
    stop = check_number("duration", duration, above=0.0, unit="s")
    rate = float(np.linalg.norm(vector("amplitude", amplitude)))
    f = check_number("frequency", frequency, above=0.0, unit="Hz")
    law = swing(rate / (2.0 * math.pi * f), f, -0.5 * math.pi)
    return Motion(AboutAxis(_attitude(attitude), amplitude, law), Still(), 0.0, stop, "k06-sine")


def pitch_sweep(
    duration: float = 60.0, *, amplitude: float = math.radians(120.0), frequency: float = 0.1, yaw: float = 0.5
) -> Motion:
    """Pitch that swings through +90° and −90°, where Euler angles are singular.

    Parameters
    ----------
    duration : float
        s.
    amplitude : float
        Greatest pitch angle, rad.
    frequency : float
        Swings per second, Hz.
    yaw : float
        Heading at level, rad.
    """
    from scipy.spatial.transform import Rotation

    stop = check_number("duration", duration, above=0.0, unit="s")
    start = Rotation.from_euler("Z", check_number("yaw", yaw, unit="rad"))
    return Motion(AboutAxis(start, (0.0, 1.0, 0.0), swing(amplitude, frequency)), Still(), 0.0, stop, "pitch-sweep")


def coning(
    duration: float = 60.0,
    *,
    half_angle: float = math.radians(5.0),
    frequency: float = 1.0,
    attitude: Rotation | None = None,
) -> Motion:
    """Coning of the z axis by `half_angle` (rad), `frequency` times a second; see `Coning`."""
    stop = check_number("duration", duration, above=0.0, unit="s")
    return Motion(Coning(_attitude(attitude), half_angle, frequency), Still(), 0.0, stop, "coning")


def tumbling(
    duration: float = 60.0,
    *,
    inertia: npt.ArrayLike = (1.0, 2.0, 3.0),
    rate_x: float = 3.4,
    rate_z: float = 2.0,
    attitude: Rotation | None = None,
) -> Motion:
    """Tumbling of a body in free flight through all attitudes, as to its rotation; see `free_body`.

    Its origin stays in place, so that the accelerometer reads gravity alone.
    """
    stop = check_number("duration", duration, above=0.0, unit="s")
    law = free_body(inertia, rate_x, rate_z)
    # the rates' own frequencies are of the size of the rates
    step = 0.05 / math.hypot(rate_x, rate_z)
    return Motion(FromRate(_attitude(attitude), law, step=step), Still(), 0.0, stop, "tumbling")


def _random(duration: float, seed: int) -> Motion:
    return random_motion(duration, seed)


def _of_duration(make: Callable[[float], Motion]) -> Callable[[float, int], Motion]:
    def motion(duration: float, seed: int) -> Motion:
        return make(duration)

    return motion


MOTIONS: Final[dict[str, Callable[[float, int], Motion]]] = {
    "random": _random,
    "rest": _of_duration(rest),
    "k06-sine": _of_duration(k06_sine),
    "pitch-sweep": _of_duration(pitch_sweep),
    "coning": _of_duration(coning),
    "tumbling": _of_duration(tumbling),
    "walk": _of_duration(walk),
}
"""Motions by name: from duration (s) and seed. Only ``"random"`` depends on the seed."""
