"""`simulate`: a whole recording by a few words, in memory or in a file."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, BinaryIO

from northdown._validation import check_choice, check_number
from northdown.errors import InputError, expected
from northdown.recording import Recording
from northdown.simulation.imu import measure, measure_chunks
from northdown.simulation.imu_errors import SensorErrors
from northdown.simulation.motion import Motion
from northdown.simulation.motion_library import MOTIONS
from northdown.simulation.presets import LOW_COST, preset
from northdown.simulation.seeds import check_seed


def simulate(
    duration: float = 60.0,
    *,
    rate: float = 100.0,
    seed: int = 0,
    frame: str = "NED",
    motion: str | Motion = "random",
    sensors: str | SensorErrors = LOW_COST,
    name: str | None = None,
    **surroundings: Any,
) -> Recording:
    """Recording of sensors in motion, with its truth; of a handheld low-cost sensor unless told otherwise.

    Parameters
    ----------
    duration : float
        Length, s; not used with a `Motion`, which has its own.
    rate : float
        Sampling rate, Hz.
    seed : int
        The same seed gives the same recording.
    frame : {"NED", "ENU", "NWU"}
        Frame in which the recording states its truth.
    motion : str or Motion
        Name in `MOTIONS`, or a motion.
    sensors : str or SensorErrors
        Name in `PRESETS`, or sensors.
    name : str, optional
        Name of the recording.
    **surroundings
        ``field``, ``gravity``, ``position``, ``disturbances``, ``array`` and ``array_errors`` of `measure`.

    Returns
    -------
    Recording
        With `reference` (the truth at every sample) and `movement`.
    """
    seed = check_seed(seed)
    moved, errors, own_name = _ingredients(duration, seed, motion, sensors)
    rate = check_number("rate", rate, low=1.0, high=10_000.0, unit="Hz")
    return measure(moved, errors, seed, rate=rate, frame=frame, name=name or own_name, **surroundings)


def simulate_to_file(
    path: str | os.PathLike[str] | BinaryIO,
    duration: float = 60.0,
    *,
    rate: float = 100.0,
    seed: int = 0,
    frame: str = "NED",
    motion: str | Motion = "random",
    sensors: str | SensorErrors = LOW_COST,
    progress: Callable[[int], None] | None = None,
    name: str | None = None,
    **surroundings: Any,
) -> int:
    """Write the recording that `simulate` returns, in little memory however long it is.

    Parameters
    ----------
    path : str, os.PathLike or binary stream
        A name as for `northdown.write_recording`; only ``.mat`` needs the whole recording in memory. The file appears
        whole or not at all. A stream gets CSV.
    progress : callable, optional
        Called with the number of samples written so far.
    duration, rate, seed, frame, motion, sensors, name, **surroundings
        See `simulate`.

    Returns
    -------
    int
        Number of samples.
    """
    from northdown.simulation.writing import write_chunks

    seed = check_seed(seed)
    moved, errors, own_name = _ingredients(duration, seed, motion, sensors)
    rate = check_number("rate", rate, low=1.0, high=10_000.0, unit="Hz")
    chunks = measure_chunks(moved, errors, seed, rate=rate, frame=frame, name=name or own_name, **surroundings)
    return write_chunks(chunks, path, progress)


def _ingredients(
    duration: float, seed: int, motion: str | Motion, sensors: str | SensorErrors
) -> tuple[Motion, SensorErrors, str]:
    duration = check_number("duration", duration, low=1.0, unit="s")
    if isinstance(motion, str):
        check_choice("motion", motion, tuple(MOTIONS))
        motion = MOTIONS[motion](duration, seed)
    elif not isinstance(motion, Motion):
        raise InputError(expected("a motion's name or a Motion", type(motion).__name__))
    if not isinstance(sensors, (str, SensorErrors)):
        raise InputError(expected("the name of sensors or SensorErrors", type(sensors).__name__))
    words = ["simulated", motion.name, *([sensors] if isinstance(sensors, str) else []), str(seed)]
    return motion, preset(sensors) if isinstance(sensors, str) else sensors, "-".join(words)
