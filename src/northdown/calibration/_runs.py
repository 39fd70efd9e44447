"""Runs of evenly sampled values: the true step of time, and where samples were lost."""

from __future__ import annotations

import math

import numpy as np

from northdown._validation import BoolArray, FloatArray
from northdown.checks.base import IndexArray, count, duration, gap_limit
from northdown.errors import InputError, expected

# Shorter runs give too few cluster times.
_LEAST_RUN = 64
# Steps of time that vary by more than this, relative to their mean, are worth a word.
_JITTER = 0.1
# Share of the steps that must be whole multiples of the usual one for times to count as even.
_MOSTLY = 0.95


def find_runs(time: FloatArray, notes: list[str]) -> tuple[IndexArray, IndexArray, float]:
    """Starts and stops (exclusive) of the runs without a gap, and the rate (Hz) within them.

    Parameters
    ----------
    time : (N,) array
        Times of the samples that are there, s, not decreasing.
    notes : list of str
        Gaps and uneven steps are added in words.

    Raises
    ------
    InputError
        When time stands still, or no run is long enough for a curve.
    """
    dt = np.diff(time)
    step, gap = _steps(dt)
    if not step > 0.0:
        raise InputError(expected("times that increase", "one time for most samples", do="give the sampling rate"))
    cuts = np.flatnonzero(gap) + 1
    starts, stops = np.concatenate([[0], cuts]), np.concatenate([cuts, [len(time)]])
    if len(cuts):
        longest = float((time[stops - 1] - time[starts]).max())
        notes.append(
            f"{count(len(cuts), 'gap')} in {len(time)} samples: the runs between them are averaged, the longest "
            f"lasts {duration(longest)}"
        )
    if (stops - starts).max() < _LEAST_RUN:
        got = f"{(stops - starts).max()} samples between gaps at most"
        raise InputError(expected(f"a run of {_LEAST_RUN} samples or more", got, do="find out why samples are lost"))
    spread = float(np.std(dt[~gap])) / step
    if spread > _JITTER:
        notes.append(
            f"time steps vary by {100.0 * spread:.0f} %: the sensor is taken to have sampled evenly, every "
            f"{duration(step)}"
        )
    return starts, stops, 1.0 / step


def _steps(dt: FloatArray) -> tuple[float, BoolArray]:
    """Sampling step (s; NaN when there is none), and which steps of time are gaps."""
    forward = dt[dt > 0.0]
    if not forward.size:
        return math.nan, np.zeros(len(dt), dtype=np.bool_)
    ratio = dt / float(np.median(forward))
    whole = np.round(ratio)
    even = (whole >= 1.0) & (np.abs(ratio - whole) < _JITTER)
    if float(even.mean()) > _MOSTLY:
        # even times of which some were lost, maybe many
        return float(dt[even & (whole == 1.0)].mean()), whole > 1.0
    limit = gap_limit(dt)
    return float(dt[dt <= limit].mean()), dt > limit
