"""Delimited text, both ways: generic loggers' CSV, northdown's own, and whatever else has named columns."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Mapping
from typing import Any, BinaryIO, Final

import numpy.typing as npt

from northdown.errors import FormatError, InputError, expected
from northdown.io import repoimu
from northdown.io.array_columns import PREFIX
from northdown.io.assemble import Options, build_recording, seconds
from northdown.io.columns import plan_columns
from northdown.io.layout import (
    EXTRAS,
    KEYS,
    Meta,
    array_of,
    check_kind,
    orientation_from_columns,
    orientation_meta,
    recording_columns,
    recording_meta,
)
from northdown.io.source import Source, quoted
from northdown.io.text import Text, scan
from northdown.orientation import Orientation
from northdown.recording import Recording

_UNITS: Final = {"time": "s", "gyr": "rad/s", "acc": "m/s^2"}


def read_recording(source: Source, options: Options) -> Recording:
    """Read a recording from delimited text; see `northdown.io.read`."""
    text = scan(source)
    meta = comments_meta(text.comments)
    check_kind(meta, "recording", source.label)
    if not any(text.labels) and not options.columns:
        do = "name them by number, as in columns={'gyr': [1, 2, 3]}"
        if len(text.labels) == 8:
            do += "; a trajectory of time, position and quaternion is read by northdown.io.read_orientation"
        raise FormatError(expected("a header that names the columns", f"numbers only in {source.label}", do=do))
    array = array_of(meta, options.array, source.label)
    plan = plan_columns(text.labels, columns=options.columns, units=options.units, array=array)
    extras = {f: text.labels.index(f"ref_{f}") for f in EXTRAS if meta and f"ref_{f}" in text.labels}
    times = plan.places.get("time", (None,))
    values = text.load(sorted({*plan.needed, *extras.values()}), time=times[0])
    recording = build_recording(plan, values, options, meta, {f: values[i] for f, i in extras.items()})
    return repoimu.adjust(recording, options) if repoimu.matches(text.labels) else recording


def write_recording(recording: Recording, file: BinaryIO) -> None:
    """Write a recording as CSV with units in its header and metadata in comment lines."""
    units = _UNITS | {"mag": "uT" if recording.mag_unit == "uT" else "a.u."}
    columns: dict[str, npt.NDArray[Any]] = {}
    for name, values in recording_columns(recording).items():
        unit = units["acc"] if name.startswith(PREFIX) else units.get(name.partition("_")[0])
        columns[f"{name} ({unit})" if unit else name] = values
    _write(columns, recording_meta(recording), file)


def read_orientation(text: Text, frame: str | None, name: str | None) -> Orientation:
    """Read an orientation from text with named columns; see `northdown.io.read_orientation`."""
    meta = comments_meta(text.comments)
    check_kind(meta, "orientation", text.source.label)
    places = {label: i for i, label in enumerate(text.labels)}
    plan = plan_columns(text.labels, sensors=False)
    if not {"time", "reference"} <= set(plan.places):
        shown = quoted(", ".join(text.labels)) if any(text.labels) else "numbers without header"
        raise FormatError(expected("columns time, qw, qx, qy, qz", shown))
    extras = {key: places[key] for key in EXTRAS if key in places}
    clock = plan.places["time"][0]
    values = text.load(sorted({*plan.needed, *extras.values()}), time=clock)
    columns = {key: values[i] for key, i in extras.items()}
    columns |= {f"q{c}": values[i] for c, i in zip("wxyz", plan.places["reference"], strict=True)}
    columns["time"] = seconds(values[clock], plan.units.get("time", "s" if meta else None), keep=True)
    return orientation_from_columns(columns, meta, frame, name or text.source.stem)


def write_orientation(orientation: Orientation, file: BinaryIO, convention: str) -> None:
    """Write the table of `Orientation.to_pandas` (radians), with the frame in a comment line."""
    table = orientation.to_pandas(convention)
    _write({str(c): table[c].to_numpy() for c in table}, orientation_meta(orientation), file)


def comments_meta(comments: tuple[str, ...]) -> Meta:
    """Metadata from the comment lines ``# key: value`` of a file that northdown wrote; empty for other files."""
    meta: Meta = {}
    for comment in comments:
        match = re.fullmatch(r"(\w+): ?(.*)", comment)
        if match and match[1] in KEYS:
            meta[match[1]] = _plain_value(match[2])
    return meta if "northdown" in meta else {}


def _plain_value(text: str) -> str:
    if text.startswith('"'):
        try:
            value = json.loads(text)
        except (ValueError, RecursionError):
            return text
        return value if isinstance(value, str) else text
    return text


def meta_comments(meta: Meta) -> str:
    """Comment lines that `comments_meta` reads; a value that would not fit on a line is written as JSON."""
    lines = []
    for key, value in meta.items():
        plain = value.isprintable() and value == value.strip() and not value.startswith('"')
        lines.append(f"# {key}: {value if plain else json.dumps(value)}\n")
    return "".join(lines)


def _write(columns: Mapping[str, npt.NDArray[Any]], meta: Meta, file: BinaryIO) -> None:
    import pandas as pd

    if not len(next(iter(columns.values()))):
        raise InputError(expected("at least one sample to write", "none"))
    text = io.TextIOWrapper(file, encoding="utf-8", newline="")
    text.write(meta_comments(meta))
    pd.DataFrame(columns).to_csv(text, index=False, lineterminator="\n")
    text.flush()
    text.detach()
