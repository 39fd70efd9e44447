"""Units of noise coefficients: SI, and those of data sheets."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

GRAVITY: Final = 9.80665
_DEG: Final = 180.0 / math.pi
_MICRO_G: Final = 1e6 / GRAVITY
_HOUR: Final = 3600.0
_ROOT_HOUR: Final = 60.0

SYMBOLS: Final = ("Q", "N", "B", "K", "R")
NAMES: Final = {
    "Q": "quantisation",
    "N": "white noise",
    "B": "bias instability",
    "K": "random walk",
    "R": "ramp",
}


@dataclass(frozen=True)
class Unit:
    """A unit for display: SI value × factor."""

    name: str
    factor: float


SI: Final[dict[str, dict[str, str]]] = {
    "gyr": {"Q": "rad", "N": "rad/s/√Hz", "B": "rad/s", "K": "rad/s²/√Hz", "R": "rad/s²", "": "rad/s"},
    "acc": {"Q": "m/s", "N": "m/s²/√Hz", "B": "m/s²", "K": "m/s³/√Hz", "R": "m/s³", "": "m/s²"},
    "mag": {"Q": "µT·s", "N": "µT/√Hz", "B": "µT", "K": "µT/s/√Hz", "R": "µT/s", "": "µT"},
}
"""Units inside the library, by sensor and symbol; under the empty symbol the unit of the signal."""

SHOWN: Final[dict[str, dict[str, tuple[Unit, ...]]]] = {
    "gyr": {
        "Q": (Unit("µrad", 1e6),),
        "N": (Unit("°/s/√Hz", _DEG), Unit("°/√h", _DEG * _ROOT_HOUR)),
        "B": (Unit("°/h", _DEG * _HOUR),),
        "K": (Unit("°/h/√h", _DEG * _HOUR * _ROOT_HOUR),),
        "R": (Unit("°/h²", _DEG * _HOUR**2),),
        "": (Unit("°/s", _DEG),),
    },
    "acc": {
        "Q": (Unit("mm/s", 1e3),),
        "N": (Unit("µg/√Hz", _MICRO_G), Unit("m/s/√h", _ROOT_HOUR)),
        "B": (Unit("µg", _MICRO_G),),
        "K": (Unit("µg/√h", _MICRO_G * _ROOT_HOUR),),
        "R": (Unit("µg/h", _MICRO_G * _HOUR),),
        "": (Unit("µg", _MICRO_G),),
    },
    "mag": {
        "Q": (Unit("nT·s", 1e3),),
        "N": (Unit("nT/√Hz", 1e3),),
        "B": (Unit("nT", 1e3),),
        "K": (Unit("nT/√h", 1e3 * _ROOT_HOUR),),
        "R": (Unit("nT/h", 1e3 * _HOUR),),
        "": (Unit("nT", 1e3),),
    },
}
"""Units for tables and figures, the first one for choice."""


def si_unit(sensor: str, symbol: str, *, arbitrary: bool = False) -> str:
    """SI unit of a coefficient; a field of unknown unit counts in 'a.u.' instead of µT."""
    name = SI[sensor][symbol]
    return name.replace("µT", "a.u.") if arbitrary else name


def shown_units(sensor: str, symbol: str, *, arbitrary: bool = False) -> tuple[Unit, ...]:
    """Units in which a coefficient is shown."""
    units = SHOWN[sensor][symbol]
    return tuple(Unit(u.name.replace("nT", "a.u."), u.factor * 1e-3) for u in units) if arbitrary else units
