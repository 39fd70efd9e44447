"""Offset between the clock of a gyroscope and that of its reference, from angular rates alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from northdown._validation import BoolArray, FloatArray, check_choice, check_increasing, check_number
from northdown.errors import InputError, expected
from northdown.estimators.gyro_integration import GyroIntegration
from northdown.evaluation._clock_fit import Rates, coarse_offset, fit_offset
from northdown.evaluation.matching import Truth, find_reference
from northdown.orientation import Orientation
from northdown.recording import Recording

Clock = Literal["as recorded", "aligned"]
_CLOCKS: Final = ("as recorded", "aligned")

# Time (s) over which rates are averaged: longer than the noise of an optical system, shorter than human motion.
_WINDOW = 0.05
# Slower windows (rad/s) say little about the offset, and their small errors would make others look like outliers.
_MOVING = np.deg2rad(20.0)
# Windows in motion must make up this time (s), so that sigma can be told from how far parts of it disagree.
_LEAST_MOTION = 2.0
_STEADY = 1e-3  # rad/s; rates that change less are as good as constant
_WORST_SIGMA = 0.003  # s; what is known worse than this is not worth taking out
_MOST_LEFT_OVER = 0.5  # where nothing agrees it is about 1, in real recordings below 0.05
_MOST_WINDOWS = 30_000


@dataclass(frozen=True)
class ClockOffset:
    """By how much a gyroscope's samples are late against the reference attitude of the same recording.

    Parameters
    ----------
    offset : float
        Offset, s. **Positive: the gyroscope is late.** What its sample stamped t shows, the reference shows at
        t − offset; an attitude integrated from it and stamped t is the true one of t − offset.
    sigma : float
        Its standard deviation, s, from how far parts of the recording disagree.
    samples : int
        Windows of 50 ms that were compared, all in motion; they overlap.
    """

    offset: float
    sigma: float
    samples: int

    def __str__(self) -> str:
        which = "behind" if self.offset >= 0.0 else "ahead of"
        offset, sigma = 1e3 * abs(self.offset), 1e3 * self.sigma
        return f"gyroscope {offset:.3f} ± {sigma:.3f} ms {which} the reference"


def clock_offset(recording: Recording, *, limit: float = 0.5) -> ClockOffset:
    """Find the offset between the clocks of a recording's gyroscope and of its reference.

    It bears on what is measured, not on what is estimated: an optical system and an inertial sensor that are not
    triggered together differ by some offset, and a gyroscope's own low-pass delays it. No sensor on the body can
    see that, so that an error of offset times rate is counted against every estimator alike. See `attitude_error`,
    ``clock="aligned"``.

    Parameters
    ----------
    recording : Recording
        With `gyr` and `reference`, in motion with changing rates. Samples of either may be missing.
    limit : float
        Largest offset to look for, s. Raising it finds larger ones and uses less of both ends of the recording.

    Returns
    -------
    ClockOffset

    Raises
    ------
    InputError
        When there is no gyroscope or no reference, too little motion to tell, no agreement between the two, or the
        offset is beyond `limit`.

    Notes
    -----
    Let ω̄_ref be mean rates over windows of 50 ms (or one period of the reference, if that is longer), from the
    rotation between the two ends of each, and ω̄_gyr(τ) those of the integrated gyroscope τ later. The offset τ
    minimises the robust (Cauchy) sum of ‖ω̄_ref − C ω̄_gyr(τ) − c‖² together with a matrix C and a vector c, which
    take up the gyroscope's bias, scale and misalignment and any rotation between the two body frames: attitudes are
    compared nowhere. It starts from the correlation of the rates' sizes.

    A sample of the gyroscope stands for the time since the sample before it. Of a sensor whose samples are values of
    the moment, the offset contains half a sampling period.
    """
    if recording.gyr is None:
        raise InputError(expected("a recording with gyr, to find the offset of its clock", "one without"))
    limit = check_number("limit", limit, above=0.0, high=60.0, unit="s")
    rates = _rates(recording, recording.gyr, find_reference(recording), limit)
    start = coarse_offset(rates, limit)
    found = fit_offset(rates, start, limit)
    if found.change > _MOVING and found.left_over > _MOST_LEFT_OVER:
        got = f"rates that differ by {100.0 * found.left_over:.0f} % of what they change"
        do = "check that both belong together, or raise limit"
        raise InputError(expected("a gyroscope and a reference that turn alike", got, do=do))
    steady = found.change < _STEADY
    if steady or not found.sigma < _WORST_SIGMA:
        doubt = f"rates that leave it open by {1e3 * found.sigma:.0f} ms (1 sigma)"
        got = "rates that hardly change" if steady else doubt
        do = "use a part in which the rate changes faster"
        raise InputError(expected("motion that tells the offset between the clocks", got, do=do))
    if abs(found.offset) > limit:
        raise InputError(expected(f"an offset within ±{limit:g} s", f"{found.offset:.3f} s", do="raise limit"))
    return ClockOffset(found.offset, found.sigma, len(rates))


def choose_clock(truth: Truth, clock: Clock | ClockOffset) -> ClockOffset | None:
    """The offset to take out: none, one known before, or that of the recording."""
    if isinstance(clock, ClockOffset):
        return clock
    if check_choice("clock", clock, _CLOCKS) == "as recorded":
        return None
    if not isinstance(truth, Recording):
        got = f"truth as an {type(truth).__name__}"
        raise InputError(expected("a recording as truth, to align the clocks", got, do="give a ClockOffset"))
    return clock_offset(truth)


def _rates(recording: Recording, gyr: FloatArray, reference: Orientation, limit: float) -> Rates:
    """Windows in motion in which both reference and, `limit` around it, the gyroscope are there."""
    for time in (recording.time, reference.time):
        check_increasing(time)
    if len(recording) < 3 or len(reference) < 3:
        got = f"{len(recording)} and {len(reference)}"
        raise InputError(expected("three samples or more of gyroscope and reference", got))
    integrated = _integrate(recording.time, gyr)
    time = reference.time
    period = _period(time)
    span = max(1, round(_WINDOW / period))
    first = np.arange(0, len(time) - span, max(1, span // 4))
    begin, end = time[first], time[first + span]
    margin = limit + 2.0 * _WINDOW
    use = (end - begin < (span + 0.5) * period) & (begin - margin > recording.time[0])
    use &= (end + margin < recording.time[-1]) & (end > begin)
    missing = _missing(recording.time, gyr)
    # the gyroscope is there throughout when no gap ends between
    use &= np.searchsorted(missing, begin - margin) == np.searchsorted(missing, end + margin)
    first = first[use]
    turn = (reference.rotation[first].inv() * reference.rotation[first + span]).as_rotvec()
    mean: FloatArray = turn / (time[first + span] - time[first])[:, None]
    moving: BoolArray = np.linalg.norm(mean, axis=1) > _MOVING
    share = period * max(1, span // 4)
    if moving.sum() * share < _LEAST_MOTION:
        got = f"{moving.sum() * share:.1f} s in which both are known"
        do = "use a longer or livelier part"
        raise InputError(
            expected(f"{_LEAST_MOTION:g} s faster than 20 °/s, to find the offset of the clocks", got, do=do)
        )
    chosen = np.flatnonzero(moving)
    chosen = chosen[:: -(-len(chosen) // _MOST_WINDOWS)]
    first = first[chosen]
    return Rates(integrated, time[first], time[first + span], mean[chosen])


def _integrate(time: FloatArray, gyr: FloatArray) -> Orientation:
    """The gyroscope alone, from no rotation; samples that are not there turn nothing."""
    from scipy.spatial.transform import Rotation

    filled = Recording(time=time, gyr=np.nan_to_num(gyr, nan=0.0))
    longest = float(time[-1] - time[0]) + 1.0
    return GyroIntegration().run(filled, initial=Rotation.identity(), max_gap=longest)


def _period(time: FloatArray) -> float:
    """Median step, s; samples of equal time are left out."""
    step = np.diff(time)
    if not (step > 0.0).any():
        got = f"{len(time)} of one"
        raise InputError(expected("samples of different times, to find the offset of the clocks", got))
    return float(np.median(step[step > 0.0]))


def _missing(time: FloatArray, gyr: FloatArray) -> FloatArray:
    """Times at which the gyroscope has no sample: rows of NaN, and the ends of gaps."""
    step = np.diff(time, prepend=time[0])
    gone = np.isnan(gyr).any(axis=1) | (step > 2.0 * _period(time))
    return np.asarray(time[gone])
