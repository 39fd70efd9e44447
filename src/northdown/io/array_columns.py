"""Columns of a table that are the channels of an array of accelerometers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from northdown._validation import BoolArray, FloatArray
from northdown.arrays import AccelerometerArray
from northdown.errors import InputError, expected
from northdown.io.source import quoted
from northdown.io.units import is_unit, split_bracket

PREFIX: Final = "array_"
"""What the names of an array's columns begin with."""

# As many columns of that prefix are no chance.
_CERTAIN: Final = 6


def find_channels(
    labels: Sequence[str], array: AccelerometerArray, given: Sequence[int] | None = None
) -> tuple[int, ...]:
    """Indices of the columns of an array's channels, in its order.

    Parameters
    ----------
    labels : sequence of str
        Header of each column, with or without unit.
    array : AccelerometerArray
        Its names, or these after ``array_``, are looked for; other columns are left alone.
    given : sequence of int, optional
        Columns that the caller has named.

    Raises
    ------
    InputError
        When a channel is missing or there are two of a name.
    """
    if given is not None:
        if len(given) != len(array):
            raise InputError(expected(f"{len(array)} columns, one for each accelerometer", f"{len(given)}"))
        return tuple(given)
    plain = [split_bracket(label)[0] for label in labels]
    found = []
    for name in array.names:
        places = [i for i, label in enumerate(plain) if label == PREFIX + name]
        places = places or [i for i, label in enumerate(plain) if label == name]
        if len(places) != 1:
            have = [label for label in plain if label.startswith(PREFIX)]
            what = f"a column {PREFIX}{name} or {name}, one for each of the array's {len(array)} accelerometers"
            got = f"{len(places)} of that name" if places else f"{len(have)} named {PREFIX}…"
            shown = f" ({', '.join(quoted(h, 20) for h in have[:8])})" if have and not places else ""
            do = "give columns={'array': […]}"
            raise InputError(expected(what, got + shown, do=do))
        found.append(places[0])
    return tuple(found)


def unit_of_channels(labels: Sequence[str]) -> str | None:
    """Unit that the headers of an array's channels state, None without any; two of them are an error."""
    units = {unit for _, unit in map(split_bracket, labels) if unit is not None and is_unit("array", unit)}
    if len(units) > 1:
        raise InputError(expected("one unit for the channels of the array", " and ".join(sorted(units))))
    return units.pop() if units else None


def check_no_geometry(labels: Sequence[str]) -> None:
    """Raise when there are channels of an array but no geometry, as without it they cannot be used."""
    have = [label for label in labels if label.startswith(PREFIX)]
    if len(have) >= _CERTAIN:
        do = "give array=…, a geometry or its TOML file (--array on the command line), or columns={'array': []}"
        raise InputError(expected("the geometry of the array", f"{len(have)} columns {PREFIX}… without it", do=do))


def check_channels_live(array: AccelerometerArray, values: FloatArray) -> None:
    """Raise when some channels of an array have no samples at all, while others have."""
    dead: BoolArray = np.isnan(values).all(axis=0).reshape(-1)
    if dead.any() and not dead.all():
        names = ", ".join(name for name, gone in zip(array.names, dead, strict=True) if gone)
        do = "leave them out of the geometry (array=…, or --array on the command line)"
        raise InputError(expected("samples in every channel of the array", f"none in {names}", do=do))
