"""Simulated recordings against rigid-body laws and their stated errors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from northdown import InputError
from northdown.simulation import LOW_COST, Motion, SensorErrors, measure, random_motion, simulate


def test_error_free_samples_integrate_to_the_truth():
    motion = random_motion(20.0, 200.0, np.random.default_rng(1))
    recording = measure(motion, SensorErrors(), np.random.default_rng(0))
    steps = Rotation.from_rotvec(recording.gyr[1:] * np.diff(recording.time)[:, None])
    attitude = motion.rotation[0]
    for step in steps:
        attitude = attitude * step
    assert (attitude * motion.rotation[-1].inv()).magnitude() < 1e-12  # rad, rounding of 4000 products


def test_specific_force_and_field_in_the_navigation_frame():
    motion = random_motion(20.0, 200.0, np.random.default_rng(1))
    recording = measure(motion, SensorErrors(), np.random.default_rng(0), field=np.array([20.0, 3.0, 40.0]))
    force = motion.rotation.apply(recording.acc)
    assert np.allclose(force - motion.acceleration, [0.0, 0.0, -9.80665], atol=1e-12)
    assert np.allclose(motion.rotation.apply(recording.mag), [20.0, 3.0, 40.0], atol=1e-12)


def test_acceleration_belongs_to_a_path_that_starts_and_ends_at_rest():
    motion = random_motion(30.0, 1000.0, np.random.default_rng(4))
    velocity = np.cumsum(motion.acceleration, axis=0) * 1e-3
    assert np.abs(velocity[-1]).max() < 1e-3  # m/s: rectangle rule at 1 kHz
    assert np.abs(velocity).max() > 0.05
    assert (motion.acceleration[:4900] == 0.0).all()


def test_noise_and_bias_have_the_stated_size():
    n = 40_000
    still = Motion(np.arange(n) / 100.0, Rotation.concatenate([Rotation.identity()] * n), np.zeros((n, 3)))
    recording = measure(still, LOW_COST, np.random.default_rng(6))
    for value, density in ((recording.gyr, LOW_COST.gyr_noise), (recording.acc, LOW_COST.acc_noise)):
        # a standard deviation from n samples is known to 1/√(2n) = 0.35 %; four of these
        assert value.std(axis=0) == pytest.approx(np.full(3, density * 10.0), rel=0.015)
    start = Motion(still.time[:2], still.rotation[:2], still.acceleration[:2])
    biases = [measure(start, LOW_COST, np.random.default_rng(k)).gyr.mean(axis=0) for k in range(400)]
    spread = np.hypot(LOW_COST.gyr_bias, LOW_COST.gyr_noise * 10.0 / np.sqrt(2.0))
    assert np.std(biases) == pytest.approx(spread, rel=4.0 / np.sqrt(2.0 * 1200.0))


def test_the_seed_decides_and_the_frame_only_turns_the_truth():
    a, b, c = simulate(5.0, seed=1), simulate(5.0, seed=1, frame="ENU"), simulate(5.0, seed=2)
    assert np.array_equal(a.gyr, b.gyr)
    assert not np.array_equal(a.gyr, c.gyr)
    turned = a.reference.to_frame("ENU").rotation * b.reference.rotation.inv()
    assert turned.magnitude().max() < 1e-14


@pytest.mark.parametrize(("duration", "rate"), [(0.5, 100.0), (10.0, 0.0), (float("nan"), 100.0), (10.0, 1e9)])
def test_bad_arguments(duration, rate):
    with pytest.raises(InputError, match="expected"):
        simulate(duration, rate=rate)
