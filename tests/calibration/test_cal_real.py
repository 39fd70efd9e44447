"""Real recordings: what calibration does to the field's spread, what it refuses, and how late magnetometers are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cal_truth import SOFT_IRON, chi2_bounds

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
    # RepoIMU's tests 4 and 8 see less than a tenth of all directions, about one axis
    few = (nd.datasets.repoimu(test, 1, data_root) for test in (4, 8))
    for recording in (walk, broad(data_root, "11"), *few):
        with pytest.raises(InputError, match="a magnetometer turned into directions all around"):
            calibrate_magnetometer(recording)


@pytest.mark.parametrize(("test", "share"), [(2, 0.3), (3, 0.3), (5, 0.3), (6, 0.6), (7, 0.4)])
def test_a_quarter_of_all_directions_is_enough_to_gain(data_root: Path, test: int, share: float) -> None:
    """RepoIMU's sensor was hardly turned, but its field is even: parts left out of the fit become more even too."""
    # of test 2 the points leave the offset uncertain to 6 %: it must be asked for
    part = calibrate_magnetometer(nd.datasets.repoimu(test, 1, data_root), tolerance=0.1 if test == 2 else 0.05).mag
    assert part.evidence.coverage < 0.6
    assert part.evidence.held_out_after < share * part.evidence.held_out_before


def test_trials_of_one_sensor_agree(data_root: Path) -> None:
    """One sensor, seven motions in one room: its iron is the same within the σ that each trial states.

    In trial 03 an uneven field passes for 1.5 µT of hard iron, with residuals as small as elsewhere.
    """
    numbers = ("03", "05", "07", "09", "21", "29", "31")
    parts = [calibrate_magnetometer(broad(data_root, number)).mag for number in numbers]
    offsets, sigmas = np.array([p.offset for p in parts]), np.array([p.offset_sigma for p in parts])
    off = (offsets - np.average(offsets, axis=0, weights=sigmas**-2)) / sigmas
    low, high = chi2_bounds(off.size - 3)
    assert low < (off**2).sum() / (off.size - 3) < high
    assert np.abs(off).max() < 3.0  # 99.9 % of 21 normal values are within 4
    alike = [k for k, number in enumerate(numbers) if number != "03"]
    assert offsets[alike].std(axis=0).max() < 0.5  # µT
    # five of the six elements of a symmetric matrix of determinant 1 are free
    matrices, spread_of = np.array([p.matrix for p in parts]), np.array([p.matrix_sigma for p in parts])
    off = ((matrices - np.average(matrices, axis=0, weights=spread_of**-2)) / spread_of)[:, *np.triu_indices(3)]
    low, high = chi2_bounds(5 * (len(parts) - 1))
    assert low < (off**2).sum() / (5 * (len(parts) - 1)) < high


@pytest.mark.parametrize("tolerance", [0.05, 0.2])
def test_a_magnet_on_the_sensor_is_refused(data_root: Path, tolerance: float) -> None:
    for number in ("33", "35"):
        with pytest.raises(InputError, match=r"expected a (magnetometer turned|field of constant size)"):
            calibrate_magnetometer(broad(data_root, number), tolerance=tolerance)


def test_what_gains_nothing_is_said_to(data_root: Path) -> None:
    """Trial 29: a magnet that was passed makes the spread, and the sensor was calibrated before."""
    recording = broad(data_root, "29")
    calibration = calibrate_magnetometer(recording)
    assert spread(calibration.apply(recording)) == pytest.approx(spread(recording), rel=0.01)
    notes = " ".join(calibration.mag.evidence.notes)
    assert "over all directions, disturbed ones too, the field's size is no more even" in notes
    assert "a calibrated sensor is better left as it is" in notes


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
