"""Checks of each sensor by itself: missing, repeated and clipped samples."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from northdown._validation import BoolArray, FloatArray
from northdown.checks.base import (
    Finding,
    IndexArray,
    Severity,
    Signals,
    count,
    duration,
    percent,
    run_bounds,
)
from northdown.kernels.clipping import CORNER, LONGEST_SWING, LOWEST_RANGE

# Longest time (s) without a sample that does no harm: what the estimators' `max_gap` allows the gyroscope; what a
# tilt and a heading survive on the gyroscope alone.
_PATIENCE = {"gyr": 0.1, "acc": 1.0, "mag": 5.0}
# Share of repeated samples above which a sensor is taken to be slower than the recording.
_REPEATED = 0.05
# A sensor that keeps the same value on all axes this long (s), over this many samples, is frozen.
_FROZEN, _FROZEN_SAMPLES = 0.5, 20
# Lowest level at which the others clip: accelerometers must hold more than gravity, magnetometers more than the
# field they are in.
_RANGE_OF_MEDIAN = {"acc": 1.3, "mag": 1.15}
# Samples at the level itself, or within a hundredth of it, that clipping leaves at least.
_LEAST_EXACT, _LEAST_NEAR = 5, 10
_UNITS = {"gyr": "rad/s", "acc": "m/s²", "mag": "µT"}


def missing(s: Signals) -> Iterator[Finding]:
    """Samples that are not there, for each sensor."""
    for name, here in s.present.items():
        n = len(here)
        absent = n - int(here.sum())
        if not absent:
            continue
        at = int(np.argmin(here))
        if absent == n:
            severity: Severity = "error" if name == "gyr" else "warning"
            yield Finding(f"{name}-missing", severity, f"{name} has no sample at all: all {n} rows hold NaN", at)
            continue
        # the edges count: a filter waits from the first time to the first sample
        times = np.concatenate((s.time[:1], s.time[here], s.time[-1:]))
        wait = float(np.diff(times).max())
        effective = (int(here.sum()) - 1) / max(float(np.ptp(s.time[here])), 1e-300)
        message = (
            f"{name} has no sample in {absent} of {n} rows ({percent(absent, n)}), first at {s.where(at)}; new ones "
            f"come at {effective:.4g} Hz on average, the longest time without is {duration(wait)}"
        )
        severity = "note"
        if wait > _PATIENCE[name]:
            severity = "error" if name == "gyr" else "warning"
            message += {
                "gyr": "; estimators stop there: cut the recording, or raise max_gap to hold the last rate",
                "acc": "; tilt rests on the gyroscope alone meanwhile",
                "mag": "; heading drifts with the gyroscope meanwhile",
            }[name]
        yield Finding(f"{name}-missing", severity, message, at)


def zeros(s: Signals) -> Iterator[Finding]:
    """Rows of exact zeros where there can be none: gravity and the field do not vanish."""
    for name in ("acc", "mag"):
        if name in s.sensors:
            x, y, z = s.sensors[name].T
            row = np.flatnonzero((x == 0.0) & (y == 0.0) & (z == 0.0))
            if row.size:
                at = int(row[0])
                yield Finding(
                    f"{name}-zero",
                    "warning",
                    f"{name} is exactly (0, 0, 0) in {count(len(row), 'row')} ({percent(len(row), len(s.time))}), "
                    f"first at {s.where(at)}; if that means 'no sample', write NaN there",
                    at,
                )


def repeats(s: Signals) -> Iterator[Finding]:
    """Sensors that repeat their values: frozen, or slower than the recording."""
    for name in s.sensors:
        w = s.samples(name)
        if len(w) < 3:
            continue
        rows = np.flatnonzero(s.present[name])
        same_axis, same = s.repeated[name]
        start, stop = run_bounds(same)
        length = s.time[rows[stop]] - s.time[rows[start]] if len(start) else np.zeros(0)
        frozen = (length > _FROZEN) & (stop - start >= _FROZEN_SAMPLES)
        if frozen.any():
            at = int(rows[start[frozen][0]])
            yield Finding(
                f"{name}-stuck",
                "warning",
                f"{name} does not change at all for {duration(float(length[frozen].max()))} "
                f"({count(int(frozen.sum()), 'time')} longer than {duration(_FROZEN)}), first at {s.where(at)}; the "
                "sensor was frozen, or is too coarse to show its noise: write NaN there if it was frozen",
                at,
            )
        yield from _slower(s, name, same, same_axis, frozen, start, stop)


def _slower(
    s: Signals,
    name: str,
    same: BoolArray,
    same_axis: BoolArray,
    frozen: BoolArray,
    start: IndexArray,
    stop: IndexArray,
) -> Iterator[Finding]:
    """A sensor that keeps each value for a few rows."""
    awake = np.ones(len(same), dtype=np.bool_)
    for i, j in zip(start[frozen], stop[frozen], strict=True):
        awake[int(i) : int(j)] = False
    kept = same[awake]
    if not kept.size:
        return
    share = float(kept.mean())
    # A coarse sensor at rest repeats on each axis by chance, so on all at once as often as the product says; a
    # slow one repeats on all axes together.
    each = same_axis[awake].mean(axis=0)
    if share < _REPEATED or share < 0.5 * (float(each.min()) + float(each.prod())):
        return
    rows = 1.0 / s.step * s.present[name].mean() if s.step > 0.0 else math.nan
    at = int(np.argmax(same)) + 1
    yield Finding(
        f"{name}-rate",
        "note",
        f"{name} repeats its last value in {percent(share, 1.0)} of its rows: new values come at about "
        f"{rows * (1.0 - share):.3g} Hz; filters take each repeat for a measurement, so write NaN where there is "
        "no new one",
        at,
    )


def clipping(s: Signals) -> Iterator[Finding]:
    """Samples that pile up at the end of a sensor's range."""
    for name in s.sensors:
        w, rows = _fresh(s, name)
        found = list(_clipped_sides(s, name, w))
        if not found:
            continue
        hit = np.unique(np.concatenate([where for *_, where in found]))
        at = int(rows[hit[0]])
        levels = ", ".join(f"{'xyz'[axis]} at {_level(name, sign * v)}" for axis, sign, v, _ in found)
        severity: Severity = "error" if name == "gyr" and len(hit) > 0.005 * len(w) else "warning"
        yield Finding(
            f"{name}-clipped",
            severity,
            f"{name} is clipped on {levels}: {count(len(hit), 'sample')} ({percent(len(hit), len(w))}), first at "
            f"{s.where(at)}; what exceeded the range is lost: record with a wider range",
            at,
        )


def gyr_levels(time: FloatArray, gyr: FloatArray) -> FloatArray:
    """Largest rate of each axis that is clipped, (3, 2) for its positive and negative side; infinite elsewhere."""
    levels = np.full((3, 2), math.inf)
    if any(_may_clip(sign * axis) for axis in gyr.T.copy() for sign in (1.0, -1.0)):  # the quick way out
        signals = Signals(time, gyr, None, None, "NED", "")
        w, _ = _fresh(signals, "gyr")
        for axis, sign, _, where in _clipped_sides(signals, "gyr", w):
            levels[axis, 0 if sign > 0.0 else 1] = (sign * w[where, axis]).max()
    return levels


def _may_clip(x: FloatArray) -> bool:
    """Whether enough samples of an axis of a gyroscope are near its largest for `_clipped` to find it clipped."""
    top = float(x.max(initial=-math.inf))
    if math.isnan(top):
        top = float(np.nanmax(x, initial=-math.inf))
    if not LOWEST_RANGE < top < math.inf:
        return False
    near, high = np.count_nonzero(x >= 0.99 * top), np.count_nonzero(x >= 0.95 * top)
    # repeats are not left out yet, so that the second condition is only half of the one there
    return bool((near >= _LEAST_NEAR and near >= high - near) or np.count_nonzero(x == top) >= _LEAST_EXACT)


def _fresh(s: Signals, name: str) -> tuple[FloatArray, IndexArray]:
    """Samples of a sensor that do not repeat the one before on all axes, and their rows."""
    same = s.repeated[name][1]
    if not same.any():
        return s.samples(name), np.flatnonzero(s.present[name])
    fresh = np.concatenate(([True], ~same))
    return s.samples(name)[fresh], np.flatnonzero(s.present[name])[fresh]


def _clipped_sides(s: Signals, name: str, w: FloatArray) -> Iterator[tuple[int, float, float, IndexArray]]:
    """Axis, sign, level and samples of what is clipped among the fresh samples w of a sensor."""
    floor = LOWEST_RANGE if name == "gyr" else _RANGE_OF_MEDIAN[name] * s.medians[name]
    longest = LONGEST_SWING / s.step if s.step > 0.0 else math.inf
    for axis in range(3):
        for sign in (1.0, -1.0):
            for level, where in _clipped(sign * w[:, axis], floor, longest):
                yield axis, sign, level, where


def _level(name: str, value: float) -> str:
    more = f" ({math.degrees(value):.0f} deg/s)" if name == "gyr" else ""
    return f"{value:.4g} {_UNITS[name]}{more}"


def _clipped(x: FloatArray, floor: float, longest: float) -> Iterator[tuple[float, IndexArray]]:
    """Level at which an axis is clipped, and the indices where; nothing when it is not.

    `floor` is the lowest level that counts, `longest` the number of samples that a clipped swing lasts at most.
    """
    top = float(x.max())
    if not floor < top < math.inf:
        return
    high = np.flatnonzero(x >= 0.95 * top)
    near = high[x[high] >= 0.99 * top]
    exact = high[x[high] == top]
    start, stop = run_bounds(x == top)
    # Clipping piles samples up at one value. The 50 levels keep out a coarse sensor at the top of a slow swing.
    piled = len(exact) >= _LEAST_EXACT and (stop - start).max() >= 3 and len(exact) > len(high) - len(exact)
    if piled and len(np.unique(x[x > 0.5 * top])) >= 50:
        yield top, exact
        return
    # After calibration the clipped value is no longer one value, but still much rarer just below.
    if len(near) < _LEAST_NEAR or len(near) < 2 * (len(high) - len(near)):
        return
    start, stop = run_bounds(x >= 0.99 * top)
    inner = (stop - start >= 3) & (start >= 2) & (stop <= len(x) - 2)
    start, stop = start[inner], stop[inner]
    if len(start) < 2 or np.median(stop - start) > longest:  # a body that turns steadily
        return
    slope = 0.5 * (x[start - 1] - x[start - 2] + x[stop] - x[stop + 1])
    if np.median(slope * (stop - start)) > CORNER * top:
        yield float(np.median(x[near])), near


CHECKS = (missing, zeros, repeats, clipping)
