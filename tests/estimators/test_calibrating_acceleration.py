"""Acceleration that lasts: seen by the calibrating filter, flagged, and not taken for tilt."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown import Flag
from northdown.simulation import measure, random_motion, waypoints


def ride(acceleration, *, seconds=110.0, seed=1):
    """Rest until 20 s, then a level circle of 12 m/s with that centripetal acceleration from 30 to 80 s."""
    time = np.arange(0.0, seconds + 0.05, 0.1)
    rise = np.clip((time - 20.0) / 6.0, 0.0, 1.0) - np.clip((time - 84.0) / 6.0, 0.0, 1.0)
    turn = np.clip((time - 27.0) / 3.0, 0.0, 1.0) - np.clip((time - 80.0) / 3.0, 0.0, 1.0)
    yaw = np.cumsum(acceleration / 12.0 * turn) * 0.1
    velocity = 12.0 * rise[:, None] * np.column_stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)])
    motion = waypoints(time, Rotation.from_euler("z", yaw[:, None]), np.cumsum(velocity, axis=0) * 0.1)
    exact = measure(motion, rate=100.0)
    rng = np.random.default_rng(seed)
    n = len(exact)
    return dataclasses.replace(
        exact,
        gyr=exact.gyr + 1e-3 * rng.normal(size=(n, 3)),
        acc=exact.acc + 0.03 * rng.normal(size=(n, 3)),
        mag=exact.mag + 0.3 * rng.normal(size=(n, 3)),
    )


@pytest.mark.parametrize("method", ["run", "smooth"])
def test_level_turn_is_coasted_through(method):
    recording = ride(4.0)
    turning = (recording.time > 35.0) & (recording.time < 78.0)
    estimate = getattr(nd.CalibratingEKF(), method)(recording)
    believing = getattr(nd.CalibratingEKF(acc_gate=1e3), method)(recording)
    errors = [nd.attitude_error(o, recording, mask=turning) for o in (estimate, believing)]
    # the mean force is atan(4 / 9.81) = 22° off the vertical
    assert errors[1].rmse().inclination_deg > 8.0
    assert errors[0].rmse().inclination_deg < 2.6  # mostly from before it is seen
    assert errors[0].rmse().heading_deg < 3.0
    rejected = estimate.has(Flag.ACC_REJECTED)
    assert rejected[turning].mean() > 0.95
    assert not rejected[recording.time < 20.0].any()
    assert not rejected[recording.time > 105.0].any()
    acceleration = estimate.diagnostics["acceleration"][turning]
    assert np.abs(acceleration - 4.0).max() < 1.0  # m/s², by an attitude that is a degree or two off


def test_a_smoother_sees_when_it_began():
    """Real time has been tilted by then; what comes after shows that."""
    recording = ride(4.0)
    onset = (recording.time > 20.0) & (recording.time < 34.0)
    live, smoothed = (getattr(nd.CalibratingEKF(), method)(recording) for method in ("run", "smooth"))
    believing = nd.CalibratingEKF(heading_outlier=0.0, smooth_walk=1.0).smooth(recording)  # no second pass
    tilt = [nd.attitude_error(o, recording, mask=onset).rmse().inclination_deg for o in (live, believing, smoothed)]
    assert tilt[2] < 0.3  # degrees
    assert tilt[2] < 0.5 * min(tilt[:2])
    error = nd.attitude_error(smoothed, recording, mask=recording.time > 20.0)
    sigma = np.sqrt(np.einsum("nii->ni", smoothed.covariance[error.index]))
    assert (np.abs(error.rotvec[:, :2]) < 3.0 * sigma[:, :2]).mean() > 0.95


def test_acceleration_that_does_not_show_in_the_norm_is_not_held_for_long():
    """1 m/s² makes the norm 0.5 % larger, less than the gate: flags say so only at the beginning."""
    recording = ride(1.0)
    turning = (recording.time > 45.0) & (recording.time < 78.0)
    assert nd.CalibratingEKF().run(recording).has(Flag.ACC_REJECTED)[turning].mean() < 0.5


@pytest.mark.parametrize("scale", [1.0, 1.03])
def test_motion_on_the_spot_is_believed(scale):
    for turn, reach in ((1.0, 0.1), (3.0, 0.25)):
        recording = measure(random_motion(60.0, 3, turn=turn, reach=reach), rate=100.0)
        recording = dataclasses.replace(recording, acc=scale * recording.acc)
        estimate = nd.CalibratingEKF().run(recording)
        # a scale error makes some samples look like acceleration, which does no harm
        assert estimate.has(Flag.ACC_REJECTED).mean() <= (0.0 if scale == 1.0 else 0.2)
        assert nd.attitude_error(estimate, recording).rmse().inclination_deg < 1.0


@pytest.mark.parametrize(("turn", "reach"), [(1.0, 0.1), (3.0, 0.25)], ids=["calm", "lively"])
def test_wrong_attitude_is_found_out_and_put_right(turn, reach):
    """A start that is 38° off, and a glitch of the gyroscope by 26°: neither looks like acceleration for long."""
    exact = measure(random_motion(90.0, 3, turn=turn, reach=reach), rate=100.0)
    rng = np.random.default_rng(0)
    n = len(exact)
    recording = dataclasses.replace(
        exact,
        gyr=exact.gyr + 2e-3 * rng.normal(size=(n, 3)),
        acc=exact.acc + 0.03 * rng.normal(size=(n, 3)),
        mag=exact.mag + 0.3 * rng.normal(size=(n, 3)),
    )
    off = Rotation.from_rotvec([0.6, 0.3, 0.0]) * recording.reference.rotation[0]
    wrong_start = nd.CalibratingEKF().stream(initial=off).run(recording)
    gyr = recording.gyr.copy()
    gyr[4000:4020] += [2.0, 0.0, 1.0]  # rad/s for 0.2 s
    glitch = nd.CalibratingEKF().run(dataclasses.replace(recording, gyr=gyr))
    for estimate, since in ((wrong_start, 20.0), (glitch, 65.0)):
        error = nd.attitude_error(estimate, recording, mask=recording.time > since)
        assert error.rmse().inclination_deg < 1.5
        assert error.rmse().heading_deg < 10.0  # the magnetometer pulls more slowly


def test_smooth_acceleration_is_no_rest():
    # no vibration: for the scatter of the sensors, the body is at rest all the time
    recording = ride(4.0)
    still = nd.CalibratingEKF().run(recording).diagnostics["still"]
    assert still[(recording.time > 2.0) & (recording.time < 20.0)].mean() > 0.95
    assert not still[(recording.time > 24.0) & (recording.time < 26.0)].any()
    assert not still[(recording.time > 87.0) & (recording.time < 89.0)].any()
    assert still[recording.time > 105.0].mean() > 0.95


def test_nothing_changes_on_real_recordings(data_root):
    for trial in ("15_undisturbed_fast_translation_A", "25_disturbed_tapping_B"):
        if not (data_root / "broad" / f"{trial}.mat").is_file():
            pytest.skip(f"{trial} is not at hand")
        recording = nd.datasets.broad(trial, data_root)
        for method in ("run", "smooth"):
            assert not getattr(nd.CalibratingEKF(), method)(recording).has(Flag.ACC_REJECTED).any()


def test_fast_motion_is_neither_travel_nor_a_lost_attitude(data_root):
    """Even where the filter is told that motion on the spot moves its velocity little: else 112° and 101° off."""
    for trial in ("15_undisturbed_fast_translation_A", "21_undisturbed_fast_combined"):
        if not (data_root / "broad" / f"{trial}.mat").is_file():
            pytest.skip(f"{trial} is not at hand")
        recording = nd.datasets.broad(trial, data_root)
        estimate = nd.CalibratingEKF(speed_motion=0.0, acc_motion=0.0).run(recording)
        assert not estimate.has(Flag.ACC_REJECTED).any()
        assert nd.attitude_error(estimate, recording).rmse().total_deg < 2.0
