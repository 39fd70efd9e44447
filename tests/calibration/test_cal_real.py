"""Real recordings: what calibration does to the field's spread, what it refuses, and how late magnetometers are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cal_truth import SOFT_IRON

import northdown as nd
from northdown.calibration import calibrate_gyroscope, calibrate_magnetometer, magnetometer_lag
from northdown.errors import InputError


def broad(root: Path, number: str) -> nd.Recording:
    return nd.read(next(iter((root / "broad").glob(f"{number}_*.mat"))), frame="ENU")


def spread(recording: nd.Recording) -> float:
    """Standard deviation of the field's size relative to its mean."""
    size = np.linalg.norm(recording.mag[~np.isnan(recording.mag).any(axis=1)], axis=1)
    return float(size.std() / size.mean())


@pytest.mark.parametrize(("number", "share"), [("03", 0.75), ("05", 0.97), ("21", 0.95)])
def test_the_spread_of_the_field_shrinks(data_root: Path, number: str, share: float) -> None:
    recording = broad(data_root, number)
    calibration = calibrate_magnetometer(recording)
    assert calibration.mag.evidence.model == "ellipsoid"
    assert spread(calibration.apply(recording)) < share * spread(recording)
    # the data set's magnetometer is calibrated: what is left is the laboratory's field, uneven by 1 to 2 %
    assert np.abs(calibration.mag.offset).max() < 2.0  # µT
    assert np.abs(calibration.mag.matrix - np.eye(3)).max() < 0.04


def test_iron_added_to_a_real_recording_is_found(data_root: Path) -> None:
    recording = broad(data_root, "03")
    plain = calibrate_magnetometer(recording)
    hard = np.array([30.0, -12.0, 45.0])
    shifted = nd.Recording(recording.time, mag=recording.mag + hard)
    found = calibrate_magnetometer(shifted).mag
    assert found.offset - plain.mag.offset == pytest.approx(hard, abs=1e-4)  # µT
    spoilt = nd.Recording(recording.time, mag=recording.mag @ SOFT_IRON.T + hard)
    both = calibrate_magnetometer(spoilt)
    assert spread(spoilt) > 0.3
    assert spread(both.apply(spoilt)) < 1.02 * spread(plain.apply(recording))


def test_too_little_turning_is_refused(data_root: Path) -> None:
    walk = nd.read(data_root / "ximu" / "straightLine_CalInertialAndMag.csv", rate=256.0)
    for recording in (walk, broad(data_root, "11")):
        with pytest.raises(InputError, match="a magnetometer turned into directions all around"):
            calibrate_magnetometer(recording)


def test_broads_magnetometer_is_late_by_13_ms(data_root: Path) -> None:
    """Trials of one sensor, each with its own motion, agree within their σ: neither is by chance."""
    found = np.array([magnetometer_lag(broad(data_root, number)) for number in ("03", "07", "21", "31")])
    mean = np.average(found[:, 0], weights=found[:, 1] ** -2)
    assert 0.010 < mean < 0.016  # s
    assert np.abs((found[:, 0] - mean) / found[:, 1]).max() < 3.5


def test_bias_from_the_rest_at_the_start(data_root: Path) -> None:
    recording = broad(data_root, "21")
    part = calibrate_gyroscope(recording).gyr
    still = ~recording.movement
    still[1000:] = False
    # the data set's own mask of movement agrees; bias instability of such a sensor is 1e-4 rad/s or so
    assert part.offset == pytest.approx(recording.gyr[still].mean(axis=0), abs=3e-4)
