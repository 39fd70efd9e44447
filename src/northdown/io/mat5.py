"""The structure of MATLAB 5 files, as far as arrays of numbers and lines of text need it.

A file is a header of 128 bytes and a row of elements; an element is a tag (type, number of bytes) and data padded to
eight bytes. A variable is an element of type 14, often packed by zlib into one of type 15, and holds elements
itself: flags, dimensions, name, numbers. Everything a file declares is checked against what is there before memory is
taken, and nothing in it is run: SciPy's reader, by contrast, can be brought to crash by a damaged file.

Source: MATLAB MAT-File Format, The MathWorks, Level 5.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO, Final

import numpy as np
import numpy.typing as npt

from northdown.errors import FormatError
from northdown.io.source import Source, quoted

_HEADER_BYTES: Final = 128
_PREFIX: Final = 4096  # flags, dimensions and name of a variable take far less
_NAME_LIMIT: Final = 512
_MATRIX, _COMPRESSED = 14, 15
_STORED: Final = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_CLASSES: Final = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
_OTHER_CLASSES: Final = {1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 16: "function", 17: "object"}
_CHAR: Final = 4
_TEXT_LIMIT: Final = 100_000
_COMPLEX: Final = 0x0800


@dataclass(frozen=True)
class Variable:
    """A variable of a file, not yet loaded.

    Attributes
    ----------
    name : str
        Its name.
    shape : tuple of int
        Its dimensions.
    kind : str
        ``"number"``, ``"char"``, or what else it is.
    """

    name: str
    shape: tuple[int, ...]
    kind: str
    _class: int
    _offset: int
    _size: int
    _packed: bool
    _values_at: int


class Mat5:
    """A MATLAB 5 file.

    Parameters
    ----------
    source : Source
        The file.

    Attributes
    ----------
    variables : dict
        `Variable` by name.

    Raises
    ------
    FormatError
        When an element does not fit into the file, or is not what the format says.
    """

    def __init__(self, source: Source) -> None:
        if source.size < _HEADER_BYTES:
            raise source.damaged("MATLAB", "the header is not complete")
        self._source = source
        self._order = "<" if source.head[126:128] == b"IM" else ">"
        with source.open() as file:
            self.variables = {v.name: v for v in self._variables(file)}

    def load(self, name: str) -> npt.NDArray[np.generic]:
        """Load an array of numbers; the caller has checked its size."""
        variable = self.variables[name]
        kind = _CLASSES[variable._class]
        stored, data = self._values(variable, 8 * math.prod(variable.shape))
        if stored not in _STORED:
            raise self._damaged(f"{quoted(name)} holds no numbers")
        form = np.dtype(self._order + _STORED[stored])
        if len(data) != math.prod(variable.shape) * form.itemsize:
            raise self._damaged(f"{quoted(name)} is not complete")
        values = np.frombuffer(data, form).astype(kind)
        return np.ascontiguousarray(values.reshape(variable.shape, order="F"))

    def text(self, name: str) -> str:
        """Load a line of text."""
        variable = self.variables[name]
        if math.prod(variable.shape) > _TEXT_LIMIT:
            raise self._damaged(f"{quoted(name)} is too long")
        stored, data = self._values(variable, 4 * math.prod(variable.shape))
        utf16 = "utf-16-le" if self._order == "<" else "utf-16-be"
        return data.decode({16: "utf-8", 17: utf16, 4: utf16}.get(stored, "latin-1"), "replace")

    def _damaged(self, reason: str) -> FormatError:
        return self._source.damaged("MATLAB", reason)

    def _variables(self, file: BinaryIO) -> Iterator[Variable]:
        offset = _HEADER_BYTES
        while offset + 8 <= self._source.size:
            file.seek(offset)
            kind, size = struct.unpack(self._order + "II", file.read(8))
            offset += 8
            if offset + size > self._source.size:
                raise self._damaged("it ends within an array")
            if kind in (_MATRIX, _COMPRESSED):
                packed = kind == _COMPRESSED
                prefix = self._read(file, offset, size, packed, _PREFIX)
                yield self._describe(prefix, offset, size, packed)
            offset += size

    def _read(self, file: BinaryIO, offset: int, size: int, packed: bool, limit: int) -> bytes:
        """First bytes, at most `limit`, of an element's data, unpacked."""
        file.seek(offset)
        if not packed:
            return file.read(min(size, limit))
        unpacker = zlib.decompressobj()
        parts: list[bytes] = []
        limit += 8  # the tag of the variable, which stands inside
        try:
            while size > 0 and limit > 0:
                piece = file.read(min(size, 1 << 20))
                size -= len(piece)
                while piece and limit > 0:
                    parts.append(unpacker.decompress(piece, limit))
                    limit -= len(parts[-1])
                    piece = unpacker.unconsumed_tail
        except zlib.error:
            raise self._damaged("a packed array is broken") from None
        data = b"".join(parts)
        if len(data) < 8 or struct.unpack(self._order + "I", data[:4])[0] != _MATRIX:
            raise self._damaged("a packed array is no array")
        return data[8:]

    def _describe(self, data: bytes, offset: int, size: int, packed: bool) -> Variable:
        _, flags, at = self._element(data, 0, 8)
        _, dimensions, at = self._element(data, at, 256)
        _, name, at = self._element(data, at, _NAME_LIMIT)
        if len(flags) < 8 or not dimensions or len(dimensions) % 4:
            raise self._damaged("an array has no flags or dimensions")
        word = struct.unpack(self._order + "I", flags[:4])[0]
        shape = struct.unpack(f"{self._order}{len(dimensions) // 4}i", dimensions)
        if min(shape) < 0:
            raise self._damaged("an array has a negative size")
        number = word & 0xFF
        kind = "number" if number in _CLASSES else _OTHER_CLASSES.get(number, "unknown")
        if number in _CLASSES and word & _COMPLEX:
            kind = "complex"
        return Variable(name.decode("latin-1"), shape, kind, number, offset, size, packed, at)

    def _element(self, data: bytes, at: int, limit: int) -> tuple[int, bytes, int]:
        """Type and data of the element at a place, and where the next one is."""
        kind, size, start, end = self._tag(data, at)
        if size > limit or start + size > len(data):
            raise self._damaged("an array is not complete")
        return kind, data[start : start + size], end

    def _tag(self, data: bytes, at: int) -> tuple[int, int, int, int]:
        if at + 8 > len(data):
            raise self._damaged("an array is not complete")
        kind, size = struct.unpack_from(self._order + "II", data, at)
        if kind >> 16:  # up to four bytes of data within the tag
            size = kind >> 16
            if size > 4:
                raise self._damaged("an array has a wrong tag")
            return kind & 0xFFFF, size, at + 4, at + 8
        start = at + 8
        return kind, size, start, start + (size + 7) // 8 * 8

    def _values(self, variable: Variable, limit: int) -> tuple[int, bytes]:
        """Type and bytes of a variable's numbers."""
        with self._source.open() as file:
            data = self._read(
                file, variable._offset, variable._size, variable._packed, variable._values_at + 16 + limit
            )
        if not math.prod(variable.shape) and variable._values_at + 8 > len(data):
            return 9, b""
        kind, values, _ = self._element(data, variable._values_at, limit)
        return kind, values
