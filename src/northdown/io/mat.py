"""MATLAB 5 files (``save -v7`` and earlier), both ways; version 7.3 is HDF5.

Only arrays of numbers and logicals are loaded: no objects, function handles or cells.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, BinaryIO, cast

import numpy.typing as npt

from northdown.errors import FormatError, expected
from northdown.io.arrays import recording_of
from northdown.io.assemble import Options
from northdown.io.layout import meta_json, parse_meta, recording_arrays, recording_meta
from northdown.io.mat5 import Mat5
from northdown.io.source import Source, quoted
from northdown.recording import Recording


def read_recording(source: Source, options: Options) -> Recording:
    """Read a recording from a MATLAB 5 file; see `northdown.io.read`."""
    file = Mat5(source)
    shapes = {name: v.shape for name, v in file.variables.items() if v.kind == "number"}
    if not shapes:
        held = ", ".join(f"{v.kind} {quoted(name, 30)}" for name, v in list(file.variables.items())[:4]) or "none"
        do = "save a struct's fields as arrays: save('file.mat', '-struct', 'name')"
        raise FormatError(expected("arrays of numbers", f"{held} in {source.label}", do=do))
    note = file.variables.get("northdown")
    text = file.text("northdown") if note is not None and note.kind == "char" else None

    def load(names: Sequence[str]) -> Mapping[str, npt.NDArray[Any]]:
        return {name: file.load(name) for name in names}

    return recording_of(shapes, load, parse_meta(text, source.label), options, source)


def write_recording(recording: Recording, file: BinaryIO) -> None:
    """Write a recording with its reference as MATLAB arrays; ``jsondecode(northdown)`` gives frame and units."""
    import scipy.io

    arrays: dict[str, Any] = {"northdown": meta_json(recording_meta(recording))}
    arrays |= recording_arrays(recording)
    scipy.io.savemat(cast("Any", file), arrays, appendmat=False, oned_as="column")
