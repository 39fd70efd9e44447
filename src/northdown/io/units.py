"""Units of measured columns: each is converted once, here, to rad/s, m/s², µT and seconds.

======== ===============================================================================================
quantity units (upper or lower case; superscripts, ``^`` and spaces as you like)
======== ===============================================================================================
gyr      rad/s, mrad/s, deg/s (dps, °/s), mdps
acc      m/s², g, mg, with g = 9.80665 m/s²
array    as acc
mag      uT (µT), nT, mT, T, G (gauss), mG, a.u. (size without known unit: only its direction counts)
time     s, ms, us, ns
======== ===============================================================================================
"""

from __future__ import annotations

import math
import re
from typing import Final

from northdown._validation import check_number
from northdown.errors import InputError, expected

STANDARD_GRAVITY: Final = 9.80665
"""m/s² in one g (CGPM 1901)."""

ARBITRARY: Final = "a.u."
QUANTITIES: Final = ("time", "gyr", "acc", "mag", "array")

_DEG: Final = math.pi / 180.0
# Factor to SI (µT for the field) and spellings, after `_plain`.
_SPELLINGS: Final[dict[str, tuple[tuple[float, str], ...]]] = {
    "gyr": (
        (1.0, "rad/s rad/sec rads-1 radians/s radians/sec radian/s rads"),
        (1e-3, "mrad/s mrads-1"),
        (_DEG, "deg/s deg/sec degs-1 degree/s degrees/s degrees/sec dps degs"),
        (1e-3 * _DEG, "mdps mdeg/s"),
    ),
    "acc": (
        (1.0, "m/s2 m/s/s ms-2 m/s**2 m/sec2 m/sec/sec mps2"),
        (STANDARD_GRAVITY, "g gn g0"),
        (1e-3 * STANDARD_GRAVITY, "mg milli-g millig"),
    ),
    "mag": (
        (1.0, "ut microtesla"),
        (1e-3, "nt nanotesla"),
        (1e3, "mt millitesla"),
        (1e6, "t tesla"),
        (100.0, "g gauss gs"),
        (0.1, "mg mgauss milligauss"),
        (1.0, "a.u. au a.u arbitrary normalized normalised 1 -"),
    ),
    "time": (
        (1.0, "s sec secs second seconds"),
        (1e-3, "ms msec msecs millisecond milliseconds milli millis"),
        (1e-6, "us usec usecs microsecond microseconds micros"),
        (1e-9, "ns nsec nsecs nanosecond nanoseconds nanos"),
    ),
}
_FACTORS: Final[dict[str, dict[str, float]]] = {
    quantity: {word: factor for factor, words in rows for word in words.split()}
    for quantity, rows in _SPELLINGS.items()
}
_FACTORS["array"] = _FACTORS["acc"]  # its channels are accelerometers
_ARBITRARY: Final = frozenset(_SPELLINGS["mag"][-1][1].split())
_SHOWN: Final = {
    "gyr": "rad/s, deg/s, dps, mdps",
    "acc": "m/s², g, mg",
    "mag": "uT, nT, mT, T, G, mG, a.u.",
    "time": "s, ms, us, ns",
    "array": "m/s², g, mg",
}
_REPLACED: Final = str.maketrans(
    {
        "µ": "u",
        "μ": "u",
        "°": "deg",
        "º": "deg",
        "²": "2",
        "⁻": "-",
        "¹": "1",
        "−": "-",
        "_": "/",
        "^": "",
        " ": "",
        "·": "",
        "⋅": "",
    }
)


def _plain(unit: str) -> str:
    return unit.translate(_REPLACED).lower()


def is_unit(quantity: str, unit: str) -> bool:
    """Whether a text is a unit of ``"gyr"``, ``"acc"``, ``"mag"``, ``"time"`` or ``"array"``."""
    return _plain(unit) in _FACTORS[quantity]


def is_arbitrary(unit: str | float | None) -> bool:
    """Whether a field in this unit has a size without meaning."""
    return unit is None or (isinstance(unit, str) and _plain(unit) in _ARBITRARY)


def factor(quantity: str, unit: str | float | None) -> float:
    """Find the factor that takes a unit to SI (µT for ``"mag"``).

    Parameters
    ----------
    quantity : {"gyr", "acc", "mag", "time", "array"}
        What is measured.
    unit : str, float or None
        A unit of the table above; a number is the factor itself, for raw counts; None means SI already.

    Raises
    ------
    InputError
        When the unit is not one of this quantity.
    """
    if unit is None:
        return 1.0
    if not isinstance(unit, str):
        return check_number(f"the factor of {quantity}", unit, above=0.0)
    try:
        return _FACTORS[quantity][_plain(unit)]
    except KeyError:
        what = f"a unit of {quantity} out of {_SHOWN[quantity]}"
        do = f"give units={{{quantity!r}: …}}, a unit or the factor to SI"
        raise InputError(expected(what, repr(unit[:40]), do=do)) from None


def split_bracket(label: str) -> tuple[str, str | None]:
    """Split a header such as ``"Gyroscope X (deg/s)"`` into name and unit; the unit is None without bracket."""
    match = re.fullmatch(r"(.*?)\s*[(\[{]([^()\[\]{}]*)[)\]}]\s*", label)
    if match is None:
        return label.strip(), None
    return match[1].strip(), match[2].strip() or None
