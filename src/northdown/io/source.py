"""Where bytes come from, and which format they are in: decided by content, never by the file's name."""

from __future__ import annotations

import io
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, BinaryIO, Final

from northdown.errors import FormatError, InputError, NorthdownError, expected

MAX_BYTES: Final = 2 * 1024**3
"""Largest file, and largest content of a compressed file, that is read unless the caller raises the limit: 2 GiB."""

FORMATS: Final = ("csv", "parquet", "hdf5", "mat")
SUPPORTED: Final = "CSV or other delimited text, Parquet, HDF5 or MATLAB"

_HEAD: Final = 4096
_HDF5: Final = b"\x89HDF\r\n\x1a\n"
_FOREIGN: Final[tuple[tuple[bytes, str, str], ...]] = (
    (b"\x93NUMPY", "a NumPy .npy file", "save it as .csv, .parquet, .hdf5 or .mat"),
    (b"PK\x03\x04", "a zip archive (.npz, .xlsx or other)", "unpack it, or save its table as .csv"),
    (b"\x1f\x8b", "gzip-compressed data", "unpack it first, for example: gunzip -c file | northdown … -"),
    (b"\x28\xb5\x2f\xfd", "zstd-compressed data", "unpack it first"),
    (b"BZh", "bzip2-compressed data", "unpack it first"),
    (b"\xfd7zXZ\x00", "xz-compressed data", "unpack it first"),
    (b"PARE", "an encrypted Parquet file", "write it without encryption"),
    (b"#ROSBAG", "a ROS bag", "export its IMU topic as .csv"),
    (b"\x89MCAP", "an MCAP log", "export its IMU topic as .csv"),
    (b"%PDF", "a PDF document", "export the data as .csv"),
    (b"\xd0\xcf\x11\xe0", "an old Office document", "save its table as .csv"),
)


def quoted(text: object, limit: int = 60) -> str:
    """Show foreign text in a message: on one line, in quotes, and not too long."""
    shown = str(text)
    return repr(shown if len(shown) <= limit else shown[: limit - 1] + "…")


@dataclass(frozen=True)
class Source:
    """Bytes of one file or stream.

    Attributes
    ----------
    label : str
        Name for messages.
    stem : str
        File name without folder and suffix; empty for a stream without name.
    size : int
        Number of bytes.
    head : bytes
        The first 4096 bytes.
    """

    label: str
    stem: str
    size: int
    head: bytes
    _path: Path | None = None
    _data: bytes = field(default=b"", repr=False)

    def open(self) -> BinaryIO:
        """Open at the first byte, for reading."""
        if self._path is None:
            return io.BytesIO(self._data)
        try:
            return open(self._path, "rb")
        except OSError as error:
            raise InputError(_refused(self.label, error)) from None

    @contextmanager
    def parsing(self, kind: str) -> Iterator[None]:
        """Turn whatever a parser raises on a damaged file of some kind into one `FormatError`."""
        try:
            yield
        except NorthdownError:
            raise
        except Exception as error:
            raise self.damaged(kind, error) from None

    def damaged(self, kind: str, reason: object) -> FormatError:
        """Error for content that the parser of a format refuses."""
        why = str(reason).strip().split("\n")[0][:120] or type(reason).__name__
        return FormatError(
            expected(
                f"an undamaged {kind} file", f"{self.label} ({why})", do="copy or export it again: it may be cut off"
            )
        )


def open_source(path: str | os.PathLike[str] | IO[bytes], max_bytes: int = MAX_BYTES) -> Source:
    """Look at a file, or take a stream into memory.

    A stream of unknown content is refused at its first bytes: it might be endless.

    Raises
    ------
    InputError
        For a folder, a missing, empty, unreadable or too large file, or a text stream.
    """
    if isinstance(max_bytes, bool) or not isinstance(max_bytes, int) or max_bytes < 1:
        raise InputError(expected("max_bytes as a whole number above 0", quoted(max_bytes)))
    if hasattr(path, "read"):
        return _from_stream(path, max_bytes)
    if not isinstance(path, (str, os.PathLike)):
        raise InputError(expected("a path or an open binary stream", f"a {type(path).__name__}"))
    label = quoted(os.fspath(path), 200)
    try:
        file = Path(path)
        mode = file.stat().st_mode
        if stat.S_ISDIR(mode):
            raise InputError(expected("a file", f"the folder {label}", do="name a file in it"))
        with open(file, "rb") as stream:
            if not stat.S_ISREG(mode):
                return _from_stream(stream, max_bytes)
            size = os.fstat(stream.fileno()).st_size
            head = stream.read(_HEAD)
    except FileNotFoundError:
        raise InputError(expected("a file that exists", label, do="check the path")) from None
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise InputError(_refused(label, error)) from None
    if not size:
        raise InputError(expected("a file with data", f"{label}, which is empty"))
    _check_size(label, size, max_bytes)
    return Source(label, file.stem, size, head, file)


def _from_stream(stream: Any, max_bytes: int) -> Source:
    name = getattr(stream, "name", "")
    label = quoted(name, 200) if isinstance(name, str) and name else "the stream"
    stem = Path(name).stem if isinstance(name, str) and not name.startswith(("<", "/dev/")) else ""
    chunks: list[bytes] = []
    size = 0
    while size <= max_bytes:
        try:
            chunk = stream.read(min(1 << 20, max_bytes + 1 - size))
        except (OSError, ValueError) as error:
            raise InputError(_refused(label, error)) from None
        if not isinstance(chunk, (bytes, bytearray)):
            raise InputError(
                expected("a binary stream", "a stream of text", do="open it with mode 'rb', or give sys.stdin.buffer")
            )
        if not chunk:
            break
        if not chunks or size < _HEAD <= size + len(chunk):
            chunks = [b"".join([*chunks, chunk])]
            if len(chunks[0]) >= _HEAD:
                recognise(chunks[0][:_HEAD], label)
        else:
            chunks.append(bytes(chunk))
        size += len(chunk)
    if not size:
        raise InputError(expected("a stream with data", f"{label}, which is empty"))
    _check_size(label, size, max_bytes)
    data = b"".join(chunks)
    return Source(label, stem, size, data[:_HEAD], None, data)


def recognise(head: bytes, label: str) -> str:
    """Recognise one of `FORMATS` by the first bytes of a file.

    Raises
    ------
    FormatError
        For anything else: what it seems to be, and what to do.
    """
    if head.startswith(b"PAR1"):
        return "parquet"
    if any(head[at : at + 8] == _HDF5 for at in (0, 512, 1024, 2048)):
        return "hdf5"
    if head[124:128] in (b"\x00\x01IM", b"\x01\x00MI") or head.startswith(b"MATLAB 5.0"):
        return "mat"
    if len(head) > 1 and head[0] == 0x80 and 2 <= head[1] <= 5:
        do = "it could run code and is not opened; save the data as .csv, .parquet, .hdf5 or .mat"
        raise FormatError(expected(SUPPORTED, f"a Python pickle in {label}", do=do))
    for magic, what, do in _FOREIGN:
        if head.startswith(magic):
            raise FormatError(expected(SUPPORTED, f"{what} in {label}", do=do))
    if not _is_text(head):
        raise FormatError(expected(SUPPORTED, f"unknown binary data in {label}", do="export it in one of these"))
    return "csv"


def _is_text(head: bytes) -> bool:
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return True
    control = sum(byte < 9 or 13 < byte < 32 for byte in head)
    return b"\0" not in head and control * 100 <= len(head)


def _check_size(label: str, size: int, max_bytes: int) -> None:
    if size > max_bytes:
        got = f"{label} with {'more' if size == max_bytes + 1 else format(size / 1e6, '.1f') + ' MB'}"
        raise InputError(
            expected(f"at most {max_bytes / 1e6:.1f} MB", got, do="cut it into parts, or raise max_bytes")
        )


def _refused(label: str, error: Exception) -> str:
    reason = getattr(error, "strerror", None) or str(error).split("\n")[0]
    return expected("a file that can be read", f"{label} ({str(reason).lower()})")
