r"""Inertial navigation aided by zero-velocity updates: error-state Kalman filter and smoother.

The strapdown solution is corrected whenever the body stands still: its velocity is then measured as zero. Through the
correlations that the filter keeps, each stance also corrects position, tilt and the biases, so that the position
error grows with the distance walked instead of with t³. What zero velocity does not show is the heading: its error
grows with the gyroscope's noise and its vertical bias. The state, its model and the scheme stand in
`northdown.kernels.navigation`, the smoother in `northdown.kernels.navigation_smoother`.

In a rest that is longer than a stance the gyroscope measures its own bias too (zero angular rate update).

A foot that stands still creeps, and does so for longer than one sample: pseudo-measurements that follow each other
are not independent. Each has the variance σ² · max(1, τ/Δt), so that their weight does not depend on the sampling
rate.

Sources: I. Skog, J.-O. Nilsson, P. Händel, IPIN 2010 and E. Foxlin, IEEE Comput. Graph. Appl. 25(6), 2005,
doi:10.1109/MCG.2005.140 for zero-velocity aiding; D. Simón Colomar, J.-O. Nilsson, P. Händel, IPIN 2012,
doi:10.1109/IPIN.2012.6418936 for smoothing it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from northdown._validation import BoolArray, FloatArray, check_mask, check_single_rotation
from northdown.errors import InputError, expected
from northdown.frames import check_frame, rotation_between
from northdown.navigation.noise import NavigationNoise
from northdown.navigation.samples import Samples, dense
from northdown.navigation.still import Detector, Shoe
from northdown.navigation.trajectory import Trajectory
from northdown.orientation import Flag, Orientation
from northdown.recording import Recording

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

# Samples in a part of the trace, which then stays in the processor's cache; a row has 2.8 kB.
_CHUNK: Final = 512
# Time (s) at both ends of a rest in which the body may already turn.
_EDGE: Final = 0.2
# Longest time (s) at the start over which accelerometer and magnetometer are averaged.
_START: Final = 1.0


def navigate(
    recording: Recording,
    *,
    frame: str | None = None,
    initial: Rotation | None = None,
    zero_velocity: bool = True,
    smooth: bool = True,
    detector: Detector | None = None,
    still: npt.ArrayLike | None = None,
    noise: NavigationNoise | None = None,
    max_gap: float = 0.1,
) -> Trajectory:
    """Track position by inertial navigation, corrected whenever the body stands still.

    Parameters
    ----------
    recording : Recording
        With gyroscope and accelerometer, which is best carried on a foot, and begins with a second of rest. The
        magnetometer is used for the first heading only.
    frame : {"NED", "ENU", "NWU"}, optional
        Navigation frame of the result; the recording's own when not given.
    initial : scipy.spatial.transform.Rotation, optional
        Attitude (body → frame) at the first sample. When not given, from accelerometer and magnetometer at the start;
        without a magnetometer the sensor's x axis points north there.
    zero_velocity : bool
        Whether stillness corrects the solution. Without, it is the strapdown solution with its growing covariance.
    smooth : bool
        Whether each sample also uses what comes after it. Without, the velocity jumps at the start of each stance.
    detector : Detector, optional
        How stillness is found; `Shoe()` when not given.
    still : (N,) array of bool, optional
        Stillness that is known otherwise; then no detector is used.
    noise : NavigationNoise, optional
        What the filter assumes.
    max_gap : float
        Longest time (s) without a sample that is bridged.

    Returns
    -------
    Trajectory
        From the origin, with covariances, biases and `still`. Where the heading is unknown, so says the orientation's
        flag `HEADING_UNKNOWN`, and covariances are those in relation to the first heading.

    Raises
    ------
    InputError
        When a sensor is missing or silent for too long, time runs backwards, nothing is still although zero velocity
        is to be used, or the values are so large that the result is no number.
    """
    noise = NavigationNoise() if noise is None else _check("noise", noise, NavigationNoise)
    detector = Shoe(gravity=noise.gravity) if detector is None else _check("detector", detector, Detector)
    samples = dense(recording, max_gap)
    axes = check_frame(recording.frame if frame is None else frame)
    mask = detector.find_in(samples) if still is None else check_mask("still", still, len(recording))
    if zero_velocity and not mask.any():
        do = "take the gyroscope's bias away, raise the detector's threshold, or go without zero velocity"
        raise InputError(expected("samples at which the body stands still", "none", do=do))
    stance = _stance(samples.time, mask, noise.rest) if zero_velocity else np.zeros(len(recording), np.uint8)
    state = np.zeros(20)
    state[16] = np.nan
    initial = check_single_rotation("initial", initial)
    state[:4], heading_known = _start(recording, mask, initial, axes)
    run = _run(
        samples,
        stance,
        state,
        noise.covariance(bool(mask[0]), heading_known and initial is None),
        noise.parameters(),
        smooth,
    )
    flags = np.full(len(recording), 0 if heading_known else int(Flag.HEADING_UNKNOWN), np.uint8)
    return _trajectory(recording, *run, mask, flags).to_frame(axes)


def _check(name: str, value: Any, kind: type[Any]) -> Any:
    if not isinstance(value, kind):
        raise InputError(expected(f"{name} as a {kind.__name__}", type(value).__name__))
    return value


def _stance(time: FloatArray, still: BoolArray, rest: float) -> npt.NDArray[np.uint8]:
    """0 moving, 1 still, 2 within a stillness that lasts for `rest` seconds or more."""
    stance = still.astype(np.uint8)
    edges = np.diff(np.concatenate([[0], stance.astype(np.int8), [0]]))
    for first, stop in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
        if time[stop - 1] - time[first] >= rest:
            start, end = np.searchsorted(time, (time[first] + _EDGE, time[stop - 1] - _EDGE))
            stance[start:end] = 2
    return stance


def _start(recording: Recording, still: BoolArray, initial: Rotation | None, frame: str) -> tuple[FloatArray, bool]:
    """Attitude (w, x, y, z), body → NED, before the first sample, and whether its heading is known."""
    if initial is not None:
        turned = rotation_between(frame, "NED") * initial
        return np.roll(turned.as_quat(), 1), True
    from northdown.kernels.navigation import level

    moving = int(np.argmin(still)) if not still.all() else len(still)
    within = recording.time - recording.time[0] <= _START
    quat = np.empty(4)
    known = level()(_first(recording.acc, moving, within), _first(recording.mag, moving, within), quat)
    return quat, bool(known)


def _first(value: FloatArray | None, moving: int, within: BoolArray) -> FloatArray:
    """Mean over the stillness at the start, or else the first sample."""
    if value is None:
        return np.full(3, np.nan)
    there: BoolArray = np.asarray(~np.isnan(value).any(axis=1))
    quiet = there & within & (np.arange(len(value)) < moving)
    if quiet.any():
        mean: FloatArray = value[quiet].mean(axis=0)
        return mean
    first: FloatArray = value[int(np.argmax(there))].copy()
    return first


def _run(
    samples: Samples,
    stance: npt.NDArray[np.uint8],
    state: FloatArray,
    cov: FloatArray,
    params: FloatArray,
    smooth: bool,
) -> tuple[FloatArray, FloatArray]:
    """Nominal states (N, 16) and covariances (N, 27), filtered or smoothed.

    The smoother needs what the filter knew at each sample. Instead of all that, its state at the start of each part
    is kept, and the filter runs through each part a second time.
    """
    from northdown.kernels.navigation import N_TRACE, forward

    n = len(samples.time)
    nominal, covariance = np.empty((n, 16)), np.empty((n, 27))
    trace = np.empty((min(n, _CHUNK), N_TRACE))
    parts = [slice(k, min(k + _CHUNK, n)) for k in range(0, n, _CHUNK)]
    kept: list[tuple[FloatArray, FloatArray]] = []

    def filter_part(part: slice) -> FloatArray:
        rows = trace[: part.stop - part.start]
        forward()(params, *(x[part] for x in samples), stance[part], state, cov, rows)
        return rows

    for part in parts:
        if smooth:
            kept.append((state.copy(), cov.copy()))
        rows = filter_part(part)
        nominal[part], covariance[part] = rows[:, :16], _blocks(rows)
    bad = ~(np.isfinite(nominal).all(axis=1) & np.isfinite(covariance).all(axis=1))
    if bad.any():
        at = int(np.argmax(bad))
        raise InputError(expected("samples of a size that can be navigated with", "an overflow", at=at))
    if smooth:
        from northdown.kernels.navigation_smoother import backward

        adjoint, info = np.zeros(15), np.zeros((15, 15))
        for part, (first_state, first_cov) in zip(reversed(parts), reversed(kept), strict=True):
            state[:], cov[:] = first_state, first_cov
            backward()(filter_part(part), adjoint, info, nominal[part], covariance[part])
    return nominal, covariance


def _blocks(rows: FloatArray) -> FloatArray:
    """Covariances of position, velocity and attitude, (N, 27), from the trace."""
    from northdown.kernels.navigation import COVARIANCE

    cov = rows[:, COVARIANCE:].reshape(len(rows), 15, 15)
    blocks: FloatArray = np.stack([cov[:, k : k + 3, k : k + 3] for k in (0, 3, 6)], axis=1).reshape(len(rows), 27)
    return blocks


def _trajectory(
    recording: Recording,
    nominal: FloatArray,
    covariance: FloatArray,
    still: BoolArray,
    flags: npt.NDArray[np.uint8],
) -> Trajectory:
    blocks = covariance.reshape(-1, 3, 3, 3)
    orientation = Orientation(
        recording.time,
        nominal[:, :4],
        "NED",
        covariance=blocks[:, 2],
        gyr_bias=nominal[:, 13:16],
        flags=flags,
        name=recording.name,
    )
    return Trajectory(
        orientation,
        nominal[:, 4:7],
        nominal[:, 7:10],
        position_covariance=blocks[:, 0],
        velocity_covariance=blocks[:, 1],
        acc_bias=nominal[:, 10:13],
        still=still,
        name=recording.name,
    )
