r"""What is to be found, what measures it, and how it evolves: the models whose observability is analysed.

The attitude is one of

=================== =================================================== =============================================
state               numbers                                             evolves by
=================== =================================================== =============================================
``quaternion``      q = (w, x, y, z), of any length                     q̇ = ½ q ⊗ (0, ω)
``quaternion+norm`` the same, and \|q\|² as one more measurement          the same
``euler``           roll φ, pitch θ, yaw ψ                              K06 (2.9)
``tangent``         small rotation δ about north, east, down            q = exp(δ) q(t)
=================== =================================================== =============================================

with the body rate ω known, unless it is a state itself (then its derivative is known, as in an inertial unit without
gyroscopes). Measured is either, method ``direct``, the direction of gravity and the field in the body, axis by axis
(K06 (3.19), (3.20)), or, method ``indirect``, what K06 (3.16) makes of them: −tan ψ, −sin θ, tan φ.

K06 prints z₂ = −2 (xz − wy) without and z₁, z₃ as quotients, so that only z₂ changes with the length of q; and (2.16)
has 1/‖q‖. Its figure 3.4 follows only when z₂ is divided by \|q\|² too and 1/‖q‖ is left out; see `Variant`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias, get_args

from northdown._validation import check_choice
from northdown.errors import InputError, expected

State: TypeAlias = Literal["quaternion", "quaternion+norm", "euler", "tangent"]
Unknown: TypeAlias = Literal["gyr_bias", "field", "dip", "rate"]
Method: TypeAlias = Literal["direct", "indirect"]
Variant: TypeAlias = Literal["scale-free", "printed-pitch", "printed-rate", "printed"]
"""Equations of the quaternion: independent of its length, with K06's z₂, with K06's 1/‖q‖ in q̇, or with both."""

STATES: Final[tuple[str, ...]] = get_args(State)
UNKNOWNS: Final[tuple[str, ...]] = get_args(Unknown)
METHODS: Final[tuple[str, ...]] = get_args(Method)
VARIANTS: Final[tuple[str, ...]] = get_args(Variant)

ATTITUDE_NAMES: Final = {
    "quaternion": ("qw", "qx", "qy", "qz"),
    "quaternion+norm": ("qw", "qx", "qy", "qz"),
    "euler": ("roll", "pitch", "yaw"),
    "tangent": ("turn_north", "turn_east", "turn_down"),
}
UNKNOWN_NAMES: Final = {
    "gyr_bias": ("gyr_bias_x", "gyr_bias_y", "gyr_bias_z"),
    "field": ("field_north", "field_down"),
    "dip": ("dip",),
    "rate": ("rate_x", "rate_y", "rate_z"),
}


@dataclass(frozen=True)
class Model:
    """States, measurements and equations.

    Parameters
    ----------
    sensors : tuple of str
        Axes, such as ``"acc_x"``; see `parse_sensors`.
    state : {"quaternion", "quaternion+norm", "euler", "tangent"}
        How the attitude is written.
    unknown : tuple of {"gyr_bias", "field", "dip", "rate"}
        What else is to be found, all constant but the rate: the gyroscope's bias in body axes (rad/s); the field's
        parts north and down; or of a field of unit size the dip (rad) alone; the body rate (rad/s).
    method : {"direct", "indirect"}
        What is measured.
    variant : {"scale-free", "printed-pitch", "printed-rate", "printed"}
        See `Variant`.
    field : tuple of two floats
        The field's part to the north and down, in any unit.
    """

    sensors: tuple[str, ...]
    state: State = "quaternion"
    unknown: tuple[Unknown, ...] = ()
    method: Method = "direct"
    variant: Variant = "scale-free"
    field: tuple[float, float] = (0.5, math.sqrt(0.75))

    def __post_init__(self) -> None:
        check_choice("state", self.state, STATES)
        check_choice("method", self.method, METHODS)
        check_choice("variant", self.variant, VARIANTS)
        for name in self.unknown:
            check_choice("unknown", name, UNKNOWNS)
        if {"field", "dip"} <= set(self.unknown):
            raise InputError(expected("either field or dip as unknown", "both", do="field includes the dip"))
        if any(s.startswith("gyr") for s in self.sensors) and "rate" not in self.unknown:
            do = "make the rate unknown, or leave gyr out: it drives the model"
            raise InputError(expected("gyr as a sensor only with an unknown rate", "a known rate", do=do))
        if {"gyr_bias", "rate"} <= set(self.unknown) and not any(s.startswith("gyr") for s in self.sensors):
            raise InputError(expected("gyr among the sensors for its bias and an unknown rate", "none"))
        if self.method == "indirect":
            self._check_indirect()

    def _check_indirect(self) -> None:
        acc, mag = axes_of(self.sensors, "acc"), axes_of(self.sensors, "mag")
        if acc != "xyz" or mag not in ("", "xyz"):
            got = ", ".join(self.sensors) or "no sensors"
            do = "add axes, or use the direct method"
            raise InputError(expected("acc xyz, with mag xyz or without mag, for the indirect method", got, do=do))
        if {"field", "dip"} & set(self.unknown):
            raise InputError(
                expected("a known field with the indirect method, which does not use it", "an unknown one")
            )

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the n states."""
        names = list(ATTITUDE_NAMES[self.state])
        for name in self.unknown:
            names += UNKNOWN_NAMES[name]
        return tuple(names)

    @property
    def measurement_names(self) -> tuple[str, ...]:
        """Names of the m measurements."""
        names = self.sensors
        if self.method == "indirect":
            yaw = ("-tan(yaw)",) if axes_of(self.sensors, "mag") else ()
            names = (*yaw, "-sin(pitch)", "tan(roll)", *(s for s in self.sensors if s.startswith("gyr")))
        return (*names, "norm") if self.state == "quaternion+norm" else names


def axes_of(sensors: Iterable[str], kind: str) -> str:
    """Axes of one kind of sensor, such as ``"xy"``."""
    return "".join(s[-1] for s in sensors if s.startswith(kind))


_ITEM: Final = re.compile(r"(acc|mag|gyr)[ _:]*([xyz]{0,3})", re.IGNORECASE)


def parse_sensors(sensors: str | Sequence[str]) -> tuple[str, ...]:
    """Axes of sensors from a text such as ``"acc xyz, mag xy"``, or a sequence of its parts.

    Returns
    -------
    tuple of str
        Such as ``("acc_x", "acc_y", "acc_z", "mag_x", "mag_y")``, in this order; all three axes where none is named.

    Raises
    ------
    InputError
        For anything else, or an axis named twice.
    """
    if not isinstance(sensors, (str, list, tuple)):
        raise InputError(expected("sensors such as 'acc xyz, mag xy'", type(sensors).__name__))
    parts = sensors.split(",") if isinstance(sensors, str) else [str(s) for s in sensors]
    found: list[str] = []
    for part in (p.strip() for p in parts):
        match = _ITEM.fullmatch(part)
        if match is None:
            raise InputError(expected("sensors such as 'acc xyz, mag xy' out of acc, mag and gyr", repr(part)))
        found += [f"{match[1].lower()}_{axis}" for axis in (match[2].lower() or "xyz")]
    twice = [s for k, s in enumerate(found) if s in found[:k]]
    if twice or not found:
        raise InputError(expected("each axis of a sensor once", f"{twice[0]} twice" if twice else "none"))
    return tuple(sorted(found, key=lambda s: (("acc", "mag", "gyr").index(s[:3]), s)))
