"""Checks of arguments: each ``check_*`` returns a clean value or raises the precise error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from northdown.errors import InputError, expected

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


def as_float_array(name: str, value: Any) -> FloatArray:
    """Convert to a C-ordered float64 array; anything that is not real numbers is an error."""
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "fiub":
            if array.dtype.kind == "O":  # None among numbers, or pandas' NA
                array = np.array(
                    [[math.nan if v is None else v for v in row] for row in array]
                    if array.ndim == 2
                    else [math.nan if v is None else v for v in array]
                )
            if array.dtype.kind not in "fiub":
                raise TypeError
        return np.ascontiguousarray(array, dtype=np.float64)
    except (TypeError, ValueError):
        kind = getattr(value, "dtype", type(value).__name__)
        raise InputError(expected(f"real numbers in {name}", f"{kind}", do=f"convert {name} first")) from None


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
    array = np.asarray(value)
    if array.ndim == 2 and 1 in array.shape:
        array = array.ravel()
    if array.shape != (length,):
        raise InputError(expected(f"{name} of shape ({length},)", f"shape {array.shape}"))
    if array.dtype != np.bool_ and not np.isin(array, (0, 1)).all():
        raise InputError(expected(f"booleans in {name}", f"values of type {array.dtype}"))
    return array.astype(np.bool_)


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
    bound = f" above {above:g}" if above is not None else ""
    if above is None and math.isfinite(low):
        bound = f" between {low:g} and {high:g}" if math.isfinite(high) else f" of at least {low:g}"
    inside = low <= number <= high and (above is None or number > above)
    if not math.isfinite(number) or not inside:
        raise InputError(expected(f"{name}{bound}{' ' + unit if unit else ''}", f"{number:g}"))
    return number


def check_choice(name: str, value: Any, choices: Sequence[str]) -> str:
    """Check that a string is one of a few."""
    if value not in choices:
        raise InputError(expected(f"{name} to be one of {', '.join(choices)}", repr(value)))
    return str(value)
