r"""A gyroscope at the end of its range: how the calibrating filter finds it, and how it makes up for what is lost.

A sensor that clips shows its range while the true rate goes on, and loses on one axis and to one side only. Before
and after, the rate has a slope; a smooth swing between the slopes α₁ and −α₂, a time T apart, exceeds the range by
the cubic

.. math::

    e(t) = T \bigl(\alpha_1 u (1 - u)^2 + \alpha_2 u^2 (1 - u)\bigr), \quad u = t / T, \qquad
    \int_0^T e \, dt = \tfrac{1}{12} T^2 (\alpha_1 + \alpha_2)

which is what `restored` adds. In real time neither T nor α₂ is known: α₁ t (1 − t / `SWING`) is added as long as it
lasts, and at its end, with α₂ taken for α₁, the angle that is then still missing. What it adds is uncertain, and
the filter counts on that about this axis alone.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any, Final

import numpy as np

from northdown._validation import FloatArray
from northdown.checks.base import run_bounds
from northdown.estimators._calibrating_layout import (
    AGE_GYR,
    ALERT,
    CLIP_ADDED,
    CLIP_SLOPE,
    CLIP_TIME,
    CLIPPED,
    CLIPPING,
    GIVEN,
    HELD_SLOPE,
    HELD_TIME,
    LAST_GYR,
    LEVELS,
    PEAKS,
    QUANTUM,
    SLOPE,
)
from northdown.kernels.clipping import CORNER, LONGEST_SWING, LOWEST_RANGE
from northdown.kernels.jit import inline
from northdown.recording import Recording

NEARLY: Final = 0.99
"""Part of the range from which a sample counts as clipped: calibration has spread the one value that it had."""
SWING: Final = 0.3
"""Time (s) after which the rate is expected back within the range."""
LACKING: Final = 0.5
"""Standard deviation of what a clipped rate still lacks, as a part of slope times time."""
LEAST_LACKING: Final = 0.02
"""The least of it, as a part of the range."""
REPEATS: Final = 3.0
"""Samples of one value, on one axis alone, that a plateau has at least."""
QUANTA: Final = 8.0
"""Steps of the output by which it came there at least: a coarse sensor goes over a peak by one or two a time."""


@inline
def unclipped(s: Any, dt: float, gyr: Any) -> Any:
    """Rate with what it seems to lack, and the angles that have been lost besides and are known only now."""
    nothing = (0.0, 0.0, 0.0)
    if s[CLIPPING] == 0.0 and max(abs(gyr[0]), abs(gyr[1]), abs(gyr[2])) < s[ALERT]:
        s[LAST_GYR], s[LAST_GYR + 1], s[LAST_GYR + 2] = gyr
        s[AGE_GYR] = 0.0
        return gyr, nothing
    s[AGE_GYR] += dt
    moved = gyr[0] != s[LAST_GYR] or gyr[1] != s[LAST_GYR + 1] or gyr[2] != s[LAST_GYR + 2]
    if not (moved and s[AGE_GYR] > 0.0):
        # the first sample, or one that was held
        s[LAST_GYR], s[LAST_GYR + 1], s[LAST_GYR + 2] = gyr
        return gyr, nothing
    per_age = 1.0 / s[AGE_GYR]
    x, lost_x = _axis(s, dt, per_age, gyr[0], 0)
    y, lost_y = _axis(s, dt, per_age, gyr[1], 1)
    z, lost_z = _axis(s, dt, per_age, gyr[2], 2)
    s[AGE_GYR] = 0.0
    s[CLIPPING] = max(s[CLIP_TIME], s[CLIP_TIME + 1], s[CLIP_TIME + 2])
    return (x, y, z), (lost_x, lost_y, lost_z)


@inline
def _axis(s: Any, dt: float, per_age: float, x: float, a: int) -> Any:
    """One axis: its rate, and the angle that it has lacked until now."""
    sign, side = (1.0, 2 * a) if x >= 0.0 else (-1.0, 2 * a + 1)
    last, age = s[LAST_GYR + a], s[AGE_GYR]
    s[LAST_GYR + a] = x
    slope = (x - last) * per_age
    live = s[GIVEN] < 0.0
    if x != last and not abs(x - last) > s[QUANTUM]:
        s[QUANTUM] = abs(x - last)
    if live and abs(x) > LOWEST_RANGE:
        _seek(s, a, side, abs(x), x == last, sign * slope)
    limit = NEARLY * s[LEVELS + side]
    if abs(x) < limit:
        lost = 0.0
        time = s[CLIP_TIME + a]
        if time > 0.0:
            time += 0.5 * age
            if live and time < LONGEST_SWING:
                lost = s[CLIP_SLOPE + a] * time * time / 6.0 - s[CLIP_ADDED + a]
            s[CLIP_TIME + a] = 0.0
        s[SLOPE + a] = slope
        return x, lost
    if not s[CLIP_TIME + a] > 0.0:
        slope = max(sign * s[SLOPE + a], 0.0) if abs(last) >= s[ALERT] else max(sign * slope, 0.0)
        below = min(max(limit - sign * last, 0.0) / slope, age) if slope > 0.0 else 0.5 * age
        s[CLIP_SLOPE + a] = sign * slope
        s[CLIP_TIME + a] = max(age - below, 1e-9)
        s[CLIP_ADDED + a] = 0.0
    else:
        s[CLIP_TIME + a] += age
    if not live:
        return x, 0.0
    time = s[CLIP_TIME + a]
    more = s[CLIP_SLOPE + a] * time * max(0.0, 1.0 - time / SWING)
    s[CLIP_ADDED + a] += more * dt
    return x + more, 0.0


@inline
def _seek(s: Any, a: int, side: int, high: float, repeated: bool, slope: float) -> None:
    """Look for the level of one side where it is not known: the highest value, repeated, entered with a corner."""
    if s[LEVELS + side] == math.inf:
        if not repeated:
            s[HELD_TIME + a] = 0.0
            slope = max(slope, s[SLOPE + a] if side % 2 == 0 else -s[SLOPE + a])
            s[HELD_SLOPE + a] = slope if slope * s[AGE_GYR] > QUANTA * s[QUANTUM] else 0.0
        else:
            s[HELD_TIME + a] += s[AGE_GYR]
            time = s[HELD_TIME + a] + s[AGE_GYR]
            long = s[HELD_TIME + a] > (REPEATS - 1.5) * s[AGE_GYR]
            if long and high >= s[PEAKS + side] and s[HELD_SLOPE + a] * time > CORNER * high:
                s[LEVELS + side] = high
                s[SLOPE + a] = s[HELD_SLOPE + a] if side % 2 == 0 else -s[HELD_SLOPE + a]
        s[PEAKS + side] = max(high, s[PEAKS + side])
    elif s[PEAKS + side] > 0.0 and NEARLY * high > s[LEVELS + side]:
        s[LEVELS + side] = math.inf  # a higher value refutes what was found here
        s[PEAKS + side] = high
        s[CLIP_TIME + a] = 0.0


@inline
def add_lacking(s: Any, dt: float, c: Any) -> None:
    """Standard deviation of what is lost in a sample, about its axis; c are the columns of the attitude."""
    for a in range(3):
        if s[CLIP_TIME + a] > 0.0:
            lacking = LACKING * abs(s[CLIP_SLOPE + a]) * s[CLIP_TIME + a] + LEAST_LACKING * abs(s[LAST_GYR + a])
            for i in range(3):
                s[CLIPPED + i] += c[a][i] * lacking * dt


def alert(s: FloatArray) -> float:
    """Rate (rad/s) on any axis from which clipping is looked for."""
    return min(LOWEST_RANGE, NEARLY * float(s[LEVELS : LEVELS + 6].min()))


def restored(recording: Recording, levels: FloatArray) -> Recording:
    """The recording with a smooth swing in place of what its gyroscope lost; `levels` are those of the state."""
    if recording.gyr is None or not np.isfinite(levels[:6]).any():
        return recording
    gyr = recording.gyr.copy()
    rows = np.flatnonzero(np.isfinite(gyr).all(axis=1))
    if len(rows) < 4:
        return recording
    fresh = np.concatenate(([True], (np.diff(gyr[rows], axis=0) != 0.0).any(axis=1)))
    rows = rows[fresh & np.concatenate(([True], np.diff(recording.time[rows]) > 0.0))]
    time = recording.time[rows]
    for side, level in enumerate(levels[:6].tolist()):
        a, sign = side // 2, 1.0 - 2.0 * (side % 2)
        x, limit = sign * recording.gyr[rows, a], NEARLY * level
        for i, j in zip(*run_bounds(x >= limit), strict=True):
            if i < 2 or j > len(x) - 2:
                continue
            up, down = (
                _crossing(time[i - 2 : i + 1], x[i - 2 : i + 1], limit),
                _crossing(-time[j - 1 : j + 2][::-1], x[j - 1 : j + 2][::-1], limit),
            )
            span = -down[0] - up[0]
            if 0.0 < span < LONGEST_SWING:
                u = np.clip((time[i:j] - up[0]) / span, 0.0, 1.0)
                gyr[rows[i:j], a] += sign * span * (up[1] * u * (1.0 - u) ** 2 + down[1] * u * u * (1.0 - u))
    return dataclasses.replace(recording, gyr=gyr)


def _crossing(time: FloatArray, x: FloatArray, limit: float) -> tuple[float, float]:
    """When the line through the first two of three samples reaches a limit, before the third; and its slope, ≥ 0."""
    slope = max(0.0, float((x[1] - x[0]) / (time[1] - time[0])))
    step = float(time[2] - time[1])
    return float(time[1]) + (min((limit - float(x[1])) / slope, step) if slope > 0.0 else 0.5 * step), slope
