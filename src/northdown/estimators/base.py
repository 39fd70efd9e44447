"""The contract of an estimator.

An estimator is one file in this folder: a docstring with the problem, the equations and their source, the step
function(s), and a frozen dataclass of parameters derived from :class:`Estimator`. Putting the file here registers it.
"""

from __future__ import annotations

import abc
import dataclasses
import math
import types
import typing
from collections.abc import Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from northdown._validation import FloatArray, check_choice, check_number
from northdown.arrays import AccelerometerArray
from northdown.errors import InputError, expected
from northdown.estimators._stream import Stream
from northdown.frames import Frame
from northdown.kernels.runner import Kernel
from northdown.orientation import Orientation
from northdown.recording import Recording

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


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


class Samples(NamedTuple):
    """What a kernel takes in the places of gyroscope, accelerometer and magnetometer: (N, 3) arrays, or None.

    Extra is what it takes beside them, (N, `Kernel.n_extra`).
    """

    gyr: FloatArray | None
    acc: FloatArray | None
    mag: FloatArray | None
    extra: FloatArray | None = None


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
    """Where `gyr_bias`, `rate`, their sigmas and the `covariance` (nine entries by rows) stand in what the kernel
    records; other names, of one column each, become `Orientation.diagnostics`."""
    smooths: ClassVar[bool] = False
    """Whether `smooth` can be called."""
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
            elif AccelerometerArray in typing.get_args(hint):
                if not isinstance(value, AccelerometerArray):
                    raise InputError(expected(f"an AccelerometerArray for {f.name}", type(value).__name__))
            elif hint is int:
                number = check_number(f.name, value, **f.metadata)
                if number != int(number):
                    raise InputError(expected(f"a whole number for {f.name}", f"{number:g}"))
                object.__setattr__(self, f.name, int(number))
            else:
                number = check_number(f.name, value, **f.metadata)
                object.__setattr__(self, f.name, number)

    @abc.abstractmethod
    def _parameters(self, frame: Frame) -> Sequence[float]:
        """The kernel's parameter tuple, in its order, for a result in `frame`."""

    def _initial_state(self, quat: FloatArray, frame: Frame) -> Sequence[float]:
        """The kernel's state after the quaternion, for the attitude `quat` (body → NED) at the start."""
        return (0.0,) * (self.kernel.n_state - 4)

    def for_recording(self, recording: Recording) -> Estimator:
        """Copy with what is taken from a recording beside the samples: the geometry of an array."""
        return self

    def check_sensors(self, recording: Recording) -> None:
        """Raise InputError when a needed sensor is missing from a recording."""
        absent = [sensor for sensor in self.needs if getattr(recording, sensor) is None]
        if absent:
            raise InputError(expected(f"{' and '.join(self.needs)} for {self.name}", f"no {' and no '.join(absent)}"))

    def samples(self, recording: Recording) -> Samples:
        """What the kernel takes of a recording in the places of gyroscope, accelerometer and magnetometer."""
        return Samples(recording.gyr, recording.acc, recording.mag)

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
            Longest time (s) for which the last gyroscope sample is held while the gyroscope has none. Where more time
            than this, and than 1 s, has passed without any sample, tilt and heading are found anew as at the start
            (but by `vqf`, which keeps to its paper).

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
        self.check_sensors(recording)
        this = self.for_recording(recording)
        stream = this.stream(frame=frame or recording.frame, initial=initial, max_gap=max_gap)
        return stream.run(recording)

    def smooth(self, recording: Recording, *, frame: str | None = None) -> Orientation:
        """Estimate the orientation from the whole recording, at each time from its past and its future.

        More accurate than `run`, and only for recordings; estimators whose `smooths` is true can do it.

        Parameters
        ----------
        recording : Recording
            Sensor data. Rows of NaN in acc and mag are samples that were not taken.
        frame : {"NED", "ENU", "NWU"}, optional
            Navigation frame of the result; the recording's own when not given.

        Returns
        -------
        Orientation
            Attitude at every time of the recording.

        Raises
        ------
        InputError
            When the estimator cannot smooth, and as for `run`.
        """
        from northdown.estimators._registry import registry

        able = ", ".join(name for name, estimator in registry().items() if estimator.smooths)
        raise InputError(expected(f"an estimator that smooths ({able})", self.name, do="use run"))

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


@cache
def _type_hints(cls: type[Estimator]) -> Mapping[str, Any]:
    return typing.get_type_hints(cls)
