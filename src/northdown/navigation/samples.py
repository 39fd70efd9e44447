"""Samples for integration: every row filled, or an error that says where there was nothing to fill it with."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from northdown._validation import BoolArray, FloatArray, check_increasing, check_number
from northdown.errors import InputError, expected
from northdown.recording import Recording

# A step of exactly the longest gap is one, whatever the rounding of times.
_SLACK = 1.0 + 1e-9


class Samples(NamedTuple):
    """Times (N,), rates and specific forces (N, 3) without missing rows."""

    time: FloatArray
    gyr: FloatArray
    acc: FloatArray


def dense(recording: Any, max_gap: float) -> Samples:
    """Samples of gyroscope and accelerometer in every row.

    The gyroscope's last sample is held; the accelerometer is interpolated, as a value that belongs to a time.

    Raises
    ------
    InputError
        When a sensor is missing or silent for longer than `max_gap` (s), or time runs backwards or jumps.
    """
    max_gap = check_number("max_gap", max_gap, low=0.0, unit="s")
    check_sampled(recording, ("gyr", "acc"))
    time = recording.time
    check_steps(time, max_gap, "time")
    there = _there(recording, "gyr", max_gap)
    last = np.maximum.accumulate(np.where(there, np.arange(len(time)), int(np.argmax(there))))
    return Samples(time, recording.gyr[last], fill(time, recording.acc, _there(recording, "acc", max_gap)))


def check_sampled(recording: Any, sensors: tuple[str, ...]) -> None:
    """Check that it is a recording of two samples or more with these sensors, in order of time."""
    if not isinstance(recording, Recording):
        raise InputError(expected("a Recording", type(recording).__name__))
    for sensor in sensors:
        value = getattr(recording, sensor)
        if value is None or np.isnan(value).any(axis=1).all():
            raise InputError(expected(f"{' and '.join(sensors)} for navigation", f"no {sensor} in the recording"))
    if len(recording) < 2:
        raise InputError(expected("two samples or more", f"{len(recording)}"))
    check_increasing(recording.time)


def check_steps(time: FloatArray, max_gap: float, what: str, rows: Any = None) -> None:
    """Raise where neighbouring times are further apart than the longest gap."""
    step = np.diff(time)
    wide = step > max_gap * _SLACK
    if wide.any():
        first = int(np.argmax(wide))
        at = first + 1 if rows is None else int(rows[first]) + 1
        got = f"{step[first]:.3g} s without {'samples' if what == 'time' else what}"
        do = f"cut the recording there, or allow it with max_gap={float(step[first]):.3g} or more"
        raise InputError(expected(f"gaps of at most {max_gap:g} s", got, at=at, do=do))


def _there(recording: Recording, sensor: str, max_gap: float) -> BoolArray:
    """Rows that hold a sample; both ends of the recording count as rows in the search for gaps."""
    there: BoolArray = ~np.isnan(getattr(recording, sensor)).any(axis=1)
    if not there.all():
        known = np.unique(np.concatenate([[0], np.flatnonzero(there), [len(there) - 1]]))
        check_steps(recording.time[known], max_gap, sensor, known)
    return there


def fill(time: FloatArray, value: FloatArray, there: BoolArray) -> FloatArray:
    """Linear interpolation (N, 3) over rows without a sample; beyond the ends the nearest one."""
    if there.all():
        return value
    filled: FloatArray = np.column_stack([np.interp(time, time[there], value[there, i]) for i in range(3)])
    return filled
