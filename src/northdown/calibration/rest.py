"""Stretches in which the sensor unit lay still, found from the sensors' own noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from northdown._validation import BoolArray, FloatArray, check_increasing, check_number
from northdown.errors import InputError, expected
from northdown.recording import Recording

# Length of the windows (s) whose noise is looked at.
_WINDOW: Final = 0.5
# Quietest share of the windows that shows the noise at rest, and how much above it still counts as rest.
_QUIET: Final = 0.05
_ABOVE: Final = 3.0
# Bounds for the threshold, so that neither quantisation nor a recording without rest misleads it: standard deviations
# of the gyroscope (rad/s) and the accelerometer (m/s²).
_BOUNDS: Final = {"gyr": (0.004, 0.02), "acc": (0.02, 0.15)}
# A steady turn has little noise too; rests differ from each other by less than this rate (rad/s).
_SAME_RATE: Final = 0.035
# A step of time longer than this many times the median one ends a rest.
_GAP: Final = 5.0
# Parts of a rest whose means tell how its mean is scattered.
_BATCHES: Final = 8


@dataclass(frozen=True, eq=False)
class Rest:
    """A stretch of rest.

    Attributes
    ----------
    start, stop : int
        Samples [start, stop) of the recording.
    duration : float
        Length, s.
    acc, gyr : (3,) array or None
        Means of the accelerometer (m/s²) and of the gyroscope (rad/s), where the recording has them.
    """

    start: int
    stop: int
    duration: float
    acc: FloatArray | None
    gyr: FloatArray | None

    @property
    def shows_gravity(self) -> bool:
        """Whether there is an accelerometer and it shows a direction, in whatever unit."""
        return self.acc is not None and float(np.linalg.norm(self.acc)) > 0.01


def find_rests(
    recording: Recording,
    *,
    min_duration: float = 1.0,
    gyr_std: float | None = None,
    acc_std: float | None = None,
) -> tuple[Rest, ...]:
    """Find where the sensor unit lay still.

    Parameters
    ----------
    recording : Recording
        With a gyroscope, an accelerometer or both.
    min_duration : float
        Shortest rest, s.
    gyr_std, acc_std : float, optional
        Standard deviation over half a second (rad/s, m/s²; root mean square over the axes) below which a sensor
        counts as still. When not given, three times that of the quietest twentieth of the recording, within
        0.004 to 0.02 rad/s and 0.02 to 0.15 m/s².

    Returns
    -------
    tuple of Rest
        In order of time. Empty when the sensor never lay still.

    Raises
    ------
    InputError
        When there is neither gyroscope nor accelerometer, or time runs backwards.
    """
    min_duration = check_number("min_duration", min_duration, above=0.0, unit="s")
    limits = {"gyr": gyr_std, "acc": acc_std}
    sensors = {s: v for s in ("gyr", "acc") if (v := getattr(recording, s)) is not None}
    if not sensors:
        raise InputError(expected("a gyroscope or an accelerometer", "a recording without", do="record one of them"))
    check_increasing(recording.time)
    step = float(np.median(np.diff(recording.time))) if len(recording) > 1 else 0.0
    width = max(5, round(_WINDOW / step)) if step > 0.0 else 0
    if not step > 0.0 or len(recording) < 2 * width:
        return ()
    # whole windows without a gap in time
    steps = np.concatenate([[0], np.cumsum(np.diff(recording.time) > _GAP * step)])
    still: BoolArray = np.asarray(steps[width - 1 :] == steps[: len(steps) - width + 1])
    for sensor, samples in sensors.items():
        mean, deviation = _moving(samples, width)
        limit = limits[sensor]
        if limit is None:
            there = deviation[np.isfinite(deviation)]
            quiet = float(np.quantile(there, _QUIET)) if len(there) else math.nan
            limit = float(np.clip(_ABOVE * quiet, *_BOUNDS[sensor]))
        else:
            limit = check_number(f"{sensor}_std", limit, above=0.0)
        still = still & (deviation <= limit)  # False where there are too few samples
        if sensor == "gyr" and still.any():
            usual = np.median(mean[still], axis=0)
            still = still & (np.abs(mean - usual) <= _SAME_RATE).all(axis=1)
    return _stretches(recording, still, width, min_duration)


def _moving(samples: FloatArray, width: int) -> tuple[FloatArray, FloatArray]:
    """Mean (M, 3) and standard deviation (M,) over all windows; NaN where half of the samples are missing."""
    there: BoolArray = np.asarray(~np.isnan(samples).any(axis=1))
    centre = samples[there].mean(axis=0) if there.any() else np.zeros(3)
    filled = np.where(there[:, None], samples - centre, 0.0)

    def sums(values: FloatArray) -> FloatArray:
        total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
        difference: FloatArray = total[width:] - total[:-width]
        return difference

    count = sums(there[:, None].astype(np.float64))[:, 0]
    count = np.where(count >= max(3.0, 0.1 * width), count, np.nan)
    mean = sums(filled) / count[:, None]
    variance = np.maximum(sums(filled**2) / count[:, None] - mean**2, 0.0).mean(axis=1)
    return mean + centre, np.sqrt(variance * count / (count - 1.0))


def _stretches(recording: Recording, still: BoolArray, width: int, min_duration: float) -> tuple[Rest, ...]:
    edges = np.diff(np.concatenate([[False], still, [False]]).astype(np.int8))
    rests: list[Rest] = []
    trim = width // 4  # where motion sets in, the window is still quiet
    for first, last in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
        start = int(first) + (trim if first > 0 else 0)
        stop = int(last) + width - 1 - (trim if last < len(still) else 0)
        duration = float(recording.time[stop - 1] - recording.time[start]) if stop > start + 1 else 0.0
        # two runs of still windows may overlap where one window between them was not still
        if rests and start < rests[-1].stop:
            start = rests[-1].stop
            duration = float(recording.time[stop - 1] - recording.time[start]) if stop > start + 1 else 0.0
        if duration < min_duration:
            continue
        means = {s: _mean(getattr(recording, s), start, stop) for s in ("acc", "gyr")}
        rests.append(Rest(start, stop, duration, means["acc"], means["gyr"]))
    return tuple(rests)


def _mean(samples: FloatArray | None, start: int, stop: int) -> FloatArray | None:
    if samples is None:
        return None
    part = samples[start:stop]
    part = part[~np.isnan(part).any(axis=1)]
    return part.mean(axis=0) if len(part) else None


def noise_density(recordings: Sequence[tuple[Recording, tuple[Rest, ...]]], sensor: str) -> float:
    """Variance of a mean at rest times its duration, over all axes and rests, (unit)²·s.

    From the scatter of the means of a rest's parts, so that noise which is correlated within a part counts fully.
    It is at least what the samples' resolution leaves uncertain.
    """
    total, weight, resolution = 0.0, 0.0, math.inf
    shortest = math.inf
    for recording, rests in recordings:
        samples = getattr(recording, sensor)
        for rest in rests if samples is not None else ():
            part = samples[rest.start : rest.stop]
            part = part[~np.isnan(part).any(axis=1)]
            batches = min(_BATCHES, len(part) // 2)
            if batches < 2:
                continue
            size = len(part) // batches
            means = part[: size * batches].reshape(batches, size, 3).mean(axis=1)
            duration = rest.duration * size * batches / len(part)
            total += float(means.var(axis=0, ddof=1).mean()) * duration / batches * (batches - 1)
            weight += batches - 1
            shortest = min(shortest, rest.duration)
            for axis in range(3):
                steps = np.diff(np.unique(part[:, axis]))
                resolution = min(resolution, float(steps.min()) if len(steps) else math.inf)
    if weight == 0.0:
        return 0.0
    floor = 0.0 if math.isinf(resolution) else resolution**2 / 12.0 * shortest
    return max(total / weight, floor)
