"""Pairs of magnetometer samples with the rotation between them, for its alignment to the gyroscope."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from northdown._validation import FloatArray, check_increasing
from northdown.recording import Recording

# Time (s) between the samples of a pair, and the least turn (rad) between them that says something.
_STEP: Final = 0.25
_TURN: Final = 0.05


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs of samples.

    Attributes
    ----------
    before, after : (P, 3) array
        Directions of the field.
    rate_before, rate_after : (P, 3) array
        Angular rate at these times, rad/s.
    turn : (P, 3, 3) array
        Rotation from the body after to the body before.
    length : (P,) array
        Time between, s.
    """

    before: FloatArray
    after: FloatArray
    rate_before: FloatArray
    rate_after: FloatArray
    turn: FloatArray
    length: FloatArray

    def __len__(self) -> int:
        return len(self.length)


def gather_pairs(recordings: Sequence[Recording]) -> Pairs:
    """Collect the pairs of all recordings between which the body turned."""
    parts = [_pairs(r) for r in recordings]
    joined = {f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Pairs)}
    angle = np.arccos(np.clip((np.trace(joined["turn"], axis1=1, axis2=2) - 1.0) / 2.0, -1.0, 1.0))
    return Pairs(**{name: value[angle > _TURN] for name, value in joined.items()})


def _pairs(recording: Recording) -> Pairs:
    from northdown.kernels.turn import turns

    check_increasing(recording.time)
    none = np.empty((0, 3))
    if recording.gyr is None or recording.mag is None:
        return Pairs(none, none, none, none, np.empty((0, 3, 3)), np.empty(0))
    gyr, mag, time = recording.gyr, recording.mag, recording.time
    there = np.flatnonzero(~np.isnan(mag).any(axis=1) & (np.nan_to_num(mag) != 0.0).any(axis=1))
    chosen = []
    last = -math.inf
    for i, t in zip(there.tolist(), time[there].tolist(), strict=True):
        if t >= last + _STEP:
            chosen.append(i)
            last = t
    index = np.array(chosen, dtype=np.int64)
    first, second = index[:-1], index[1:]
    missing = np.concatenate([[0], np.cumsum(np.isnan(gyr).any(axis=1))])
    length = time[second] - time[first]
    good = (length < 2.0 * _STEP) & (missing[second + 1] == missing[first])
    first, second, length = first[good], second[good], length[good]
    rotation, unused = np.empty((len(first), 3, 3)), np.empty((len(first), 3, 3, 3))
    turns()(
        np.nan_to_num(gyr),
        np.diff(time, prepend=time[:1]),
        np.zeros((len(first), 3)),
        np.eye(3),
        first + 1,
        second + 1,
        rotation,
        unused,
    )
    before, after = (mag[i] / np.linalg.norm(mag[i], axis=1)[:, None] for i in (first, second))
    return Pairs(before, after, gyr[first], gyr[second], rotation, length)
