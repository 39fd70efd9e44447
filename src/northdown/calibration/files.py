"""Calibrations in files: TOML, or JSON with the same content.

::

    format = "northdown calibration"
    version = 1

    # calibrated = matrix · (raw − offset)
    [mag]
    unit = "uT"
    offset = [12.01, -24.98, 8.003]
    offset_sigma = [0.021, 0.019, 0.02]
    matrix = [[0.91, -0.05, 0.03], [-0.05, 1.05, -0.04], [0.03, -0.04, 1.0]]
    matrix_sigma = [[0.0005, 0.0004, 0.0004], [0.0004, 0.0005, 0.0005], [0.0004, 0.0005, 0.0005]]
    norm = 50.66

    [mag.evidence]
    model = "ellipsoid"
    …

There is no date in a file: the same calibration gives the same bytes. Numbers are written so that they are read
back exactly.
"""

from __future__ import annotations

import json
import math
import os
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

from northdown.calibration.model import Calibration
from northdown.calibration.part import SENSORS, Evidence, SensorCalibration, TemperatureSlope
from northdown.errors import FormatError, InputError, expected
from northdown.io.atomic import atomic_write
from northdown.io.source import open_source, quoted
from northdown.io.tables import Table, as_array, as_number, as_table, as_text, check_keys, parse_table, toml_value

FORMAT: Final = "northdown calibration"
VERSION: Final = 1
SUFFIXES: Final = (".toml", ".json")
_MAX_BYTES: Final = 1 << 18
_MAX_NOTES: Final = 100

_PART_KEYS: Final = (
    "unit",
    "offset",
    "offset_sigma",
    "matrix",
    "matrix_sigma",
    "norm",
    "temperature",
    "evidence",
)
_TEMPERATURE_KEYS: Final = ("reference", "low", "high", "coefficients")
_EVIDENCE_KEYS: Final = tuple(f.name for f in fields(Evidence))


def save(calibration: Calibration, path: str | os.PathLike[str]) -> None:
    """Write a calibration; an existing file is replaced at once, or not at all.

    Parameters
    ----------
    calibration : Calibration
        What to write.
    path : str or os.PathLike
        Name that ends in ``.toml`` or ``.json``.

    Raises
    ------
    InputError
        When the calibration holds nothing, the name has another ending, or the system refuses to write.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(expected("a file name that ends in .toml or .json", repr(str(path))))
    if not calibration.parts:
        raise InputError(expected("a calibration of at least one sensor", "none"))
    tables = {part.sensor: _as_table(part) for part in calibration.parts}
    if suffix == ".json":
        text = json.dumps({"format": FORMAT, "version": VERSION, **tables}, indent=2, ensure_ascii=False) + "\n"
    else:
        text = _toml(tables)
    with atomic_write(path) as file:
        file.write(text.encode("utf-8", errors="replace"))


def load(path: str | os.PathLike[str]) -> Calibration:
    """Read a calibration that `save` has written, TOML or JSON by its content.

    Raises
    ------
    FormatError
        When the content is something else, damaged, or its numbers are not what they should be.
    InputError
        When the file is missing, empty, or larger than 256 KiB.
    """
    source = open_source(path, _MAX_BYTES)
    with source.open() as file:
        data = file.read(_MAX_BYTES)
    table = parse_table(data, source.label, "a calibration")
    if table.get("format") != FORMAT:
        do = "write calibrations with northdown.calibration.save"
        raise FormatError(expected(f"a calibration (format = {FORMAT!r})", f"none in {source.label}", do=do))
    version = table.get("version")
    if isinstance(version, bool) or version != VERSION:
        got = f"version {quoted(version, 20)} in {source.label}"
        raise FormatError(expected(f"a calibration of version {VERSION}", got, do="update northdown"))
    check_keys("a calibration", table, ("format", "version", *SENSORS))
    parts = {s: _read_part(s, as_table(s, table[s])) for s in SENSORS if s in table}
    if not parts:
        raise FormatError(expected("a calibration of gyr, acc or mag", f"none in {source.label}"))
    return Calibration(**parts)


def _as_table(part: SensorCalibration) -> Table:
    table: Table = {"unit": part.unit}
    for name in ("offset", "offset_sigma", "matrix", "matrix_sigma"):
        table[name] = getattr(part, name).tolist()
    if not math.isnan(part.norm):
        table["norm"] = part.norm
    if part.temperature is not None:
        slope = part.temperature
        table["temperature"] = {
            "reference": slope.reference,
            "low": slope.low,
            "high": slope.high,
            "coefficients": slope.coefficients.tolist(),
        }
    evidence = {f.name: getattr(part.evidence, f.name) for f in fields(Evidence)}
    table["evidence"] = {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in evidence.items()
        if not (isinstance(value, float) and not math.isfinite(value))
    }
    return table


def _toml(tables: dict[str, Table]) -> str:
    lines = [f"format = {toml_value(FORMAT)}", f"version = {VERSION}", "", "# calibrated = matrix · (raw − offset)"]
    for sensor, table in tables.items():
        lines += [f"[{sensor}]"]
        lines += [f"{name} = {toml_value(v)}" for name, v in table.items() if not isinstance(v, dict)]
        for name, inner in table.items():
            if isinstance(inner, dict):
                lines += ["", f"[{sensor}.{name}]"] + [f"{key} = {toml_value(v)}" for key, v in inner.items()]
        lines.append("")
    return "\n".join(lines)


def _read_part(sensor: str, table: Table) -> SensorCalibration:
    check_keys(f"[{sensor}]", table, _PART_KEYS)
    for name in ("unit", "offset", "matrix"):
        if name not in table:
            raise FormatError(expected(f"{name} in [{sensor}]", "none"))
    values: dict[str, Any] = {"unit": as_text(f"unit in [{sensor}]", table["unit"])}
    if not values["unit"]:
        raise FormatError(expected(f"unit in [{sensor}]", "an empty text"))
    for name, rows in (("offset", None), ("offset_sigma", None), ("matrix", 3), ("matrix_sigma", 3)):
        if name in table:
            values[name] = as_array(f"{name} in [{sensor}]", table[name], 3, rows)
    if "norm" in table:
        values["norm"] = as_number(f"norm in [{sensor}]", table["norm"])
    try:
        if "temperature" in table:
            values["temperature"] = _read_temperature(as_table("temperature", table["temperature"]))
        if "evidence" in table:
            values["evidence"] = _read_evidence(as_table("evidence", table["evidence"]))
        return SensorCalibration(sensor, **values)
    except FormatError:
        raise
    except InputError as error:
        raise FormatError(f"{error} (in [{sensor}])") from None


def _read_temperature(table: Table) -> TemperatureSlope:
    check_keys("temperature", table, _TEMPERATURE_KEYS)
    missing = [key for key in _TEMPERATURE_KEYS if key not in table]
    if missing:
        raise FormatError(expected(f"{missing[0]} of the temperature", "none"))
    return TemperatureSlope(
        as_number("reference", table["reference"]),
        as_array("coefficients", table["coefficients"], 3, 5),
        as_number("low", table["low"]),
        as_number("high", table["high"]),
    )


def _read_evidence(table: Table) -> Evidence:
    check_keys("evidence", table, _EVIDENCE_KEYS)
    values: dict[str, Any] = {"model": "given"}
    for name, value in table.items():
        if name in ("model", "quantity", "unit"):
            values[name] = as_text(name, value)
        elif name == "notes":
            if not isinstance(value, list) or len(value) > _MAX_NOTES:
                raise FormatError(expected("a list of notes", quoted(value)))
            values[name] = tuple(as_text(name, v) for v in value)
        elif name == "samples":
            values[name] = int(as_number(name, value))
        else:
            values[name] = as_number(name, value)
    return Evidence(**values)
