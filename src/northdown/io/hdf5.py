"""HDF5, both ways, including MATLAB 7.3 files; links out of the file, references and virtual data aren't followed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, BinaryIO, Final

import numpy as np
import numpy.typing as npt

from northdown.errors import FormatError, InputError, expected
from northdown.io.arrays import recording_of
from northdown.io.assemble import Options
from northdown.io.layout import meta_json, parse_meta, recording_arrays, recording_meta
from northdown.io.optional import import_optional
from northdown.io.source import Source, quoted
from northdown.recording import Recording

_MAX_DEPTH: Final = 4
_MAX_OBJECTS: Final = 1000
_MATLAB_TEXT: Final = (b"char", b"cell", b"struct", b"function_handle")
_UNITS: Final = {"time": "s", "gyr": "rad/s", "acc": "m/s^2", "array_acc": "m/s^2"}


def read_recording(source: Source, options: Options) -> Recording:
    """Read a recording from an HDF5 file; see `northdown.io.read`."""
    h5py = import_optional("h5py", "io")
    with source.open() as stream:
        with source.parsing("HDF5"):
            file = h5py.File(stream, "r")
        with file:
            return _recording_of(file, h5py, source, options)


def _recording_of(file: Any, h5py: Any, source: Source, options: Options) -> Recording:
    with source.parsing("HDF5"):
        datasets = dict(_datasets(file, h5py))
        shapes = {name: _shape(dataset) for name, dataset in datasets.items()}
        units = {name: unit for name, dataset in datasets.items() if (unit := _unit(dataset.attrs))}
        text = _attribute(file.attrs, "northdown")
        scalars = {k: v for k in ("sampling_rate", "rate", "fs") if (v := _scalar(file.attrs, k)) is not None}
    if not datasets:
        raise FormatError(expected("arrays of numbers", f"none in {source.label}"))

    def load(names: Sequence[str]) -> Mapping[str, npt.NDArray[Any]]:
        with source.parsing("HDF5"):
            return {n: _load(datasets[n]) if n in datasets else scalars[n] for n in names}

    meta = parse_meta(text if isinstance(text, (str, bytes)) else None, source.label)
    return recording_of({k: (1,) for k in scalars} | shapes, load, meta, options, source, units)


def write_recording(recording: Recording, file: BinaryIO) -> None:
    """Write a recording with its reference as HDF5 arrays with a ``units`` attribute."""
    h5py = import_optional("h5py", "io")
    units = _UNITS | {"mag": "uT" if recording.mag_unit == "uT" else "a.u.", "reference_time": "s"}
    with h5py.File(file, "w") as target:
        for name, values in recording_arrays(recording).items():
            target[name] = values
            if name in units:
                target[name].attrs["units"] = np.bytes_(units[name])
        target.attrs["northdown"] = np.bytes_(meta_json(recording_meta(recording)))


def _datasets(group: Any, h5py: Any, prefix: str = "", depth: int = 0) -> Iterator[tuple[str, Any]]:
    """Names and datasets of numbers. Only hard links count: soft and external ones may lead anywhere."""
    for count, name in enumerate(group):
        if count >= _MAX_OBJECTS:
            raise InputError(expected(f"at most {_MAX_OBJECTS} arrays in a group", "more"))
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        item = group[name]
        if isinstance(item, h5py.Group):
            if depth < _MAX_DEPTH and "MATLAB_class" not in item.attrs:
                yield from _datasets(item, h5py, f"{prefix}{name}_", depth + 1)
        elif isinstance(item, h5py.Dataset) and item.dtype.kind in "fiub" and item.shape is not None:
            if _attribute(item.attrs, "MATLAB_class") in _MATLAB_TEXT:
                continue
            if item.external or item.is_virtual:
                got = f"{quoted(name)}, which is kept in another file"
                raise FormatError(expected("arrays inside the file", got, do="repack it, for example with h5repack"))
            yield prefix + name, item


def _shape(dataset: Any) -> tuple[int, ...]:
    """Shape of a dataset; MATLAB stores the last index first."""
    shape: tuple[int, ...] = dataset.shape
    return shape[::-1] if "MATLAB_class" in dataset.attrs else shape


def _load(dataset: Any) -> npt.NDArray[Any]:
    array: npt.NDArray[Any] = dataset[()]
    array = array.T if "MATLAB_class" in dataset.attrs else array
    return np.asarray(array, dtype=np.float64) if array.dtype.kind == "f" else np.asarray(array)


def _scalar(attributes: Any, key: str) -> npt.NDArray[Any] | None:
    value = np.asarray(_attribute(attributes, key))
    if value.size != 1 or value.dtype.kind not in "fiu":
        return None
    return value.ravel().astype(np.float64)


def _unit(attributes: Any) -> str | None:
    """Text of the attribute ``units`` or ``unit``."""
    for key in ("units", "unit"):
        value = _attribute(attributes, key, any_length=True)
        value = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
        if isinstance(value, str) and value.strip():
            return value.strip()
    return None


def _attribute(attributes: Any, key: str, *, any_length: bool = False) -> Any:
    """Value of an attribute, or None.

    Text of variable length lies in a heap, in which a damaged file can catch the HDF5 library for ever. So it is
    read only where other programs commonly have it; northdown's own attributes have a fixed length.
    """
    if key not in attributes or (attributes.get_id(key).dtype.hasobject and not any_length):
        return None
    return attributes[key]
