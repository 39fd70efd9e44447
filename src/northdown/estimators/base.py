"""The contract of an estimator, and the registry that finds them.

An estimator is one file in this folder: a docstring with the problem, the equations and their source, the step
function(s), and a frozen dataclass of parameters derived from :class:`Estimator`. Putting the file here registers it.
"""

from __future__ import annotations

import abc
import dataclasses
import difflib
import importlib
import math
import pkgutil
import types
import typing
from collections.abc import Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray, as_float_array, check_choice, check_no_infinity, check_number
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
    Kernel,
    Workspace,
)
from northdown.orientation import Orientation
from northdown.recording import Recording

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

_ORIENTATION_FIELDS = ("gyr_bias", "gyr_bias_sigma")
_NO_SAMPLE: FloatArray = np.full(3, np.nan)


def parameter(
    default: Any,
    *,
    unit: str = "",
    low: float = -math.inf,
    high: float = math.inf,
    above: float | None = None,
) -> Any:
    """Field of an estimator: its default, unit and range. Its meaning stands in the class docstring."""
    metadata = {"unit": unit, "low": low, "high": high, "above": above}
    return dataclasses.field(default=default, metadata=metadata)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Estimator(abc.ABC):
    """Base of all estimators: parameters are checked here, and `run` and `stream` are the same for all."""

    name: ClassVar[str]
    """Name on the command line."""
    needs: ClassVar[tuple[str, ...]] = ("gyr", "acc")
    """Sensors without which there is no result."""
    uses: ClassVar[tuple[str, ...]] = ("gyr", "acc", "mag")
    """Sensors that the filter's steps use."""
    kernel: ClassVar[Kernel]
    outputs: ClassVar[Mapping[str, slice]] = types.MappingProxyType({})
    """Where `gyr_bias`, its sigma and the `covariance` (nine entries by rows) stand in what the kernel records;
    other names, of one column each, become `Orientation.diagnostics`."""
    singular: ClassVar[str] = ""
    """Attitudes in which the method fails, in words; empty for none."""

    def __post_init__(self) -> None:
        hints = _type_hints(type(self))
        for f in dataclasses.fields(self):
            value = getattr(self, f.name)
            hint = hints[f.name]
            if value is None and types.NoneType in typing.get_args(hint):
                continue
            if typing.get_origin(hint) is typing.Literal:
                check_choice(f.name, value, typing.get_args(hint))
            elif hint is bool:
                if not isinstance(value, (bool, np.bool_)):
                    raise InputError(expected(f"true or false for {f.name}", repr(value)))
            else:
                number = check_number(f.name, value, **f.metadata)
                object.__setattr__(self, f.name, number)

    @abc.abstractmethod
    def _parameters(self, frame: Frame) -> Sequence[float]:
        """The kernel's parameter tuple, in its order, for a result in `frame`."""

    def _initial_state(self, quat: FloatArray, frame: Frame) -> Sequence[float]:
        """The kernel's state after the quaternion, for the attitude `quat` (body → NED) at the start."""
        return (0.0,) * (self.kernel.n_state - 4)

    def run(
        self,
        recording: Recording,
        *,
        frame: str | None = None,
        initial: Rotation | None = None,
        max_gap: float = 0.1,
    ) -> Orientation:
        """Estimate the orientation over a recording.

        Parameters
        ----------
        recording : Recording
            Sensor data. Rows of NaN in acc and mag are samples that were not taken.
        frame : {"NED", "ENU", "NWU"}, optional
            Navigation frame of the result; the recording's own when not given.
        initial : scipy.spatial.transform.Rotation, optional
            Attitude (body → `frame`) before the first sample. When not given, tilt starts from the first
            accelerometer sample and heading from the first usable magnetometer sample; until then
            `Orientation.flags` says so.
        max_gap : float
            Longest time (s) for which the last gyroscope sample is held while the gyroscope has none.

        Returns
        -------
        Orientation
            Attitude at every time of the recording. At the first sample it is the start itself; each later sample
            stands for the time since the one before.

        Raises
        ------
        InputError
            When a sensor is missing, time runs backwards, the gyroscope is silent for longer than `max_gap`, or
            the values are so large that the result is no number.
        """
        stream = self.stream(frame=frame or recording.frame, initial=initial, max_gap=max_gap)
        return stream.run(recording)

    def stream(
        self,
        *,
        rate: float | None = None,
        frame: str = "NED",
        initial: Rotation | None = None,
        max_gap: float = 0.1,
    ) -> Stream:
        """Start an estimate that goes on sample by sample, or part by part.

        Parameters
        ----------
        rate : float, optional
            Sampling rate in Hz; needed by `Stream.update` unless every call gives its time.
        frame, initial, max_gap
            As for `run`.
        """
        return Stream(self, rate=rate, frame=frame, initial=initial, max_gap=max_gap)


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
        state[MAX_GAP] = max_gap if "gyr" in estimator.uses else math.inf
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
        samples = {"gyr": _vector("gyr", gyr), "acc": _vector("acc", acc), "mag": _vector("mag", mag)}
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
        estimator, kernel = self.estimator, self.estimator.kernel
        n = len(recording)
        absent = [s for s in estimator.needs if getattr(recording, s) is None]
        if absent:
            raise InputError(
                expected(f"{' and '.join(estimator.needs)} for {estimator.name}", f"no {' and no '.join(absent)}")
            )
        sensors = [getattr(recording, s) for s in ("gyr", "acc", "mag")]
        if any(s is None for s in sensors):
            nothing = np.zeros((n, 3)) if recording.gyr is None else np.full((n, 3), np.nan)
            if recording.gyr is None:
                sensors[0], nothing = nothing, np.full((n, 3), np.nan)
            sensors = [nothing if s is None else s for s in sensors]
        out = np.empty((n, kernel.n_out))
        flags = np.zeros(n, np.uint8)
        work = self._work
        code, done = kernel.run(work.params, work.state, work.turn, recording.time, *sensors, out, flags)
        if code:
            self._raise(code, recording.time[done] if done < n else math.nan, done)
        if n:
            self.flags = int(flags[-1])
        return Orientation._trusted(
            time=recording.time,
            quat=out[:, :4],
            frame=self.frame,
            flags=flags,
            name=estimator.name,
            **_outputs(estimator.outputs, out),
        )

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
            raise InputError(
                expected(
                    f"a gyroscope sample at least every {limit:g} s",
                    "NaN for longer",
                    at=at,
                    do="cut the recording there, or raise max_gap",
                )
            )
        raise InputError(
            expected(
                "an attitude of finite numbers",
                "an overflow",
                at=at,
                do="check the units of gyr, acc and mag",
            )
        )


def _outputs(where: Mapping[str, slice], out: FloatArray) -> dict[str, Any]:
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


def _vector(name: str, value: npt.ArrayLike) -> FloatArray:
    array = as_float_array(name, value)
    if array.shape != (3,):
        raise InputError(expected(f"{name} of shape (3,)", f"shape {array.shape}"))
    vector = np.empty(3)  # aligned, writable, of NumPy's own float64
    vector[:] = array
    return vector


@cache
def _type_hints(cls: type[Estimator]) -> Mapping[str, Any]:
    return typing.get_type_hints(cls)


@cache
def _modules() -> tuple[str, ...]:
    """Names of the files that hold estimators."""
    package = importlib.import_module("northdown.estimators")
    names = (m.name for m in pkgutil.iter_modules(package.__path__))
    return tuple(sorted(n for n in names if not n.startswith("_") and n != "base"))


@cache
def _load(module_name: str) -> type[Estimator]:
    """The estimator of one file."""
    module = importlib.import_module(f"northdown.estimators.{module_name}")
    for value in vars(module).values():
        if isinstance(value, type) and issubclass(value, Estimator) and value.__module__ == module.__name__:
            return value
    raise TypeError(f"estimators/{module_name}.py defines no Estimator")


def registry() -> Mapping[str, type[Estimator]]:
    """All estimators by name, in the order of their names."""
    found = [_load(module_name) for module_name in _modules()]
    return {estimator.name: estimator for estimator in sorted(found, key=lambda e: e.name)}


def get(name: str) -> type[Estimator]:
    """Estimator class by its name, such as ``"mahony"``; only its own file is loaded."""
    module_name = name.replace("-", "_")
    if module_name in _modules() and "_" not in name:
        return _load(module_name)
    known = [m.replace("_", "-") for m in _modules()]
    close = difflib.get_close_matches(name, known, n=1)
    hint = f"did you mean {close[0]!r}?" if close else None
    raise InputError(expected(f"an estimator out of {', '.join(known)}", repr(name), do=hint))


def find_class(class_name: str) -> type[Estimator] | None:
    """Estimator by the name of its class, such as ``"GyroEulerEKF"``, whose file is ``gyro_euler_ekf``."""
    for module_name in _modules():
        if module_name.replace("_", "") == class_name.lower():
            return _load(module_name)
    return None
