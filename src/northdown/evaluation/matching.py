"""Bring an estimate and the truth to the same times.

Where both were sampled together they are compared sample by sample; otherwise the truth is interpolated, and never
across its own long gaps: where the truth was not seen, nothing counts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from northdown._validation import BoolArray, FloatArray, check_increasing, check_mask, check_number
from northdown.errors import InputError, expected
from northdown.orientation import Orientation
from northdown.recording import Recording

Truth: TypeAlias = Orientation | Recording

# Times closer than this are the same sample: text files often carry microseconds, and a body that
# turns at 2000 °/s turns by 0.002° in that time.
_SAME_TIME = 1e-6


@dataclass(frozen=True, eq=False)
class Matched:
    """The samples at which estimate and truth can be compared.

    Parameters
    ----------
    index : (M,) array of int
        Samples of the estimate.
    truth : Orientation
        The truth at the times of these samples, length M, in the frame of the estimate.
    """

    index: npt.NDArray[np.intp]
    truth: Orientation


def match(
    estimate: Orientation,
    truth: Truth,
    *,
    mask: npt.ArrayLike | None = None,
    max_gap: float | None = None,
    late: float = 0.0,
) -> Matched:
    """Find the samples of an estimate at which the truth is known.

    When every sample of the truth (within the time both cover) falls on a sample of the estimate to within 1 µs,
    exactly these are compared, and samples at which the truth is missing do not count. Otherwise the truth is
    interpolated at the estimate's times, by spherical linear interpolation.

    Parameters
    ----------
    estimate : Orientation
        Estimated orientation, N samples.
    truth : Orientation or Recording
        True orientation, or a recording that carries it. Of a recording, `movement` limits the samples too.
    mask : (N,) array of bool, optional
        Samples of the estimate that count.
    max_gap : float, optional
        Longest gap (s) between samples of the truth to interpolate across. When not given, 0.1 s or three of its
        median periods, whichever is longer.
    late : float
        By how much the estimate's clock is later than that of the truth, s: its sample stamped t is compared with
        the truth at t − late. Samples that do not count without it do not count with it either.

    Returns
    -------
    Matched

    Raises
    ------
    InputError
        When the recording has no reference, the times do not overlap, or no sample is left.
    """
    reference = find_reference(truth).to_frame(estimate.frame)
    counts = np.ones(len(estimate), dtype=np.bool_) if mask is None else check_mask("mask", mask, len(estimate))
    if isinstance(truth, Recording) and truth.movement is not None:
        counts &= _carry_over(estimate.time, truth.time, truth.movement)
    _check_overlap(estimate, reference)
    longest = _check_gap(max_gap, reference.time)
    known, nearest = _known(estimate.time, reference.time, longest)
    if late != 0.0:
        reference = replace(reference, time=reference.time + check_number("late", late, unit="s"))
        _check_overlap(estimate, reference)
        known_later, nearest = _known(estimate.time, reference.time, longest)
        known &= known_later
    index = np.flatnonzero(known & counts)
    if not index.size:
        if not known.any():
            raise InputError(
                expected(
                    "times at which both the estimate and the truth are known",
                    "none: the truth has gaps there",
                    do="raise max_gap",
                )
            )
        raise InputError(
            expected(
                "at least one sample to count",
                f"{int(known.sum())} samples with a known truth and {int(counts.sum())} in the mask, none in both",
                do="give another mask",
            )
        )
    if nearest is not None:
        return Matched(index, reference[nearest[index]])
    return Matched(index, reference.at(estimate.time[index]))


def find_reference(truth: Truth) -> Orientation:
    """The true orientation that `truth` is or carries; an error when it carries none."""
    if isinstance(truth, Orientation):
        return truth
    if not isinstance(truth, Recording):
        raise InputError(expected("truth as an Orientation or a Recording", type(truth).__name__))
    if truth.reference is None:
        raise InputError(
            expected(
                "a recording with a reference",
                f"{truth.name or 'one'} without",
                do="give the true orientation instead",
            )
        )
    return truth.reference


def longest_gap(time: FloatArray) -> float:
    """Gap (s) up to which samples at `time` are taken to belong together: 0.1 s or three median periods."""
    return max(0.1, 3.0 * float(np.median(np.diff(time)))) if len(time) > 1 else 0.1


def _check_gap(max_gap: float | None, time: FloatArray) -> float:
    return longest_gap(time) if max_gap is None else check_number("max_gap", max_gap, low=0.0, unit="s")


def _check_overlap(estimate: Orientation, reference: Orientation) -> None:
    for what, value in (("estimate", estimate), ("truth", reference)):
        if not len(value):
            raise InputError(
                expected(f"an {what} with samples" if what == "estimate" else "a truth with samples", "none")
            )
    a, b = estimate.time, reference.time
    if a[-1] < b[0] - _SAME_TIME or b[-1] < a[0] - _SAME_TIME:
        raise InputError(
            expected(
                "an estimate and a truth that overlap in time",
                f"{a[0]:g} to {a[-1]:g} s and {b[0]:g} to {b[-1]:g} s",
                do="bring both to the same clock",
            )
        )


def _known(time: FloatArray, known_time: FloatArray, max_gap: float) -> tuple[BoolArray, npt.NDArray[np.intp] | None]:
    """Which times have a known truth, and the truth's sample for each when both were sampled together."""
    if len(time) == len(known_time) and bool((np.abs(time - known_time) <= _SAME_TIME).all()):
        return np.ones(len(time), dtype=np.bool_), np.arange(len(time))
    nearest = _nearest(time, known_time)
    same: BoolArray = np.abs(known_time[nearest] - time) <= _SAME_TIME
    shared = (known_time >= time[0] - _SAME_TIME) & (known_time <= time[-1] + _SAME_TIME)
    back = _nearest(known_time[shared], time)
    if bool((np.abs(time[back] - known_time[shared]) <= _SAME_TIME).all()) and shared.any():
        return same, nearest
    right = np.clip(np.searchsorted(known_time, time, side="left"), 1, max(len(known_time) - 1, 1))
    right = np.minimum(right, len(known_time) - 1)
    left = np.maximum(right - 1, 0)
    inside = (time >= known_time[0]) & (time <= known_time[-1])
    close: BoolArray = (known_time[right] - known_time[left] <= max_gap * (1.0 + 1e-9)) | (
        time == known_time[nearest]
    )
    return inside & close, None


def _nearest(time: FloatArray, among: FloatArray) -> npt.NDArray[np.intp]:
    """Index of the nearest of the times `among`, for each of `time`."""
    right = np.clip(np.searchsorted(among, time), 0, len(among) - 1)
    left = np.maximum(right - 1, 0)
    return np.where(time - among[left] < among[right] - time, left, right)


def _carry_over(time: FloatArray, mask_time: FloatArray, mask: BoolArray) -> BoolArray:
    """A mask over `mask_time` at other times: that of the nearest sample, false outside its span."""
    if time is mask_time or np.array_equal(time, mask_time):
        return mask
    if not len(mask_time):
        return np.zeros(len(time), dtype=np.bool_)
    check_increasing(mask_time)
    inside = (time >= mask_time[0] - _SAME_TIME) & (time <= mask_time[-1] + _SAME_TIME)
    result: BoolArray = mask[_nearest(time, mask_time)] & inside
    return result
