"""What calibrations are given: one recording or several of the same sensors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from northdown._validation import FloatArray
from northdown.errors import InputError, expected
from northdown.recording import Recording

NAMES = {"gyr": "gyroscope", "acc": "accelerometer", "mag": "magnetometer"}


def gather(recording: Recording | Sequence[Recording], sensors: Sequence[str]) -> list[Recording]:
    """Check one or several recordings that must have certain sensors.

    Raises
    ------
    InputError
        When there is none, one lacks a sensor, or magnetic units differ.
    """
    if isinstance(recording, Recording):
        recordings = [recording]
    elif isinstance(recording, (list, tuple)):
        recordings = list(recording)
    else:
        raise InputError(expected("a recording or a list of recordings", type(recording).__name__))
    if not recordings:
        raise InputError(expected("at least one recording", "none"))
    for r in recordings:
        if not isinstance(r, Recording):
            raise InputError(expected("recordings", type(r).__name__))
        for sensor in sensors:
            samples = getattr(r, sensor)
            if samples is None or not (~np.isnan(samples).any(axis=1)).any():
                got = f"{r.name!r} without" if r.name else "one without"
                raise InputError(expected(f"a recording with samples of the {NAMES[sensor]}", got))
    units = {r.mag_unit for r in recordings if r.mag is not None}
    if "mag" in sensors and len(units) > 1:
        raise InputError(expected("recordings with the magnetic field in one unit", " and ".join(sorted(units))))
    return recordings


def axis_words(direction: FloatArray) -> str:
    """A direction in words: 'x', '−z', or its components."""
    if not np.isfinite(direction).all():
        return "some axis"
    k = int(np.argmax(np.abs(direction)))
    if abs(direction[k]) > 0.95:
        return ("" if direction[k] > 0.0 else "−") + "xyz"[k]
    return "(" + ", ".join(f"{c:.2f}" for c in direction) + ")"
