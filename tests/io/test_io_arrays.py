"""HDF5 and Parquet from other programs: shapes, names, units, and what must be refused."""

from __future__ import annotations

import sys
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

import northdown as nd
from northdown.errors import FormatError, MissingDependencyError
from northdown.io import read, write_recording

N = 6
GYR = np.arange(18.0).reshape(N, 3)
ACC = GYR[::-1] + 0.5
TIME = np.arange(N) / 100.0


def check_sensors(recording: nd.Recording) -> None:
    np.testing.assert_array_equal(recording.gyr, GYR)
    np.testing.assert_array_equal(recording.acc, ACC)
    np.testing.assert_array_equal(recording.time, TIME)


class TestHdf5:
    """HDF5 through h5py."""

    def test_datasets_by_name_and_unit(self, tmp_path) -> None:
        with h5py.File(tmp_path / "log.bin", "w") as f:
            f["imu/gyr"] = np.rad2deg(GYR)
            f["imu/gyr"].attrs["units"] = "deg/s"
            f["imu/acc"] = ACC.T  # (3, N), as some write it
            f["imu/mag"] = np.ones((N, 3))
            f["imu/mag"].attrs["unit"] = "G"
            f["time"] = TIME.astype(np.float32)
            f["note"] = "text is left alone"
        recording = read(tmp_path / "log.bin")
        np.testing.assert_allclose(recording.gyr, GYR, rtol=1e-15)  # two roundings
        np.testing.assert_array_equal(recording.acc, ACC)
        np.testing.assert_array_equal(recording.mag, np.full((N, 3), 100.0))
        assert recording.mag_unit == "uT"
        np.testing.assert_allclose(recording.time, TIME, rtol=1e-7)  # float32 in the file
        assert recording.name == "log"

    def test_columns_and_rate(self, tmp_path) -> None:
        with h5py.File(tmp_path / "log.h5", "w") as f:
            f["omega_strange"] = GYR
            f["f"] = ACC
            f["fs"] = 100.0
        check_sensors(read(tmp_path / "log.h5", columns={"gyr": "omega_strange", "acc": "f"}))

    def test_rate_as_attribute(self, tmp_path) -> None:
        with h5py.File(tmp_path / "log.h5", "w") as f:
            f["gyr"], f["acc"] = GYR, ACC
            f.attrs["sampling_rate"] = 100.0
        check_sensors(read(tmp_path / "log.h5"))
        assert read(tmp_path / "log.h5", rate=50.0).time[1] == 0.02

    @pytest.mark.parametrize("n", [4, 6])
    def test_matlab_73(self, n: int, tmp_path) -> None:
        """MATLAB writes a header block of 512 bytes, and its arrays transposed; four rows look like four columns."""
        path = tmp_path / "log.mat"
        with h5py.File(path, "w", userblock_size=512) as f:
            for name, value in {"gyr": GYR, "acc": ACC, "time": TIME[:, None]}.items():
                f[name] = value[:n].T
                f[name].attrs["MATLAB_class"] = np.bytes_("double")
            f["name"] = np.zeros((3, 1), np.uint16)
            f["name"].attrs["MATLAB_class"] = np.bytes_("char")
        with open(path, "r+b") as file:
            file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64")
        recording = read(path)
        np.testing.assert_array_equal(recording.gyr, GYR[:n])
        np.testing.assert_array_equal(recording.acc, ACC[:n])
        np.testing.assert_array_equal(recording.time, TIME[:n])

    def test_links_out_of_the_file(self, tmp_path, refused) -> None:
        with h5py.File(tmp_path / "secret.h5", "w") as f:
            f["gyr"] = GYR
        with h5py.File(tmp_path / "log.h5", "w") as f:
            f["gyr"] = h5py.ExternalLink("secret.h5", "/gyr")
            f["acc"] = h5py.SoftLink("/gyr")
        refused(lambda: read(tmp_path / "log.h5", rate=1), "arrays of numbers", kind=FormatError)

    def test_data_kept_outside(self, tmp_path, refused) -> None:
        (tmp_path / "raw").write_bytes(GYR.tobytes())
        with h5py.File(tmp_path / "log.h5", "w") as f:
            f.create_dataset("gyr", (N, 3), "f8", external=[(str(tmp_path / "raw"), 0, 144)])
        refused(lambda: read(tmp_path / "log.h5", rate=1), "arrays inside the file", "'gyr'", kind=FormatError)

    def test_virtual_data(self, tmp_path, refused) -> None:
        layout = h5py.VirtualLayout((N, 3), "f8")
        layout[:] = h5py.VirtualSource(str(tmp_path / "secret.h5"), "gyr", (N, 3))
        with h5py.File(tmp_path / "log.h5", "w") as f:
            f.create_virtual_dataset("gyr", layout)
        refused(lambda: read(tmp_path / "log.h5", rate=1), "arrays inside the file", kind=FormatError)

    def test_references_are_left_alone(self, tmp_path) -> None:
        with h5py.File(tmp_path / "log.h5", "w") as f:
            f["gyr"] = GYR
            f.create_dataset("acc", (N, 3), h5py.ref_dtype)
        assert read(tmp_path / "log.h5", rate=1).acc is None

    def test_huge_declared_size(self, tmp_path, refused) -> None:
        with h5py.File(tmp_path / "log.h5", "w") as f:
            f.create_dataset("gyr", (10**11, 3), "f8", chunks=(1024, 3), compression="gzip")
        assert (tmp_path / "log.h5").stat().st_size < 10_000
        refused(lambda: read(tmp_path / "log.h5", rate=1), "at most 2147.5 MB", "raise max_bytes")

    def test_group_that_holds_itself(self, tmp_path) -> None:
        with h5py.File(tmp_path / "log.h5", "w") as f:
            f["gyr"] = GYR
            f.create_group("g")["again"] = f["/"]
        np.testing.assert_array_equal(read(tmp_path / "log.h5", rate=1).gyr, GYR)  # the walk ends at some depth

    def test_different_lengths(self, tmp_path, refused) -> None:
        with h5py.File(tmp_path / "log.h5", "w") as f:
            f["gyr"], f["acc"] = GYR, ACC[:-1]
        refused(lambda: read(tmp_path / "log.h5", rate=1), "one length", "with 6", "with 5", kind=FormatError)

    @pytest.mark.parametrize("value", ["{", "[1]", '{"northdown": 3}', "[" * 50_000])
    def test_wild_metadata(self, value: str, tmp_path, refused) -> None:
        with h5py.File(tmp_path / "log.h5", "w") as f:
            f["gyr"] = GYR
            f.attrs["northdown"] = np.bytes_(value)
        refused(lambda: read(tmp_path / "log.h5", rate=1), "metadata as JSON", kind=FormatError)


class TestParquet:
    """Parquet through pyarrow."""

    def columns(self) -> dict[str, np.ndarray]:
        named = {f"gyr_{c}": GYR[:, i] for i, c in enumerate("xyz")}
        return named | {f"acc_{c}": ACC[:, i] for i, c in enumerate("xyz")}

    def test_by_name(self, tmp_path) -> None:
        table = pa.table({"time": TIME, "label": ["a"] * N, **self.columns()})
        pq.write_table(table, tmp_path / "log", row_group_size=4)
        check_sensors(read(tmp_path / "log"))

    @pytest.mark.parametrize("unit", ["ns", "us", "ms"])
    def test_timestamps(self, unit: str, tmp_path) -> None:
        parts = {"ns": 10**9, "us": 10**6, "ms": 10**3}[unit]
        stamps = pa.array(1_700_000_000 * parts + np.arange(N) * (parts // 100), pa.timestamp(unit))
        pq.write_table(pa.table({"time": stamps, **self.columns()}), tmp_path / "log.parquet")
        check_sensors(read(tmp_path / "log.parquet"))

    def test_nulls_are_no_samples(self, tmp_path) -> None:
        table = pa.table({"mag_x (uT)": [1, None], "mag_y (uT)": [1.0, None], "mag_z (uT)": [1.0, None]})
        pq.write_table(table, tmp_path / "log.parquet")
        mag = read(tmp_path / "log.parquet", rate=1).mag
        assert mag is not None
        np.testing.assert_array_equal(np.isnan(mag), [[False] * 3, [True] * 3])

    def test_null_time(self, tmp_path, refused) -> None:
        stamps = pa.array([1, None, 3, 4, 5, 6], pa.timestamp("ns"))
        pq.write_table(pa.table({"time": stamps, **self.columns()}), tmp_path / "log.parquet")
        refused(lambda: read(tmp_path / "log.parquet"), "a time in every row", kind=FormatError)

    def test_huge_declared_size(self, tmp_path, refused) -> None:
        table = pa.table({f"gyr_{c}": np.zeros(300_000) for c in "xyz"})
        pq.write_table(table, tmp_path / "log.parquet", compression="zstd")
        assert (tmp_path / "log.parquet").stat().st_size < 100_000
        refused(lambda: read(tmp_path / "log.parquet", rate=1, max_bytes=1_000_000), "at most 1.0 MB of numbers")

    def test_no_rows(self, tmp_path, refused) -> None:
        pq.write_table(pa.table({f"gyr_{c}": np.zeros(0) for c in "xyz"}), tmp_path / "log.parquet")
        refused(lambda: read(tmp_path / "log.parquet", rate=1), "a header only", kind=FormatError)

    def test_name_twice(self, tmp_path, refused) -> None:
        table = pa.table([pa.array([1.0])] * 4, names=["acc_x", "acc_y", "acc_z", "acc_z"])
        pq.write_table(table, tmp_path / "log.parquet")
        refused(lambda: read(tmp_path / "log.parquet", rate=1), "one column for acc z")
        refused(lambda: read(tmp_path / "log.parquet", rate=1, columns={"acc": [0, 1, 2]}), "twice", kind=FormatError)


def test_broad_layout(tmp_path) -> None:
    """The .mat and .hdf5 files of BROAD, made small: both give the same."""
    half = np.sqrt(0.5)
    quat = np.array([[1, 0, 0, 0], [half, half, 0, 0], [np.nan] * 4, [0, 1, 0, 0], [0, 0, 1, 0], [np.nan] * 4])
    arrays = {
        "imu_gyr": GYR,
        "imu_acc": ACC,
        "imu_mag": GYR + 30,
        "opt_quat": quat,
        "opt_pos": GYR,
        "movement": np.array([False, True, True, True, True, False])[:, None],
    }
    scipy.io.savemat(tmp_path / "05_x.mat", arrays | {"sampling_rate": 2000 / 7, "info": "text"})
    with h5py.File(tmp_path / "05_x.hdf5", "w") as f:
        for name, value in arrays.items():
            f[name] = value.ravel() if name == "movement" else value
        f.attrs["sampling_rate"] = 2000 / 7
    for suffix in ("mat", "hdf5"):
        recording = read(tmp_path / f"05_x.{suffix}")
        assert recording.name == "05_x"
        assert (recording.frame, recording.mag_unit, recording.reference_offset) == ("ENU", "uT", "none")
        np.testing.assert_allclose(recording.time, np.arange(N) * 0.0035, rtol=1e-15)
        np.testing.assert_array_equal(recording.gyr, GYR)
        assert recording.reference is not None
        np.testing.assert_array_equal(recording.reference.time, recording.time[[0, 1, 3, 4]])
        assert recording.reference.frame == "ENU"
        np.testing.assert_array_equal(recording.movement, [False, True, True, True, True, False])
        ned = read(tmp_path / f"05_x.{suffix}", frame="NED", name="five")
        assert (ned.frame, ned.name) == ("NED", "five")
        assert ned.reference is not None
        truth = recording.reference.to_frame("NED").quat
        np.testing.assert_array_equal(ned.reference.quat, truth)


@pytest.mark.parametrize(
    ("module", "suffix", "package"), [("pyarrow.parquet", "parquet", "pyarrow"), ("h5py", "hdf5", "h5py")]
)
def test_optional_package_missing(module: str, suffix: str, package: str, tmp_path, monkeypatch, refused) -> None:
    recording = nd.Recording(TIME, GYR)
    path = tmp_path / f"log.{suffix}"
    write_recording(recording, path)
    monkeypatch.setitem(sys.modules, module, None)
    parts = (f"the package {package}", "pip install 'northdown[io]'")
    refused(lambda: read(path), *parts, kind=MissingDependencyError)
    other = tmp_path / f"new.{suffix}"
    refused(lambda: write_recording(recording, other), *parts, kind=MissingDependencyError)
    assert [p.name for p in Path(tmp_path).iterdir()] == [path.name]
