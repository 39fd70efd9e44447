"""Geometry of accelerometer arrays in files: TOML to write by hand, and one line of JSON inside recordings.

::

    name = "four corners"

    [[accelerometer]]
    name = "north"
    position_m = [0.05, 0.0, 0.0]
    direction = [0, 0, 1]

    [[accelerometer]]
    …

``position_m`` is from the body's origin, in body axes; ``direction`` is where the reading is positive, of any
length. Names are optional: for all or for none.
"""

from __future__ import annotations

import json
import os
import tomllib
from pathlib import PurePath
from typing import IO, Any, Final

import numpy as np

from northdown._validation import FloatArray
from northdown.arrays import AccelerometerArray
from northdown.errors import FormatError, InputError, expected
from northdown.io.atomic import atomic_write
from northdown.io.source import open_source, quoted

_MAX_BYTES: Final = 1 << 18
_TOP: Final = ("name", "accelerometer")
_ENTRY: Final = ("name", "position_m", "direction")


def read_array(path: str | os.PathLike[str] | IO[bytes]) -> AccelerometerArray:
    """Read the geometry of an accelerometer array from a TOML file.

    Parameters
    ----------
    path : str, os.PathLike or open binary stream
        File of the form shown above, at most 256 KiB.

    Raises
    ------
    FormatError
        When it is not TOML, or an entry is not what it should be: the entry is named.
    InputError
        When the file is missing, empty or too large.
    """
    source = open_source(path, _MAX_BYTES)
    with source.open() as file:
        data = file.read(_MAX_BYTES)
    try:
        table = tomllib.loads(data.decode("utf-8-sig"))
    # the parser raises ValueError for what it does not understand, RecursionError for nesting
    except (ValueError, RecursionError) as error:
        why = str(error).split("\n")[0][:100]
        raise FormatError(expected("an accelerometer array in TOML", f"{source.label} ({why})")) from None
    return array_from_table(table, source.label, source.stem)


def write_array(array: AccelerometerArray, path: str | os.PathLike[str]) -> None:
    """Write the geometry of an array as TOML; `read_array` gives it back, digit for digit.

    Parameters
    ----------
    array : AccelerometerArray
        What to write.
    path : str or os.PathLike
        Name that ends in ``.toml``. The file appears whole or not at all.

    Raises
    ------
    InputError
        For another ending, or a place that cannot be written.
    """
    if not isinstance(array, AccelerometerArray):
        raise InputError(expected("an AccelerometerArray", type(array).__name__))
    if PurePath(path).suffix.lower() != ".toml":
        raise InputError(expected("a file name that ends in .toml", quoted(os.fspath(path), 200)))
    lines = [f"name = {_text(array.name)}"]
    for entry in array_table(array)["accelerometer"]:
        lines += ["", "[[accelerometer]]", f"name = {_text(entry['name'])}"]
        lines += [f"{key} = {entry[key]!r}" for key in ("position_m", "direction")]
    with atomic_write(path) as file:
        file.write(("\n".join(lines) + "\n").encode("utf-8", errors="replace"))


def array_table(array: AccelerometerArray) -> dict[str, Any]:
    """An array as a table of plain values, as both kinds of files hold it."""
    entries = [
        {"name": name, "position_m": position.tolist(), "direction": direction.tolist()}
        for name, position, direction in zip(array.names, array.position, array.direction, strict=True)
    ]
    return {"name": array.name, "accelerometer": entries}


def array_json(array: AccelerometerArray) -> str:
    """Geometry as one line of ASCII."""
    return json.dumps(array_table(array))


def array_from_json(text: str, label: str) -> AccelerometerArray:
    """Geometry from `array_json`.

    Raises
    ------
    FormatError
        When the text is something else.
    """
    try:
        table = json.loads(text)
    except (ValueError, RecursionError):
        table = None
    if not isinstance(table, dict):
        raise FormatError(expected("the geometry of the array as JSON", f"other text in {label}"))
    return array_from_table(table, label)


def array_from_table(table: dict[str, Any], label: str, stem: str = "") -> AccelerometerArray:
    """Geometry from `array_table`; `stem` is its name where the table has none."""
    _check_keys("an array", table, _TOP, label)
    name = table.get("name", stem)
    if not isinstance(name, str) or len(name) > 200:
        raise FormatError(expected("a name of at most 200 characters", f"{quoted(name)} in {label}"))
    entries = table.get("accelerometer")
    if not isinstance(entries, list) or not entries:
        got = "none" if entries is None or entries == [] else type(entries).__name__
        raise FormatError(expected("[[accelerometer]] entries", f"{got} in {label}"))
    position, direction, names = [], [], []
    for number, entry in enumerate(entries, 1):
        where = f"accelerometer {number}"
        if not isinstance(entry, dict):
            raise FormatError(expected(f"{where} as a table", f"{type(entry).__name__} in {label}"))
        if isinstance(entry.get("name"), str):
            where += f" ({quoted(entry['name'], 40)})"
        _check_keys(where, entry, _ENTRY, label)
        position.append(_three(f"position_m of {where}", entry.get("position_m"), label))
        direction.append(_three(f"direction of {where}", entry.get("direction"), label))
        if not np.any(direction[-1]):
            raise FormatError(expected(f"direction of {where} other than zero", f"zeros in {label}"))
        if "name" in entry:
            names.append(entry["name"])
    if names and len(names) != len(entries):
        got = f"{len(names)} of {len(entries)} in {label}"
        raise FormatError(expected("names for all accelerometers, or for none", got))
    try:
        return AccelerometerArray(np.array(position), np.array(direction), tuple(names), name)
    except (InputError, TypeError) as error:
        # unhashable names, such as lists, are no names
        what = str(error) if isinstance(error, InputError) else expected("names that are texts", "others")
        raise FormatError(f"{what} (in {label})") from None


def _check_keys(what: str, table: dict[str, Any], known: tuple[str, ...], label: str) -> None:
    unknown = [key for key in table if key not in known]
    if unknown:
        raise FormatError(expected(f"{what} with only {', '.join(known)}", f"{quoted(unknown[0])} in {label}"))


def _three(what: str, value: Any, label: str) -> FloatArray:
    if value is None:
        raise FormatError(expected(what, f"none in {label}"))
    good = isinstance(value, list) and len(value) == 3
    good = good and all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in value)
    # an integer may have more digits than a number can hold
    numbers = np.array([float(v) if abs(v) < 1e300 else np.inf for v in value]) if good else np.zeros(0)
    if not good or not np.isfinite(numbers).all():
        raise FormatError(expected(f"three finite numbers as {what}", f"{quoted(value)} in {label}"))
    return numbers


def _text(text: str) -> str:
    # JSON's escapes are among those of TOML, but for those beyond 16 bits, which stay as they are
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")
