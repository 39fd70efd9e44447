"""A running estimate that takes the channels of an accelerometer array."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from northdown._validation import FloatArray, as_float_array, check_no_infinity
from northdown.errors import InputError, expected
from northdown.estimators._stream import Stream, vector
from northdown.kernels.runner import COUNT

if TYPE_CHECKING:
    from northdown.estimators._array_filter import GyroFreeFilter


class ArrayStream(Stream):
    """A running estimate of a filter with an accelerometer array. Made by `GyroFreeFilter.stream`."""

    estimator: GyroFreeFilter

    def update(
        self,
        channels: FloatArray,
        acc: FloatArray | None = None,
        mag: FloatArray | None = None,
        time: float | None = None,
    ) -> FloatArray:
        """Take one sample and return the attitude.

        Parameters
        ----------
        channels : (K,) array
            Specific force that each of the array's accelerometers measures along its direction, m/s². With a NaN in
            it: no sample.
        acc : None
            Must stay so: the array gives the specific force.
        mag : (3,) array, optional
            Field in body axes. None or NaN: no sample.
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
        """
        if acc is not None:
            raise InputError(
                expected("no acc beside the channels of an array", "one", do="give update(channels, mag=…)")
            )
        row = as_float_array("channels", channels)
        count = self._made.matrix.shape[1]
        if row.shape != (count,):
            raise InputError(expected(f"channels of shape ({count},)", f"shape {row.shape}"))
        check_no_infinity("channels", row, at=int(self._work.state[COUNT]))
        field = None if mag is None else vector("mag", mag)
        rate, force, field, extra = self.estimator.reduced(self._made, row, field)
        self._work.extra[:] = extra
        return super().update(rate, force, field, time)

    def _set_up(self, work: Any) -> None:
        super()._set_up(work)
        self._made = self.estimator.reduction()
