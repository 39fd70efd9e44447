"""Real files: units by the size of gravity at rest, and equality across formats."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from northdown.io import read, write_recording

# |acc| at rest: 9.78 to 9.83 m/s² on Earth's surface; these sensors' scale errors are up to 3 %
GRAVITY = 9.80665
SCALE_ERROR = 0.03 * GRAVITY

FILES = [
    ("broad/01_undisturbed_slow_rotation_A.mat", {}),
    ("broad/33_disturbed_attached_magnet_2cm.hdf5", {}),
    ("repoimu/TStick_Test02_Trial1.csv", {}),
    ("repoimu/TStick_Test05_Trial1.csv", {}),
    ("fusion/sensor_data.csv", {}),
    ("ximu/straightLine_CalInertialAndMag.csv", {"rate": 256}),
]


@pytest.mark.parametrize(("path", "arguments"), FILES)
def test_units(path, arguments, data_root) -> None:
    recording = read(data_root / path, **arguments)
    resting = recording[: round(0.5 * recording.rate)]
    mean = resting.acc.mean(axis=0)
    assert np.linalg.norm(mean) == pytest.approx(GRAVITY, abs=SCALE_ERROR)
    assert mean[2] > 0.9 * np.linalg.norm(mean)  # specific force, on the axis that points up
    assert np.abs(resting.gyr).max() < 0.1  # rad/s: at rest, a few deg/s of noise and bias
    field = np.linalg.norm(resting.mag, axis=1).mean()
    if recording.mag_unit == "uT":
        assert 20.0 < field < 70.0  # µT, the range over Earth's surface
    else:
        assert 0.9 < field < 1.2  # RepoIMU's unit field


def test_broad_mat_and_hdf5_agree(data_root, assert_same) -> None:
    stem = data_root / "broad" / "33_disturbed_attached_magnet_2cm"
    assert_same(read(f"{stem}.mat"), read(f"{stem}.hdf5"))


def test_ximu_counts_other_packets_too(data_root) -> None:
    """Packet numbers advance by 1.52 a sample: 256 samples and 128 quaternions a second, and a few more.

    No step is above 3, so no sample is lost, and samples follow each other at the nominal rate.
    """
    path = data_root / "ximu" / "straightLine_CalInertialAndMag.csv"
    packets = np.loadtxt(path, delimiter=",", skiprows=1, usecols=0)
    steps = np.diff(packets)
    assert steps.max() <= 3
    assert steps.mean() == pytest.approx(1.5, abs=0.05)
    recording = read(path, rate=256)
    assert len(recording) == len(packets)
    assert recording.duration == pytest.approx((len(packets) - 1) / 256, abs=1e-9)


def test_fusion_keeps_its_own_time(data_root) -> None:
    path = data_root / "fusion" / "sensor_data.csv"
    time = np.loadtxt(path, delimiter=",", skiprows=1, usecols=0)
    np.testing.assert_array_equal(read(path).time, time)


@pytest.mark.parametrize("suffix", ["csv", "parquet", "hdf5", "mat"])
def test_round_trip(suffix: str, data_root, tmp_path, assert_same) -> None:
    recording = read(data_root / "repoimu" / "TStick_Test03_Trial1.csv")
    write_recording(recording, tmp_path / f"x.{suffix}")
    assert_same(read(tmp_path / f"x.{suffix}"), recording)


def test_name_does_not_matter(data_root, tmp_path, assert_same) -> None:
    path = data_root / "broad" / "33_disturbed_attached_magnet_2cm.hdf5"
    shutil.copy(path, tmp_path / "renamed.csv")
    assert_same(read(tmp_path / "renamed.csv", name="a"), read(path, name="a"))
