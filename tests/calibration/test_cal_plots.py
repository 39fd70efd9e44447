"""The figure of a calibration shows what was measured and what came of it."""

from __future__ import annotations

import numpy as np
import pytest
from cal_truth import directions, field_recording, positions_recording, turns_recording

from northdown.calibration import (
    Calibration,
    calibrate_accelerometer,
    calibrate_gyroscope,
    calibrate_magnetometer,
)
from northdown.errors import InputError
from northdown.plots._calibration import calibration as draw
from northdown.recording import Recording

RNG = np.random.default_rng


def test_the_magnetometer_is_drawn_before_and_after() -> None:
    recording = field_recording(directions(RNG(1), 500))
    found = calibrate_magnetometer(recording)
    figure = draw(found, recording)
    assert len(figure.axes) == 4
    before, after = (line.get_ydata() for line in figure.axes[3].get_lines()[:2])
    assert before == pytest.approx(np.linalg.norm(recording.mag, axis=1))
    assert after == pytest.approx(np.linalg.norm(found.apply(recording).mag, axis=1))
    x, y = (np.asarray(v) for v in figure.axes[0].get_lines()[2].get_data())
    assert np.hypot(x, y) == pytest.approx(np.full(len(x), found.mag.norm))


def test_rests_and_turns_are_drawn() -> None:
    positions = positions_recording(directions(RNG(2), 12))
    found = calibrate_accelerometer(positions)
    before, after = (np.asarray(line.get_ydata()) for line in draw(found, positions).axes[0].get_lines()[:2])
    assert len(before) == 12
    assert np.sqrt(np.mean(before**2)) == pytest.approx(found.acc.evidence.before)
    assert np.sqrt(np.mean(after**2)) == pytest.approx(found.acc.evidence.after)
    turned = turns_recording(directions(RNG(3), 12))
    found = calibrate_gyroscope(turned, turns=True)
    after = np.asarray(draw(found, [turned]).axes[0].get_lines()[1].get_ydata())
    assert np.sqrt(np.mean(after**2)) == pytest.approx(np.rad2deg(found.gyr.evidence.after))
    bias = calibrate_gyroscope(turned, turns=False)
    assert draw(bias, turned).axes[0].get_ylabel() == "rate (°/s)"


def test_nothing_to_draw() -> None:
    found = calibrate_magnetometer(field_recording(directions(RNG(4), 300)))
    with pytest.raises(InputError, match="calibration of one sensor"):
        draw(Calibration(), [])
    with pytest.raises(InputError, match="samples of the magnetometer"):
        draw(found, Recording(np.arange(3.0), mag=np.full((3, 3), np.nan)))
    moving = Recording(np.arange(300) / 100.0, acc=RNG(5).normal(0.0, 9.0, (300, 3)))
    with pytest.raises(InputError, match="rests of the accelerometer"):
        draw(calibrate_accelerometer(positions_recording(directions(RNG(6), 12))), moving)
