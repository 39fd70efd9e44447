"""`read` and `read_orientation`: the format is recognised by content, and its own module does the rest."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import IO

import numpy as np

from northdown._validation import check_choice, check_number
from northdown.arrays import AccelerometerArray
from northdown.errors import FormatError, expected
from northdown.frames import check_frame
from northdown.io.array_file import read_array
from northdown.io.assemble import Options
from northdown.io.columns import Columns, Units
from northdown.io.source import FORMATS, MAX_BYTES, Source, open_source, recognise
from northdown.orientation import Orientation
from northdown.recording import Recording


def read(
    path: str | os.PathLike[str] | IO[bytes],
    *,
    format: str | None = None,
    rate: float | None = None,
    units: Units | None = None,
    columns: Columns | None = None,
    frame: str | None = None,
    name: str | None = None,
    array: AccelerometerArray | str | os.PathLike[str] | None = None,
    max_bytes: int = MAX_BYTES,
) -> Recording:
    """Read a recording from a file, in SI units.

    Parameters
    ----------
    path : str, os.PathLike or open binary stream
        Delimited text (comma, semicolon, tab or blanks; decimal point or comma), Parquet, HDF5 or MATLAB. The format
        is recognised by content; the name does not matter. A stream, such as ``sys.stdin.buffer``, is read to its
        end.
    format : {"csv", "parquet", "hdf5", "mat"}, optional
        Take the content for this format, without recognising it.
    rate : float, optional
        Constant sampling rate, Hz. Needed when the file has no time; otherwise it replaces the file's time by
        ``0, 1/rate, …``. Packet numbers are not used as time, as loggers count other packets with them: in an x-IMU's
        files they skip to make room for its quaternions, while the samples follow each other at the nominal rate.
    units : mapping, optional
        Units that override the header's, such as ``{"gyr": "deg/s", "acc": "g", "mag": "G", "time": "ms"}``; see
        `northdown.io.units`. A number is the factor to SI, for raw counts.
    columns : mapping, optional
        Columns by name or number (from 0) where the header does not tell:
        ``{"time": "t", "gyr": ["p", "q", "r"], "reference": ["qw", "qx", "qy", "qz"]}``; also ``acc``, ``mag``,
        ``movement``. An empty list leaves a quantity out. ``array`` names the channels of an array of accelerometers,
        in the order of its geometry.
    frame : {"NED", "ENU", "NWU"}, optional
        Frame in which results are wanted and the file's reference is. A file that northdown wrote knows its own: its
        reference is then converted.
    name : str, optional
        Name of the recording. When not given, the one in the file, or the file's name without suffix.
    array : AccelerometerArray, str or os.PathLike, optional
        Geometry of the array of accelerometers whose channels the file holds, or a TOML file with it (see
        `read_array`). Its channels are the columns with the accelerometers' names, or these after ``array_``. A file
        that northdown wrote knows its own.
    max_bytes : int
        Limit for the size of the file, and of what it unpacks to; 2 GiB unless raised.

    Returns
    -------
    Recording
        Rate in rad/s, specific force in m/s², field in µT, time in seconds. Empty cells and NaN are samples that were
        not taken.

    Raises
    ------
    FormatError
        When the content is of no known format, damaged or cut off, or its rows or numbers are not what they should
        be.
    InputError
        When the file is missing, empty or too large, or columns, units or the rate have to be given.
    MissingDependencyError
        For Parquet without pyarrow, HDF5 without h5py.

    Notes
    -----
    *Units.* Without any unit, the gyroscope is taken to be in rad/s, the accelerometer in m/s²; a field without unit
    gets ``mag_unit="arbitrary"``. `Recording.check` says when the size of the numbers contradicts this.

    *Time.* Dates (times more than 1e8 s from zero, or ISO 8601 text) are counted from the first sample, before the
    conversion to seconds, so that integer nanoseconds keep their precision. Dates in seconds with a decimal point
    have lost theirs already: 0.2 µs. The start is not kept, so two files of one clock no longer share it. Other times
    are kept as they are.
    """
    if format is not None:
        check_choice("format", format, FORMATS)
    options = Options(
        None if rate is None else check_number("rate", rate, above=0.0, unit="Hz"),
        units,
        columns,
        None if frame is None else check_frame(frame),
        name or "",
        max_bytes=max_bytes,
        array=array if array is None or isinstance(array, AccelerometerArray) else read_array(array),
    )
    source = open_source(path, max_bytes)
    options = options.named(source.stem)
    kind = format or recognise(source.head, source.label)
    with np.errstate(all="ignore"):  # wild numbers become infinities, which Recording reports
        return _reader(kind)(source, options)


def _reader(kind: str) -> Callable[[Source, Options], Recording]:
    """Reader of a format; imported here, as each brings its own packages."""
    if kind == "parquet":
        from northdown.io.parquet import read_recording
    elif kind == "hdf5":
        from northdown.io.hdf5 import read_recording
    elif kind == "mat":
        from northdown.io.mat import read_recording
    else:
        from northdown.io.csv import read_recording
    return read_recording


def read_orientation(
    path: str | os.PathLike[str] | IO[bytes],
    *,
    frame: str | None = None,
    name: str | None = None,
    max_bytes: int = MAX_BYTES,
) -> Orientation:
    """Read an orientation from CSV, Parquet or a TUM trajectory.

    Parameters
    ----------
    path : str, os.PathLike or open binary stream
        File written by `write_orientation`, or a table with columns such as ``time``, ``qw``, ``qx``, ``qy``, ``qz``,
        or eight numbers to a line as in TUM's format (``timestamp tx ty tz qx qy qz qw``). Quaternions are Hamilton,
        from body to navigation frame.
    frame : {"NED", "ENU", "NWU"}, optional
        Navigation frame. Needed when the file does not name it; when it does, the result is converted to this one.
    name : str, optional
        Name of the orientation where the file gives none; its own name by default.
    max_bytes : int
        Limit for the size of the file.

    Raises
    ------
    FormatError
        When the content is of no known format, or damaged.
    InputError
        When the file is missing, empty or too large, or no frame is known.
    """
    target = None if frame is None else check_frame(frame)
    source = open_source(path, max_bytes)
    kind = recognise(source.head, source.label)
    if kind not in ("csv", "parquet"):
        raise FormatError(expected("an orientation in CSV, Parquet or TUM format", f"{kind} in {source.label}"))
    with np.errstate(all="ignore"):  # as in `read`
        if kind == "parquet":
            from northdown.io import parquet

            return parquet.read_orientation(source, target, name, max_bytes)
        from northdown.io import csv, tum
        from northdown.io.text import scan

        text = scan(source)
        reader = tum.read_orientation if tum.matches(text) else csv.read_orientation
        return reader(text, target, name)
