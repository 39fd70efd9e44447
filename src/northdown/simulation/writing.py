"""A recording written part by part, in the formats of `northdown.io`."""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, BinaryIO, Final

import numpy as np

from northdown.errors import InputError, expected
from northdown.orientation import Orientation

if TYPE_CHECKING:
    from northdown.recording import Recording

_CSV: Final = (".csv", ".txt")
_PARQUET: Final = (".parquet", ".pq")
_HDF5: Final = (".h5", ".hdf5")
SUFFIXES: Final = (*_CSV, *_PARQUET, *_HDF5, ".mat")
"""Endings of names that `write_chunks` knows."""


def write_chunks(
    chunks: Iterable[Recording],
    path: str | os.PathLike[str] | BinaryIO,
    progress: Callable[[int], None] | None = None,
) -> int:
    """Write parts of one recording, in order, to one file.

    Parameters
    ----------
    chunks : iterable of Recording
        Parts with the same sensors, whose references have the recording's times.
    path : str, os.PathLike or binary stream
        Name that ends in one of `SUFFIXES`. ``.mat`` gathers all parts first; the others are written as they come.
        The file appears whole or not at all. A stream, such as standard output, gets CSV.
    progress : callable, optional
        Called with the number of samples written so far.

    Returns
    -------
    int
        Number of samples.
    """
    # loading the formats takes longer than listing their endings in --help may
    from northdown.io import write_recording
    from northdown.io.atomic import atomic_write

    counted = _Counted(chunks, progress)
    if not isinstance(path, (str, os.PathLike)):
        _csv(iter(counted), path)
        return counted.done
    suffix = PurePath(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(expected(f"a name that ends in one of {', '.join(SUFFIXES)}", repr(str(path))))
    if suffix == ".mat":
        write_recording(join(counted), path)
    else:
        write = _csv if suffix in _CSV else _parquet if suffix in _PARQUET else _hdf5
        with atomic_write(path) as file:
            write(iter(counted), file)
    return counted.done


class _Counted:
    """Iterable that counts the samples that have been taken, and tells."""

    def __init__(self, chunks: Iterable[Recording], progress: Callable[[int], None] | None) -> None:
        self._chunks, self._progress = chunks, progress
        self.done = 0

    def __iter__(self) -> Iterator[Recording]:
        for chunk in self._chunks:
            if not len(chunk):
                continue
            yield chunk
            self.done += len(chunk)
            if self._progress is not None:
                self._progress(self.done)
        if not self.done:
            raise InputError(expected("at least one sample to write", "none"))


def join(chunks: Iterable[Recording]) -> Recording:
    """One recording from its parts, in order."""
    parts = list(chunks)
    if not parts:
        raise InputError(expected("at least one part of a recording", "none"))
    arrays: dict[str, Any] = {"time": np.concatenate([p.time for p in parts])}
    for key in ("gyr", "acc", "mag", "array_acc", "movement"):
        if getattr(parts[0], key) is not None:
            arrays[key] = np.concatenate([getattr(p, key) for p in parts])
    references = [p.reference for p in parts if p.reference is not None]
    if references:
        first = references[0]
        keys = [k for k in ("time", "quat", "covariance", "gyr_bias", "flags") if getattr(first, k) is not None]
        joined: dict[str, Any] = {k: np.concatenate([getattr(r, k) for r in references]) for k in keys}
        arrays["reference"] = Orientation(frame=first.frame, name=first.name, **joined)
    return replace(parts[0], **arrays)


def _csv(chunks: Iterator[Recording], file: BinaryIO) -> None:
    import pandas as pd

    from northdown.io import csv
    from northdown.io.layout import recording_columns

    for k, chunk in enumerate(chunks):
        # by way of memory: a text layer would close the file, standard output too, when a pipe breaks
        if k == 0:
            head = io.BytesIO()
            csv.write_recording(chunk, head)
            file.write(head.getbuffer())
        else:
            rows = pd.DataFrame(recording_columns(chunk)).to_csv(index=False, header=False, lineterminator="\n")
            file.write(rows.encode())


def _parquet(chunks: Iterator[Recording], file: BinaryIO) -> None:
    from northdown.io.layout import meta_json, recording_columns, recording_meta
    from northdown.io.optional import import_optional

    pyarrow, parquet = import_optional("pyarrow", "io"), import_optional("pyarrow.parquet", "io")
    writer = None
    try:
        for chunk in chunks:
            columns = {name: np.ascontiguousarray(v) for name, v in recording_columns(chunk).items()}
            table = pyarrow.table(columns).replace_schema_metadata({"northdown": meta_json(recording_meta(chunk))})
            writer = writer or parquet.ParquetWriter(file, table.schema)
            writer.write_table(table)
    finally:
        if writer is not None:
            writer.close()


def _hdf5(chunks: Iterator[Recording], file: BinaryIO) -> None:
    from northdown.io.layout import meta_json, recording_arrays, recording_meta
    from northdown.io.optional import import_optional

    h5py = import_optional("h5py", "io")
    first = next(chunks)
    units = {"time": "s", "gyr": "rad/s", "acc": "m/s^2", "array_acc": "m/s^2", "reference_time": "s"}
    units["mag"] = "uT" if first.mag_unit == "uT" else "a.u."
    with h5py.File(file, "w") as target:
        for name, values in recording_arrays(first).items():
            dataset = target.create_dataset(name, data=values, maxshape=(None, *values.shape[1:]))
            if name in units:
                dataset.attrs["units"] = np.bytes_(units[name])
        target.attrs["northdown"] = np.bytes_(meta_json(recording_meta(first)))
        for chunk in chunks:
            for name, values in recording_arrays(chunk).items():
                dataset = target[name]
                dataset.resize(len(dataset) + len(values), axis=0)
                dataset[-len(values) :] = values
