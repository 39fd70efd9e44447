"""Recordings in files of named arrays (HDF5, MATLAB): northdown's own, BROAD's, and others by the arrays' names."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from northdown.arrays import AccelerometerArray
from northdown.errors import FormatError, InputError, expected
from northdown.io import broad
from northdown.io.array_columns import PREFIX
from northdown.io.assemble import Options, build_recording
from northdown.io.columns import plan_columns
from northdown.io.layout import Meta, array_of, check_kind, recording_from_arrays
from northdown.io.source import Source, quoted
from northdown.recording import Recording

Shapes = Mapping[str, tuple[int, ...]]
Load = Callable[[Sequence[str]], Mapping[str, npt.NDArray[Any]]]

_AXES: Final = {3: "xyz", 4: "wxyz"}
_RATE_NAMES: Final = (
    "sampling_rate",
    "sample_rate",
    "rate",
    "fs",
    "SamplingRate",
    "sampleRate",
    "samplingRate",
    "Fs",
)


def recording_of(
    shapes: Shapes, load: Load, meta: Meta, options: Options, source: Source, units: Mapping[str, str] | None = None
) -> Recording:
    """Make a recording of a file's arrays.

    Parameters
    ----------
    shapes : mapping
        Name and shape of each array of numbers in the file.
    load : callable
        Reads the arrays of given names.
    meta : dict
        Metadata that northdown wrote; empty for other files.
    options : Options
        The wishes of the caller of `northdown.io.read`.
    source : Source
        For messages.
    units : mapping, optional
        Units that the file states for its arrays.

    Notes
    -----
    Sizes are checked before anything is loaded, as a small compressed file may declare a huge array.
    """
    check_kind(meta, "recording", source.label)
    array = array_of(meta, options.array, source.label)
    own = bool(meta) and not (options.units or options.columns or options.rate)
    if own or (broad.matches(shapes) and not (options.units or options.columns)):
        names = [n for n in shapes if n not in broad.UNUSED]
        _check_size(shapes, names, options.max_bytes, source)
        if own:
            return recording_from_arrays(
                load(names), meta, options.name or meta.get("name") or options.stem, options.frame, array
            )
        return broad.recording_of(load(names), options)
    labels, places, groups = _columns(shapes, units or {}, array)
    plan = plan_columns(labels, columns=options.columns, units=options.units, groups=groups, array=array)
    rates = [n for n in _RATE_NAMES if n in shapes and math.prod(shapes[n]) == 1]
    names = sorted({places[i][0] for i in plan.needed} | set(rates[:1]))
    _check_size(shapes, names, options.max_bytes, source)
    arrays = load(names)
    values = {i: _column(arrays[places[i][0]], *places[i][1:]) for i in plan.needed}
    lengths = {labels[i]: len(v) for i, v in values.items()}
    if len(set(lengths.values())) > 1:
        got = ", ".join(f"{quoted(k, 30)} with {v}" for k, v in list(lengths.items())[:6])
        raise FormatError(expected("arrays of one length", got, do="choose with columns={…}"))
    rate = float(arrays[rates[0]].ravel()[0]) if rates else None
    return build_recording(plan, values, options, meta, rate=rate)


def _columns(
    shapes: Shapes, units: Mapping[str, str], array: AccelerometerArray | None
) -> tuple[list[str], list[tuple[str, int, int]], dict[str, list[int]]]:
    """Label of every column of every array, where it is and among how many, and the columns of each array."""
    labels: list[str] = []
    places: list[tuple[str, int, int]] = []
    groups: dict[str, list[int]] = {}
    for name, shape in shapes.items():
        sides = [n for n in shape if n != 1]
        if not sides or len(sides) > 2:
            continue
        count = 1 if len(sides) == 1 else sides[1] if sides[1] in _AXES else sides[0]
        if name == "array_acc" and array is not None and len(array) in sides and len(sides) == 2:
            own = [f"{PREFIX}{n} ({units[name]})" if name in units else f"{PREFIX}{n}" for n in array.names]
            labels += own
            places += [(name, k, len(own)) for k in range(len(own))]
            continue
        if len(sides) == 2 and count not in _AXES:
            continue
        groups[name] = list(range(len(labels), len(labels) + count))
        for k in range(count):
            label = name if count == 1 else f"{name}_{_AXES[count][k]}"
            labels.append(f"{label} ({units[name]})" if name in units else label)
            places.append((name, k, count))
    return labels, places, groups


def _column(array: npt.NDArray[Any], index: int, count: int) -> npt.NDArray[Any]:
    """Column of an array that is (N, count) or (count, N); of one-dimensional ones, all."""
    flat = array.reshape([n for n in array.shape if n != 1])
    if flat.ndim == 2 and flat.shape[1] != count:
        flat = flat.T
    column = flat[:, index] if flat.ndim == 2 else flat.ravel()
    if column.dtype.kind == "i":
        return column.astype(np.int64)
    return column if column.dtype.kind == "u" else column.astype(np.float64)


def _check_size(shapes: Shapes, names: Sequence[str], max_bytes: int, source: Source) -> None:
    declared = sum(8 * math.prod(shapes[n]) for n in names)
    if declared > max_bytes:
        got = f"{declared / 1e6:.1f} MB in {source.label}"
        raise InputError(expected(f"at most {max_bytes / 1e6:.1f} MB of numbers", got, do="raise max_bytes"))
