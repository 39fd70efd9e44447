"""Targets of output, looked at before the work starts, so that a typing error does not cost it."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from northdown.cli.reading import same_file
from northdown.errors import InputError, expected

if TYPE_CHECKING:
    from northdown.orientation import Orientation

ORIENTATION_SUFFIXES = (".csv", ".parquet", ".pq", ".tum", ".txt")
FIGURE_SUFFIXES = (".png", ".svg", ".pdf")


def check_target(option: str, path: str, *, source: str, suffixes: tuple[str, ...] = ()) -> None:
    """Check that a file can be written: its suffix, its folder, and that it is not the input.

    Raises
    ------
    InputError
        With the option's name.
    """
    target = Path(path)
    if "\0" in path or target.is_dir():
        raise InputError(expected(f"a file name for {option}", f"the folder {path!r}", do="add a file name"))
    if suffixes and target.suffix.lower() not in suffixes:
        got = repr(path) if target.suffix else f"{path!r} without an ending"
        raise InputError(expected(f"{option} to end in {', '.join(suffixes)}", got))
    if not target.parent.is_dir():
        raise InputError(expected(f"a folder that exists for {option}", repr(str(target.parent)), do="make it first"))
    if not os.access(target.parent, os.W_OK):
        raise InputError(expected(f"a folder one may write to for {option}", repr(str(target.parent))))
    if source != "-" and same_file(source, path):
        raise InputError(expected(f"a name of its own for {option}", f"the input {path!r}", do="choose another name"))


def make_folder(out: str) -> Path:
    """Make the folder of --out, with those above it, unless it is there."""
    folder = Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or str(problem)
        raise InputError(expected("a folder that can be made for --out", f"{out!r} ({reason.lower()})")) from None
    return folder


def write_orientation(orientation: Orientation, path: str) -> None:
    """Write to a file by its suffix, or as CSV to standard output for ``-``."""
    import northdown.io

    if path != "-":
        northdown.io.write_orientation(orientation, path)
        return
    from northdown.io import csv

    # by way of memory, as the writer's text layer would close standard output when a pipe breaks
    written = io.BytesIO()
    csv.write_orientation(orientation, written, "zyx")
    sys.stdout.flush()
    sys.stdout.buffer.write(written.getbuffer())
