"""Write a trajectory to a file."""

from __future__ import annotations

import io
import os
from pathlib import PurePath
from typing import BinaryIO, Final

import numpy as np

from northdown.errors import InputError, expected
from northdown.io.atomic import atomic_write
from northdown.io.csv import meta_comments
from northdown.navigation.trajectory import Trajectory

SUFFIXES: Final = (".csv", ".tum", ".txt")


def write_trajectory(trajectory: Trajectory, path: str | os.PathLike[str]) -> None:
    """Write a trajectory.

    Parameters
    ----------
    trajectory : Trajectory
        At least one sample.
    path : str or os.PathLike
        ``.csv``: the columns of `Trajectory.to_pandas`, in m, m/s and rad, with frame and name in comment lines.
        ``.tum`` or ``.txt``: TUM's format, lines of ``time x y z qx qy qz qw``, which other tools read; the frame
        stands in a comment. The file appears whole or not at all.

    Raises
    ------
    InputError
        For another suffix, an empty trajectory, or a place that cannot be written.
    """
    if not isinstance(trajectory, Trajectory):
        raise InputError(expected("a Trajectory", type(trajectory).__name__))
    suffix = PurePath(path).suffix.lower() if isinstance(path, (str, os.PathLike)) else ""
    if suffix not in SUFFIXES:
        raise InputError(expected(f"a name that ends in one of {', '.join(SUFFIXES)}", repr(path)[:200]))
    if not len(trajectory):
        raise InputError(expected("at least one sample to write", "none"))
    with atomic_write(path) as file:
        write_csv(trajectory, file) if suffix == ".csv" else _write_tum(trajectory, file)


def write_csv(trajectory: Trajectory, file: BinaryIO) -> None:
    """Write the table of `Trajectory.to_pandas` as CSV."""
    text = io.TextIOWrapper(file, encoding="utf-8", newline="")
    text.write(meta_comments({"frame": trajectory.frame, "name": trajectory.name}))
    trajectory.to_pandas().to_csv(text, index=False, lineterminator="\n")
    text.flush()
    text.detach()


def _write_tum(trajectory: Trajectory, file: BinaryIO) -> None:
    quat = np.roll(trajectory.orientation.quat, -1, axis=1)
    rows = np.column_stack([trajectory.time, trajectory.position, quat])
    file.write(f"# frame: {trajectory.frame}\n# time x y z qx qy qz qw\n".encode())
    np.savetxt(file, rows, fmt=["%.9f", *["%.9g"] * 7])
