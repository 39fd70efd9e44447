"""Rests are found where the sensor lay still, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest
from cal_truth import directions, positions_recording

from northdown.calibration.rest import find_rests, noise_density
from northdown.errors import InputError
from northdown.recording import Recording

RNG = np.random.default_rng


def test_rests_are_found_with_their_means() -> None:
    up = directions(RNG(1), 6)
    recording = positions_recording(up)
    rests = find_rests(recording)
    assert len(rests) == 6
    for k, rest in enumerate(rests):
        # truth: samples 400 k to 400 k + 300; a quarter of a window is left out on each side
        assert 400 * k <= rest.start <= 400 * k + 40
        assert 400 * k + 260 <= rest.stop <= 400 * k + 300
        assert rest.duration == pytest.approx((rest.stop - rest.start - 1) / 100.0)
        assert rest.acc == pytest.approx(recording.acc[rest.start : rest.stop].mean(axis=0), abs=1e-12)


def test_each_sensor_alone_suffices() -> None:
    both = positions_recording(directions(RNG(2), 5))
    assert len(find_rests(Recording(both.time, acc=both.acc))) == 5
    only_gyr = find_rests(Recording(both.time, gyr=both.gyr))
    assert len(only_gyr) == 5
    assert only_gyr[0].acc is None
    with pytest.raises(InputError, match="a gyroscope or an accelerometer"):
        find_rests(Recording(both.time, mag=both.acc))


def test_a_steady_turn_is_no_rest() -> None:
    rng = RNG(3)
    gyr = 1e-3 * rng.normal(size=(3000, 3))
    gyr[1000:1500, 2] += 1.0  # 1 rad/s about the vertical: the accelerometer does not see it
    acc = np.array([0.0, 0.0, 9.81]) + 0.02 * rng.normal(size=(3000, 3))
    rests = find_rests(Recording(np.arange(3000) / 100.0, gyr=gyr, acc=acc))
    assert [(rest.start < 1000, rest.stop <= 1000) for rest in rests] == [(True, True), (False, False)]
    assert rests[1].start >= 1500


def test_a_gap_in_time_ends_a_rest() -> None:
    n = 1000
    time = np.arange(n) / 100.0
    time[500:] += 60.0
    recording = Recording(time, gyr=1e-3 * RNG(4).normal(size=(n, 3)))
    rests = find_rests(recording)
    assert len(rests) == 2
    assert max(rest.duration for rest in rests) < 5.1


def test_missing_samples_do_not_matter() -> None:
    recording = positions_recording(directions(RNG(5), 4))
    acc = np.array(recording.acc)
    acc[np.arange(len(acc)) % 4 != 0] = np.nan  # a quarter of the gyroscope's rate
    assert len(find_rests(Recording(recording.time, gyr=recording.gyr, acc=acc))) == 4


def test_thresholds_and_shortest_rest() -> None:
    recording = positions_recording(directions(RNG(6), 3))
    assert find_rests(recording, min_duration=5.0) == ()
    assert find_rests(recording, gyr_std=1e-5) == ()
    assert find_rests(recording[:20]) == ()
    with pytest.raises(InputError, match="min_duration"):
        find_rests(recording, min_duration=0.0)
    with pytest.raises(InputError, match="run backwards"):
        find_rests(Recording(recording.time[::-1], acc=recording.acc))


def test_noise_density_of_white_noise_and_of_equal_samples() -> None:
    sigma, rate = 0.03, 100.0
    recording = Recording(np.arange(20_000) / rate, acc=[0.0, 0.0, 9.81] + sigma * RNG(7).normal(size=(20_000, 3)))
    rests = tuple(find_rests(recording[k : k + 1000])[0] for k in range(0, 20_000, 1000))
    pairs = [(recording[1000 * k : 1000 * (k + 1)], (rest,)) for k, rest in enumerate(rests)]
    # σ²/rate, known to √(2 / (20 rests · 7 · 3 axes)) = 7 %
    assert noise_density(pairs, "acc") == pytest.approx(sigma**2 / rate, rel=0.25)
    # a sensor that always shows one of two values, 0.1 apart, is not known better than 0.1/√12
    coarse = Recording(
        np.arange(400) / rate, acc=np.tile([0.0, 0.0, 9.8], (400, 1)) + 0.1 * (np.arange(400) == 200)[:, None]
    )
    rest = find_rests(coarse, acc_std=1.0)
    assert noise_density([(coarse, rest)], "acc") >= 0.1**2 / 12.0 * rest[0].duration * 0.999
