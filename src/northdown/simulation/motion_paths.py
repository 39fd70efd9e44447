"""Paths: standing still, shaking, and splines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray, check_number
from northdown.simulation.motion import Path, vector

if TYPE_CHECKING:
    from scipy.interpolate import BPoly, BSpline


class Still(Path):
    """The body's origin stays at one place.

    Parameters
    ----------
    position : (3,) array
        NED, m.
    """

    def __init__(self, position: npt.ArrayLike = (0.0, 0.0, 0.0)) -> None:
        self.position = vector("position", position)

    def evaluate(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `Path`."""
        nothing = np.zeros((3, len(time)))
        return nothing + self.position[:, None], nothing, nothing


class Shaking(Path):
    """Sinusoidal shift, p = amplitude · sin(2π f t + φ), as of a vibrating floor.

    Parameters
    ----------
    amplitude : (3,) array
        NED, m.
    frequency : float
        Hz.
    phase : float
        rad.
    """

    def __init__(self, amplitude: npt.ArrayLike, frequency: float, phase: float = 0.0) -> None:
        self.amplitude = vector("amplitude", amplitude)
        self.frequency = check_number("frequency", frequency, above=0.0, unit="Hz")
        self.phase = check_number("phase", phase, unit="rad")

    def evaluate(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `Path`."""
        w = 2.0 * np.pi * self.frequency
        sine, cosine = np.sin(w * time + self.phase), np.cos(w * time + self.phase)
        position: FloatArray = self.amplitude[:, None] * sine
        return position, w * self.amplitude[:, None] * cosine, -w * w * position


class SplinePath(Path):
    """Position along a piecewise polynomial; before its first and after its last break it stays where it is.

    Parameters
    ----------
    spline : scipy.interpolate.BSpline or BPoly
        Of values (3,) in NED, m. For an acceleration without jumps its first two derivatives vanish at both ends.
    ends : sequence of float
        Its first and last break, s.
    """

    def __init__(self, spline: BSpline | BPoly, ends: Sequence[float] | FloatArray) -> None:
        self._spline = spline
        self._rate, self._acceleration = spline.derivative(1), spline.derivative(2)
        self._first, self._last = float(ends[0]), float(ends[-1])

    def evaluate(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `Path`."""
        inside = np.clip(time, self._first, self._last)
        moving = inside == time
        position = self._spline(inside).T
        return (
            position,
            np.where(moving, self._rate(inside).T, 0.0),
            np.where(moving, self._acceleration(inside).T, 0.0),
        )

    def acceleration(self, time: FloatArray) -> FloatArray:
        """See `Path`."""
        inside = np.clip(time, self._first, self._last)
        acceleration: FloatArray = np.where(inside == time, self._acceleration(inside).T, 0.0)
        return acceleration
