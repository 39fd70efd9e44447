"""Numbers typed as options: options are read as text, so that a mistake is told in northdown's own words."""

from __future__ import annotations

import math

from northdown.errors import InputError, expected


def read_number(
    option: str,
    text: str,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    above: float | None = None,
    unit: str = "",
) -> float:
    """Read a finite number in a range; the error names the option."""
    from northdown._validation import check_number

    try:
        number = float(text)
    except ValueError:
        raise InputError(expected(f"a number{f' of {unit}' if unit else ''} for {option}", repr(text))) from None
    return check_number(option, number, low=low, high=high, above=above, unit=unit)


def read_count(option: str, text: str) -> int:
    """Read a whole number from 0 up."""
    try:
        number = int(text)
    except ValueError:
        number = -1
    if number < 0:
        raise InputError(expected(f"a whole number from 0 up for {option}", repr(text)))
    return number
