"""Calibrations as values: applied, joined, checked, and put into words."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from cal_truth import GYR_BIAS, GYR_MATRIX, directions, field_recording
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from northdown.calibration import (
    Calibration,
    Evidence,
    SensorCalibration,
    TemperatureSlope,
    calibrate_magnetometer,
    coverage,
)
from northdown.errors import InputError
from northdown.recording import Recording

RNG = np.random.default_rng
numbers = st.floats(-3.0, 3.0)


@st.composite
def parts(draw: st.DrawFn, sensor: str = "gyr") -> SensorCalibration:
    matrix = np.eye(3) + 0.2 * draw(arrays(np.float64, (3, 3), elements=st.floats(-0.9, 0.9)))
    return SensorCalibration(sensor, draw(arrays(np.float64, 3, elements=numbers)), matrix)


@settings(max_examples=40, deadline=None)
@given(parts(), parts(), parts(), arrays(np.float64, (4, 3), elements=numbers))
def test_joining_is_applying_one_after_the_other(
    a: SensorCalibration, b: SensorCalibration, c: SensorCalibration, raw: np.ndarray
) -> None:
    # offsets up to 3 through inverses of condition up to 20 or so
    assert a.then(b).correct(raw) == pytest.approx(b.correct(a.correct(raw)), abs=1e-9)
    first, second, third = (Calibration(gyr=part) for part in (a, b, c))
    left, right = (third @ second) @ first, third @ (second @ first)
    assert left.gyr.correct(raw) == pytest.approx(right.gyr.correct(raw), abs=1e-9)
    assert (second @ first) == first.then(second)


def test_joining_carries_sigma_and_sensors() -> None:
    one = SensorCalibration("acc", offset_sigma=[0.3, 0.0, 0.0], matrix=2.0 * np.eye(3), matrix_sigma=0.1 * np.eye(3))
    two = SensorCalibration("acc", offset_sigma=[0.8, 0.0, 0.0], matrix=3.0 * np.eye(3), matrix_sigma=0.2 * np.eye(3))
    both = one.then(two)
    assert both.offset_sigma[0] == pytest.approx(math.hypot(0.3, 0.8 / 2.0))
    assert both.matrix_sigma[0, 0] == pytest.approx(math.hypot(0.2 * 2.0, 3.0 * 0.1))
    whole = Calibration(acc=one).then(Calibration(gyr=SensorCalibration("gyr")))
    assert [part.sensor for part in whole.parts] == ["gyr", "acc"]


def test_applying_leaves_missing_samples_and_other_sensors() -> None:
    rng = RNG(1)
    mag = rng.normal(size=(5, 3))
    mag[2] = np.nan
    recording = Recording(np.arange(5.0), gyr=rng.normal(size=(5, 3)), mag=mag, name="x", frame="ENU")
    done = Calibration(gyr=SensorCalibration("gyr", GYR_BIAS, GYR_MATRIX)).apply(recording)
    assert np.array_equal(done.mag, recording.mag, equal_nan=True)
    assert (done.name, done.frame) == ("x", "ENU")
    expected = np.array([GYR_MATRIX @ (g - GYR_BIAS) for g in recording.gyr])
    assert done.gyr == pytest.approx(expected, abs=1e-14)
    iron = Calibration(mag=SensorCalibration("mag", [1.0, 2.0, 3.0])).apply(recording)
    assert np.isnan(iron.mag[2]).all()
    assert np.array_equal(iron.mag[3], mag[3] - [1.0, 2.0, 3.0])


def test_applying_to_the_wrong_recording() -> None:
    recording = Recording(np.arange(3.0), mag=np.ones((3, 3)), mag_unit="arbitrary")
    with pytest.raises(InputError, match="magnetic field in uT"):
        Calibration(mag=SensorCalibration("mag")).apply(recording)
    with pytest.raises(InputError, match="one without gyr"):
        Calibration(gyr=SensorCalibration("gyr")).apply(recording)
    with pytest.raises(InputError, match="without nothing"):
        Calibration().apply(recording)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"sensor": "thermometer"}, "sensor to be one of"),
        ({"sensor": "gyr", "offset": [1.0, 2.0]}, r"offset of shape \(3,\)"),
        ({"sensor": "gyr", "offset": [1.0, 2.0, np.nan]}, "finite offset"),
        ({"sensor": "gyr", "matrix": np.diag([1.0, 1.0, -1.0])}, "mirrors"),
        ({"sensor": "gyr", "matrix": np.diag([1.0, 1.0, 0.0])}, "flattens"),
        ({"sensor": "gyr", "matrix": np.zeros((3, 3))}, "flattens"),
        ({"sensor": "gyr", "offset_sigma": [-1.0, 0.0, 0.0]}, "at least 0"),
        ({"sensor": "gyr", "unit": "uT"}, "unit of gyr"),
    ],
)
def test_impossible_parts_are_refused(arguments: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        SensorCalibration(**arguments)


def test_parts_in_the_wrong_place() -> None:
    with pytest.raises(InputError, match="a calibration of acc as acc, got one of gyr"):
        Calibration(acc=SensorCalibration("gyr"))
    with pytest.raises(InputError, match="calibration of acc in m/s\\^2 to follow"):
        SensorCalibration("acc").then(SensorCalibration("gyr"))
    slope = TemperatureSlope(25.0, np.ones((1, 3)), 0.0, 50.0)
    warm = SensorCalibration("gyr", temperature=slope)
    with pytest.raises(InputError, match="one calibration that depends on temperature"):
        warm.then(warm)
    scaled = SensorCalibration("gyr", matrix=2.0 * np.eye(3)).then(warm)
    raw = RNG(2).normal(size=(3, 3))
    t = np.array([10.0, 20.0, 70.0])
    assert scaled.correct(raw, t) == pytest.approx(warm.correct(2.0 * raw, t), abs=1e-12)


def test_parts_cannot_be_changed() -> None:
    part = SensorCalibration("gyr", GYR_BIAS)
    with pytest.raises(ValueError, match="read-only"):
        part.offset[0] = 1.0
    with pytest.raises(AttributeError):
        part.offset = np.zeros(3)


def test_coverage_counts_directions() -> None:
    everything = coverage(directions(RNG(3), 5000))
    assert everything.share == 1.0
    assert everything.counts.sum() == 5000
    assert everything.largest_gap < 0.25  # rad; bins are 0.35 wide
    assert np.isnan(everything.missing).all()
    upper = directions(RNG(4), 5000)
    upper[:, 2] = np.abs(upper[:, 2])
    half = coverage(upper)
    assert 0.5 <= half.share < 0.62  # bins that the equator cuts count as seen
    assert half.missing @ [0.0, 0.0, -1.0] > 0.95
    with pytest.raises(InputError, match="vectors with a direction"):
        coverage(np.zeros((2, 3)))
    assert coverage(np.empty((0, 3))).share == 0.0


def test_words_fit_eighty_columns() -> None:
    notes = ("a note that is so long that it cannot possibly fit into one line of eighty columns, " * 2,)
    part = calibrate_magnetometer(field_recording(directions(RNG(5), 400))).mag
    slope = TemperatureSlope(25.0, np.full((2, 3), 1e-4), 10.0, 40.0)
    warm = SensorCalibration("gyr", GYR_BIAS, GYR_MATRIX, temperature=slope, evidence=Evidence("given", notes=notes))
    text = str(Calibration(mag=part, gyr=warm))
    assert max(len(line) for line in text.splitlines()) <= 80
    assert "Hard iron" in text
    assert re.search(r"x 1[12]\.\d+ ± 0\.0\d+ µT", text)
    assert "±" in text
    assert "x 0.573 °/s" in text  # 0.01 rad/s
    assert str(Calibration()) == "a calibration of nothing"
