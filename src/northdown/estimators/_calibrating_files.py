"""What the calibrating filter has learnt, in a file: TOML, or JSON with the same content.

::

    format = "northdown learnt calibration"
    version = 1
    estimator = "calibrating-ekf"
    frame = "body"

    # rate = g - gyr_bias - gyr_matrix · g, for the gyroscope's output g
    # field = m - mag_iron, for the magnetometer's output m of mag_delay later
    # specific force = a - acc_bias, for the accelerometer's output a
    [gyr_bias]
    unit = "rad/s"
    value = [0.001, -0.002, 0.0005]
    sigma = [0.0001, 0.0001, 0.0002]
    …

There is no date in a file: the same knowledge gives the same bytes. Numbers are read back exactly.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from northdown.errors import FormatError, InputError, expected
from northdown.io.atomic import atomic_write
from northdown.io.source import open_source, quoted
from northdown.io.tables import Table, as_array, as_number, as_table, check_keys, parse_table, toml_value

if TYPE_CHECKING:
    from northdown.estimators._calibrating_learnt import LearntCalibration

FORMAT: Final = "northdown learnt calibration"
VERSION: Final = 1
SUFFIXES: Final = (".toml", ".json")
_MAX_BYTES: Final = 1 << 16
_UNITS: Final = {
    "gyr_bias": "rad/s",
    "gyr_matrix": "1",
    "rest_offset": "rad/s",
    "mag_delay": "s",
    "mag_iron": "µT",
    "acc_bias": "m/s²",
}
_HEAD: Final[Table] = {"format": FORMAT, "version": VERSION, "estimator": "calibrating-ekf", "frame": "body"}


def save(known: LearntCalibration, path: str | os.PathLike[str]) -> None:
    """Write a file, whole or not at all; see `LearntCalibration.save`."""
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(expected("a file name that ends in .toml or .json", repr(str(path))))
    tables = {
        name: {"unit": unit, "value": _plain(getattr(known, name)), "sigma": _plain(getattr(known, f"{name}_sigma"))}
        for name, unit in _UNITS.items()
    }
    if suffix == ".json":
        text = json.dumps({**_HEAD, **tables}, indent=2) + "\n"
    else:
        lines = [f"{key} = {toml_value(value)}" for key, value in _HEAD.items()]
        lines += ["", "# rate = g - gyr_bias - gyr_matrix · g, for the gyroscope's output g"]
        lines += ["# field = m - mag_iron, for the magnetometer's output m of mag_delay later"]
        lines += ["# specific force = a - acc_bias, for the accelerometer's output a"]
        for name, table in tables.items():
            lines += [f"[{name}]", *(f"{key} = {toml_value(value)}" for key, value in table.items()), ""]
        text = "\n".join(lines)
    with atomic_write(path) as file:
        file.write(text.encode("utf-8"))


def load(path: str | os.PathLike[str]) -> LearntCalibration:
    """Read a file; see `LearntCalibration.load`."""
    from northdown.estimators._calibrating_learnt import LearntCalibration

    source = open_source(path, _MAX_BYTES)
    with source.open() as file:
        data = file.read(_MAX_BYTES)
    table = parse_table(data, source.label, "a learnt calibration")
    if table.get("format") != FORMAT:
        do = "write one with northdown estimate --save-learnt"
        raise FormatError(expected(f"a learnt calibration (format = {FORMAT!r})", f"none in {source.label}", do=do))
    for key, value in _HEAD.items():
        if isinstance(table.get(key), bool) or table.get(key) != value:
            got = f"{quoted(table.get(key), 30)} in {source.label}"
            hint = "update northdown" if key == "version" else None
            raise FormatError(expected(f"{key} = {value!r} of a learnt calibration", got, do=hint))
    check_keys("a learnt calibration", table, (*_HEAD, *_UNITS))
    values: dict[str, Any] = {}
    for name, unit in _UNITS.items():
        values |= _read(name, unit, as_table(name, table.get(name, {})))
    try:
        return LearntCalibration(**values)
    except FormatError:
        raise
    except InputError as error:
        raise FormatError(f"{error} (in {source.label})") from None


def _plain(value: Any) -> Any:
    """The number, or nested lists of them."""
    return value.tolist() if isinstance(value, np.ndarray) else float(value)


def _read(name: str, unit: str, table: Table) -> dict[str, Any]:
    check_keys(f"[{name}]", table, ("unit", "value", "sigma"))
    if table.get("unit") != unit:
        raise FormatError(expected(f"unit {unit!r} in [{name}]", quoted(table.get("unit"), 30)))
    values: dict[str, Any] = {}
    for key, field in (("value", name), ("sigma", f"{name}_sigma")):
        if key not in table:
            raise FormatError(expected(f"{key} in [{name}]", "none"))
        label = f"{key} in [{name}]"
        if name == "mag_delay":
            values[field] = as_number(label, table[key])
        else:
            values[field] = as_array(label, table[key], 3, 3 if name == "gyr_matrix" else None)
    return values
