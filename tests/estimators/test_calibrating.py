"""What the calibrating filter promises: it finds delays and calibrations, is honest, and stands bad input."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown import Flag, InputError
from northdown.estimators._calibrating_learnt import LearntCalibration
from northdown.simulation import measure, random_motion, simulate

# Nothing but the filter's own covariance is reported.
PLAIN = {"inflation": 1.0, "tilt_sigma": 0.0, "heading_sigma": 0.0, "time_sigma": 0.0}


def sensors(seed, *, seconds=30.0, delay=0.0, matrix=None, bias=(0.0, 0.0, 0.0), noise=1.0, reach=0.0):
    """Lively motion on the spot, 100 Hz; gyroscope output g with ω = g − b − M g; late magnetometer; white noise."""
    rng = np.random.default_rng(seed)
    motion = random_motion(seconds + 1.0, seed=seed, reach=reach)
    time = np.arange(0.5, seconds, 0.01)
    exact = measure(motion, time=time)
    matrix = np.zeros((3, 3)) if matrix is None else matrix
    gyr = np.linalg.solve(np.eye(3) - matrix, (exact.gyr + bias).T).T
    mag = measure(motion, time=time - delay).mag
    n = len(time)
    return dataclasses.replace(
        exact,
        gyr=gyr + noise * 1e-3 * rng.normal(size=(n, 3)),
        acc=exact.acc + noise * 0.02 * rng.normal(size=(n, 3)),
        # 0.02 rad/√Hz of heading in a horizontal field of 21 µT, at 100 Hz
        mag=mag + noise * 0.02 * 10.0 * 21.1 * rng.normal(size=(n, 3)),
    )


def angle(a, b):
    return float((a * b.inv()).magnitude().max())


@pytest.mark.parametrize("delay", [0.013, 0.03, -0.008])
def test_delay_of_the_magnetometer_is_found(delay):
    found = nd.CalibratingEKF().run(sensors(4, seconds=60.0, delay=delay, noise=0.1)).diagnostics["mag_delay"][-1]
    # s; the noise is a tenth of what the filter expects, whose own sigma is 1 ms by then
    assert found == pytest.approx(delay, abs=1e-3)


def test_matrix_and_bias_are_found():
    rng = np.random.default_rng(2)
    matrix, bias = rng.normal(0.0, 3e-3, (3, 3)), np.array([0.01, -0.02, 0.005])
    recording = sensors(7, seconds=90.0, matrix=matrix, bias=bias, noise=0.1)
    filter_ = nd.CalibratingEKF(gyr_matrix=3e-3)
    stream = filter_.stream()
    stream.run(recording)
    known = filter_.learnt(stream)
    error = known.gyr_matrix - matrix
    assert np.abs(error / known.gyr_matrix_sigma).max() < 4.0
    assert np.sqrt(np.mean(error**2)) < 0.3 * np.sqrt(np.mean(matrix**2))
    assert np.abs(known.gyr_bias - bias).max() < 1e-3
    # without these states the same data end up further from the truth
    without = nd.CalibratingEKF(gyr_matrix=0.0).run(recording)
    late = recording.time > 30.0
    errors = [nd.attitude_error(o, recording, mask=late).rmse().total for o in (filter_.run(recording), without)]
    assert errors[0] < 0.6 * errors[1]


def test_what_was_learnt_helps_the_next_run():
    matrix = np.array([[4e-3, 2e-3, 0.0], [-3e-3, -5e-3, 1e-3], [2e-3, 0.0, 4e-3]])
    first, second = (sensors(k, seconds=90.0, matrix=matrix, delay=0.02, noise=0.3) for k in (3, 13))
    filter_ = nd.CalibratingEKF(gyr_matrix=3e-3)
    stream = filter_.stream()
    stream.run(first)
    known = filter_.learnt(stream)
    warm = filter_.warm_stream(known, frame="NED").run(second)
    cold = filter_.run(second)
    error = [nd.attitude_error(o, second, mask=second.time < 30.0).rmse().total for o in (warm, cold)]
    assert error[0] < 0.8 * error[1]
    assert warm.diagnostics["mag_delay"][0] == pytest.approx(0.02, abs=3e-3)
    with pytest.raises(InputError, match="a stream of calibrating-ekf"):
        filter_.learnt(nd.Mahony().stream())
    with pytest.raises(InputError, match=r"gyr_matrix of shape \(3, 3\)"):
        dataclasses.replace(known, gyr_matrix=np.zeros(3))
    with pytest.raises(InputError, match="gyr_bias_sigma of finite numbers"):
        dataclasses.replace(known, gyr_bias_sigma=np.array([1.0, -1.0, 0.0]))
    with pytest.raises(InputError, match="known as a LearntCalibration"):
        filter_.warm_stream({})
    assert isinstance(known, LearntCalibration)


def with_velocity(recording, speed_noise, acc_noise, epoch, rng):
    """Let the velocity at the end of each epoch (four samples) be white noise, and add noise to the accelerometer."""
    n = len(recording)
    velocity = rng.normal(0.0, speed_noise / np.sqrt(epoch), (n // 4 + 2, 3))
    velocity[0] = 0.0
    change = np.repeat(np.diff(velocity, axis=0) / epoch, 4, axis=0)
    acc_n = np.vstack([np.zeros((1, 3)), change])[:n]  # the first sample stands for no time
    noise = rng.normal(0.0, acc_noise / 0.1, (n, 3))
    acc = recording.acc + recording.reference.rotation.apply(acc_n, inverse=True) + noise
    return dataclasses.replace(recording, acc=acc)


def test_covariance_is_that_of_the_errors():
    """By Monte Carlo: bias, matrix and delay drawn from their priors, noise as the filter takes it."""
    off = {"gyr_scale": 0.0, "gyr_bias_walk": 0.0, "rest_gyr": 0.0, "gate_power": 0.0, "acc_motion": 0.0}
    noise = {"gyr_noise": 1e-4, "mag_noise": 0.02, "speed_noise": 0.002, "acc_noise": 0.02, "speed_motion": 0.0}
    filter_ = nd.CalibratingEKF(mag_delay_sigma=0.01, **off, **noise, **PLAIN)
    z = {"run": [], "smooth": []}
    for seed in range(24):
        rng = np.random.default_rng(1000 + seed)
        recording = sensors(
            100 + seed,
            seconds=20.0,
            matrix=rng.normal(0.0, filter_.gyr_matrix, (3, 3)),
            bias=rng.normal(0.0, filter_.start_bias, 3),
            delay=float(rng.normal(0.0, filter_.mag_delay_sigma)),
        )
        recording = with_velocity(recording, filter_.speed_noise, filter_.acc_noise, filter_.epoch, rng)
        truth = recording.reference.rotation
        start = Rotation.from_rotvec(rng.normal(0.0, [0.05, 0.05, 0.2])) * truth[0]
        for name in z:
            result = filter_.stream(initial=start).run(recording) if name == "run" else filter_.smooth(recording)
            at = [600, 1200, 1800]
            error = (truth[at] * result.rotation[at].inv()).as_rotvec()
            sigma = np.sqrt(np.einsum("nii->ni", result.covariance[at]))
            z[name].append((error / sigma) ** 2)
    for name in z:
        # 72 squares of each axis, three to a run that are correlated: 24 independent ones have mean 1 ± 0.29
        assert (np.mean(z[name], axis=(0, 1)) > 0.4).all(), name
        assert (np.mean(z[name], axis=(0, 1)) < 1.9).all(), name


def test_smoother_is_better_than_the_filter():
    matrix = np.array([[2e-3, 1e-3, 0.0], [-1e-3, -2e-3, 1e-3], [2e-3, 0.0, 1e-3]])
    filter_ = nd.CalibratingEKF()
    total = []
    for seed in range(40, 46):
        recording = sensors(seed, seconds=40.0, matrix=matrix, bias=(0.01, 0.0, -0.01), delay=0.01, noise=0.2)
        both = filter_.smooth(recording), filter_.run(recording)
        errors = [nd.attitude_error(o, recording).rmse() for o in both]
        assert errors[0].inclination < 0.6 * errors[1].inclination
        total.append([e.total for e in errors])
    smoothed, filtered = np.sqrt(np.mean(np.square(total), axis=0))
    assert smoothed < 0.8 * filtered


@pytest.mark.parametrize("frame", ["ENU", "NWU"])
def test_frame_turns_what_is_smoothed(frame):
    recording = simulate(10.0, rate=100.0, seed=6)
    filter_ = nd.CalibratingEKF()
    there, here = filter_.smooth(recording, frame=frame), filter_.smooth(recording).to_frame(frame)
    assert there.frame == frame
    assert angle(there.rotation, here.rotation) < 1e-10
    assert np.abs(there.covariance - here.covariance).max() < 1e-12  # rad²; variances are above 1e-6


def test_smoothing_short_and_sparse_recordings():
    recording = simulate(10.0, rate=100.0, seed=8)
    filter_ = nd.CalibratingEKF()
    for n in (0, 1, 2, 3, 7):
        part = recording[:n]
        assert len(filter_.smooth(part)) == n
        if n:
            assert angle(filter_.smooth(part).rotation, recording.reference.rotation[:n]) < 0.2
    rng = np.random.default_rng(3)
    holes = {
        k: np.where(rng.random((len(recording), 1)) < 0.7, np.nan, getattr(recording, k)) for k in ("acc", "mag")
    }
    result = filter_.smooth(dataclasses.replace(recording, **holes))
    assert nd.attitude_error(result, recording).rmse().total_deg < 3.0
    blind = filter_.smooth(dataclasses.replace(recording, mag=None))
    assert blind.has(Flag.HEADING_UNKNOWN).all()
    assert np.sqrt(blind.covariance[:, 2, 2]).min() > 1.0  # rad: the heading is not known
    with pytest.raises(InputError, match="for calibrating-ekf, got no acc"):
        filter_.smooth(dataclasses.replace(recording, acc=None))
    time = recording.time.copy()
    time[500:] -= 2.0
    with pytest.raises(InputError, match="at sample 500; sort"):
        filter_.smooth(dataclasses.replace(recording, time=time, reference=None))


def test_late_sensors_are_smoothed_backwards():
    recording = sensors(9, seconds=30.0, noise=0.1)
    acc, mag = recording.acc.copy(), recording.mag.copy()
    acc[:150], mag[:600] = np.nan, np.nan
    late = dataclasses.replace(recording, acc=acc, mag=mag)
    result = nd.CalibratingEKF().smooth(late)
    assert not result.flags.any()
    # rad; the gyroscope's bias of the first seconds is known only from later
    assert angle(result.rotation, recording.reference.rotation) < 0.03


def test_huge_samples_are_refused_before_they_do_harm():
    stream, other = nd.CalibratingEKF().stream(rate=100.0), nd.CalibratingEKF().stream(rate=100.0)
    recording = simulate(2.0, rate=100.0, seed=1)
    for k in range(len(recording)):
        row = (recording.gyr[k], recording.acc[k], recording.mag[k])
        if k % 20 == 7:
            for i in range(3):
                spoiled = list(row)
                spoiled[i] = np.array([0.0, 1e13, 0.0])
                with pytest.raises(InputError, match="units"):
                    stream.update(*spoiled)
        assert np.array_equal(stream.update(*row), other.update(*row))


def test_wild_data_give_numbers_or_an_error():
    rng = np.random.default_rng(17)
    recording = simulate(5.0, rate=100.0, seed=2)
    for size in (1e-9, 1e3, 1e6, 1e9, 1e200):
        wild = dataclasses.replace(recording, **{k: rng.normal(0.0, size, (501, 3)) for k in ("gyr", "acc", "mag")})
        for run in (nd.CalibratingEKF().run, nd.CalibratingEKF().smooth):
            if size > 1e100:
                with pytest.raises(InputError, match="units"):
                    run(wild)
                continue
            result = run(wild)
            assert np.isfinite(result.quat).all()
            assert np.isfinite(result.covariance).all()


def test_a_slow_start_from_rest_is_not_lost():
    """Turning sets in so gently that for a while nothing looks like motion."""
    n = 2000
    time = np.arange(n) * 0.01
    rate = np.where(time < 5.0, 0.0, np.minimum(0.02 * (time - 5.0), 0.3))
    gyr = np.column_stack([np.zeros(n), np.zeros(n), rate])
    turned = np.cumsum(rate) * 0.01
    mag = np.column_stack([20.0 * np.cos(turned), -20.0 * np.sin(turned), np.full(n, 45.0)])
    recording = nd.Recording(time, gyr, np.tile([0.0, 0.0, -9.80665], (n, 1)), mag)
    result = nd.CalibratingEKF(mag_noise=10.0).run(recording)  # so that the magnetometer does not mend it
    assert result.diagnostics["still"][450] == 1.0
    assert result.diagnostics["still"][-1] == 0.0
    heading = np.unwrap(result.to_frame("NED").as_euler()[:, 2])
    assert abs(heading[-1] - turned[-1]) < np.deg2rad(1.0)


def test_a_new_steady_field_becomes_the_reference():
    recording = sensors(21, seconds=150.0, noise=0.1)
    # from 40 s on the field is half as strong again and dips otherwise, still to the north
    moved = Rotation.from_euler("y", 0.2).apply(1.5 * recording.reference.rotation.apply(recording.mag))
    mag = np.where(
        (recording.time > 40.0)[:, None], recording.reference.rotation.apply(moved, inverse=True), recording.mag
    )
    u = nd.CalibratingEKF().run(dataclasses.replace(recording, mag=mag))
    rejected = u.has(Flag.MAG_REJECTED)
    assert rejected[(u.time > 42.0) & (u.time < 90.0)].mean() > 0.9
    assert not rejected[u.time > 130.0].any()
    never = nd.CalibratingEKF(field_new=1e6).run(dataclasses.replace(recording, mag=mag))
    assert never.has(Flag.MAG_REJECTED)[u.time > 130.0].mean() > 0.9


def test_a_disturbed_field_that_looks_right_for_moments_is_not_believed():
    recording = sensors(22, seconds=60.0, noise=0.1)
    field = recording.reference.rotation.apply(recording.mag)
    # from 20 s on half as strong again and turned by 40°; in every second, for a fifth, of the right norm and dip
    strength = np.where(recording.time % 1.0 < 0.2, 1.0, 1.5)[:, None]
    wrong = Rotation.from_euler("z", np.deg2rad(40.0)).apply(strength * field)
    late = recording.time > 20.0
    mag = np.where(late[:, None], recording.reference.rotation.apply(wrong, inverse=True), recording.mag)
    disturbed = dataclasses.replace(recording, mag=mag)

    def error(**parameters):
        estimate = nd.CalibratingEKF(**parameters).run(disturbed)
        return nd.attitude_error(estimate, recording, mask=late).rmse().heading_deg

    # judged by the moment alone, the heading is drawn to the wrong north, by several degrees
    without = error(gate_window=0.0)
    assert without > 3.0
    assert error() < 0.4 * without


def test_known_delay_of_the_gyroscope_is_made_up_for():
    delay, recording = 0.02, sensors(31, noise=0.0)
    motion = random_motion(31.0, seed=31, reach=0.0)
    late = measure(motion, time=recording.time - delay)
    for run in ("run", "smooth"):
        errors = [
            nd.attitude_error(
                getattr(nd.CalibratingEKF(gyr_delay=d), run)(
                    dataclasses.replace(late, time=recording.time, reference=recording.reference)
                ),
                recording.reference,
            )
            .rmse()
            .total
            for d in (delay, 0.0)
        ]
        assert errors[0] < 0.2 * errors[1]


def test_reported_sigmas_never_fall_below_their_floors():
    filter_ = nd.CalibratingEKF()
    for result in (filter_.run(simulate(20.0, seed=3)), filter_.smooth(simulate(20.0, seed=3))):
        sigma = np.sqrt(np.einsum("nii->ni", result.covariance))
        assert sigma[:, :2].min() >= filter_.tilt_sigma
        assert sigma[:, 2].min() >= 0.2 * filter_.heading_sigma
        assert np.linalg.eigvalsh(result.covariance).min() > 0.0


def test_a_wrong_bias_does_not_spin_a_body_at_rest():
    # as after a long turn under acceleration: 5 °/s off, and sure of it, while the gyroscope reads nearly nothing
    zero, matrix = np.zeros(3), np.zeros((3, 3))
    wrong = LearntCalibration(
        gyr_bias=np.array([0.0, 0.0, 0.087]),
        gyr_bias_sigma=np.full(3, 1e-3),
        gyr_matrix=matrix,
        gyr_matrix_sigma=matrix + 1e-3,
        rest_offset=zero,
        rest_offset_sigma=zero + 1e-4,
        mag_delay=0.0,
        mag_delay_sigma=0.01,
        mag_iron=zero,
        mag_iron_sigma=zero + 2.0,
        acc_bias=zero,
        acc_bias_sigma=zero + 0.1,
    )
    n, rng = 6000, np.random.default_rng(4)
    recording = nd.Recording(
        np.arange(n) * 0.01,
        np.array([0.0, 0.0, 0.002]) + 1e-3 * rng.standard_normal((n, 3)),
        np.tile([0.0, 0.0, -9.80665], (n, 1)) + 0.01 * rng.standard_normal((n, 3)),
    )
    stream = nd.CalibratingEKF().warm_stream(wrong, initial=Rotation.identity())
    result = stream.run(recording)
    # rest is found within two seconds, in which 10° are lost; then nothing turns, and the bias is the true one
    heading = np.rad2deg(result.as_euler()[:, 2])
    assert np.ptp(heading[200:]) < 1.0
    assert np.abs(result.gyr_bias[-1] - [0.0, 0.0, 0.002]).max() < 1e-3
    # one epoch in some thousands misses by four sigmas
    assert result.diagnostics["still"][300:].mean() > 0.98


def test_other_estimators_say_that_they_do_not_smooth():
    assert nd.CalibratingEKF.smooths
    assert not nd.Mahony.smooths
    with pytest.raises(InputError, match=r"an estimator that smooths .*, got mahony; use run"):
        nd.Mahony().smooth(simulate(1.0))


# degrees, real time and smoothed: what was measured, and a tenth more
BROAD = {
    "05_undisturbed_slow_rotation_with_breaks_B": (0.57, 0.36),
    "21_undisturbed_fast_combined": (1.52, 1.07),
    "29_disturbed_stationary_magnet_B": (1.29, 1.22),
}


@pytest.mark.parametrize("trial", list(BROAD))
def test_real_recordings(data_root, trial):
    if not (data_root / "broad" / f"{trial}.mat").is_file():
        pytest.skip(f"{trial} is not at hand")
    recording = nd.datasets.broad(trial, data_root)
    filter_ = nd.CalibratingEKF()
    for result, bound in zip((filter_.run(recording), filter_.smooth(recording)), BROAD[trial], strict=True):
        error = nd.attitude_error(result, recording)
        assert error.rmse().total_deg < 1.1 * bound
        sigma = np.sqrt(np.einsum("nii->ni", result.covariance[error.index]))
        assert ((np.abs(error.rotvec) < 3.0 * sigma).mean(axis=0) > 0.95).all()
        assert result.diagnostics["mag_delay"][-1] == pytest.approx(0.0125, abs=0.003)  # s, of these sensors
    assert math.isfinite(error.rmse().total)
