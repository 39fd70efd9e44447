"""Whatever a file holds, `read` gives a recording or one clear line; nothing in it is run."""

from __future__ import annotations

import io
import os
import pickle
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import northdown as nd
from northdown.errors import FormatError, NorthdownError
from northdown.io import read, read_orientation, write_recording

SUFFIXES = ("csv", "parquet", "hdf5", "mat")
FORMATS = st.sampled_from([None, "csv", "parquet", "hdf5", "mat"])


def small() -> nd.Recording:
    rng = np.random.default_rng(3)
    return nd.Recording(np.arange(50) / 100, rng.normal(size=(50, 3)), rng.normal(size=(50, 3)), name="small")


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> dict[str, bytes]:
    """A good file of each format, as bytes."""
    folder = tmp_path_factory.mktemp("good")
    for suffix in SUFFIXES:
        write_recording(small(), folder / f"x.{suffix}")
    return {suffix: (folder / f"x.{suffix}").read_bytes() for suffix in SUFFIXES}


def test_directory(tmp_path, refused) -> None:
    refused(lambda: read(tmp_path), "a file, got the folder")


def test_missing_file(tmp_path, refused) -> None:
    refused(lambda: read(tmp_path / "none\nhere.csv"), "a file that exists", "none\\nhere.csv")


def test_impossible_names(refused) -> None:
    refused(lambda: read("a\0b"), "a file that can be read")
    refused(lambda: read("x" * 5000), "a file that can be read")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_unreadable_file(tmp_path, refused) -> None:
    path = tmp_path / "x.csv"
    path.write_text("t,gx,gy,gz\n0,1,2,3\n")
    path.chmod(0)
    refused(lambda: read(path), "permission denied")


@pytest.mark.parametrize("suffix", ["csv", "mat", "hdf5", "parquet"])
def test_empty_file(suffix: str, tmp_path, refused) -> None:
    path = tmp_path / f"x.{suffix}"
    path.touch()
    refused(lambda: read(path), "which is empty")


@pytest.mark.parametrize("what", [None, 3, [1, 2], {"a": 1}])
def test_not_a_path(what, refused) -> None:
    refused(lambda: read(what), "a path or an open binary stream")


def test_text_stream(refused) -> None:
    refused(lambda: read(io.StringIO("t,gx\n")), "a binary stream", "sys.stdin.buffer")


def test_closed_stream(refused) -> None:
    stream = io.BytesIO(b"x")
    stream.close()
    refused(lambda: read(stream), "can be read")


def test_empty_stream(refused) -> None:
    refused(lambda: read(io.BytesIO()), "a stream with data")


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("as_stream", [False, True])
def test_larger_than_the_limit(suffix: str, as_stream: bool, files, tmp_path, refused) -> None:
    data = files[suffix]
    path = tmp_path / "x"
    path.write_bytes(data)
    refused(lambda: read(io.BytesIO(data) if as_stream else path, max_bytes=len(data) - 1), "at most", "max_bytes")


@pytest.mark.parametrize("max_bytes", [0, -1, 1.5, True, "1"])
def test_impossible_limit(max_bytes, refused) -> None:
    refused(lambda: read("x", max_bytes=max_bytes), "max_bytes")


class Endless(io.RawIOBase):
    """A stream that never ends, and counts what was taken."""

    taken = 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer) -> int:
        buffer[:] = bytes(len(buffer))
        self.taken += len(buffer)
        return len(buffer)


def test_endless_stream_of_junk_is_refused_at_its_start(refused) -> None:
    stream = Endless()
    refused(lambda: read(stream), "binary", kind=FormatError)
    assert stream.taken < 10_000_000


def test_stream_in_tiny_pieces(files) -> None:
    class Slow(io.BytesIO):
        def read(self, size=-1):
            return super().read(min(size, 7) if self.tell() < 6000 else size)

    for data in files.values():
        np.testing.assert_array_equal(read(Slow(data)).gyr, small().gyr)


class Exploit:
    """Writes a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = str(path)

    def __reduce__(self):
        return os.mkdir, (self.path,)


@pytest.mark.parametrize("suffix", ["csv", "mat", "hdf5", "parquet", "npy", "npz", "pkl"])
@pytest.mark.parametrize("protocol", range(6))
def test_pickle_in_disguise(suffix: str, protocol: int, tmp_path, refused) -> None:
    trap = tmp_path / "was-run"
    path = tmp_path / f"x.{suffix}"
    path.write_bytes(pickle.dumps(Exploit(trap), protocol=protocol))
    message = refused(lambda: read(path), kind=FormatError)
    assert protocol < 2 or "a Python pickle" in message
    for kind in SUFFIXES:
        refused(lambda kind=kind: read(path, format=kind), kind=FormatError)
    assert not trap.exists()


def test_numpy_files(tmp_path, refused) -> None:
    np.save(tmp_path / "a.npy", np.zeros(3))
    np.savez(tmp_path / "b.npz", np.zeros(3))
    refused(lambda: read(tmp_path / "a.npy"), "NumPy .npy", ".csv", kind=FormatError)
    refused(lambda: read(tmp_path / "b.npz"), "zip archive", ".csv", kind=FormatError)
    shutil.copy(tmp_path / "b.npz", tmp_path / "c.mat")
    refused(lambda: read(tmp_path / "c.mat"), "zip archive", kind=FormatError)


@pytest.mark.parametrize(
    "head", [b"\x1f\x8b\x08\x00abc", b"\x00\x01\x02" * 50, b"\x7fELF\x02\x01", bytes(range(256)) * 4]
)
def test_binary_junk(head: bytes, tmp_path, refused) -> None:
    path = tmp_path / "x.csv"
    path.write_bytes(head)
    refused(lambda: read(path), kind=FormatError)
    refused(lambda: read_orientation(path, frame="ENU"), kind=FormatError)


@pytest.mark.parametrize("suffix", ["parquet", "hdf5", "mat"])
def test_truncated(suffix: str, files, tmp_path, refused) -> None:
    data = files[suffix]
    for part in (4, 9, 100, len(data) // 3, len(data) // 2, len(data) - 9):
        path = tmp_path / f"x.{suffix}"
        path.write_bytes(data[:part])
        refused(lambda path=path: read(path), kind=FormatError)


@pytest.mark.parametrize("suffix", ["csv", "parquet", "hdf5", "mat"])
def test_format_is_known_by_content(suffix: str, files, tmp_path) -> None:
    path = tmp_path / "misleading.npy"
    path.write_bytes(files[suffix])
    np.testing.assert_array_equal(read(path).gyr, small().gyr)
    np.testing.assert_array_equal(read(path, format=suffix).gyr, small().gyr)


def test_wrong_format(files, tmp_path, refused) -> None:
    path = tmp_path / "x"
    path.write_bytes(files["csv"])
    for kind in ("parquet", "hdf5", "mat"):
        refused(lambda kind=kind: read(path, format=kind), "undamaged", kind=FormatError)
    refused(lambda: read(path, format="xlsx"), "one of csv, parquet, hdf5, mat")


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        ({"rate": 0}, "rate"),
        ({"rate": "fast"}, "rate"),
        ({"rate": float("nan")}, "rate"),
        ({"frame": "XYZ"}, "frame"),
    ],
)
def test_wrong_arguments(arguments, part, files, tmp_path, refused) -> None:
    path = tmp_path / "x"
    path.write_bytes(files["csv"])
    refused(lambda: read(path, **arguments), part)


def harmless(data: bytes, kind: str | None = None) -> None:
    """Read; only an error of ours, on one line, may come out."""
    messages = []
    for call in (
        lambda: read(io.BytesIO(data), format=kind, rate=10.0, max_bytes=10**8),
        lambda: read(io.BytesIO(data), max_bytes=10**8),
        lambda: read_orientation(io.BytesIO(data), frame="ENU", max_bytes=10**8),
    ):
        try:
            call()
        except NorthdownError as error:
            messages.append(str(error))
    assert not any("\n" in message or "\r" in message for message in messages)


QUICK = settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])


@QUICK
@given(st.binary(max_size=300), FORMATS)
def test_random_bytes(data: bytes, kind: str | None) -> None:
    harmless(data, kind)


@QUICK
@given(
    st.sampled_from([b"PAR1", b"\x89HDF\r\n\x1a\n", b"MATLAB 5.0 MAT-file" + b" " * 105 + b"\x00\x01IM"]),
    st.binary(max_size=300),
)
def test_random_bytes_behind_a_magic_number(magic: bytes, data: bytes) -> None:
    harmless(magic + data)


CELLS = st.one_of(
    st.floats(width=32).map(repr),
    st.integers(-(10**20), 10**20).map(str),
    st.sampled_from(
        ["", "nan", "NA", '"', '""', "'", "#", "1,5", "2024-05-01T00:00:00", "1e999", "-", "\x0b", "é", "True"]
    ),
    st.text(max_size=3),
)
LABELS = st.sampled_from(
    [
        "t",
        "time (ms)",
        "gx",
        "gy",
        "gz",
        "gyr_x (deg/s)",
        "acc_x_g",
        "mx [G]",
        "my [G]",
        "mz [G]",
        "qw",
        "",
        "(",
        "movement",
        "#",
    ]
)


@QUICK
@given(
    st.lists(LABELS, max_size=8),
    st.lists(st.lists(CELLS, max_size=8), max_size=6),
    st.sampled_from([",", ";", "\t", " "]),
    st.sampled_from(["\n", "\r\n", "\r"]),
    st.sampled_from(["utf-8", "latin-1", "utf-16"]),
)
def test_random_tables(labels, rows, separator, newline, encoding) -> None:
    lines = [separator.join(labels), *(separator.join(row) for row in rows)]
    harmless(newline.join(lines).encode(encoding, "replace"))


@QUICK
@given(st.sampled_from(SUFFIXES), st.data())
def test_flipped_bytes(files, suffix: str, data) -> None:
    damaged = bytearray(files[suffix])
    for _ in range(data.draw(st.integers(1, 4))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    harmless(bytes(damaged))
