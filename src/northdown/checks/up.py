"""Checks of which way is up: the accelerometer's sign against the frame, the field and the reference.

The motion cannot tell specific force from its opposite, because both turn alike. Three things can:

- a reference, with certainty;
- the field: it points down north of the magnetic equator and up south of it;
- the way the body lies at rest: bodies are mostly mounted with the z axis as the frame has it, but need not be.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from northdown._validation import FloatArray
from northdown.checks.base import Finding, Severity, Signals
from northdown.frames import up_axis

# Blocks of this length (s) in which the accelerometer varies by less than this share of gravity are rest.
_BLOCK, _REST = 0.5, 0.015
# The body lies flat when z holds this share of gravity, in this share of the blocks.
_FLAT, _MOSTLY = 0.9, 0.7
# Cosine of the angle between measured and true up beyond which the axes are wrong, and not just the calibration.
_WRONG = math.cos(math.radians(30.0))
_MOST_SAMPLES = 4000
# A reference this long (s) after the sample still tells its attitude well enough.
_CLOSE = 0.1


def rest_up(s: Signals) -> FloatArray:
    """Unit specific force, (M, 3) in body axes, in each block in which the accelerometer rests."""
    if "acc" not in s.sensors or not s.step > 0.0:
        return np.zeros((0, 3))
    acc = s.sensors["acc"]
    width = max(2, round(_BLOCK / s.step))
    n = len(acc) // width
    blocks = acc[: n * width].reshape(n, width, 3)
    keep = max(1, n // 2000)
    blocks = blocks[::keep]
    mean = blocks.mean(axis=1)
    size = np.sqrt(np.einsum("ij,ij->i", mean, mean))
    spread = np.sqrt(blocks.var(axis=1).sum(axis=1))
    rest = spread < _REST * s.medians["acc"]
    rest &= np.abs(size - s.medians["acc"]) < 0.1 * s.medians["acc"]
    up: FloatArray = mean[rest] / size[rest, None]
    return up


def field_down(s: Signals) -> float:
    """Mean sine of the field's dip, taking the accelerometer to point up; NaN when it says nothing."""
    if "acc" not in s.sensors or "mag" not in s.sensors:
        return math.nan
    both = np.flatnonzero(s.present["acc"] & s.present["mag"])
    both = both[:: max(1, len(both) // _MOST_SAMPLES)]
    acc, mag = s.sensors["acc"][both], s.sensors["mag"][both]
    size = np.sqrt(np.einsum("ij,ij->i", acc, acc) * np.einsum("ij,ij->i", mag, mag))
    good = size > 0.0
    if good.sum() < 10:
        return math.nan
    sine = -np.einsum("ij,ij->i", acc[good], mag[good]) / size[good]
    # near the magnetic equator, or with a badly disturbed field, the sign means nothing
    return float(np.median(sine)) if abs(float(np.mean(np.sign(sine)))) > 0.8 else math.nan


def resting_sign(s: Signals) -> Iterator[Finding]:
    """Accelerometer at rest, and the field, against the declared frame."""
    if s.reference is not None and s.reference_offset != "rotations" and "acc" in s.sensors:
        return  # the reference knows better
    up = rest_up(s)
    expected = float(up_axis(s.frame)[2])
    flat = len(up) >= 4 and float((up[:, 2] * -expected > _FLAT).mean()) > _MOSTLY
    sine = field_down(s)
    upward = sine < -0.2
    if flat:
        sign, way = ("+", "up") if expected < 0.0 else ("-", "down")
        text = (
            f"at rest acc reads {sign}{abs(s.medians['acc']):.2f} m/s² on z, so the body's z axis points {way}, "
            f"while z of {s.frame} points {'down' if way == 'up' else 'up'}"
        )
        negate = "if acc gives the direction of gravity (specific force points up at rest), negate it"
        turn = "if the body is mounted so, level will read as roll 180°, unless you remap('x,-y,-z')"
        if upward:
            severity: Severity = "warning"
            text += f", and the field points up ({_dip(sine)}), as it does only south of the magnetic equator"
            do = f"{negate}; {turn}"
        elif sine > 0.2:
            severity = "note"
            text += f"; the field points down ({_dip(sine)}), so acc has the right sign north of the magnetic equator"
            do = turn
        else:
            severity = "warning"
            do = f"{negate}; {turn}"
        yield Finding("acc-sign", severity, f"{text}; {do}", 0)
    elif upward:
        yield Finding(
            "acc-sign",
            "note",
            f"the field points up ({_dip(sine)}), which is right south of the magnetic equator; north of it, acc or "
            "mag has the wrong sign: acc must read +9.81 m/s² on the axis that points up at rest",
        )


def _dip(sine: float) -> str:
    return f"dip {math.degrees(math.asin(max(-1.0, min(1.0, sine)))):.0f}°"


def reference_up(s: Signals) -> Iterator[Finding]:
    """Specific force in the reference's frame must point up on average."""
    r = s.reference
    if r is None or s.reference_offset == "rotations" or "acc" not in s.sensors or not len(r):
        return
    inside = np.flatnonzero(s.present["acc"] & (s.time >= r.time[0]) & (s.time <= r.time[-1]))
    if len(inside) < 10:
        return
    inside = inside[:: max(1, len(inside) // _MOST_SAMPLES)]
    nearest = np.searchsorted(r.time, s.time[inside])
    close = r.time[nearest] - s.time[inside] < _CLOSE
    nearest, inside = nearest[close], inside[close]
    if len(inside) < 10:
        return
    force = r.rotation[nearest].apply(s.sensors["acc"][inside]).mean(axis=0)
    size = float(np.sqrt(force @ force))
    if not 0.0 < size < math.inf:
        return
    cosine = float(force @ up_axis(r.frame)) / size
    if cosine > _WRONG:
        return
    if cosine < -_WRONG:
        other = "ENU or NWU" if r.frame == "NED" else "NED"
        do = (
            f"points down in the reference's frame ({r.frame}): negate acc if it gives the direction of gravity "
            f"(specific force points up at rest), or declare the reference as {other}"
        )
    else:
        values = ", ".join(f"{v:.2f}" for v in force / size)
        do = (
            f"points to ({values}) in the reference's frame ({r.frame}), {math.degrees(math.acos(cosine)):.0f}° from "
            'up: remap the sensor\'s axes, or declare reference_offset="rotations" and align before comparing'
        )
    yield Finding("acc-reference", "error", f"the mean of acc {do}", int(inside[0]))


CHECKS = (reference_up, resting_sign)
