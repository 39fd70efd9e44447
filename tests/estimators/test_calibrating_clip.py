"""A gyroscope that clips: found by the calibrating filter itself, made up for, and not seen where there is none."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import northdown as nd
from northdown import Flag
from northdown.checks.sensors import gyr_levels
from northdown.estimators._calibrating_clip import restored
from northdown.simulation import measure, random_motion

LIMIT = np.deg2rad(400.0)
STEP = LIMIT / 32768.0


def ride(seed=2, *, seconds=40.0, limit=LIMIT, step=STEP, turn=3.0):
    """Lively motion at 100 Hz with white noise; a gyroscope of that range (rad/s) and step of its output."""
    rng = np.random.default_rng(seed)
    exact = measure(random_motion(seconds + 1.0, seed, turn=turn), time=np.arange(0.5, seconds, 0.01))
    n = len(exact)
    gyr = np.round((exact.gyr + 2e-3 * rng.normal(size=(n, 3))) / step) * step
    return dataclasses.replace(
        exact,
        gyr=np.clip(gyr, -limit, limit),
        acc=exact.acc + 0.03 * rng.normal(size=(n, 3)),
        mag=exact.mag + 0.3 * rng.normal(size=(n, 3)),
    )


def total(estimate, recording):
    return nd.attitude_error(estimate, recording, mask=recording.time > 5.0).rmse().total_deg


def test_clipping_is_found_and_made_up_for():
    recording = ride()
    at_end = (np.abs(recording.gyr) >= LIMIT).any(axis=1)
    assert 0.01 < at_end.mean() < 0.1
    filter_, blind = nd.CalibratingEKF(), nd.CalibratingEKF(gyr_range=1e6)
    live, run, smoothed = filter_.stream().run(recording), filter_.run(recording), filter_.smooth(recording)
    # beforehand all of it is known, and a little below the range counts as well; live, each side is once unknown
    for estimate, missed in ((run, 0.0), (smoothed, 0.0), (live, 0.4)):
        flagged = estimate.has(Flag.GYRO_CLIPPED)
        assert (at_end & ~flagged).sum() <= missed * at_end.sum()
        assert (flagged & ~at_end).mean() < 0.005
    assert total(run, recording) < 0.5 * total(blind.run(recording), recording)
    assert total(live, recording) < 0.5 * total(blind.run(recording), recording)
    assert total(smoothed, recording) < 0.3 * total(blind.smooth(recording), recording)
    # a range that is given is as good as one found
    given = nd.CalibratingEKF(gyr_range=LIMIT).smooth(recording)
    assert total(given, recording) < 1.2 * total(smoothed, recording)
    for estimate in (run, smoothed):
        error = nd.attitude_error(estimate, recording)
        sigma = np.sqrt(np.einsum("nii->ni", estimate.covariance[error.index]))
        assert ((np.abs(error.rotvec) < 3.0 * sigma).mean(axis=0) > 0.95).all()


def test_run_is_the_stream_that_knows_the_recording():
    recording = ride(seconds=30.0)[1500:]
    filter_ = nd.CalibratingEKF().for_recording(recording)
    run, stream = nd.CalibratingEKF().run(recording), filter_.stream()
    assert run.has(Flag.GYRO_CLIPPED).any()
    parts = [stream.run(recording[:700]), stream.run(recording[700:])]
    assert np.array_equal(np.vstack([p.quat for p in parts]), run.quat)
    stream = filter_.stream()
    for k in range(len(recording)):
        q = stream.update(recording.gyr[k], recording.acc[k], recording.mag[k], time=float(recording.time[k]))
        assert np.array_equal(q, run.quat[k])
        assert stream.flags == run.flags[k]
    assert nd.CalibratingEKF(gyr_range=9.0).for_recording(recording) == nd.CalibratingEKF(gyr_range=9.0)


def test_levels_are_found_after_calibration():
    """A matrix and an offset spread the one value of each side over a percent."""
    recording = ride(seconds=60.0, limit=np.deg2rad(300.0))
    offset = np.array([0.05, 0.0, -0.05])
    gyr = recording.gyr @ (np.eye(3) + 2e-3).T + offset
    levels = gyr_levels(recording.time, gyr)
    expected = np.deg2rad(300.0) + np.column_stack([offset, -offset])
    found = np.isfinite(levels)
    assert found.sum() >= 4  # one side of two axes is hardly reached
    # rad/s; two thousandths of the three axes' sum, at most 900 °/s
    assert np.abs(levels - expected)[found].max() < 2e-3 * np.deg2rad(900.0)


@pytest.mark.parametrize("step", [STEP, np.deg2rad(0.07), np.deg2rad(0.5)])
@pytest.mark.parametrize("turn", [1.5, 4.0])
def test_coarse_sensors_do_not_look_clipped(step, turn):
    # without noise, so that values repeat at each peak
    for rate in (100.0, 1000.0):
        exact = measure(random_motion(21.0, 4, turn=turn), rate=rate)
        recording = dataclasses.replace(exact, gyr=np.round(exact.gyr / step) * step)
        assert np.abs(recording.gyr).max() > 2.0
        for estimate in (nd.CalibratingEKF().stream().run(recording), nd.CalibratingEKF().smooth(recording)):
            assert not estimate.has(Flag.GYRO_CLIPPED).any()


def test_a_value_that_is_exceeded_was_no_limit():
    """A plateau with corners, then, from 4 s on, a faster turn."""
    time = np.arange(600) * 0.01
    rng = np.random.default_rng(1)
    swing = np.abs(np.sin(np.pi * time))
    rate = np.where(time < 4.0, np.minimum(6.0 * swing, 4.0), 8.0 * swing)
    gyr = np.round(np.column_stack([rate, 0.01 * rng.normal(size=(600, 2))]) / 1e-3) * 1e-3
    recording = nd.Recording(time, gyr, np.tile([0.0, 0.0, -9.80665], (600, 1)))
    flagged = nd.CalibratingEKF(rest_gyr=0.0).stream().run(recording).has(Flag.GYRO_CLIPPED)
    plateau = (time < 4.0) & (rate == 4.0)
    assert flagged[plateau].mean() > 0.7  # found within the first of three
    assert not flagged[(time < 4.0) & ~plateau & (rate < 3.95)].any()
    assert not flagged[time > 4.4].any()


def test_restored_swing_is_the_lost_one():
    """The cubic through two slopes is exact for a parabola."""
    time = np.arange(200) * 0.001
    rate = 10.0 - 800.0 * (time - 0.1003) ** 2
    gyr = np.column_stack([np.minimum(rate, 7.0), np.cos(time), -np.minimum(rate, 7.0)])
    recording = nd.Recording(time, gyr)
    levels = np.array([7.05, np.inf, np.inf, np.inf, np.inf, 7.05])  # clipped from 0.99 of it on
    result = restored(recording, levels)
    assert np.array_equal(result.gyr[:, 1], gyr[:, 1])
    # rad/s of up to 3 that were lost; slopes are taken between samples, half a step too early
    assert np.abs(result.gyr[:, 0] - rate).max() < 0.1
    assert np.array_equal(result.gyr[:, 2], -result.gyr[:, 0])
    assert restored(recording, np.full(6, np.inf)) is recording


@pytest.mark.parametrize(("test", "bounds"), [(5, (7.9, 1.7)), (6, (12.0, 11.4))])
def test_real_recordings_that_clip(data_root, test, bounds):
    if not (data_root / "repoimu" / f"TStick_Test{test:02d}_Trial1.csv").is_file():
        pytest.skip("the trial is not at hand")
    recording = nd.datasets.repoimu(test, 1, data_root)
    filter_ = nd.CalibratingEKF()
    # degrees, as measured and a tenth more; in test 06 most is that of samples whose reference is wrong
    for estimate, bound in zip((filter_.run(recording), filter_.smooth(recording)), bounds, strict=True):
        assert nd.attitude_error(estimate, recording).rmse().total_deg < 1.1 * bound
        assert 0.005 < estimate.has(Flag.GYRO_CLIPPED).mean() < 0.2


def test_real_recordings_that_do_not_clip(data_root):
    for dataset in ("broad", "repoimu"):
        for name in nd.datasets.names(dataset, data_root):
            if "Test05" in name or "Test06" in name:
                continue
            recording = (
                nd.datasets.broad(name, data_root)
                if dataset == "broad"
                else nd.datasets.repoimu(int(name[11:13]), int(name[-1]), data_root)
            )
            assert np.isinf(gyr_levels(recording.time, recording.gyr)).all(), name
