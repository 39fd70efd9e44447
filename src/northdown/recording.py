"""`Recording`: what the sensors said, when, and what is known to be true."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from northdown._validation import (
    BoolArray,
    FloatArray,
    as_float_array,
    check_channels,
    check_choice,
    check_index,
    check_mask,
    check_number,
    check_time,
    check_vectors,
)
from northdown.arrays import AccelerometerArray
from northdown.checks import Findings, check_recording, sampling_step
from northdown.errors import InputError, expected
from northdown.frames import Frame, check_frame, mounting_matrix
from northdown.orientation import Orientation

SENSORS = ("gyr", "acc", "mag")

# Bounds the memory that a mistyped rate can ask for.
_MOST_SAMPLES = 1e8

ReferenceOffset = Literal["none", "heading", "rotations"]


@dataclass(frozen=True, eq=False)
class Recording:
    """Recording of a gyroscope, an accelerometer and a magnetometer on one body.

    Parameters
    ----------
    time : (N,) array
        Time in seconds.
    gyr : (N, 3) array, optional
        Angular rate in body axes, rad/s. A sample stands for the time since the sample before it.
    acc : (N, 3) array, optional
        Specific force in body axes, m/s²: +9.81 on the axis that points up at rest.
    mag : (N, 3) array, optional
        Magnetic field in body axes, µT unless `mag_unit` says otherwise. A row with NaN in `acc` or `mag` means that
        there was no sample at that time.
    reference : Orientation, optional
        What is known of the true orientation; may have times of its own.
    movement : (N,) array of bool, optional
        Samples over which errors are to be counted.
    frame : {"NED", "ENU", "NWU"}
        Navigation frame in which results are wanted. `reference` carries its own.
    name : str
        For tables and figures.
    mag_unit : {"uT", "arbitrary"}
        ``"arbitrary"`` when the field's size has no known unit; its direction is all that estimators need.
    array : AccelerometerArray, optional
        Geometry of an array of single-axis accelerometers; `array_acc` goes with it.
    array_acc : (N, K) array, optional
        Specific force that each of the array's K accelerometers measures along its direction, m/s². A row with NaN
        means that there was no sample at that time.
    reference_offset : {"none", "heading", "rotations"}
        How the reference's axes differ from the sensor's by constant rotations: not at all, in heading only, or
        both the navigation and the body frame (to be found by alignment).

    Raises
    ------
    InputError
        On wrong shapes, infinite values, or when there is no sensor at all.

    Notes
    -----
    A value: every method returns a new recording. float64 arrays that can be written to are kept as they are, without
    a copy, and parts of a recording may share them; whoever writes into one writes into all. Anything else is copied.
    """

    time: FloatArray
    gyr: FloatArray | None = None
    acc: FloatArray | None = None
    mag: FloatArray | None = None
    reference: Orientation | None = None
    movement: BoolArray | None = None
    frame: Frame = "NED"
    name: str = ""
    mag_unit: Literal["uT", "arbitrary"] = "uT"
    reference_offset: ReferenceOffset = "none"
    array: AccelerometerArray | None = None
    array_acc: FloatArray | None = None

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        set_field(self, "time", check_time(self.time))
        set_field(self, "frame", check_frame(self.frame))
        check_choice("mag_unit", self.mag_unit, ("uT", "arbitrary"))
        check_choice("reference_offset", self.reference_offset, ("none", "heading", "rotations"))
        n = len(self.time)
        for sensor in SENSORS:
            value = getattr(self, sensor)
            if value is not None:
                set_field(self, sensor, check_vectors(sensor, value, n))
        if (self.array is None) != (self.array_acc is None):
            raise InputError(expected("array and array_acc together", "one without the other"))
        if self.array is not None and self.array_acc is not None:
            set_field(self, "array_acc", check_channels("array_acc", self.array_acc, (n, len(self.array))))
        if self.gyr is None and self.acc is None and self.mag is None and self.array is None:
            raise InputError(expected("at least one of gyr, acc, mag and array_acc", "none"))
        if self.movement is not None:
            set_field(self, "movement", check_mask("movement", self.movement, n))
        if self.reference is not None and not isinstance(self.reference, Orientation):
            raise InputError(expected("reference as an Orientation", type(self.reference).__name__))

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        span = f"{self.duration:.1f} s at {self.rate:.1f} Hz" if self.rate > 0.0 else "no duration"
        sensors = "+".join(s for s in (*SENSORS, "array") if getattr(self, s) is not None)
        tail = ", with reference" if self.reference is not None else ""
        return f"<Recording {self.name or 'unnamed'}: {len(self)} samples, {span}, {sensors}, {self.frame}{tail}>"

    @property
    def rate(self) -> float:
        """Sampling rate in Hz, from the mean step without gaps and steps backwards; NaN when there is none."""
        step = sampling_step(self.time)
        return 1.0 / step if step > 0.0 else float("nan")

    @property
    def duration(self) -> float:
        """Time from first to last sample, s."""
        return float(self.time[-1] - self.time[0]) if len(self) else 0.0

    def check(self) -> Findings:
        """Look for what commonly goes wrong in recordings: findings in words, worst first.

        Returns
        -------
        Findings
            True rate and jitter, gaps, duplicates, time that runs backwards or is not in seconds; missing,
            saturated, stuck and repeated samples; implausible magnitudes with the unit they suggest; gyroscope,
            accelerometer and magnetometer whose axes, sense or unit contradict each other; a magnetic norm or dip
            that varies; a resting accelerometer that contradicts the declared frame, or the reference.
            ``print`` it.
        """
        return check_recording(
            self.time,
            self.gyr,
            self.acc,
            self.mag,
            frame=self.frame,
            mag_unit=self.mag_unit,
            reference=self.reference,
            reference_offset=self.reference_offset,
        )

    def _select(self, index: Any) -> Recording:
        picked: dict[str, Any] = {
            k: None if getattr(self, k) is None else getattr(self, k)[index]
            for k in (*SENSORS, "array_acc", "movement")
        }
        return replace(self, time=self.time[index], **picked)

    def __getitem__(self, index: slice | npt.NDArray[Any]) -> Recording:
        """Samples by slice, mask or indices; the reference is kept whole, as it has its own times."""
        return self._select(check_index(index, len(self)))

    def between(self, start: float, stop: float) -> Recording:
        """Samples with start ≤ time < stop (s); infinity is allowed."""
        first, last = as_float_array("start", start), as_float_array("stop", stop)
        if first.ndim or last.ndim or not first <= last:
            raise InputError(expected("two times, start not after stop", f"{start!r} and {stop!r}"))
        return self._select((self.time >= start) & (self.time < stop))

    def sort(self) -> Recording:
        """The same samples in order of time; samples of equal time keep their order."""
        return self._select(np.argsort(self.time, kind="stable"))

    def remap(self, mounting: str) -> Recording:
        """Rename the sensor's axes, as when it is mounted otherwise.

        Parameters
        ----------
        mounting : str
            Three signed axes: ``"y,-x,z"`` makes the new x the old y, the new y the old −x. The reference's body
            axes are changed likewise.
        """
        return self.rotate_body(mounting_matrix(mounting))

    def rotate_body(self, mat: npt.ArrayLike) -> Recording:
        """Express all vectors in other body axes, v' = mat v, with a rotation matrix (3, 3)."""
        from scipy.spatial.transform import Rotation

        m = as_float_array("mat", mat)
        if m.shape != (3, 3):
            raise InputError(expected("a rotation matrix of shape (3, 3)", f"shape {m.shape}"))
        error = float(np.abs(m @ m.T - np.eye(3)).max())
        if not error < 1e-9:
            raise InputError(expected("a rotation matrix", f"rows that are off orthonormal by {error:.2g}"))
        if np.linalg.det(m) < 0.0:
            raise InputError(expected("a rotation matrix", "one that mirrors space (determinant −1)"))
        turned: dict[str, Any] = {s: None if getattr(self, s) is None else getattr(self, s) @ m.T for s in SENSORS}
        reference = self.reference
        if reference is not None and self.reference_offset != "rotations":
            reference = reference.turned(right=Rotation.from_matrix(m).inv())
        array = None if self.array is None else self.array.turned(m)
        return replace(self, reference=reference, array=array, **turned)

    def resample(self, rate: float) -> Recording:
        """Resample to a constant rate (Hz).

        The gyroscope's angle, not its value, is interpolated, so that no rotation is lost; the others are
        interpolated linearly between their own samples, and stay missing across their gaps longer than two of the new
        periods or two of their own. No anti-aliasing filter is applied.

        Parameters
        ----------
        rate : float
            New rate, Hz.

        Raises
        ------
        InputError
            With fewer than two samples, time that does not increase, missing gyroscope samples, or a rate that would
            need more than 100 million samples.
        """
        rate = check_number("rate", rate, above=0.0, unit="Hz")
        dt = np.diff(self.time)
        if len(self) < 2:
            raise InputError(expected("two samples or more", f"{len(self)}"))
        if (dt <= 0.0).any():
            at = int(np.argmax(dt <= 0.0)) + 1
            do = "sort the recording (Recording.sort()) and drop samples of equal time"
            raise InputError(expected("time that increases", f"a step of {dt[at - 1]:g} s", at=at, do=do))
        if self.duration * rate > _MOST_SAMPLES:
            got = f"{self.duration:g} s at {rate:g} Hz"
            raise InputError(expected(f"at most {_MOST_SAMPLES:g} samples", got, do="choose a lower rate"))
        n = int(np.floor(self.duration * rate * (1.0 + 1e-12))) + 1
        t = self.time[0] + np.arange(n) / rate
        fields: dict[str, Any] = {}
        if self.gyr is not None:
            missing = np.isnan(self.gyr).any(axis=1)
            if missing.any():
                at = int(np.argmax(missing))
                do = "leave out the rows without a sample first"
                raise InputError(expected("a gyroscope without missing samples", "NaN", at=at, do=do))
            angle = np.vstack([np.zeros(3), np.cumsum(self.gyr[1:] * dt[:, None], axis=0)])
            new = np.column_stack([np.interp(t, self.time, angle[:, i]) for i in range(3)])
            fields["gyr"] = np.vstack([self.gyr[:1], np.diff(new, axis=0) * rate])
        for sensor in ("acc", "mag", "array_acc"):
            value = getattr(self, sensor)
            fields[sensor] = None if value is None else _interpolate(t, self.time, value, 1.0 / rate)
        movement = None if self.movement is None else np.interp(t, self.time, self.movement.astype(float)) > 0.5
        return replace(self, time=t, movement=movement, **fields)

    def shift(self, sensor: Literal["acc", "mag"], seconds: float) -> Recording:
        """Move the samples of one sensor in time against the others; undoes a lag.

        Parameters
        ----------
        sensor : {"acc", "mag"}
            Whose samples. The gyroscope's stay, as the others are held to them.
        seconds : float
            By how much its samples are later than it seems, s. Of a magnetometer that is late by 13 ms, which
            `northdown.calibration.magnetometer_lag` finds, a sample belongs to 13 ms before its time stamp: −0.013.

        Returns
        -------
        Recording
            With the same times: what the sensor said there after the shift, by linear interpolation, which smooths
            noise of successive samples. A row without a sample stays so; rows that the shift leaves without a
            neighbour, at the ends and across gaps, become NaN.

        Raises
        ------
        InputError
            When there is no such sensor, or time does not increase.
        """
        value = getattr(self, check_choice("sensor", sensor, ("acc", "mag")))
        seconds = check_number("seconds", seconds, unit="s")
        if value is None:
            raise InputError(expected(f"a recording with {sensor}", "one without"))
        backwards = np.diff(self.time) <= 0.0
        if backwards.any():
            do = "sort the recording (Recording.sort()) and drop samples of equal time"
            raise InputError(expected("time that increases", "a step back", at=int(np.argmax(backwards)) + 1, do=do))
        moved = _interpolate(self.time, self.time + seconds, value, sampling_step(self.time))
        moved[np.isnan(value).any(axis=1)] = np.nan
        return replace(self, acc=moved) if sensor == "acc" else replace(self, mag=moved)


def _interpolate(t: FloatArray, time: FloatArray, value: FloatArray, period: float) -> FloatArray:
    """Linear interpolation between the samples that are there; NaN across long gaps."""
    there = ~np.isnan(value).any(axis=1)
    channels = value.shape[1]
    result = np.full((len(t), channels), np.nan)
    if there.sum() < 2:
        return result
    known = time[there]
    for i in range(channels):
        result[:, i] = np.interp(t, known, value[there, i], left=np.nan, right=np.nan)
    right = np.clip(np.searchsorted(known, t), 1, len(known) - 1)
    left = right - 1
    gap = known[right] - known[left]
    wide = gap > 2.0 * max(period, float(np.median(np.diff(known)))) * (1.0 + 1e-9)
    # at the edges of a gap there are samples
    apart = np.minimum(np.abs(t - known[left]), np.abs(t - known[right])) > 1e-6 * period
    result[wide & apart] = np.nan
    return result
