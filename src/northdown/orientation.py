"""`Orientation`: attitude over time with its frame, uncertainty, gyroscope bias and flags."""

from __future__ import annotations

import enum
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from northdown._validation import (
    FloatArray,
    as_float_array,
    check_increasing,
    check_index,
    check_no_infinity,
    check_quat,
    check_rotation,
    check_single_rotation,
    check_time,
    check_vectors,
)
from northdown.errors import InputError, expected
from northdown.frames import EULER_COLUMNS, Frame, as_euler, check_frame, rotation_between

if TYPE_CHECKING:
    import pandas as pd
    from scipy.spatial.transform import Rotation


class Flag(enum.IntFlag):
    """What is to be known of a sample of an `Orientation`; combine with ``&``."""

    TILT_UNKNOWN = 1
    """No accelerometer sample has been seen yet: the attitude is arbitrary."""
    HEADING_UNKNOWN = 2
    """No usable magnetometer sample has been seen yet: heading is relative to the start."""
    GYRO_HELD = 4
    """The gyroscope had no sample; its last one was used."""
    LONG_STEP = 8
    """More time than the maximum gap has passed since the last sample; if more than 1 s, the attitude begins anew."""
    MAG_REJECTED = 16
    """The field was found disturbed. Of a Kalman filter: the sample was given less than 1 % of its weight."""
    NEAR_SINGULAR = 32
    """The attitude is near one in which the method's angles are undefined; do not trust it."""
    ACC_REJECTED = 64
    """Linear acceleration is so strong that the accelerometer's sample was given less than a tenth of its weight."""
    GYRO_CLIPPED = 128
    """The gyroscope is at the end of its range: what the rate has more is lost, or was put back by guess."""


# Optional fields with a vector in body axes for each sample.
_VECTORS = ("gyr_bias", "gyr_bias_sigma", "rate", "rate_sigma")


@dataclass(frozen=True, eq=False)
class Orientation:
    """Orientation of a body over time.

    Parameters
    ----------
    time : (N,) array
        Time in seconds, not decreasing.
    quat : (N, 4) array
        Unit quaternions (w, x, y, z), Hamilton, from body to `frame`. Normalised here; a norm off by more than
        1 % is an error.
    frame : {"NED", "ENU", "NWU"}
        Navigation frame.
    covariance : (N, 3, 3) array, optional
        Covariance in rad² of the small rotation vector δ, in axes of `frame`, with
        true rotation = exp(δ) · estimate. None where the method has none.
    gyr_bias : (N, 3) array, optional
        Estimated gyroscope bias, rad/s, in body axes.
    gyr_bias_sigma : (N, 3) array, optional
        Standard deviation of `gyr_bias`, rad/s.
    rate : (N, 3) array, optional
        Estimated angular rate, rad/s, in body axes, of methods that have no gyroscope.
    rate_sigma : (N, 3) array, optional
        Standard deviation of `rate`, rad/s.
    flags : (N,) array of int, optional
        Bits of `Flag`; zero when not given.
    diagnostics : mapping of str to (N,) array
        Statistics behind the flags; the estimator's docstring names them, and the thresholds.
    name : str
        Where it comes from: the estimator's or the recording's name.

    Raises
    ------
    InputError
        On wrong shapes, time that runs backwards, or quaternions that are not of unit norm.

    Notes
    -----
    A value: methods return new orientations. These may share arrays, as NumPy's views do, also with the caller.
    """

    time: FloatArray
    quat: FloatArray
    frame: Frame = "NED"
    covariance: FloatArray | None = None
    gyr_bias: FloatArray | None = None
    gyr_bias_sigma: FloatArray | None = None
    flags: npt.NDArray[np.integer[Any]] = field(default=None)  # type: ignore[arg-type]
    diagnostics: Mapping[str, FloatArray] = field(default_factory=dict)
    name: str = ""
    rate: FloatArray | None = None
    rate_sigma: FloatArray | None = None

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        set_field(self, "time", check_time(self.time))
        set_field(self, "frame", check_frame(self.frame))
        check_increasing(self.time)
        n = len(self.time)
        set_field(self, "quat", check_quat(self.quat, n))
        if self.covariance is not None:
            cov = as_float_array("covariance", self.covariance)
            if cov.shape != (n, 3, 3):
                raise InputError(expected(f"covariance of shape ({n}, 3, 3)", f"shape {cov.shape}"))
            check_no_infinity("covariance", cov.reshape(n, 9))
            set_field(self, "covariance", cov)
        for key in _VECTORS:
            if getattr(self, key) is not None:
                set_field(self, key, check_vectors(key, getattr(self, key), n))
        flags = np.zeros(n, np.uint8) if self.flags is None else np.asarray(self.flags)
        if flags.shape != (n,) or flags.dtype.kind not in "iub":
            raise InputError(expected(f"flags of shape ({n},) of integers", f"shape {flags.shape}, {flags.dtype}"))
        if ((flags < 0) | (flags > 255)).any():
            raise InputError(expected("flags between 0 and 255", f"{flags.min()} to {flags.max()}"))
        set_field(self, "flags", flags.astype(np.uint8))
        diagnostics = {key: as_float_array(key, value) for key, value in self.diagnostics.items()}
        for key, array in diagnostics.items():
            if array.shape != (n,):
                raise InputError(expected(f"{key} of shape ({n},) in diagnostics", f"shape {array.shape}"))
        set_field(self, "diagnostics", diagnostics)

    @classmethod
    def _trusted(cls, **values: Any) -> Orientation:
        """Build from arrays that northdown itself has just computed, without checking them again."""
        self = object.__new__(cls)
        absent: dict[str, Any] = {
            **dict.fromkeys(("covariance", *_VECTORS)),
            "diagnostics": {},
            "name": "",
        }
        self.__dict__.update(absent | values)
        return self

    @classmethod
    def from_rotation(cls, time: npt.ArrayLike, rotation: Rotation, frame: str = "NED", **other: Any) -> Orientation:
        """Orientation from a SciPy `Rotation` (body → frame) of length N."""
        check_rotation("rotation", rotation)
        quat = np.roll(np.atleast_2d(rotation.as_quat()), 1, axis=-1)
        return cls(check_time(time), quat, check_frame(frame), **other)

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        span = f"{self.time[0]:g} to {self.time[-1]:g} s" if len(self) else "no samples"
        extras = [n for n in ("covariance", "gyr_bias", "rate") if getattr(self, n) is not None]
        return f"<Orientation {self.name or 'unnamed'}: {len(self)} samples, {span}, body → {self.frame}" + (
            f", with {' and '.join(extras)}>" if extras else ">"
        )

    def __getitem__(self, index: slice | npt.NDArray[Any]) -> Orientation:
        """Part of the orientation, by slice, mask or increasing indices."""
        chosen = check_index(index, len(self))
        pick: dict[str, Any] = {k: v[chosen] for k, v in self._arrays()}
        pick["diagnostics"] = {k: v[chosen] for k, v in self.diagnostics.items()}
        return replace(self, **pick)

    def _arrays(self) -> Iterator[tuple[str, Any]]:
        for key in ("time", "quat", "covariance", *_VECTORS, "flags"):
            value = getattr(self, key)
            if value is not None:
                yield key, value

    @cached_property
    def rotation(self) -> Rotation:
        """SciPy `Rotation` of length N, body → `frame`."""
        from scipy.spatial.transform import Rotation

        return Rotation.from_quat(np.roll(self.quat, -1, axis=-1))

    def has(self, flag: Flag) -> npt.NDArray[np.bool_]:
        """Samples, (N,) booleans, at which any of the bits of `flag` is set."""
        found: npt.NDArray[np.bool_] = (self.flags & int(flag)) != 0
        return found

    def to_frame(self, frame: str) -> Orientation:
        """The same orientation expressed in another navigation frame."""
        target = check_frame(frame)
        if target == self.frame:
            return self
        turn = rotation_between(self.frame, target)
        mat = turn.as_matrix()
        cov = None if self.covariance is None else mat @ self.covariance @ mat.T
        quat = np.roll((turn * self.rotation).as_quat(), 1, axis=-1) if len(self) else self.quat
        return replace(self, quat=quat, frame=target, covariance=cov)

    def turned(self, left: Rotation | None = None, right: Rotation | None = None) -> Orientation:
        """Left · rotation · right: constant rotations of the navigation frame and of the body frame.

        Parameters
        ----------
        left : Rotation, optional
            Turns the navigation frame; the covariance turns with it.
        right : Rotation, optional
            Turns the body frame, as when the sensor is remounted; gyroscope bias and rate turn with it.

        Raises
        ------
        InputError
            When one of them is not a single SciPy Rotation.
        """
        left, right = check_single_rotation("left", left), check_single_rotation("right", right)
        result = self.rotation
        cov = self.covariance
        vectors = {key: getattr(self, key) for key in _VECTORS}
        if left is not None:
            result = left * result
            mat = left.as_matrix()
            cov = None if cov is None else mat @ cov @ mat.T
        if right is not None:
            result = result * right
            for key, value in vectors.items():
                # the sigmas of single axes say nothing of other axes
                vectors[key] = None if value is None or key.endswith("sigma") else right.inv().apply(value)
        quat = np.roll(result.as_quat(), 1, axis=-1)
        return replace(self, quat=quat, covariance=cov, **vectors)

    def as_euler(self, convention: str = "zyx", *, degrees: bool = False) -> FloatArray:
        """Euler angles, (N, 3), in rad unless `degrees`.

        Parameters
        ----------
        convention : {"zyx", "rfu"}
            ``"zyx"`` (roll, pitch, yaw) of body → this orientation's own frame: the aerospace angles when the frame
            is NED and the body forward-right-down. ``"rfu"`` (pitch, roll, heading) for a body with axes
            right-forward-up; heading clockwise from north, whatever the frame.
        degrees : bool
            Give degrees.
        """
        rotation = self.to_frame("ENU").rotation if convention == "rfu" else self.rotation
        angles = as_euler(rotation, convention)
        return np.rad2deg(angles) if degrees else angles

    def at(self, time: npt.ArrayLike) -> Orientation:
        """Orientation at other times (s) within the span, not decreasing, by spherical linear interpolation.

        Covariance, bias and rate are interpolated linearly; flags of both neighbours are combined. Where several
        samples have the time that is asked for, the last of them is taken. Gaps are bridged like any other step.

        Raises
        ------
        InputError
            When a time lies outside the span or runs backwards, or there is nothing to interpolate.
        """
        from scipy.spatial.transform import Rotation

        t = check_time(np.atleast_1d(as_float_array("time", time)))
        check_increasing(t)
        if not len(self) or (len(t) and (t[0] < self.time[0] or t[-1] > self.time[-1])):
            span = f"{self.time[0]:g} to {self.time[-1]:g} s" if len(self) else "no samples"
            got = f"{t[0]:g} to {t[-1]:g} s" if len(t) else "no times"
            raise InputError(expected(f"times within the orientation's span ({span})", got, do="cut the times first"))
        left = np.searchsorted(self.time, t, side="right") - 1
        right = np.minimum(left + 1, len(self) - 1)
        step = self.time[right] - self.time[left]
        u = np.divide(t - self.time[left], step, out=np.zeros_like(t), where=step > 0.0)
        first = self.rotation[left]
        turn = (first.inv() * self.rotation[right]).as_rotvec() * u[:, None]
        quat = np.roll((first * Rotation.from_rotvec(turn)).as_quat(), 1, axis=-1)

        def blend(x: FloatArray | None) -> FloatArray | None:
            if x is None:
                return None
            k = u.reshape(-1, *[1] * (x.ndim - 1))
            return x[left] * (1.0 - k) + x[right] * k

        flags = self.flags[left] | self.flags[right] * (u > 0.0)
        vectors: dict[str, Any] = {key: blend(getattr(self, key)) for key in _VECTORS}
        return replace(
            self,
            time=t,
            quat=quat,
            covariance=blend(self.covariance),
            **vectors,
            flags=flags,
            diagnostics={k: x[left] * (1.0 - u) + x[right] * u for k, x in self.diagnostics.items()},
        )

    def to_pandas(self, convention: str = "zyx") -> pd.DataFrame:
        """Table, one row per sample: quaternion, Euler angles (rad), covariance (rad²), rates (rad/s) and flags."""
        import pandas as pd

        columns: dict[str, npt.NDArray[Any]] = {"time": self.time}
        columns |= {f"q{c}": self.quat[:, i] for i, c in enumerate("wxyz")}
        angles = self.as_euler(convention)
        columns |= {name: angles[:, i] for i, name in enumerate(EULER_COLUMNS[convention])}
        if self.covariance is not None:
            for i, j in zip(*np.triu_indices(3), strict=True):
                columns[f"cov_{'xyz'[i]}{'xyz'[j]}"] = self.covariance[:, i, j]
        for key in _VECTORS:
            value = getattr(self, key)
            if value is not None:
                columns |= {f"{key}_{c}": value[:, i] for i, c in enumerate("xyz")}
        columns["flags"] = self.flags
        table = pd.DataFrame(columns)
        table.attrs = {"frame": self.frame, "name": self.name}
        return table
