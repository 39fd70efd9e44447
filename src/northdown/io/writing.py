"""`write_recording` and `write_orientation`: the format is chosen by the suffix of the name."""

from __future__ import annotations

import os
from pathlib import PurePath
from typing import Final

from northdown._validation import check_choice
from northdown.errors import InputError, expected
from northdown.frames import EULER_COLUMNS
from northdown.io.atomic import atomic_write
from northdown.io.source import quoted
from northdown.orientation import Orientation
from northdown.recording import Recording

_RECORDING: Final = {
    ".csv": "csv",
    ".txt": "csv",
    ".parquet": "parquet",
    ".pq": "parquet",
    ".h5": "hdf5",
    ".hdf5": "hdf5",
    ".mat": "mat",
}
_ORIENTATION: Final = {".csv": "csv", ".parquet": "parquet", ".pq": "parquet", ".tum": "tum", ".txt": "tum"}


def write_recording(recording: Recording, path: str | os.PathLike[str]) -> None:
    """Write a recording; `northdown.io.read` gives it back, digit for digit.

    Parameters
    ----------
    recording : Recording
        At least one sample.
    path : str or os.PathLike
        ``.csv`` (units in the header, metadata in comment lines), ``.parquet``, ``.hdf5`` or ``.h5``, ``.mat``. The
        file appears whole or not at all.

    Raises
    ------
    InputError
        For another suffix, an empty recording, or a place that cannot be written; for ``.csv`` and ``.parquet``,
        which have one time, also when the reference has times that the recording has not.
    MissingDependencyError
        For Parquet without pyarrow, HDF5 without h5py.
    """
    if not isinstance(recording, Recording):
        raise InputError(expected("a Recording", type(recording).__name__))
    kind = _kind(path, _RECORDING)
    if kind == "parquet":
        from northdown.io.parquet import write_recording as write
    elif kind == "hdf5":
        from northdown.io.hdf5 import write_recording as write
    elif kind == "mat":
        from northdown.io.mat import write_recording as write
    else:
        from northdown.io.csv import write_recording as write
    with atomic_write(path) as file:
        write(recording, file)


def write_orientation(orientation: Orientation, path: str | os.PathLike[str], convention: str = "zyx") -> None:
    """Write an orientation; `northdown.io.read_orientation` gives it back.

    Parameters
    ----------
    orientation : Orientation
        At least one sample.
    path : str or os.PathLike
        ``.csv`` or ``.parquet``: the columns of `Orientation.to_pandas`, in rad, rad² and rad/s, with frame and name;
        not the estimator's diagnostics.
        ``.tum`` or ``.txt``: TUM's trajectory format, which keeps time and quaternion only; northdown adds the frame
        as a comment. The file appears whole or not at all.
    convention : {"zyx", "rfu"}
        Euler angles among the columns; see `Orientation.as_euler`.

    Raises
    ------
    InputError
        For another suffix, an empty orientation, or a place that cannot be written.
    MissingDependencyError
        For Parquet without pyarrow.
    """
    if not isinstance(orientation, Orientation):
        raise InputError(expected("an Orientation", type(orientation).__name__))
    check_choice("convention", convention, tuple(EULER_COLUMNS))
    kind = _kind(path, _ORIENTATION)
    if not len(orientation):
        raise InputError(expected("at least one sample to write", "none"))
    from northdown.io import csv, parquet, tum

    with atomic_write(path) as file:
        if kind == "tum":
            tum.write_orientation(orientation, file)
        else:
            writer = csv.write_orientation if kind == "csv" else parquet.write_orientation
            writer(orientation, file, convention)


def _kind(path: str | os.PathLike[str], kinds: dict[str, str]) -> str:
    if not isinstance(path, (str, os.PathLike)):
        raise InputError(expected("a path", f"a {type(path).__name__}"))
    suffix = PurePath(path).suffix.lower()
    if suffix not in kinds:
        raise InputError(expected(f"a name that ends in one of {', '.join(kinds)}", quoted(os.fspath(path), 200)))
    return kinds[suffix]
