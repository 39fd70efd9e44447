"""How northdown itself lays out a recording or an orientation in a file, whatever the format.

Tables (CSV, Parquet) have the columns ``time``, ``gyr_x`` …, ``acc_x`` …, ``mag_x`` …, ``movement``, and for the
reference ``ref_qw`` …, ``ref_cov_xx`` …, ``ref_gyr_bias_x`` …, ``ref_flags``, empty where it has no sample. Array
files (HDF5, MATLAB) have ``time``, ``gyr`` (N, 3) …, and ``reference_time``, ``reference_quat`` …

What is not a number (frame, name …) is a few lines of text, here called meta: comment lines in CSV, otherwise one
JSON object named ``northdown``. Of an array of accelerometers, tables have a column ``array_…`` for each, by its
name, array files one array ``array_acc`` (N, K), and the meta the geometry as JSON (`northdown.io.array_file`).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray
from northdown.arrays import AccelerometerArray
from northdown.errors import FormatError, InputError, expected
from northdown.frames import FRAMES
from northdown.io.array_columns import PREFIX, check_channels_live
from northdown.io.array_file import array_from_json, array_json
from northdown.io.source import quoted
from northdown.orientation import Orientation
from northdown.recording import SENSORS, Recording

Meta = dict[str, str]
Columns = dict[str, npt.NDArray[Any]]

KEYS: Final = (
    "northdown", "frame", "name", "mag_unit", "reference_offset", "reference_frame", "reference_name", "array"
)  # fmt: skip
"""Keys of the metadata; ``northdown`` says what it is: ``"recording"`` or ``"orientation"``."""

_MAX_META: Final = 1 << 18
_VECTORS: Final = ("gyr_bias", "gyr_bias_sigma", "rate", "rate_sigma")
_TRIU: Final = tuple((i, j, f"{'xyz'[i]}{'xyz'[j]}") for i, j in zip(*np.triu_indices(3), strict=True))


def recording_meta(recording: Recording) -> Meta:
    """Metadata of a recording."""
    meta = {
        "northdown": "recording",
        "frame": recording.frame,
        "name": recording.name,
        "mag_unit": recording.mag_unit,
        "reference_offset": recording.reference_offset,
    }
    if recording.reference is not None:
        meta |= {"reference_frame": recording.reference.frame, "reference_name": recording.reference.name}
    if recording.array is not None:
        meta["array"] = array_json(recording.array)
    return meta


def orientation_meta(orientation: Orientation) -> Meta:
    """Metadata of an orientation."""
    return {"northdown": "orientation", "frame": orientation.frame, "name": orientation.name}


def meta_json(meta: Meta) -> str:
    """Metadata as one line of ASCII."""
    return json.dumps(meta)


def parse_meta(text: str | bytes | None, label: str) -> Meta:
    """Metadata from `meta_json`; an empty dict for None.

    Raises
    ------
    FormatError
        When it is not an object of strings.
    """
    if text is None:
        return {}
    try:
        meta = json.loads(text[:_MAX_META])
    except (ValueError, RecursionError):
        meta = None
    if not isinstance(meta, dict) or not all(isinstance(v, str) for v in meta.values()):
        raise FormatError(expected("northdown's metadata as JSON", f"other text in {label}"))
    return {key: meta[key] for key in KEYS if key in meta}


def array_of(meta: Meta, given: AccelerometerArray | None, label: str) -> AccelerometerArray | None:
    """Geometry of a file's array: the one given, else its own if it has one."""
    if given is not None or "array" not in meta:
        return given
    return array_from_json(meta["array"], label)


def check_kind(meta: Meta, kind: str, label: str) -> None:
    """Raise when a file that northdown wrote holds the other kind of thing."""
    found = meta.get("northdown")
    if found is not None and found != kind:
        do = "read it with northdown.io.read_orientation" if found == "orientation" else "read it with northdown.read"
        raise FormatError(
            expected(f"{'a' if kind == 'recording' else 'an'} {kind}", f"{quoted(found)} in {label}", do=do)
        )


def recording_columns(recording: Recording) -> Columns:
    """Columns of a recording's table.

    Raises
    ------
    InputError
        When the reference has times that the recording has not: a table has one time.
    """
    _check_not_empty(len(recording))
    columns: Columns = {"time": recording.time}
    for sensor in SENSORS:
        value: FloatArray | None = getattr(recording, sensor)
        if value is not None:
            columns |= {f"{sensor}_{c}": value[:, i] for i, c in enumerate("xyz")}
    if recording.array is not None and recording.array_acc is not None:
        columns |= {f"{PREFIX}{n}": recording.array_acc[:, i] for i, n in enumerate(recording.array.names)}
    if recording.movement is not None:
        columns["movement"] = recording.movement.astype(np.uint8)
    reference = recording.reference
    if reference is not None and len(reference):
        rows = _rows_of(reference.time, recording.time)
        for name, value in _orientation_columns(reference, "ref_").items():
            columns[name] = np.full(len(recording), np.nan)
            columns[name][rows] = value
    return columns


def _orientation_columns(orientation: Orientation, prefix: str) -> Columns:
    columns: Columns = {f"{prefix}q{c}": orientation.quat[:, i] for i, c in enumerate("wxyz")}
    if orientation.covariance is not None:
        columns |= {f"{prefix}cov_{name}": orientation.covariance[:, i, j] for i, j, name in _TRIU}
    for name in _VECTORS:
        vectors: FloatArray | None = getattr(orientation, name)
        if vectors is not None:
            columns |= {f"{prefix}{name}_{c}": vectors[:, i] for i, c in enumerate("xyz")}
    if orientation.flags.any():
        columns[f"{prefix}flags"] = orientation.flags
    return columns


EXTRAS: Final = (
    *(f"cov_{name}" for _, _, name in _TRIU),
    *(f"{name}_{c}" for name in _VECTORS for c in "xyz"),
    "flags",
)
"""Columns of an orientation beyond time and quaternion; with ``ref_`` before them in a recording's table."""


def orientation_extras(columns: Mapping[str, npt.NDArray[Any]]) -> dict[str, Any]:
    """Fields of an `Orientation`, such as ``covariance``, from those of `EXTRAS` that are there."""
    fields: dict[str, Any] = {}
    if all(f"cov_{name}" in columns for _, _, name in _TRIU):
        cov = np.empty((len(columns["cov_xx"]), 3, 3))
        for i, j, name in _TRIU:
            cov[:, i, j] = cov[:, j, i] = columns[f"cov_{name}"]
        fields["covariance"] = cov
    for name in _VECTORS:
        if all(f"{name}_{c}" in columns for c in "xyz"):
            fields[name] = np.column_stack([columns[f"{name}_{c}"] for c in "xyz"]).astype(np.float64)
    if "flags" in columns:
        fields["flags"] = check_flags(columns["flags"])
    return fields


def check_flags(flags: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    """Flags as bytes; anything but whole numbers from 0 to 255 is an error."""
    if not (np.isfinite(flags).all() and (flags >= 0).all() and (flags <= 255).all() and (flags % 1 == 0).all()):
        raise FormatError(expected("flags that are whole numbers from 0 to 255", "others"))
    return flags.astype(np.uint8)


def recording_arrays(recording: Recording) -> Columns:
    """Named arrays of a recording, for files that hold several; the reference keeps its own times."""
    _check_not_empty(len(recording))
    arrays: Columns = {"time": recording.time}
    for name in (*SENSORS, "array_acc", "movement"):
        value = getattr(recording, name)
        if value is not None:
            arrays[name] = value
    if recording.reference is not None:
        arrays |= {f"reference_{key}": value for key, value in recording.reference._arrays()}
    return arrays


def recording_from_arrays(
    arrays: Mapping[str, npt.NDArray[Any]],
    meta: Meta,
    name: str,
    frame: str | None = None,
    array: AccelerometerArray | None = None,
) -> Recording:
    """Recording from `recording_arrays` and `recording_meta`; shapes are checked by `Recording`."""
    fields: dict[str, Any] = {}
    for key in (*SENSORS, "movement"):
        if key in arrays:
            fields[key] = arrays[key].ravel() if key == "movement" else arrays[key]
    if array is not None and "array_acc" in arrays:
        channels = arrays["array_acc"]
        if channels.ndim != 2 or channels.shape[1] != len(array):
            what = f"array_acc with {len(array)} columns, one for each of {', '.join(array.names)}"
            raise FormatError(expected(what, f"shape {channels.shape}"))
        check_channels_live(array, channels.astype(np.float64))
        fields |= {"array": array, "array_acc": channels}
    if "time" not in arrays:
        raise FormatError(expected("an array named time", "none"))
    time = arrays["time"].ravel()
    if "reference_quat" in arrays:
        own: dict[str, Any] = {
            k: arrays[f"reference_{k}"] for k in ("covariance", *_VECTORS) if f"reference_{k}" in arrays
        }
        if "reference_flags" in arrays:
            own["flags"] = check_flags(arrays["reference_flags"].ravel())
        reference = Orientation(
            arrays.get("reference_time", time).ravel(),
            arrays["reference_quat"],
            meta.get("reference_frame", "NED"),  # type: ignore[arg-type]
            name=meta.get("reference_name", ""),
            **own,
        )
        fields["reference"] = reference.to_frame(frame) if frame else reference
    for key in ("frame", "mag_unit", "reference_offset"):
        if key in meta:
            fields[key] = meta[key]
    if frame:
        fields["frame"] = frame
    return Recording(time, name=name, **fields)


def orientation_from_columns(
    columns: Mapping[str, npt.NDArray[Any]], meta: Meta, frame: str | None, name: str | None
) -> Orientation:
    """Orientation from columns ``time`` (s), ``qw`` … ``qz`` and those of `EXTRAS` that are there.

    Parameters
    ----------
    columns : mapping
        Arrays (N,).
    meta : dict
        Metadata that northdown wrote; empty for other files.
    frame : str, optional
        Frame of the file where the metadata do not state it; where they do, the frame to convert to.
    name : str, optional
        Name of the result where the metadata give none.

    Raises
    ------
    InputError
        When no frame is known.
    """
    stated = meta.get("frame") or frame
    if stated is None:
        raise InputError(
            expected("a frame", "a file that does not name one", do=f"give frame=…, one of {', '.join(FRAMES)}")
        )
    quat = np.column_stack([columns[f"q{c}"] for c in "wxyz"]).astype(np.float64)
    time = columns["time"].astype(np.float64)
    extras = orientation_extras(columns)
    result = Orientation(time, quat, stated, name=meta.get("name") or name or "", **extras)  # type: ignore[arg-type]
    return result.to_frame(frame) if frame else result


def _check_not_empty(rows: int) -> None:
    if not rows:
        raise InputError(expected("at least one sample to write", "none"))


def _rows_of(part: FloatArray, time: FloatArray) -> npt.NDArray[np.intp]:
    """Rows of `time`, in whatever order it is, that have the increasing times `part`, each row once."""
    order = np.argsort(time, kind="stable")
    increasing = time[order]
    repeat = np.arange(len(part)) - np.searchsorted(part, part)  # 1 for the second of equal times, and so on
    place = np.searchsorted(increasing, part) + repeat
    found = place < len(time)
    found[found] = increasing[place[found]] == part[found]
    if not found.all():
        at = int(np.argmin(found))
        raise InputError(
            expected(
                "a reference at times of the recording, as a table has one time",
                f"a reference at {part[at]:.6f} s",
                at=at,
                do="write .hdf5 or .mat, or replace the reference by reference.at(recording.time)",
            )
        )
    return order[place]
