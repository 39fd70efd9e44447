"""Parquet, both ways: one flat table of numeric columns; the frame and the like in the file's metadata."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from northdown.errors import FormatError, InputError, expected
from northdown.io.assemble import Options, build_recording
from northdown.io.columns import plan_columns
from northdown.io.layout import (
    EXTRAS,
    Columns,
    Meta,
    array_of,
    check_kind,
    meta_json,
    orientation_from_columns,
    orientation_meta,
    parse_meta,
    recording_columns,
    recording_meta,
)
from northdown.io.optional import import_optional
from northdown.io.source import MAX_BYTES, Source, quoted
from northdown.orientation import Orientation
from northdown.recording import Recording

_BATCH = 65536


def read_recording(source: Source, options: Options) -> Recording:
    """Read a recording from a Parquet table; see `northdown.io.read`."""
    with _open(source) as file:
        labels, meta = _describe(file, source)
        check_kind(meta, "recording", source.label)
        array = array_of(meta, options.array, source.label)
        plan = plan_columns(labels, columns=options.columns, units=_time_unit(file, options), array=array)
        extras = {f: labels.index(f"ref_{f}") for f in EXTRAS if meta and f"ref_{f}" in labels}
        values = _load(file, labels, [*plan.needed, *extras.values()], options.max_bytes, source)
    return build_recording(plan, values, options, meta, {f: values[i] for f, i in extras.items()})


def write_recording(recording: Recording, file: BinaryIO) -> None:
    """Write a recording as a Parquet table with the columns of `layout`, in SI units."""
    _write(recording_columns(recording), recording_meta(recording), file)


def read_orientation(source: Source, frame: str | None, name: str | None, max_bytes: int = MAX_BYTES) -> Orientation:
    """Read an orientation from a Parquet table; see `northdown.io.read_orientation`."""
    with _open(source) as file:
        labels, meta = _describe(file, source)
        check_kind(meta, "orientation", source.label)
        wanted = ["time", "qw", "qx", "qy", "qz"]
        if not set(wanted) <= set(labels):
            raise FormatError(expected("columns time, qw, qx, qy, qz", ", ".join(labels)[:60] or "none"))
        places = {key: labels.index(key) for key in [*wanted, *EXTRAS] if key in labels}
        values = _load(file, labels, list(places.values()), max_bytes, source)
    columns = {key: values[i] for key, i in places.items()}
    return orientation_from_columns(columns, meta, frame, name or source.stem)


def write_orientation(orientation: Orientation, file: BinaryIO, convention: str) -> None:
    """Write the table of `Orientation.to_pandas`, with the frame in the file's metadata."""
    table = orientation.to_pandas(convention)
    _write({str(c): table[c].to_numpy() for c in table}, orientation_meta(orientation), file)


def _write(columns: Columns, meta: Meta, file: BinaryIO) -> None:
    pyarrow, parquet = import_optional("pyarrow", "io"), import_optional("pyarrow.parquet", "io")
    if not len(next(iter(columns.values()))):
        raise InputError(expected("at least one sample to write", "none"))
    table = pyarrow.table({name: np.ascontiguousarray(values) for name, values in columns.items()})
    parquet.write_table(table.replace_schema_metadata({"northdown": meta_json(meta)}), file)


@contextmanager
def _open(source: Source) -> Iterator[Any]:
    parquet = import_optional("pyarrow.parquet", "io")
    with source.open() as stream:
        with source.parsing("Parquet"):
            file = parquet.ParquetFile(stream)
        yield file


def _describe(file: Any, source: Source) -> tuple[list[str], Meta]:
    """Names of all columns, empty for one that holds no numbers, and northdown's metadata."""
    types = import_optional("pyarrow.types", "io")
    with source.parsing("Parquet"):
        schema = file.schema_arrow
    numeric = (types.is_integer, types.is_floating, types.is_boolean, types.is_timestamp, types.is_duration)
    labels = [f.name if any(test(f.type) for test in numeric) else "" for f in schema]
    return labels, parse_meta((schema.metadata or {}).get(b"northdown"), source.label)


def _time_unit(file: Any, options: Options) -> dict[str, str | float]:
    """Units with that of a column of time stamps, whose type states it."""
    units = dict(options.units or {})
    types = import_optional("pyarrow.types", "io")
    stamps = [f for f in file.schema_arrow if types.is_timestamp(f.type) or types.is_duration(f.type)]
    if len(stamps) == 1:
        units.setdefault("time", stamps[0].type.unit)
    return units


def _load(
    file: Any, labels: list[str], indices: list[int], max_bytes: int, source: Source
) -> dict[int, npt.NDArray[Any]]:
    """Columns by index, read in batches so that a file cannot unpack to more than it declares."""
    rows = file.metadata.num_rows
    if rows * 8 * len(indices) > max_bytes:
        got = f"{rows} rows of {len(indices)} columns in {source.label}"
        raise InputError(expected(f"at most {max_bytes / 1e6:.1f} MB of numbers", got, do="raise max_bytes"))
    names = [labels[i] for i in indices]
    if len({*names}) < len(names) or any(labels.count(name) > 1 for name in names):
        raise FormatError(expected("columns of different names", f"a name twice in {source.label}"))
    parts: dict[int, list[npt.NDArray[Any]]] = {i: [] for i in indices}
    done = 0
    with source.parsing("Parquet"):
        for batch in file.iter_batches(batch_size=_BATCH, columns=names):
            done += batch.num_rows
            if done > rows:
                break
            for i, name in zip(indices, names, strict=True):
                parts[i].append(_numbers(batch.column(name), name))
    if done != rows:
        raise source.damaged("Parquet", f"{done} rows or more where {rows} are declared")
    if not rows:
        raise FormatError(expected("rows of numbers", f"a header only in {source.label}"))
    return {i: np.concatenate(arrays) for i, arrays in parts.items()}


def _numbers(column: Any, name: str) -> npt.NDArray[Any]:
    """Array of int64 or float64; NaN where there is no value."""
    pyarrow = import_optional("pyarrow", "io")
    types = import_optional("pyarrow.types", "io")
    if types.is_timestamp(column.type) or types.is_duration(column.type):
        column = column.cast(pyarrow.int64())
        if column.null_count:
            raise FormatError(expected(f"a time in every row of {quoted(name)}", "an empty cell"))
    if column.null_count or not types.is_integer(column.type):
        column = column.cast(pyarrow.float64(), safe=False)
    array: npt.NDArray[Any] = column.to_numpy(zero_copy_only=False)
    return array
