"""What is written is read back, digit for digit, in every format; files appear whole or not at all."""

from __future__ import annotations

import os
import stat
import threading
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import northdown as nd
from northdown.io import read, read_orientation, write_orientation, write_recording
from northdown.io.atomic import atomic_write

SUFFIXES = ("csv", "parquet", "hdf5", "h5", "mat", "pq")
NAMES = st.text(min_size=1, max_size=12)
VALUES = st.floats(allow_nan=True, allow_infinity=False)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_everything(suffix: str, full_recording, tmp_path, assert_same) -> None:
    path = tmp_path / f"x.{suffix}"
    write_recording(full_recording, path)
    assert_same(read(path), full_recording)
    assert os.listdir(tmp_path) == [path.name]


@pytest.mark.parametrize("suffix", ["hdf5", "mat"])
def test_reference_with_times_of_its_own(suffix: str, full_recording, tmp_path, assert_same) -> None:
    reference = replace(full_recording.reference, time=full_recording.reference.time + 0.001)
    recording = replace(full_recording, reference=reference)
    write_recording(recording, tmp_path / f"x.{suffix}")
    assert_same(read(tmp_path / f"x.{suffix}"), recording)


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("sensor", ["gyr", "acc", "mag"])
def test_one_sensor(suffix: str, sensor: str, tmp_path, assert_same) -> None:
    recording = nd.Recording([1.7e9, 1.7e9 + 0.5], **{sensor: np.eye(3)[:2]}, name="x")  # dates are kept as well
    write_recording(recording, tmp_path / f"x.{suffix}")
    assert_same(read(tmp_path / f"x.{suffix}"), recording)


@st.composite
def recordings(draw) -> nd.Recording:
    n = draw(st.integers(1, 4))
    time = draw(hnp.arrays(np.float64, n, elements=st.floats(-1e12, 1e12)))
    vectors = st.one_of(st.none(), hnp.arrays(np.float64, (n, 3), elements=VALUES))
    gyr, acc, mag = draw(vectors), draw(vectors), draw(vectors)
    if gyr is None and acc is None and mag is None:
        acc = np.zeros((n, 3))
    reference = None
    if draw(st.booleans()):
        m = draw(st.integers(1, n))
        quat = np.eye(4)[draw(st.lists(st.integers(0, 3), min_size=m, max_size=m))]
        frame = draw(st.sampled_from(["NED", "ENU", "NWU"]))
        reference = nd.Orientation(np.sort(time)[:m], quat, frame, name=draw(st.text(max_size=4)))
    return nd.Recording(
        time,
        gyr,
        acc,
        mag,
        reference,
        draw(st.one_of(st.none(), hnp.arrays(np.bool_, n))),
        draw(st.sampled_from(["NED", "ENU", "NWU"])),
        draw(NAMES),
        draw(st.sampled_from(["uT", "arbitrary"])),
        draw(st.sampled_from(["none", "heading", "rotations"])),
    )


@pytest.mark.parametrize("suffix", ["csv", "parquet", "hdf5", "mat"])
@settings(max_examples=40, deadline=None, derandomize=True)
@given(recording=recordings())
def test_any_recording(suffix: str, recording: nd.Recording, tmp_path_factory, assert_same) -> None:
    path = tmp_path_factory.getbasetemp() / f"any.{suffix}"
    write_recording(recording, path)
    assert_same(read(path), recording)


def orientation(n: int = 20) -> nd.Orientation:
    rng = np.random.default_rng(11)
    quat = rng.normal(size=(n, 4))
    half = rng.normal(size=(n, 3, 3)) * 0.1
    return nd.Orientation(
        np.cumsum(rng.uniform(0.0, 0.02, n)),
        quat / np.linalg.norm(quat, axis=1, keepdims=True),
        "NWU",
        covariance=half @ half.transpose(0, 2, 1),
        gyr_bias=rng.normal(size=(n, 3)),
        gyr_bias_sigma=rng.random((n, 3)),
        flags=rng.integers(0, 16, n),
        name="some filter",
    )


@pytest.mark.parametrize("suffix", ["csv", "parquet", "pq"])
@pytest.mark.parametrize("convention", ["zyx", "rfu"])
def test_orientation(suffix: str, convention: str, tmp_path, assert_same_orientation) -> None:
    path = tmp_path / f"q.{suffix}"
    write_orientation(orientation(), path, convention)
    assert_same_orientation(read_orientation(path), orientation())


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_orientation_without_extras(suffix: str, tmp_path, assert_same_orientation) -> None:
    bare = replace(orientation(), covariance=None, gyr_bias=None, gyr_bias_sigma=None, flags=np.zeros(20, int))
    write_orientation(bare, tmp_path / f"q.{suffix}")
    assert_same_orientation(read_orientation(tmp_path / f"q.{suffix}"), bare)


@pytest.mark.parametrize("suffix", ["tum", "txt"])
def test_tum_keeps_time_attitude_and_frame(suffix: str, tmp_path, assert_same_orientation) -> None:
    path = tmp_path / f"q.{suffix}"
    write_orientation(orientation(), path)
    kept = replace(orientation(), covariance=None, gyr_bias=None, gyr_bias_sigma=None, flags=np.zeros(20, int))
    assert_same_orientation(read_orientation(path), kept)
    row = next(line for line in path.read_text().splitlines() if not line.startswith("#")).split()
    assert [float(v) for v in row[1:4]] == [0.0, 0.0, 0.0]
    np.testing.assert_array_equal([float(v) for v in row[4:]], orientation().quat[0, [1, 2, 3, 0]])  # x y z w


def test_foreign_tum(text, refused) -> None:
    path = text(
        "# timestamp tx ty tz qx qy qz qw\n1403636580.25 1 2 3 0 0 0.6 0.8\n1403636580.5 1 2 3 0 1 0 0\n", "a.txt"
    )
    refused(lambda: read_orientation(path), "a frame", "frame=")
    result = read_orientation(path, frame="ENU")
    np.testing.assert_array_equal(result.time, [1403636580.25, 1403636580.5])
    np.testing.assert_array_equal(result.quat, [[0.8, 0, 0, 0.6], [0, 0, 1, 0]])
    assert (result.frame, result.name) == ("ENU", "a")
    bare = text("0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", "b.txt")
    assert len(read_orientation(bare, frame="NED")) == 2


def test_foreign_table(text, refused) -> None:
    path = text("t (ms);quat_x;quat_y;quat_z;quat_w\n0;0;0;0;1\n5;1;0;0;0\n")
    result = read_orientation(path, frame="NED")
    np.testing.assert_array_equal(result.time, [0, 0.005])
    np.testing.assert_array_equal(result.quat, [[1, 0, 0, 0], [0, 1, 0, 0]])
    refused(lambda: read_orientation(text("t,a,b\n0,1,2\n"), frame="NED"), "columns time, qw")
    refused(lambda: read_orientation(text("t,qw,qx,qy,qz\n0,2,0,0,0\n"), frame="NED"), "unit quaternions")


def test_frame_of_the_file_is_converted(tmp_path) -> None:
    write_orientation(orientation(), tmp_path / "q.csv")
    converted = read_orientation(tmp_path / "q.csv", frame="NED")
    np.testing.assert_array_equal(converted.quat, orientation().to_frame("NED").quat)


def test_recording_is_no_orientation(tmp_path, full_recording, refused) -> None:
    for suffix in ("csv", "parquet", "hdf5"):
        write_recording(full_recording, tmp_path / f"x.{suffix}")
        refused(lambda suffix=suffix: read_orientation(tmp_path / f"x.{suffix}", frame="NED"), "an orientation")


@pytest.mark.parametrize("flags", ["300", "-1", "1.5"])
def test_impossible_flags(flags: str, text, refused) -> None:
    path = text(f"time,qw,qx,qy,qz,flags\n0,1,0,0,0,{flags}\n")
    refused(lambda: read_orientation(path, frame="NED"), "flags")


def test_frame_of_a_recording_can_be_chosen(tmp_path, full_recording) -> None:
    for suffix in ("csv", "hdf5"):
        write_recording(full_recording, tmp_path / f"x.{suffix}")
        ned = read(tmp_path / f"x.{suffix}", frame="NED")
        assert ned.frame == ned.reference.frame == "NED"
        np.testing.assert_array_equal(ned.reference.quat, full_recording.reference.to_frame("NED").quat)


class TestWriting:
    """Names, places, and failures half-way."""

    @pytest.mark.parametrize("name", ["x", "x.npy", "x.pkl", "x.csv.gz", "x.tum"])
    def test_unknown_suffix(self, name: str, tmp_path, full_recording, refused) -> None:
        refused(lambda: write_recording(full_recording, tmp_path / name), "ends in one of .csv", repr(name)[1:-1])
        assert not os.listdir(tmp_path)

    def test_wrong_things(self, tmp_path, full_recording, refused) -> None:
        refused(lambda: write_recording(orientation(), tmp_path / "x.csv"), "a Recording, got Orientation")
        refused(lambda: write_orientation(full_recording, tmp_path / "x.csv"), "an Orientation, got Recording")
        refused(lambda: write_orientation(orientation(), tmp_path / "x.csv", "xyz"), "convention")
        refused(lambda: write_recording(full_recording, 3), "a path")

    @pytest.mark.parametrize("suffix", ["csv", "parquet", "hdf5", "mat"])
    def test_nothing_to_write(self, suffix: str, tmp_path, refused) -> None:
        empty = nd.Recording(np.zeros(0), np.zeros((0, 3)))
        refused(lambda: write_recording(empty, tmp_path / f"x.{suffix}"), "at least one sample")
        assert not os.listdir(tmp_path)

    @pytest.mark.parametrize("suffix", ["csv", "parquet", "tum"])
    def test_no_orientation_to_write(self, suffix: str, tmp_path, refused) -> None:
        refused(lambda: write_orientation(orientation()[:0], tmp_path / f"x.{suffix}"), "at least one sample")

    def test_no_folder(self, tmp_path, full_recording, refused) -> None:
        refused(lambda: write_recording(full_recording, tmp_path / "no" / "x.csv"), "a folder that exists")
        (tmp_path / "d.csv").mkdir()
        refused(lambda: write_recording(full_recording, tmp_path / "d.csv"), "the folder")
        refused(lambda: write_recording(full_recording, "a\0b.csv"), "the name of a file")

    def test_failure_leaves_the_old_file(self, tmp_path) -> None:
        path = tmp_path / "x.csv"
        path.write_text("old")

        def fail() -> None:
            with atomic_write(path) as file:
                file.write(b"half of the new")
                raise KeyError("interrupted")

        with pytest.raises(KeyError):
            fail()
        assert path.read_text() == "old"
        assert os.listdir(tmp_path) == ["x.csv"]

    def test_readers_never_see_half_a_file(self, tmp_path) -> None:
        path = tmp_path / "x.bin"
        with atomic_write(path) as file:
            file.write(b"a" * 1000)
            file.flush()
            assert not path.exists()
        assert path.read_bytes() == b"a" * 1000

    def test_disk_error(self, tmp_path, refused) -> None:
        def full() -> None:
            with atomic_write(tmp_path / "x"):
                raise OSError(28, "No space left on device")

        refused(full, "no space left on device")
        assert not os.listdir(tmp_path)

    def test_umask_sets_permissions(self, tmp_path) -> None:
        plain = tmp_path / "plain"
        plain.touch()
        with atomic_write(tmp_path / "x") as file:
            file.write(b"1")
        assert stat.S_IMODE((tmp_path / "x").stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)

    def test_symbolic_link_stays(self, tmp_path) -> None:
        (tmp_path / "target").write_bytes(b"old")
        (tmp_path / "link").symlink_to("target")
        with atomic_write(tmp_path / "link") as file:
            file.write(b"new")
        assert (tmp_path / "link").is_symlink()
        assert (tmp_path / "target").read_bytes() == b"new"

    def test_two_writers(self, tmp_path) -> None:
        """Both write at once; one whole file remains."""
        path = tmp_path / "x.csv"
        parts = [nd.Recording(np.arange(200.0), np.full((200, 3), float(k)), name=f"{k}") for k in range(2)]
        threads = [threading.Thread(target=write_recording, args=(part, path)) for part in parts]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        result = read(path)
        assert len(result) == 200
        assert (result.gyr == float(result.name)).all()
        assert os.listdir(tmp_path) == ["x.csv"]
