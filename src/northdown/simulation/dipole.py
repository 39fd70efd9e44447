"""Magnetic disturbances: dipoles, at rest or moving, such as magnets, motors and passing cars."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray
from northdown.errors import InputError, expected
from northdown.simulation.motion import Path, vector
from northdown.simulation.motion_paths import Still

# µ₀/4π in µT m³/(A m²): 1e-7 T m/A within 2e-10 of it (CODATA 2018)
_CONSTANT = 0.1
_NEAREST = 1e-3


class Dipole:
    """Magnetic dipole in the navigation frame.

    Parameters
    ----------
    moment : (3,) array
        Magnetic moment in NED, A m². A magnet of 1 cm³ of neodymium has about 1, a car 100 to 1000.
    place : (3,) array or Path
        Where it is, NED, m; a `Path` when it moves.
    """

    def __init__(self, moment: npt.ArrayLike, place: npt.ArrayLike | Path) -> None:
        self.moment = vector("moment", moment)
        self.path = place if isinstance(place, Path) else Still(place)

    def field(self, time: FloatArray, position: FloatArray) -> FloatArray:
        """Field (3, N) in NED, µT, at times (N,) and places (3, N) in NED.

        Raises
        ------
        InputError
            Within a millimetre of the dipole, where the field of a point is no magnet's.

        Notes
        -----
        B = µ₀/4π (3 r̂ (r̂ · m) − m)/r³.
        """
        r = position - self.path.evaluate(time)[0]
        distance = np.sqrt((r * r).sum(axis=0))
        if len(time) and distance.min() < _NEAREST:
            at = float(time[np.argmin(distance)])
            raise InputError(
                expected("a dipole at least 1 mm from the sensor", f"{distance.min():.2g} m at {at:g} s")
            )
        direction = r / distance
        along = 3.0 * direction * (self.moment @ direction)
        field: FloatArray = _CONSTANT * (along - self.moment[:, None]) / distance**3
        return field
