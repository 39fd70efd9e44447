"""Parameters and input of the filters that take an array of accelerometers for a gyroscope."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from northdown._validation import FloatArray
from northdown.arrays import AccelerometerArray
from northdown.errors import InputError, expected
from northdown.estimators._array import Reduction, channels, reduce_array
from northdown.estimators._array_stream import ArrayStream
from northdown.estimators.base import Estimator, Samples, parameter
from northdown.recording import Recording

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


class Reduced(NamedTuple):
    """What the kernel takes of an array, in the places of gyroscope and accelerometer and beside, and the field."""

    rate: FloatArray
    force: FloatArray
    mag: FloatArray | None
    extra: FloatArray


@dataclass(frozen=True, kw_only=True)
class GyroFreeFilter(Estimator):
    """Parameters of the filters that take an array of accelerometers for a gyroscope.

    Parameters
    ----------
    array : AccelerometerArray, optional
        Geometry of the array. None: the recording's own.
    acc_noise : float
        White noise density of each accelerometer of the array, m/s²/√Hz. Raising it trusts the field more, and the
        rate less.
    mag_noise : float
        White noise density of the magnetometer, µT/√Hz, in a field of `field` µT; only the ratio counts. Raising it
        makes heading follow the magnetometer more slowly.
    field : float
        Size of the field, µT. Raising it is lowering `mag_noise`.
    gravity : float
        Local gravity, m/s². Raising it lowers the weight of the specific force's direction in proportion.
    start_tilt : float
        Standard deviation of the starting attitude about a horizontal axis, rad. Raising it converges faster from a
        bad start and more nervously from a good one.
    start_heading : float
        The same about the vertical. Raising it turns faster to the magnetometer's north at first.
    start_rate : float
        Standard deviation of the angular rate at the start, which is taken for zero, rad/s. Raising it learns a rate
        faster at first.

    Notes
    -----
    `Orientation.diagnostics` has ``acceleration``, rms of linear acceleration over `motion_window`, m/s²; ``nis`` and
    ``nis_dof``, normalised innovation squared of the sample and of how many scalar measurements, as `KalmanFilter`.
    """

    needs: ClassVar[tuple[str, ...]] = ("array",)
    uses: ClassVar[tuple[str, ...]] = ("array", "mag")

    array: AccelerometerArray | None = None
    acc_noise: float = parameter(0.005, unit="m/s²/√Hz", above=0.0)
    mag_noise: float = parameter(0.05, unit="µT/√Hz", above=0.0)
    field: float = parameter(50.0, unit="µT", above=0.0)
    gravity: float = parameter(9.80665, unit="m/s²", above=0.0)
    start_tilt: float = parameter(0.05, unit="rad", above=0.0)
    start_heading: float = parameter(0.1, unit="rad", above=0.0)
    start_rate: float = parameter(1.0, unit="rad/s", above=0.0)

    def for_recording(self, recording: Recording) -> GyroFreeFilter:
        return self if self.array is not None else replace(self, array=recording.array)

    def stream(
        self,
        *,
        rate: float | None = None,
        frame: str = "NED",
        initial: Rotation | None = None,
        max_gap: float = 0.1,
    ) -> ArrayStream:
        """Start an estimate that goes on sample by sample, or part by part; needs the parameter `array`.

        Parameters
        ----------
        rate, frame, initial, max_gap
            As for `Estimator.stream`.
        """
        return ArrayStream(self, rate=rate, frame=frame, initial=initial, max_gap=max_gap)

    def reduction(self) -> Reduction:
        """The six numbers that the filter makes of a sample of its array.

        Raises
        ------
        InputError
            Without an array, or with one that cannot do.
        """
        return reduce_array(self._geometry())

    def _geometry(self) -> AccelerometerArray:
        if self.array is None:
            do = f"give {type(self).__name__}(array=…)"
            raise InputError(expected("the geometry of an accelerometer array", "none", do=do))
        return self.array

    def samples(self, recording: Recording) -> Samples:
        if recording.array_acc is None:
            return Samples(None, None, recording.mag)
        row = channels(self.array, recording.array_acc, self.name)
        return Samples(*self.reduced(self.reduction(), row, recording.mag))

    def reduced(self, made: Reduction, row: FloatArray, mag: FloatArray | None) -> Reduced:
        """What the kernel takes for channels (…, K) and field (…, 3)."""
        # einsum sums each row by itself: a matrix product's last digit would depend on how many rows there are
        parts: list[FloatArray] = [
            np.einsum("...k,ck->...c", row, np.ascontiguousarray(part))
            for part in (made.matrix[:3], made.matrix[3:], made.extra)
        ]
        return Reduced(parts[0], parts[1], mag, parts[2])
