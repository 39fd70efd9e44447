"""Magnetometer to body, its lag, and the local field."""

from __future__ import annotations

import numpy as np
import pytest
from cal_truth import FIELD, chi2_bounds, turning_recording
from scipy.spatial.transform import Rotation

from northdown.calibration import align_magnetometer, local_field, magnetometer_lag
from northdown.calibration._field_pairs import gather_pairs
from northdown.calibration.alignment import _DipResiduals, _GyrResiduals
from northdown.errors import InputError
from northdown.recording import Recording

SMALL = Rotation.from_rotvec([0.05, -0.08, 0.03])


def rotation_error(matrix: np.ndarray, truth: Rotation) -> np.ndarray:
    return (Rotation.from_matrix(matrix) * truth.inv()).as_rotvec()


@pytest.mark.parametrize("method", ["gyr", "dip"])
def test_a_misalignment_is_recovered(method: str) -> None:
    part = align_magnetometer(turning_recording(misaligned=SMALL), method=method, tolerance=0.05).mag
    assert np.abs(rotation_error(part.matrix, SMALL)).max() < 0.01  # rad; 0.6 µT of noise in 50 are 0.01 for a sample
    assert part.matrix @ part.matrix.T == pytest.approx(np.eye(3), abs=1e-12)
    assert part.evidence.after < part.evidence.before
    assert not part.offset.any()


def test_sigma_of_the_gyroscope_method_is_honest() -> None:
    errors, lags = [], []
    for seed in range(50):
        recording = turning_recording(seed=seed, duration=20.0, rate=40.0, misaligned=SMALL)
        part = align_magnetometer(recording, method="gyr").mag
        # a rotation's variances from those of the elements: each element square is moved by two components
        total = (part.matrix_sigma**2).sum(axis=1)
        variance = 0.5 * (total.sum() - 2.0 * total)
        errors.append(rotation_error(part.matrix, SMALL) / np.sqrt(variance))
        if seed % 2:
            lag, sigma = magnetometer_lag(recording)
            lags.append(lag / sigma)
    low, high = chi2_bounds(150)
    assert low < np.mean(np.square(errors)) < high
    low, high = chi2_bounds(25)
    assert low < np.mean(np.square(lags)) < high


def test_axes_named_otherwise_are_found_with_the_gyroscope() -> None:
    swapped = Rotation.from_matrix([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    part = align_magnetometer(turning_recording(misaligned=swapped * SMALL)).mag
    assert np.abs(rotation_error(part.matrix, swapped * SMALL)).max() < 0.01  # rad


@pytest.mark.parametrize("lag", [0.0, 0.012, 0.05, -0.02])
def test_the_lag_is_found_and_does_not_spoil_the_alignment(lag: float) -> None:
    recording = turning_recording(misaligned=SMALL, lag=lag)
    found, sigma = magnetometer_lag(recording)
    assert abs(found - lag) < max(4.0 * sigma, 2e-3)  # s; the turned field is linear in the lag to 1 ms at 50 ms
    assert sigma < 2e-3
    part = align_magnetometer(recording).mag
    assert np.abs(rotation_error(part.matrix, SMALL)).max() < 0.01  # rad
    told = [note for note in part.evidence.notes if "ms" in note]
    assert len(told) == (lag != 0.0)
    assert all(("late" if lag > 0.0 else "early") in note for note in told)


@pytest.mark.parametrize("method", ["gyr", "dip"])
def test_turning_about_one_axis_is_refused(method: str) -> None:
    recording = turning_recording(axes=np.array([0.0, 0.0, 1.0]))
    with pytest.raises(InputError, match="turns about all axes"):
        align_magnetometer(recording, method=method)


def test_no_turning_and_no_rest_are_refused() -> None:
    still = turning_recording(axes=np.zeros(3))
    with pytest.raises(InputError, match="turns of 3° or more"):
        align_magnetometer(still)
    shaken = Recording(still.time, acc=5.0 * np.random.default_rng(0).normal(size=(len(still), 3)), mag=still.mag)
    with pytest.raises(InputError, match="hardly moves"):
        align_magnetometer(shaken, method="dip")
    with pytest.raises(InputError, match="hardly moves"):
        local_field(shaken)
    with pytest.raises(InputError, match="method to be one of gyr, dip"):
        align_magnetometer(still, method="magic")


def test_a_magnetometer_that_is_not_calibrated_is_refused() -> None:
    recording = turning_recording()
    with pytest.raises(InputError, match="expected"):
        align_magnetometer(
            Recording(recording.time, gyr=recording.gyr, mag=recording.mag + np.array([80.0, 0.0, 0.0]))
        )


def test_a_slower_magnetometer_will_do() -> None:
    recording = turning_recording(misaligned=SMALL)
    mag = np.array(recording.mag)
    mag[np.arange(len(mag)) % 10 != 0] = np.nan
    part = align_magnetometer(Recording(recording.time, gyr=recording.gyr, mag=mag)).mag
    assert np.abs(rotation_error(part.matrix, SMALL)).max() < 0.01  # rad


def test_local_field() -> None:
    recording = turning_recording(axes=0.3 * np.ones(3))
    field = local_field(recording)
    assert field.norm == pytest.approx(FIELD, abs=0.05)  # µT
    assert np.rad2deg(field.dip) == pytest.approx(65.0, abs=0.2)
    # means of 20 samples of 0.3 µT; across a spread of noise only
    assert field.norm_spread == pytest.approx(0.3 / np.sqrt(20.0), rel=0.3)
    dip = np.deg2rad(65.0)
    assert field.vector("NED") == pytest.approx(FIELD * np.array([np.cos(dip), 0.0, np.sin(dip)]), abs=0.2)
    assert field.vector("ENU") == pytest.approx(FIELD * np.array([0.0, np.cos(dip), -np.sin(dip)]), abs=0.2)


def test_horizontal_acceleration_does_not_change_the_dip() -> None:
    """It hardly changes the size of specific force, only its direction."""
    recording = turning_recording(axes=0.2 * np.ones(3))
    level = local_field(recording)
    acc = np.array(recording.acc)
    second = slice(len(acc) // 2, None)
    # 0.15 g across, at 2 Hz
    across = np.cross(acc[second], [0.3, -0.5, 0.8])
    across *= (
        0.15 * 9.81 * np.sin(4.0 * np.pi * recording.time[second])[:, None] / np.linalg.norm(across, axis=1)[:, None]
    )
    acc[second] += across
    shaken = local_field(Recording(recording.time, gyr=recording.gyr, acc=acc, mag=recording.mag))
    assert shaken.dip == pytest.approx(level.dip, abs=0.003)  # rad
    assert shaken.samples < 0.75 * level.samples


def test_derivatives_of_the_residuals() -> None:
    recording = turning_recording(duration=20.0, mag_noise=0.0)
    pairs = gather_pairs([recording])
    up = recording.acc[::100] / np.linalg.norm(recording.acc[::100], axis=1)[:, None]
    field = recording.mag[::100] / FIELD
    for residuals, unknowns in ((_GyrResiduals(pairs), np.zeros(4)), (_DipResiduals(up, field), np.array([0.1]))):
        jacobian = residuals(np.eye(3), unknowns)[1]
        for k in range(jacobian.shape[1]):
            step = np.zeros(jacobian.shape[1])
            step[k] = 1e-5
            plus, minus = (
                residuals(Rotation.from_rotvec(s * step[:3]).as_matrix(), unknowns + s * step[3:])[0]
                for s in (1.0, -1.0)
            )
            # without noise the second field is where the gyroscope says, but for its own noise
            assert jacobian[:, k] == pytest.approx((plus - minus) / 2e-5, abs=2e-3)
