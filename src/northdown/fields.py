"""Gravity and the Earth's magnetic field at a place: WGS 84 and the World Magnetic Model.

`northdown` takes north as *magnetic* north, so that estimators need no position: there the field is
`MagneticField.magnetic_ned`. Add the declination with `to_true_north` where true headings are wanted.
"""

from __future__ import annotations

import datetime
import importlib
import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from northdown._validation import FloatArray, check_number
from northdown.errors import InputError, MissingDependencyError, expected
from northdown.orientation import Orientation

# WGS 84: semi-major axis (m), flattening, first eccentricity squared, normal gravity at the equator (m/s²),
# Somigliana's constant, and ω² a² b/GM.
_A: Final = 6_378_137.0
_F: Final = 1.0 / 298.257223563
_E2: Final = 6.69437999014e-3
_GAMMA_E: Final = 9.7803253359
_K: Final = 0.00193185265241
_M: Final = 0.00344978650684


def normal_gravity(latitude: float, height: float = 0.0) -> float:
    """Gravity at a place on or above the WGS 84 ellipsoid, m/s², down.

    Parameters
    ----------
    latitude : float
        Geodetic, rad.
    height : float
        Above the ellipsoid, m; −10 to 100 km.

    Notes
    -----
    Somigliana's formula and the free-air correction to second order, NIMA TR8350.2 (2000), equations 4-1 and 4-3. Up
    to 20 km the correction's own error is below 2e-6 m/s². Real gravity differs by up to about 2e-3 m/s².
    """
    lat = check_number("latitude", latitude, low=-math.pi / 2, high=math.pi / 2, unit="rad")
    h = check_number("height", height, low=-10e3, high=100e3, unit="m") / _A
    square = math.sin(lat) ** 2
    surface = _GAMMA_E * (1.0 + _K * square) / math.sqrt(1.0 - _E2 * square)
    return surface * (1.0 - 2.0 * (1.0 + _F + _M - 2.0 * _F * square) * h + 3.0 * h * h)


@dataclass(frozen=True)
class MagneticField:
    """The Earth's magnetic field at a place.

    Parameters
    ----------
    declination : float
        Magnetic north is this far east of true north, rad.
    inclination : float
        Dip: the field points this far below the horizon, rad.
    intensity : float
        µT.
    """

    declination: float
    inclination: float
    intensity: float

    @property
    def horizontal(self) -> float:
        """Horizontal part, µT. Below 6 µT, near the magnetic poles, headings are poor; below 2 µT of no use."""
        return self.intensity * math.cos(self.inclination)

    @property
    def ned(self) -> FloatArray:
        """Vector (3,) in true north, east, down, µT."""
        h, d = self.horizontal, self.declination
        return np.array([h * math.cos(d), h * math.sin(d), self.intensity * math.sin(self.inclination)])

    @property
    def magnetic_ned(self) -> FloatArray:
        """Vector (3,) in magnetic north, east, down, µT: the axes in which estimators work."""
        return np.array([self.horizontal, 0.0, self.intensity * math.sin(self.inclination)])


def earth_field(
    latitude: float, longitude: float, height: float = 0.0, *, date: float | str | datetime.date
) -> MagneticField:
    """Magnetic field of the Earth by the World Magnetic Model.

    Parameters
    ----------
    latitude, longitude : float
        Geodetic, rad.
    height : float
        Above the WGS 84 ellipsoid, m; −1 to 850 km.
    date : float, str or datetime.date
        Year with fraction (2026.5), ISO date ("2026-07-01") or date, from 2010 to the end of 2029.

    Raises
    ------
    InputError
        Outside these ranges.
    MissingDependencyError
        Without the package pygeomag.

    Notes
    -----
    The model of NOAA and the British Geological Survey of the date's five years. It holds the part of the field that
    comes from the Earth's core; of the crust and of the ionosphere the declination commonly differs by some 0.4°, and
    near iron by any amount.
    """
    lat = check_number("latitude", latitude, low=-math.pi / 2, high=math.pi / 2, unit="rad")
    lon = check_number("longitude", longitude, low=-2 * math.pi, high=2 * math.pi, unit="rad")
    kilometres = check_number("height", height, low=-1e3, high=850e3, unit="m") / 1e3
    year = _decimal_year(date)
    model = _pygeomag().GeoMag(base_year=year)
    found = model.calculate(glat=math.degrees(lat), glon=math.degrees(lon), alt=kilometres, time=year)
    return MagneticField(math.radians(found.d), math.radians(found.i), found.f / 1e3)


def to_true_north(orientation: Orientation, declination: float) -> Orientation:
    """Orientation relative to true north from one relative to magnetic north.

    Parameters
    ----------
    orientation : Orientation
        In any frame, whose north is magnetic.
    declination : float
        Magnetic north is this far east of true north, rad; it is added to the heading.
    """
    from scipy.spatial.transform import Rotation

    angle = check_number("declination", declination, low=-math.pi, high=math.pi, unit="rad")
    # about down in NED, and so the other way about an axis that points up
    return orientation.turned(left=Rotation.from_rotvec([0.0, 0.0, angle if orientation.frame == "NED" else -angle]))


def _decimal_year(date: float | str | datetime.date) -> float:
    if isinstance(date, str):
        try:
            date = datetime.date.fromisoformat(text := date.strip())
        except ValueError:
            raise InputError(expected("a date such as 2026-07-01", repr(text[:40]))) from None
    if isinstance(date, datetime.date):
        first, after = datetime.date(date.year, 1, 1), datetime.date(date.year + 1, 1, 1)
        date = date.year + (date.toordinal() - first.toordinal()) / (after - first).days
    return check_number("date", date, low=2010.0, high=math.nextafter(2030.0, 0.0))


def _pygeomag() -> Any:
    try:
        return importlib.import_module("pygeomag")
    except ImportError:
        do = "run: pip install 'northdown[fields]'"
        raise MissingDependencyError(expected("the package pygeomag", "none installed", do=do)) from None
