"""Turns between rests, collected from recordings for the fit of scale and alignment."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from northdown._validation import BoolArray, FloatArray
from northdown.calibration.rest import Rest, noise_density
from northdown.recording import Recording

# Turns that are longer (s), or in which time jumps by this many median steps, are not used.
_LONGEST: Final = 60.0
_GAP: Final = 5.0
# Equal largest samples in a row that mean the gyroscope was clipped.
_CLIPPED: Final = 4


@dataclass(frozen=True, eq=False)
class Turns:
    """All usable turns, with their samples one after another."""

    rate: FloatArray
    dt: FloatArray
    starts: np.typing.NDArray[np.int64]
    stops: np.typing.NDArray[np.int64]
    bias: FloatArray
    before: FloatArray
    after: FloatArray
    # number of the rest before and after each turn, and variance of each rest's direction (rad²)
    rest: np.typing.NDArray[np.int64]
    rest_variance: FloatArray
    own_variance: FloatArray
    skipped: int

    def __len__(self) -> int:
        return len(self.starts)

    def part(self, kept: BoolArray) -> Turns:
        """Some of the turns."""
        return replace(
            self,
            starts=self.starts[kept],
            stops=self.stops[kept],
            bias=self.bias[kept],
            before=self.before[kept],
            after=self.after[kept],
            rest=self.rest[kept],
            own_variance=self.own_variance[kept],
        )

    def integrate(self, mat: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rotation (T, 3, 3) from the end of each turn to its start, and its derivatives (T, 3, 3, 3)."""
        from northdown.kernels.turn import turns

        rotation, derivative = np.empty((len(self), 3, 3)), np.empty((len(self), 3, 3, 3))
        turns()(
            self.rate,
            self.dt,
            self.bias,
            np.array(mat, order="C"),  # a copy, as the kernel takes none that is read-only
            self.starts,
            self.stops,
            rotation,
            derivative,
        )
        return rotation, derivative


def gather_turns(rested: Sequence[tuple[Recording, tuple[Rest, ...]]]) -> Turns | None:
    """Collect the usable turns of all recordings."""
    acc_density, gyr_density = max(noise_density(rested, "acc"), 1e-12), max(noise_density(rested, "gyr"), 1e-18)
    rate, dt, spans, bias, directions, rest, variance, own = [], [], [], [], [], [], [], []
    skipped = done = rests_done = 0
    for recording, rests in rested:
        if recording.gyr is None or recording.acc is None:
            continue
        good = [r for r in rests if r.shows_gravity and r.gyr is not None]
        ceiling = np.nanmax(np.abs(recording.gyr), axis=0)
        for k, (a, b) in enumerate(itertools.pairwise(good)):
            first, last = a.stop, b.start + 1
            part = recording.gyr[first:last]
            steps = np.diff(recording.time[first - 1 : last])
            if not _usable(part, steps, ceiling):
                skipped += 1
                continue
            length = float(steps.sum())
            rate.append(part)
            dt.append(steps)
            spans.append((done, done + len(part)))
            done += len(part)
            bias.append((_vector(a.gyr) + _vector(b.gyr)) / 2.0)
            directions.append((_unit(a.acc), _unit(b.acc)))
            rest.append((rests_done + k, rests_done + k + 1))
            of_bias = gyr_density * (1.0 / a.duration + 1.0 / b.duration) / 4.0
            own.append(gyr_density * length + of_bias * length**2)
        variance += [acc_density / r.duration / float(_vector(r.acc) @ _vector(r.acc)) for r in good]
        rests_done += len(good)
    if not spans:
        return None
    ends = np.array(spans, dtype=np.int64)
    pairs = np.array(directions)
    return Turns(
        np.ascontiguousarray(np.concatenate(rate)),
        np.concatenate(dt),
        np.ascontiguousarray(ends[:, 0]),
        np.ascontiguousarray(ends[:, 1]),
        np.array(bias),
        np.ascontiguousarray(pairs[:, 0]),
        np.ascontiguousarray(pairs[:, 1]),
        np.array(rest, dtype=np.int64),
        np.array(variance),
        np.array(own),
        skipped,
    )


def _vector(value: FloatArray | None) -> FloatArray:
    return np.zeros(3) if value is None else value


def _unit(value: FloatArray | None) -> FloatArray:
    vector = _vector(value)
    unit: FloatArray = vector / np.linalg.norm(vector)
    return unit


def _usable(part: FloatArray, steps: FloatArray, ceiling: FloatArray) -> bool:
    """Whether a turn is short, without gaps or missing samples, and not clipped."""
    if np.isnan(part).any() or steps.sum() > _LONGEST or steps.max() > _GAP * max(float(np.median(steps)), 1e-9):
        return False
    top = np.abs(part) >= ceiling
    if len(part) < _CLIPPED:
        return True
    runs = np.lib.stride_tricks.sliding_window_view(top, _CLIPPED, axis=0)
    return not bool(runs.all(axis=2).any())
