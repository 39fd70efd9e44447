"""A running estimate: what `Estimator.run` and `Estimator.stream` both are."""

from __future__ import annotations

import math
import typing
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray, as_float_array, check_no_infinity, check_number
from northdown.errors import InputError, expected
from northdown.frames import Frame, check_frame, quat_from_ned
from northdown.kernels.runner import (
    COUNT,
    GYRO_GAP,
    HEADING_UNKNOWN,
    LAST,
    MAX_GAP,
    N_RUNNER,
    NEXT,
    NO_TIME,
    NO_VECTOR,
    PENDING,
    PERIOD,
    TILT_UNKNOWN,
    TIME_BACKWARDS,
    Workspace,
)
from northdown.orientation import Orientation
from northdown.recording import Recording

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

    from northdown.estimators.base import Estimator

_ORIENTATION_FIELDS = ("gyr_bias", "gyr_bias_sigma", "rate", "rate_sigma")
_NO_SAMPLE: FloatArray = np.full(3, np.nan)


class Stream:
    """A running estimate: the state of an estimator between samples. Made by `Estimator.stream`.

    Attributes
    ----------
    flags : int
        Bits of `northdown.Flag` of the last `update`.
    """

    def __init__(
        self,
        estimator: Estimator,
        *,
        rate: float | None,
        frame: str,
        initial: Rotation | None,
        max_gap: float,
    ) -> None:
        self.estimator = estimator
        self.frame: Frame = check_frame(frame)
        self.flags = 0
        kernel = estimator.kernel
        work = kernel.workspace()
        work.turn[:] = quat_from_ned(self.frame)
        work.params[:] = estimator._parameters(self.frame)
        start, pending = _start(work.turn, initial)
        state = work.state
        state[PENDING] = pending
        state[LAST] = math.nan
        max_gap = check_number("max_gap", max_gap, low=0.0, unit="s")
        state[MAX_GAP] = max_gap if {"gyr", "array"} & set(estimator.uses) else math.inf
        state[PERIOD] = math.nan if rate is None else 1.0 / check_number("rate", rate, above=0.0, unit="Hz")
        state[N_RUNNER : N_RUNNER + 4] = start
        state[N_RUNNER + 4 :] = estimator._initial_state(start, self.frame)
        self._set_up(work)

    def _set_up(self, work: Workspace) -> None:
        self._work = work
        self._whole = work.whole
        self._row = work.out[:4]
        self._update = self._first_update

    def _first_update(self, *args: Any) -> int:
        """Compile `update`, which a whole recording does not need, when it is first called."""
        self._update = self.estimator.kernel.update
        return self._update(*args)

    def __getstate__(self) -> dict[str, Any]:
        return {"estimator": self.estimator, "frame": self.frame, "flags": self.flags, "whole": self._whole}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.estimator, self.frame, self.flags = state["estimator"], state["frame"], state["flags"]
        work = self.estimator.kernel.workspace()
        work.whole[:] = state["whole"]
        self._set_up(work)

    def update(
        self,
        gyr: FloatArray,
        acc: FloatArray | None = None,
        mag: FloatArray | None = None,
        time: float | None = None,
    ) -> FloatArray:
        """Take one sample and return the attitude.

        Parameters
        ----------
        gyr, acc, mag : (3,) arrays
            Rate (rad/s), specific force (m/s²) and field, in body axes. None or NaN: no sample.
        time : float, optional
            Time of the sample in seconds. When not given, one period after the last.

        Returns
        -------
        (4,) array
            Quaternion (w, x, y, z), body → `frame`. A new array at each call.

        Raises
        ------
        InputError
            As for `Estimator.run`; the state is then as it was before the call.

        Notes
        -----
        Fastest with contiguous float64 arrays; anything else is converted first.
        """
        if time is None:
            time = NEXT
        if acc is None:
            acc = _NO_SAMPLE
        if mag is None:
            mag = _NO_SAMPLE
        try:
            code = self._update(self._whole, time, gyr, acc, mag)
        except TypeError:
            code = -1 - NO_VECTOR
        if code < 0:
            code = self._update_converted(code, gyr, acc, mag, time)
        self.flags = code
        return self._row.copy()

    def _update_converted(self, code: int, gyr: Any, acc: Any, mag: Any, time: Any) -> int:
        """Try again with converted arguments if that was the trouble, else say what was wrong."""
        count = int(self._work.state[COUNT])
        samples = {"gyr": vector("gyr", gyr), "acc": vector("acc", acc), "mag": vector("mag", mag)}
        if code == -1 - NO_VECTOR:
            time = check_number("time", time)
            code = self._update(self._whole, time, *samples.values())
        if code < 0:
            for name, sample in samples.items():
                check_no_infinity(name, sample, at=count)
            self._raise(-1 - code, time, count)
        return code

    def run(self, recording: Recording) -> Orientation:
        """Go on through a recording, or a part of one, from where this stream stands.

        Its times must follow on from those already taken. Results are those of the uninterrupted run.
        """
        out, flags = self._record(recording)
        if len(flags):
            self.flags = int(flags[-1])
        return Orientation._trusted(
            time=recording.time,
            quat=out[:, :4],
            frame=self.frame,
            flags=flags,
            name=self.estimator.name,
            **outputs(self.estimator.outputs, out),
        )

    def _record(self, recording: Recording) -> tuple[FloatArray, npt.NDArray[np.uint8]]:
        """All that the kernel records over a recording, (N, n_out), and the flags."""
        kernel, n = self.estimator.kernel, len(recording)
        sensors = all_samples(self.estimator, recording)
        out = np.empty((n, kernel.n_out))
        flags = np.zeros(n, np.uint8)
        work = self._work
        code, done = kernel.run(work.params, work.state, work.turn, recording.time, *sensors, out, flags)
        if code:
            self._raise(code, recording.time[done] if done < n else math.nan, done)
        return out, flags

    def _raise(self, code: int, time: float, at: int) -> typing.NoReturn:
        if code == NO_TIME:
            raise InputError(expected("a rate, or a time with each sample", "neither", do="give stream(rate=…)"))
        if code == TIME_BACKWARDS:
            raise InputError(
                expected(
                    "finite time that does not run backwards",
                    f"{time:.6f} s",
                    at=at,
                    do="sort the recording by time (Recording.sort(), or --sort on the command line)",
                )
            )
        if code == GYRO_GAP:
            limit = self._work.state[MAX_GAP]
            sensor = "a gyroscope" if "gyr" in self.estimator.uses else "an array"
            raise InputError(
                expected(
                    f"{sensor} sample at least every {limit:g} s",
                    "NaN for longer",
                    at=at,
                    do="cut the recording there, or raise max_gap",
                )
            )
        do = "check the units of gyr, acc and mag"
        if "array" in self.estimator.uses:
            do = "check the array's geometry and units; where the body accelerates, use gyro-free-mekf"
        raise InputError(expected("an attitude of finite numbers", "an overflow", at=at, do=do))


def all_samples(estimator: Estimator, recording: Recording) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """gyr, acc and mag, (N, 3) each, of a recording that has what the estimator needs, and what goes beside them.

    A sensor that is not there has NaN; a gyroscope that is not there measures no rate.
    """
    estimator.check_sensors(recording)
    gyr, acc, mag, extra = estimator.samples(recording)
    shape = (len(recording), 3)
    nothing = np.full(shape, np.nan) if acc is None or mag is None else np.empty((0, 3))
    return (
        np.zeros(shape) if gyr is None else gyr,
        nothing if acc is None else acc,
        nothing if mag is None else mag,
        np.empty((shape[0], 0)) if extra is None else extra,
    )


def outputs(where: Mapping[str, slice], out: FloatArray) -> dict[str, Any]:
    """Fields of the `Orientation` from what the kernel recorded after the quaternion."""
    fields: dict[str, Any] = {}
    for key, columns in where.items():
        values = out[:, columns]
        if key == "covariance":
            fields[key] = values.reshape(-1, 3, 3)
        elif key in _ORIENTATION_FIELDS:
            fields[key] = values
        else:
            fields.setdefault("diagnostics", {})[key] = values[:, 0]
    return fields


def _start(turn: FloatArray, initial: Rotation | None) -> tuple[FloatArray, int]:
    """Quaternion body → NED at the start, and what is still to be found."""
    if initial is None:
        return turn * (1.0, -1.0, -1.0, -1.0), TILT_UNKNOWN | HEADING_UNKNOWN
    from scipy.spatial.transform import Rotation

    to_ned = Rotation.from_quat(np.roll(turn, -1)).inv()
    if not isinstance(initial, Rotation) or not initial.single:
        raise InputError(expected("initial as a single SciPy Rotation, body → frame", type(initial).__name__))
    return np.roll((to_ned * initial).as_quat(), 1), 0


def vector(name: str, value: npt.ArrayLike) -> FloatArray:
    """One sample as the compiled code takes it, or what is wrong with it."""
    array = as_float_array(name, value)
    if array.shape != (3,):
        raise InputError(expected(f"{name} of shape (3,)", f"shape {array.shape}"))
    result = np.empty(3)  # aligned, writable, of NumPy's own float64
    result[:] = array
    return result
