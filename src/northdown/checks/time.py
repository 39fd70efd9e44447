"""Checks of a recording's times: enough of them, in order, in seconds, evenly spaced."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from northdown._validation import FloatArray
from northdown.checks.base import Finding, Severity, Signals, count, duration, percent
from northdown.kernels.holes import LONGEST_HOLE

_FEW = 10
# Standard deviation of the step, relative to it, above which the true sample times are in doubt.
_JITTER = 0.1
# A gap longer than this (s) is more than filters bridge by holding the last rate.
_LONG_GAP = 0.1
# Rates outside these (Hz) are no inertial sensor's: the unit of time is in doubt.
_SLOWEST, _FASTEST = 2.0, 50e3


def few_samples(s: Signals) -> Iterator[Finding]:
    """Too few samples to estimate anything."""
    n = len(s.time)
    if n < _FEW:
        severity: Severity = "warning" if n else "error"
        yield Finding("time-few", severity, f"the recording has {count(n, 'sample')}; most checks need more")


def backwards(s: Signals) -> Iterator[Finding]:
    """Time that runs backwards."""
    back = np.flatnonzero(s.dt < 0.0)
    if back.size:
        at = int(back[0]) + 1
        largest = -float(s.dt[back].min())
        yield Finding(
            "time-backwards",
            "error",
            f"time runs backwards {count(len(back), 'time')}, by up to {duration(largest)}, first at {s.where(at)}; "
            "sort the rows if they are out of order (Recording.sort(), or --sort on the command line), or cut the "
            "recording there if the clock was set back",
            at,
        )


def duplicates(s: Signals) -> Iterator[Finding]:
    """Times that occur more than once."""
    same = np.flatnonzero(s.dt == 0.0)
    if not same.size:
        return
    at = int(same[0]) + 1
    shares = percent(len(same), len(s.dt))
    single = s.time.astype(np.float32)
    resolution = float(np.spacing(np.abs(single).max()))
    if resolution > 1e-3 and not resolution < s.gap / 2.0 and (single == s.time).all():
        do = "the times were kept in single precision: read them again in double precision, or count from the start"
    else:
        do = (
            "if these samples came in packets, spread their times evenly (time = start + i / rate); if rows were "
            "written twice, drop the copies"
        )
    message = f"{count(len(same), 'step')} of time {'is' if len(same) == 1 else 'are'} zero ({shares}), first at "
    yield Finding("time-duplicate", "warning", f"{message}{s.where(at)}; {do}", at)


def gaps(s: Signals) -> Iterator[Finding]:
    """Steps much longer than the others."""
    long = np.flatnonzero(s.dt > s.gap)
    if not long.size or (s.dt < 0.0).any():  # rows out of order leave holes where they belong
        return
    step = s.dt[long]
    worst = int(long[np.argmax(step)])
    lost = int(np.rint(step / s.step - 1.0).sum()) if s.step > 0.0 else 0
    longest = float(step.max())
    severity: Severity = "warning" if longest > _LONG_GAP else "note"
    do = ""
    if longest > LONGEST_HOLE:
        do = "; a turn within it is not seen, and tilt and heading begin anew after it"
    elif longest > _LONG_GAP:
        do = "; a turn within it is not seen: cut the recording there (Recording.between)"
    yield Finding(
        "time-gap",
        severity,
        f"{count(len(long), 'gap')} in time ({count(lost, 'sample')} lost, {percent(lost, lost + len(s.time))}); the "
        f"longest, {duration(longest)}, follows {s.where(worst)}{do}",
        int(long[0]) + 1,
    )


def rate(s: Signals) -> Iterator[Finding]:
    """Sampling rate, and whether the steps are even."""
    if not s.step > 0.0:
        return
    inside = s.dt[(s.dt >= 0.0) & (s.dt <= s.gap)]
    jitter = float(inside.std())
    message = (
        f"rate {1.0 / s.step:.4g} Hz (median step {duration(float(np.median(inside)))}, jitter {duration(jitter)})"
    )
    if jitter <= _JITTER * s.step:
        yield Finding("time-rate", "note", message)
        return
    rounded = _rounding(s.time, s.step)
    cause = f"times are rounded to {duration(rounded)}" if rounded else "times are those of arrival, not of sampling"
    yield Finding(
        "time-jitter",
        "warning",
        f"{message}: steps are uneven by {percent(jitter, s.step)}; if {cause} and the sensor's rate is constant, "
        "rebuild them: time = start + i / rate",
    )


def _rounding(time: FloatArray, step: float) -> float:
    """Decimal resolution (s) that all times keep to, if it is coarse enough to explain uneven steps; else 0."""
    since = time - time[0]
    for digit in (1e-1, 1e-2, 1e-3, 1e-4):
        # rounding to a digit spreads the steps by at most half of it
        if 2.0 * _JITTER * step < digit < step and np.abs(since / digit - np.rint(since / digit)).max() < 1e-3:
            return digit
    return 0.0


def unit(s: Signals) -> Iterator[Finding]:
    """Times that are not in seconds."""
    if len(s.time) < _FEW or not s.step > 0.0 or _SLOWEST <= 1.0 / s.step <= _FASTEST:
        return
    severity: Severity = "error" if s.gyr is not None else "warning"
    found = f"the time step of {s.step:.4g} s is"
    if s.step * _FASTEST < 1.0:
        do = "too short for these sensors: give time in seconds"
    elif (s.dt == np.rint(s.dt)).all() and np.median(s.dt) == 1.0:
        do = "that of a sample count: divide it by the sampling rate"
    else:
        name, divisor = ("ms", "1000") if s.step < 5e2 else ("µs", "1e6") if s.step < 5e5 else ("ns", "1e9")
        do = f"too long for these sensors: if time is in {name}, divide it by {divisor}"
    yield Finding("time-unit", severity, f"{found} {do}", 0)


CHECKS = (few_samples, backwards, duplicates, unit, gaps, rate)
