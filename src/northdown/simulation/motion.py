"""`Motion`: what a body does, as functions of time with exact derivatives.

Two laws make a motion: a `Turning` for the attitude and a `Path` for the position. Either can be asked at any times,
in any order, and its derivatives are those of the same function, not differences.

========================= ============================== ======================
symbol                    name                           unit, axes
========================= ============================== ======================
R (body → NED)            ``quat``, ``rotation``
ω,  Ṙ = R [ω×]            ``rate``                       rad/s, body
ω̇                         ``angular_acceleration``       rad/s², body
p, v = ṗ, a = v̇           ``position``, ``velocity``,    m, m/s, m/s², NED
                          ``acceleration``
========================= ============================== ======================
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray, as_float_array, check_number
from northdown.errors import InputError, expected
from northdown.orientation import Orientation
from northdown.simulation import _quaternions as quaternions

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

STANDARD_GRAVITY = 9.80665
"""m/s² (CGPM 1901)."""


class Turning(ABC):
    """Attitude as a function of time.

    Attributes
    ----------
    span : tuple of two floats
        First and last time (s) at which it is defined.
    """

    span: tuple[float, float] = (-math.inf, math.inf)

    @abstractmethod
    def evaluate(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Attitude and its derivatives.

        Parameters
        ----------
        time : (N,) array
            Times within `span`, s.

        Returns
        -------
        quat, rate, angular_acceleration : (4, N), (3, N), (3, N) arrays
            Unit quaternions (w, x, y, z) from body to NED; body rate, rad/s; its derivative in body axes, rad/s².
        """

    def quat(self, time: FloatArray) -> FloatArray:
        """Attitude alone, (4, N); laws that can do this faster override it."""
        return self.evaluate(time)[0]


class Path(ABC):
    """Position of the body's origin as a function of time; `span` as for `Turning`."""

    span: tuple[float, float] = (-math.inf, math.inf)

    @abstractmethod
    def evaluate(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position (m), velocity (m/s) and acceleration (m/s²) in NED, each (3, N), at times (N,) in s."""

    def acceleration(self, time: FloatArray) -> FloatArray:
        """Acceleration alone, (3, N); laws that can do this faster override it."""
        return self.evaluate(time)[2]


@dataclass(frozen=True, eq=False)
class Kinematics:
    """State of a motion at given times.

    Parameters
    ----------
    time : (N,) array
        Time, s.
    quat : (N, 4) array
        Unit quaternions (w, x, y, z), body to NED.
    rate, angular_acceleration : (N, 3) arrays
        Body rate, rad/s, and its derivative, rad/s², in body axes.
    position, velocity, acceleration : (N, 3) arrays
        Of the body's origin in NED: m, m/s, m/s².
    """

    time: FloatArray
    quat: FloatArray
    rate: FloatArray
    angular_acceleration: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray

    @cached_property
    def rotation(self) -> Rotation:
        """SciPy `Rotation` of length N, body to NED."""
        return quaternions.to_rotation(self.quat.T)

    def specific_force(
        self, gravity: float = STANDARD_GRAVITY, position: npt.ArrayLike = (0.0, 0.0, 0.0)
    ) -> FloatArray:
        """What error-free accelerometers measure, (N, 3), in body axes, m/s².

        Parameters
        ----------
        gravity : float
            m/s², down.
        position : (3,) array
            Place of the accelerometers in the body, m.

        Notes
        -----
        f = Rᵀ (a − g) + ω̇ × r + ω × (ω × r).
        """
        arm = vector("position", position)
        free = self.acceleration - np.array([0.0, 0.0, gravity])
        force = quaternions.rotate_inverse(self.quat.T, free.T).T
        turning = np.cross(self.angular_acceleration, arm) + np.cross(self.rate, np.cross(self.rate, arm))
        return np.ascontiguousarray(force + turning)


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of a rigid body, from `start` to `stop`.

    Parameters
    ----------
    turning : Turning
        Its attitude.
    path : Path
        Its position.
    start, stop : float
        Span of time in which it is of interest, s; inside the spans of both laws.
    name : str
        For the names of recordings.
    """

    turning: Turning
    path: Path
    start: float
    stop: float
    name: str = "motion"

    def __post_init__(self) -> None:
        check_number("start", self.start, unit="s")
        check_number("stop", self.stop, above=float(self.start), unit="s")
        low, high = self.span
        if self.start < low or self.stop > high:
            raise InputError(
                expected(f"a motion from {low:g} to {high:g} s at most", f"{self.start:g} to {self.stop:g} s")
            )

    @property
    def span(self) -> tuple[float, float]:
        """First and last time (s) at which both laws are defined."""
        a, b = self.turning.span, self.path.span
        return max(a[0], b[0]), min(a[1], b[1])

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.stop - self.start

    def times(self, rate: float) -> FloatArray:
        """Times from start to stop at a constant rate (Hz)."""
        rate = check_number("rate", rate, above=0.0, unit="Hz")
        return self.start + np.arange(int(np.floor(self.duration * rate + 1e-9)) + 1) / rate

    def orientation(
        self, time: npt.ArrayLike | None = None, *, rate: float = 100.0, frame: str = "NED"
    ) -> Orientation:
        """The true orientation at given times (s), or at a rate (Hz) from start to stop."""
        state = self.at(self.times(rate) if time is None else time)
        return Orientation(state.time, state.quat, "NED", name=self.name).to_frame(frame)

    def at(self, time: npt.ArrayLike) -> Kinematics:
        """Exact state at any times within `span`.

        Parameters
        ----------
        time : float or (N,) array
            Times, s, in any order.

        Raises
        ------
        InputError
            When a time lies outside the span.
        """
        t = np.atleast_1d(as_float_array("time", time))
        low, high = self.span
        if t.ndim != 1:
            raise InputError(expected("time of shape (N,)", f"shape {t.shape}"))
        outside = ~((t >= low) & (t <= high))
        if outside.any():
            at = int(np.argmax(outside))
            raise InputError(expected(f"times from {low:g} to {high:g} s", f"{t[at]:g} s", at=at))
        quat, rate, angular = self.turning.evaluate(t)
        rows = [quat, rate, angular, *self.path.evaluate(t)]
        return Kinematics(t, *(np.ascontiguousarray(x.T) for x in rows))


def vector(name: str, value: npt.ArrayLike) -> FloatArray:
    """Check three finite numbers."""
    array = as_float_array(name, value)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise InputError(expected(f"three finite numbers for {name}", f"{array.tolist()}"))
    return array
