"""The geometry of an array as given on the command line: a name, or a TOML file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from northdown.cli.numbers import read_number
from northdown.errors import InputError, expected

if TYPE_CHECKING:
    from northdown.arrays import AccelerometerArray

# m; a ship has room for this, a sensor that is larger has the wrong unit
_LARGEST: Final = 100.0


def read_geometry(option: str, text: str, radius: str | None) -> AccelerometerArray:
    """A named geometry of a radius, or the one in a TOML file."""
    from northdown.arrays import geometry
    from northdown.io import read_array

    size = None if radius is None else read_number("--radius", radius, above=0.0, high=_LARGEST, unit="m")
    if text.lower().endswith(".toml"):
        if size is not None:
            raise InputError(expected(f"--radius with a named geometry for {option}", f"the file {text!r}"))
        return read_array(text)
    return geometry(text, size)
