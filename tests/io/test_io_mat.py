"""MATLAB 5 files: against SciPy's reader, and files made to mislead."""

from __future__ import annotations

import struct
import tracemalloc
import zlib

import numpy as np
import pytest
import scipy.io

from northdown.errors import FormatError
from northdown.io import read
from northdown.io.mat5 import Mat5
from northdown.io.source import open_source

N = 6
GYR = np.arange(18.0).reshape(N, 3)
ACC = GYR[::-1] + 0.5
TIME = np.arange(N) / 100.0


@pytest.mark.parametrize("compressed", [False, True])
def test_arrays_by_name(compressed: bool, tmp_path) -> None:
    held = {"gyr": GYR, "acc": ACC, "t": TIME, "label": "walk", "s": {"a": 1}, "c": np.array([1, "x"], object)}
    scipy.io.savemat(tmp_path / "log.dat", held, do_compression=compressed, appendmat=False)
    recording = read(tmp_path / "log.dat")
    np.testing.assert_array_equal(recording.gyr, GYR)
    np.testing.assert_array_equal(recording.acc, ACC)
    np.testing.assert_array_equal(recording.time, TIME)


def test_struct_only(tmp_path, refused) -> None:
    scipy.io.savemat(tmp_path / "log.mat", {"imu": {"gyr": GYR}})
    refused(lambda: read(tmp_path / "log.mat"), "struct 'imu'", "-struct", kind=FormatError)


def test_bomb(tmp_path, refused) -> None:
    """A small file whose compressed array unpacks to far more than the limit."""
    scipy.io.savemat(tmp_path / "log.mat", {"gyr": np.zeros((500_000, 3))}, do_compression=True)
    assert (tmp_path / "log.mat").stat().st_size < 100_000
    refused(lambda: read(tmp_path / "log.mat", rate=1, max_bytes=1_000_000), "at most 1.0 MB", "max_bytes")


def test_bomb_behind_an_array(tmp_path) -> None:
    """What is packed behind a small array is never unpacked."""
    scipy.io.savemat(tmp_path / "log.mat", {"gyr": GYR})
    data = (tmp_path / "log.mat").read_bytes()
    bomb = zlib.compress(data[128:] + bytes(20_000_000))
    (tmp_path / "log.mat").write_bytes(data[:128] + struct.pack("<II", 15, len(bomb)) + bomb)
    read(tmp_path / "log.mat", rate=1)  # imports take memory only once
    tracemalloc.start()
    np.testing.assert_array_equal(read(tmp_path / "log.mat", rate=1).gyr, GYR)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1_000_000


@pytest.mark.parametrize("compressed", [False, True])
def test_same_as_scipy(compressed: bool, tmp_path) -> None:
    rng = np.random.default_rng(2)
    kinds = ["f8", "f4", *(f"{sign}{size}" for sign in "iu" for size in (1, 2, 4, 8))]
    held = {f"a_{k}": (rng.normal(size=(5, 3)) * 100).astype(k) for k in kinds}
    held |= {
        "flag": np.array([[True], [False]]),
        "deep": rng.normal(size=(2, 3, 4)),
        "one": 2.5,
        "none": np.zeros((0, 0)),
    }
    path = tmp_path / "x.mat"
    scipy.io.savemat(path, held, do_compression=compressed)
    file = Mat5(open_source(path))
    truth = scipy.io.loadmat(path)
    for name in held:
        found = file.load(name)
        assert found.dtype == truth[name].dtype
        np.testing.assert_array_equal(found, truth[name])


def test_big_endian_with_numbers_stored_small(tmp_path) -> None:
    """As MATLAB writes it: whole numbers in a double array are stored as bytes or in the tag itself."""
    flags = struct.pack(">IIII", 6, 8, 6, 0)
    size = struct.pack(">IIii", 5, 8, 2, 3)
    name = struct.pack(">HH4s", 3, 1, b"gyr\0")
    numbers = struct.pack(">II6b2x", 1, 6, 1, 2, 3, 4, 5, -6)
    time = struct.pack(">IIii", 5, 8, 2, 1) + struct.pack(">HH4s", 1, 1, b"t") + struct.pack(">HHbb2x", 2, 1, 0, 1)
    body = b"".join(
        struct.pack(">II", 14, len(part)) + part for part in (flags + size + name + numbers, flags + time)
    )
    (tmp_path / "log.mat").write_bytes(b"MATLAB 5.0".ljust(124) + b"\x01\x00MI" + body)
    recording = read(tmp_path / "log.mat", units={"time": "s"})
    np.testing.assert_array_equal(recording.gyr, [[1, 3, 5], [2, 4, -6]])
    np.testing.assert_array_equal(recording.time, [0, 1])


@pytest.mark.parametrize(
    ("rows", "part"), [(2**31 - 1, "at most 2147.5 MB"), (7, "not complete"), (5, "not complete")]
)
def test_size_declared_but_not_there(rows: int, part: str, tmp_path, refused) -> None:
    scipy.io.savemat(tmp_path / "log.mat", {"gyr": GYR})
    data = bytearray((tmp_path / "log.mat").read_bytes())
    at = data.find(struct.pack("<II", 5, 8)) + 8  # dimensions: type int32, eight bytes
    data[at : at + 8] = struct.pack("<ii", rows, 3)
    (tmp_path / "log.mat").write_bytes(data)
    refused(lambda: read(tmp_path / "log.mat", rate=1), part)
