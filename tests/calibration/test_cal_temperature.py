"""Bias by temperature: the polynomial is recovered, its σ honest, and it is not extrapolated."""

from __future__ import annotations

import numpy as np
import pytest
from cal_truth import chi2_bounds

from northdown.calibration import Calibration, TemperatureSlope, calibrate_gyroscope_temperature
from northdown.errors import InputError
from northdown.recording import Recording

LINEAR, SQUARE = np.array([1e-4, -2e-5, 0.0]), np.array([-2e-6, 0.0, 1e-6])  # rad/s per °C, per °C²
OFFSET = np.array([0.01, -0.02, 0.0])  # rad/s at 25 °C


def samples(seed: int = 0, n: int = 6000, low: float = 10.0, high: float = 50.0) -> tuple[np.ndarray, np.ndarray]:
    t = np.linspace(low, high, n)
    d = (t - 25.0)[:, None]
    return t, OFFSET + d * LINEAR + d**2 * SQUARE + 2e-3 * np.random.default_rng(seed).normal(size=(n, 3))


def test_the_polynomial_is_recovered() -> None:
    t, gyr = samples()
    part = calibrate_gyroscope_temperature(t, gyr).gyr
    slope = part.temperature
    assert slope.reference == 25.0
    assert part.offset == pytest.approx(OFFSET, abs=4e-4)  # rad/s; 4 σ
    assert slope.coefficients[0] == pytest.approx(LINEAR, abs=2e-5)
    assert slope.coefficients[1] == pytest.approx(SQUARE, abs=1e-6)
    corrected = part.correct(gyr, t)
    assert np.abs(corrected.reshape(60, -1, 3).mean(axis=1)).max() < 1e-3  # rad/s; 5 σ of 100 samples
    assert part.evidence.after < part.evidence.before / 3.0


def test_sigma_of_the_offset_is_honest() -> None:
    errors = []
    for seed in range(60):
        part = calibrate_gyroscope_temperature(*samples(seed, n=2000)).gyr
        errors.append((part.offset - OFFSET) / part.offset_sigma)
    low, high = chi2_bounds(180)
    assert low < np.mean(np.square(errors)) < high


def test_outside_the_range_the_offset_stays() -> None:
    slope = TemperatureSlope(25.0, np.array([[1.0, 2.0, 3.0]]), 10.0, 40.0)
    change = slope.change([0.0, 10.0, 25.0, 40.0, 80.0])
    assert np.array_equal(change[:, 0], [-15.0, -15.0, 0.0, 15.0, 15.0])
    t, gyr = samples(low=30.0, high=50.0)
    part = calibrate_gyroscope_temperature(t, gyr).gyr
    assert part.temperature.reference == 30.0
    assert any("25 °C was not measured" in note for note in part.evidence.notes)


def test_a_recording_needs_its_temperature() -> None:
    t, gyr = samples()
    calibration = calibrate_gyroscope_temperature(t, gyr)
    recording = Recording(np.arange(len(t)) / 100.0, gyr=gyr)
    with pytest.raises(InputError, match="temperature at each sample"):
        calibration.apply(recording)
    with pytest.raises(InputError, match="6000 temperatures"):
        calibration.apply(recording, temperature=t[:-1])
    with pytest.raises(InputError, match="finite temperatures"):
        calibration.apply(recording, temperature=np.full(len(t), np.nan))
    at_25 = calibration.at_temperature(25.0)
    assert np.array_equal(at_25.apply(recording).gyr, recording.gyr - calibration.gyr.offset)
    assert isinstance(at_25, Calibration)


def test_what_does_not_suffice_is_refused() -> None:
    t, gyr = samples()
    with pytest.raises(InputError, match="range of at least 6 °C for degree 2"):
        calibrate_gyroscope_temperature(25.0 + 0.1 * (t - 25.0), gyr)
    with pytest.raises(InputError, match="at least 24 samples"):
        calibrate_gyroscope_temperature(t[:20], gyr[:20])
    with pytest.raises(InputError, match="stays at few values"):
        calibrate_gyroscope_temperature(np.where(t < 30.0, 10.0, 50.0), gyr, degree=3)
    with pytest.raises(InputError, match="degree from 1 to 4"):
        calibrate_gyroscope_temperature(t, gyr, degree=9)
    with pytest.raises(InputError, match=r"temperature of shape \(N,\)"):
        calibrate_gyroscope_temperature(gyr, gyr)
