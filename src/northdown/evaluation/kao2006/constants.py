"""What K06 assumes, and what it does not print and had to be found.

Printed: 400 Hz, 2 s, noise of 0.1 m/s² and 0.01 gauss, the motions, the geometry but for its size.

Not printed: the circle's radius, the local field, the attitudes at the start, the covariance at the start and how the
measurements' noise was set. `DOCUMENTED` holds the values with which the tables are met best among those that make
sense. One of them makes none: gravity's y component, ½ (A2 + A3y), has the noise 0.1/√2, and K06's numbers ask for
twice that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from northdown._validation import FloatArray
from northdown.simulation.motion import Motion
from northdown.simulation.motion_library import k06_sine, pitch_sweep, rest

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

RATE: Final = 400.0
"""Samples per second."""
DURATION: Final = 2.0
"""Length of a run, s."""


@dataclass(frozen=True)
class Constants:
    """Everything that the filters and their data are made with.

    Parameters
    ----------
    acc_noise : float
        Standard deviation of a sample of each accelerometer, m/s².
    mag_noise : float
        The same of the magnetometer, in sizes of the field.
    gravity : float
        m/s².
    radius : float
        Of the circle on which the accelerometers sit, m.
    dip : float
        Of the field, rad.
    gravity_noise : tuple of three floats
        Standard deviation that the filters suppose for gravity's x, y and z components, m/s².
    yaw_sine, yaw_rest : float
        Yaw at the start of the two motions, which start level, rad.
    start_variance : float
        On the diagonal of P at the start.
    """

    acc_noise: float = 0.1
    mag_noise: float = 0.01
    gravity: float = 9.81
    radius: float = 0.0175
    dip: float = math.radians(60.0)
    gravity_noise: tuple[float, float, float] = (0.0707, 0.1414, 0.0577)
    yaw_sine: float = math.radians(19.5)
    yaw_rest: float = math.radians(11.46)
    start_variance: float = 1.0

    @property
    def field_n(self) -> FloatArray:
        """Local field in NED, of size one."""
        return np.array([math.cos(self.dip), 0.0, math.sin(self.dip)])

    def motion(self, name: str, duration: float = DURATION) -> Motion:
        """The motions of K06's chapter 4: ``"sine"``, ``"rest"``, and ``"pitch"`` through ±90°.

        Of the last K06 says only that pitch is near 90°; here it swings to ±120° once in two seconds.
        """
        if name == "pitch":
            return pitch_sweep(duration, frequency=0.5, yaw=self.yaw_rest)
        if name == "sine":
            return k06_sine(duration, attitude=_level(self.yaw_sine))
        return rest(duration, attitude=_level(self.yaw_rest))

    def stated(self) -> list[tuple[str, str]]:
        """Names and values, to print beside results."""
        x, y, z = self.gravity_noise
        return [
            ("Printed in K06", f"{RATE:g} Hz, noise {self.acc_noise:g} m/s² and {self.mag_noise:g} gauss"),
            ("Radius", f"{1e3 * self.radius:g} mm"),
            ("Field", f"({self.field_n[0]:.3f}, 0, {self.field_n[2]:.3f}) gauss in NED"),
            ("Gravity", f"{self.gravity:g} m/s²"),
            ("Noise of gravity", f"{x:g}, {y:g}, {z:g} m/s² in x, y, z, as the filters suppose"),
            (
                "Start",
                f"level, yaw {math.degrees(self.yaw_sine):g}° in motion and {math.degrees(self.yaw_rest):g}° at rest",
            ),
            ("P at the start", f"{self.start_variance:g} times the unit matrix"),
            ("Geometry", "A1 along x and A2 along y, as (2.25) demands and table 2.1 does not; A3x does not drive ω"),
            ("Filters", "indirect R propagated in full; q made unit and P projected after each update"),
        ]


DOCUMENTED: Final = Constants()
"""With these the tables are met best."""

DERIVED: Final = Constants(
    gravity_noise=(0.1 / math.sqrt(2.0), 0.1 / math.sqrt(2.0), 0.1 / math.sqrt(3.0)),
    yaw_sine=math.radians(15.0),
    yaw_rest=math.radians(15.0),
)
"""The noise that follows from (2.26), and one attitude at the start of both motions."""


def _level(yaw: float) -> Rotation:
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("z", yaw)
