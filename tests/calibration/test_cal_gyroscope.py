"""Gyroscope: bias at rest, scale and alignment from turns, and the integration behind it."""

from __future__ import annotations

import numpy as np
import pytest
from cal_truth import GYR_BIAS, GYR_MATRIX, chi2_bounds, directions, turns_recording
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from northdown.calibration import calibrate_gyroscope
from northdown.calibration._turn_data import gather_turns
from northdown.calibration.rest import find_rests
from northdown.calibration.turns import _lowers, _tangents, turn_errors
from northdown.errors import InputError
from northdown.kernels.turn import turns
from northdown.recording import Recording

RNG = np.random.default_rng


def test_bias_scale_and_alignment_are_recovered() -> None:
    recording = turns_recording(directions(RNG(1), 24))
    part = calibrate_gyroscope(recording, turns=True).gyr
    assert part.evidence.model == "bias, scale and alignment"
    assert part.evidence.samples == 24
    assert np.abs(part.offset - GYR_BIAS).max() < 1e-4  # rad/s; 4 σ of the mean
    assert np.abs(part.matrix - GYR_MATRIX).max() < 1e-3
    assert part.evidence.before > 0.02  # rad
    assert part.evidence.after < 1e-3
    # the errors are those that the evidence sums up, and there are as many as turns
    errors = turn_errors([(recording, find_rests(recording))], part.matrix)
    assert len(errors) == 24
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(part.evidence.after, rel=1e-9)


def test_sigma_is_honest() -> None:
    seeds = 50
    matrices, biases = [], []
    for seed in range(seeds):
        recording = turns_recording(directions(RNG(seed), 16), seed=seed, rest=2.5, rate=50.0)
        part = calibrate_gyroscope(recording, turns=True).gyr
        matrices.append(((part.matrix - GYR_MATRIX) / part.matrix_sigma).ravel())
        biases.append((part.offset - GYR_BIAS) / part.offset_sigma)
    low, high = chi2_bounds(9 * seeds)
    assert low < np.mean(np.square(matrices)) < high
    low, high = chi2_bounds(3 * seeds)
    assert low < np.mean(np.square(biases)) < high


@pytest.mark.parametrize(
    ("axes", "names"),
    [(np.tile([1.0, 0.0, 0.0], (24, 1)), "yz"), (np.tile([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], (12, 1)), "x")],
    ids=["x only", "y and z"],
)
def test_turns_that_leave_an_axis_out_are_refused(axes: np.ndarray, names: str) -> None:
    recording = turns_recording(axes)
    with pytest.raises(InputError, match=rf"leave axis [{names}] uncertain"):
        calibrate_gyroscope(recording, turns=True)
    part = calibrate_gyroscope(recording).gyr
    assert part.evidence.model == "bias"
    assert np.array_equal(part.matrix, np.eye(3))
    assert "only the bias was found" in " ".join(part.evidence.notes)


def test_few_turns_about_the_axes_give_scale() -> None:
    part = calibrate_gyroscope(turns_recording(np.tile(np.eye(3), (2, 1))[:5]), tolerance=0.03).gyr
    assert part.evidence.model == "bias and scale"
    assert np.abs((np.diag(part.matrix) - np.diag(GYR_MATRIX)) / np.diag(part.matrix_sigma)).max() < 4.0


def test_turns_without_turning_are_refused() -> None:
    with pytest.raises(InputError, match="three turns between rests"):
        calibrate_gyroscope(turns_recording(np.eye(3)[:1]), turns=True)
    still = Recording(np.arange(1000) / 100.0, gyr=1e-3 * RNG(1).normal(size=(1000, 3)))
    with pytest.raises(InputError, match="samples of the accelerometer"):
        calibrate_gyroscope(still, turns=True)


def test_bias_of_a_still_sensor_has_the_sigma_of_a_mean() -> None:
    noise, n = 2e-3, 4000
    gyr = np.array([0.02, -0.01, 0.0]) + noise * RNG(2).normal(size=(n, 3))
    part = calibrate_gyroscope(Recording(np.arange(n) / 100.0, gyr=gyr)).gyr
    assert part.offset == pytest.approx(gyr.mean(axis=0), abs=1e-15)
    assert part.offset_sigma == pytest.approx(
        np.full(3, noise / np.sqrt(n)), rel=0.5
    )  # eight batches tell it to 20 %


def test_a_bias_that_changes_between_rests_enlarges_its_sigma() -> None:
    recording = turns_recording(directions(RNG(3), 12))
    drift = np.linspace(0.0, 4e-3, len(recording))[:, None]  # rad/s
    part = calibrate_gyroscope(Recording(recording.time, gyr=recording.gyr + drift, acc=recording.acc)).gyr
    plain = calibrate_gyroscope(recording).gyr
    assert part.offset_sigma.min() > 3.0 * plain.offset_sigma.max()
    # each turn uses the bias of the rests beside it, so that its change does not spoil the matrix
    assert np.abs(part.matrix - GYR_MATRIX).max() < 2e-3


def test_a_moving_or_fast_gyroscope_is_refused() -> None:
    rng = RNG(4)
    moving = Recording(np.arange(2000) / 100.0, gyr=rng.normal(size=(2000, 3)))
    with pytest.raises(InputError, match="rests of the sensor, got none"):
        calibrate_gyroscope(moving)
    degrees = Recording(np.arange(2000) / 100.0, gyr=0.5 + 1e-3 * rng.normal(size=(2000, 3)))
    with pytest.raises(InputError, match="check the unit of gyr"):
        calibrate_gyroscope(degrees)


def test_a_gyroscope_with_other_axes_is_refused() -> None:
    recording = turns_recording(directions(RNG(5), 20))
    swapped = Recording(recording.time, gyr=-recording.gyr, acc=recording.acc)
    with pytest.raises(InputError, match="check its unit and axes"):
        calibrate_gyroscope(swapped, turns=True)


def test_spoilt_turns_are_passed_over() -> None:
    recording = turns_recording(directions(RNG(6), 24))
    gyr = np.array(recording.gyr)
    gyr[350] = np.nan
    gyr[800:801] = np.nan  # at rest: does no harm
    limit = 0.9 * np.nanmax(np.abs(gyr))
    clipped = np.clip(gyr, -limit, limit)
    part = calibrate_gyroscope(Recording(recording.time, gyr=clipped, acc=recording.acc), turns=True).gyr
    assert "turns were passed over" in " ".join(part.evidence.notes)
    assert np.abs(part.matrix - GYR_MATRIX).max() < 2e-3
    assert part.evidence.samples < 24


def test_several_recordings_are_one() -> None:
    recording = turns_recording(directions(RNG(7), 20))
    rests = find_rests(recording)
    middle = (rests[10].start + rests[10].stop) // 2
    whole = calibrate_gyroscope(recording, turns=True).gyr
    parts = calibrate_gyroscope([recording[:middle], recording[middle:]], turns=True).gyr
    assert parts.evidence.samples == whole.evidence.samples
    assert np.abs(parts.matrix - whole.matrix).max() < 3e-4  # the rest that was cut has other means


def test_integration_of_turns_against_scipy() -> None:
    rng = RNG(8)
    rate, dt, bias = rng.normal(0.0, 2.0, (40, 3)), rng.uniform(0.005, 0.02, 40), rng.normal(0.0, 0.1, (2, 3))
    mat = np.eye(3) + 0.05 * rng.normal(size=(3, 3))
    starts, stops = np.array([3, 20]), np.array([20, 40])

    def integrate(m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        r, k = np.empty((2, 3, 3)), np.empty((2, 3, 3, 3))
        turns()(rate, dt, bias, np.ascontiguousarray(m), starts, stops, r, k)
        return r, k

    rotation, derivative = integrate(mat)
    for t, (a, b) in enumerate(zip(starts, stops, strict=True)):
        expected = Rotation.identity()
        for n in range(a, b):
            expected = expected * Rotation.from_rotvec(mat @ (rate[n] - bias[t]) * dt[n])
        assert rotation[t] == pytest.approx(expected.as_matrix(), abs=1e-13)
    h = 1e-6
    for i in range(3):
        for j in range(3):
            step = np.zeros((3, 3))
            step[i, j] = h
            up, down = integrate(mat + step)[0], integrate(mat - step)[0]
            for t in range(2):
                turned = Rotation.from_matrix(up[t] @ down[t].T).as_rotvec() / (2.0 * h)
                # the middle of a step stands for the step: second order in 0.04 rad
                assert derivative[t, :, i, j] == pytest.approx(turned, abs=2e-4)


@settings(max_examples=25, deadline=None)
@given(
    arrays(np.float64, st.tuples(st.integers(0, 60), st.just(6)), elements=st.floats(-1e9, 1e9) | st.just(np.nan)),
    st.floats(1e-9, 1e3),
)
def test_hostile_arrays_are_refused_or_calibrated(samples: np.ndarray, step: float) -> None:
    recording = Recording(np.arange(len(samples)) * step, gyr=samples[:, :3], acc=samples[:, 3:])
    for turns_wanted in (None, True):
        try:
            part = calibrate_gyroscope(recording, turns=turns_wanted).gyr
        except InputError:
            continue
        assert np.isfinite(part.offset).all()


def test_turns_that_share_a_rest_share_its_noise() -> None:
    """The covariance of residuals is what moving each rest's direction does to the turns on both sides."""
    recording = turns_recording(directions(RNG(9), 5))
    found = gather_turns([(recording, find_rests(recording))])
    ((_, lower),) = _lowers(found, np.eye(3))
    rotation, _ = found.integrate(np.eye(3))
    frames = _tangents(found.after)

    def residuals(before: np.ndarray, after: np.ndarray) -> np.ndarray:
        away = np.einsum("tji,tj->ti", rotation, before) - after
        return np.einsum("tai,ti->ta", frames, away).ravel()

    covariance = np.kron(np.diag(found.own_variance), np.eye(2))
    start = residuals(found.before, found.after)
    for rest in range(6):
        for axis in np.eye(3):
            before, after = found.before.copy(), found.after.copy()
            before[found.rest[:, 0] == rest] += 1e-3 * axis
            after[found.rest[:, 1] == rest] += 1e-3 * axis
            moved = (residuals(before, after) - start) / 1e-3
            covariance += found.rest_variance[rest] * np.outer(moved, moved)
    # The difference is noise along the direction itself, of which a gyroscope that errs by 1° carries 2 % over.
    assert lower @ lower.T == pytest.approx(covariance, abs=0.03 * covariance.max())
    assert np.abs(covariance[:2, 2:4]).max() > 0.1 * covariance.max()
