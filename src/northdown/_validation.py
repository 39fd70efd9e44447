"""Checks of arguments: each ``check_*`` returns a clean value or raises the precise error."""

from __future__ import annotations

import math
import numbers
from collections.abc import Sequence
from decimal import Decimal
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from northdown.errors import InputError, expected

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


def as_float_array(name: str, value: Any) -> FloatArray:
    """Convert to a float64 array, C-ordered and writable; anything that is not real numbers is an error.

    None, pandas' NA and masked elements become NaN. An array that is already as wanted is returned as it is, without
    a copy; a read-only one is copied, as the compiled kernels do not take it otherwise.
    """
    try:
        if isinstance(value, np.ma.MaskedArray):  # asarray would reveal what is under the mask
            value = np.where(np.ma.getmaskarray(value), math.nan, value.data.astype(np.float64))
        array = np.asarray(value)
        if array.dtype.kind == "O":
            array = np.array([_as_float(v) for v in array.flat], dtype=np.float64).reshape(array.shape)
        if array.dtype.kind not in "fiub":
            raise TypeError
        with np.errstate(over="ignore"):  # extended precision beyond float64 becomes infinity, which is caught later
            return np.require(array, np.float64, ["C", "A", "W"])
    except (TypeError, ValueError, OverflowError):
        kind = getattr(value, "dtype", type(value).__name__)
        do = f"convert {name} first"
        if getattr(kind, "kind", "") in ("M", "m"):
            do = f"convert {name} to seconds first"
        elif isinstance(value, (list, tuple)):
            do = f"see that all rows of {name} are numbers and equally long"
        raise InputError(expected(f"real numbers in {name}", f"{kind}", do=do)) from None


def _as_float(value: Any) -> float:
    """One element of an array of objects."""
    if value is None or type(value).__name__ == "NAType":
        return math.nan
    if isinstance(value, (numbers.Real, Decimal, np.bool_)):
        return float(value)
    raise TypeError


def check_vectors(name: str, value: Any, length: int | None = None) -> FloatArray:
    """Check an (N, 3) array of float64; NaN is allowed (no sample), infinity is not."""
    array = as_float_array(name, value)
    if array.ndim != 2 or array.shape[1] != 3:
        hint = f"pass {name}.T" if array.ndim == 2 and array.shape[0] == 3 else f"give {name} as (N, 3)"
        raise InputError(expected(f"{name} of shape (N, 3)", f"shape {array.shape}", do=hint))
    if length is not None and len(array) != length:
        raise InputError(
            expected(
                f"{name} with {length} rows, one for each time",
                f"{len(array)} rows",
                do="use NaN rows where there is no sample",
            )
        )
    check_no_infinity(name, array)
    return array


def check_channels(name: str, value: Any, shape: tuple[int, int]) -> FloatArray:
    """Check an (N, K) array of float64, one column for each channel; NaN is allowed (no sample), infinity is not."""
    array = as_float_array(name, value)
    if array.shape != shape:
        what = f"{name} of shape {shape}, a row for each time and a column for each accelerometer of the array"
        raise InputError(expected(what, f"shape {array.shape}"))
    check_no_infinity(name, array)
    return array


def check_no_infinity(name: str, array: FloatArray, *, at: int | None = None) -> None:
    """Raise when an array holds an infinite value; the first row is named unless `at` is given."""
    infinite = np.isinf(array)
    if infinite.any():
        row = int(np.argwhere(infinite)[0][0]) if at is None else at
        raise InputError(
            expected(f"finite numbers in {name}", "infinity", at=row, do="use NaN where there is no sample")
        )


def check_time(value: Any) -> FloatArray:
    """Check an (N,) array of finite times in seconds. Order is not checked: see `Recording.check`."""
    array = as_float_array("time", value)
    if array.ndim != 1:
        raise InputError(expected("time of shape (N,)", f"shape {array.shape}"))
    bad = ~np.isfinite(array)
    if bad.any():
        row = int(np.argmax(bad))
        raise InputError(expected("finite time", f"{array[row]}", at=row, do="remove or repair that row"))
    return array


def check_increasing(time: FloatArray) -> None:
    """Raise when time runs backwards. Equal neighbouring times are allowed."""
    back = np.flatnonzero(np.diff(time) < 0.0)
    if back.size:
        row = int(back[0]) + 1
        raise InputError(
            expected(
                "time that does not run backwards",
                f"{time[row]:.6f} s after {time[row - 1]:.6f} s",
                at=row,
                do="sort the recording by time (Recording.sort(), or --sort on the command line)",
            )
        )


def check_mask(name: str, value: Any, length: int) -> BoolArray:
    """Check an (N,) array of booleans (0 and 1 are accepted)."""
    try:
        array = np.asarray(value)
    except ValueError:  # rows of unequal length
        raise InputError(expected(f"{name} of shape ({length},)", type(value).__name__)) from None
    if array.ndim == 2 and 1 in array.shape:
        array = array.ravel()
    if array.shape != (length,):
        raise InputError(expected(f"{name} of shape ({length},)", f"shape {array.shape}"))
    if array.dtype != np.bool_ and (array.dtype.kind not in "fiu" or not ((array == 0) | (array == 1)).all()):
        raise InputError(expected(f"booleans in {name}", f"other values, of type {array.dtype}"))
    return array.astype(np.bool_)


def check_index(value: Any, length: int) -> slice | npt.NDArray[Any]:
    """Check a slice, an (N,) mask or an array of indices into `length` samples."""
    if isinstance(value, slice):
        return value
    if hasattr(value, "__array__"):  # a pandas Series too
        value = np.asarray(value)
    if isinstance(value, np.ndarray) and value.ndim == 1:
        if value.dtype == np.bool_:
            return check_mask("the mask", value, length)
        if not value.size:
            return value.astype(np.intp)
        if value.dtype.kind in "iu":
            outside = (value >= length) | (value < -length)
            if outside.any():
                got = f"{value[np.argmax(outside)]}"
                raise InputError(expected(f"indices of {length} samples", got, do="leave out those beyond the end"))
            return value
    kind = f"{value.dtype} of shape {value.shape}" if isinstance(value, np.ndarray) else repr(value)
    raise InputError(expected("a slice, a mask or a one-dimensional array of indices", kind))


def check_number(
    name: str,
    value: Any,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    above: float | None = None,
    unit: str = "",
) -> float:
    """Check a finite number within [low, high], or strictly above `above`."""
    try:
        if isinstance(value, (str, bytes)):
            raise TypeError
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(expected(f"a number for {name}", repr(value))) from None
    except OverflowError:
        raise InputError(expected(f"a number for {name}", "one beyond 1e308")) from None
    bound = f" above {above:g}" if above is not None else ""
    if above is None and math.isfinite(low):
        bound = f" between {low:g} and {high:g}" if math.isfinite(high) else f" of at least {low:g}"
    inside = low <= number <= high and (above is None or number > above)
    if not math.isfinite(number) or not inside:
        raise InputError(expected(f"{name}{bound}{' ' + unit if unit else ''}", f"{number:g}"))
    return number


def check_choice(name: str, value: Any, choices: Sequence[str]) -> str:
    """Check that a string is one of a few."""
    if not isinstance(value, str) or value not in choices:
        raise InputError(expected(f"{name} to be one of {', '.join(choices)}", repr(value)))
    return str(value)


def check_rotation(name: str, value: Any) -> Rotation:
    """Check a SciPy Rotation, single or of any length."""
    from scipy.spatial.transform import Rotation

    if not isinstance(value, Rotation):
        raise InputError(expected(f"{name} as a SciPy Rotation", type(value).__name__))
    return value


def check_single_rotation(name: str, value: Any) -> Any:
    """Check None, or a single SciPy Rotation; one of length 1 is made single."""
    if value is None or check_rotation(name, value).single:
        return value
    if len(value) != 1:
        raise InputError(expected(f"{name} as a single rotation", f"{len(value)} of them"))
    return value[0]


def check_quat(value: Any, n: int) -> FloatArray:
    """Check (n, 4) quaternions w, x, y, z of unit norm within 1 %, and make it exactly one."""
    quat = as_float_array("quat", value)
    if quat.shape != (n, 4):
        raise InputError(expected(f"quat of shape ({n}, 4), order w, x, y, z", f"shape {quat.shape}"))
    norm = np.sqrt((quat * quat).sum(axis=1))
    bad = ~(np.abs(norm - 1.0) < 0.01)
    if bad.any():
        row = int(np.argmax(bad))
        raise InputError(expected("unit quaternions", f"norm {norm[row]:g}", at=row, do="leave out missing samples"))
    # those that are unit but for rounding stay as they are, so that copies and files keep every digit
    unit: FloatArray = quat / np.where(np.abs(norm - 1.0) < 1e-14, 1.0, norm)[:, None]
    return unit
