"""Simulated noise gives its own coefficients back: Allan deviations of errors and of every preset."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from northdown.simulation import ADXL345, PRESETS, SensorErrors, TriadErrors, measure, rest
from northdown.simulation.imu_errors import FLOOR
from northdown.simulation.imu_errors_noise import Drift


def allan_variance(values: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Overlapping Allan variance of each column; the plain definition."""
    total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values - values.mean(axis=0), axis=0)])
    rows = []
    for m in sizes:
        second = total[2 * m :] - 2.0 * total[m:-m] + total[: -2 * m]
        rows.append((second**2).mean(axis=0) / (2.0 * m * m))
    return np.array(rows)


def fit(values: np.ndarray, rate: float, which: tuple[bool, ...]) -> np.ndarray:
    """N, B and K by least squares of the Allan variance, the mean of all axes; those not in `which` are zero."""
    sizes = np.unique(np.round(np.geomspace(1.0, len(values) // 40, 24)).astype(int))
    variance = allan_variance(values, sizes).mean(axis=1)
    tau = sizes / rate
    terms = np.stack([1.0 / tau, np.full_like(tau, FLOOR**2), tau / 3.0], axis=1)[:, list(which)]
    # relative scatter grows with √τ, as the number of clusters falls
    weight = 1.0 / (variance * np.sqrt(tau))
    found = np.zeros(3)
    found[list(which)] = np.linalg.lstsq(terms * weight[:, None], variance * weight, rcond=None)[0]
    return np.sqrt(np.maximum(found, 0.0))


def samples(errors: TriadErrors, rate: float, duration: float, seed: int = 1) -> np.ndarray:
    recording = measure(rest(duration), SensorErrors(gyr=None, acc=errors, mag=None), seed, rate=rate)
    return recording.acc


def test_flicker_noise_has_a_flat_floor():
    errors = TriadErrors(instability=1.0, correlation=(16.0, 40_000.0))
    values = Drift(errors, 3, 0).at(np.arange(0.0, 600_000.0, 8.0))
    sizes = np.array([10, 30, 80, 150, 250])  # 80 s to 2000 s
    deviation = np.sqrt(allan_variance(values, sizes).mean(axis=1))
    # 900 clusters of 2000 s in three axes: 3 %; the floor itself is flat within 6 %, linear interpolation costs 1 %
    assert deviation == pytest.approx(np.full(5, FLOOR), rel=0.08)


def test_flicker_noise_starts_as_it_goes_on():
    errors = TriadErrors(instability=0.3, correlation=(1.0, 100.0))
    starts = np.array([Drift(errors, seed, 0).at(np.array([0.0, 300.0])) for seed in range(300)])
    # a sum of five processes, 100^(1/4) apart, of B² ln r/π each; a deviation from 900 draws is known to 2.4 %
    size = 0.3 * math.sqrt(5 * math.log(100.0) / 4.0 / math.pi)
    assert starts[:, 0].std() == pytest.approx(size, rel=0.1)
    assert starts[:, 1].std() == pytest.approx(size, rel=0.1)


def test_random_walk_grows_with_the_root_of_time():
    values = np.array([Drift(TriadErrors(walk=0.2), seed, 0).at(np.array([0.0, 1.0, 400.0])) for seed in range(400)])
    assert not values[:, 0].any()
    assert values[:, 1].std() == pytest.approx(0.2, rel=0.08)
    assert values[:, 2].std() == pytest.approx(0.2 * 20.0, rel=0.08)


def test_three_coefficients_at_once():
    n, b, k = 1e-3, 4e-4, 4e-6
    errors = TriadErrors(noise=n, instability=b, walk=k)
    seeds = 10
    found = np.array([fit(samples(errors, 2.0, 200_000.0, s), 2.0, (True, True, True)) for s in range(seeds)])
    for row in found:
        assert row[:2] == pytest.approx([n, b], rel=0.1)
    # K overtakes the floor beyond 13 000 s only, of which there are 15 clusters: that of one recording scatters by
    # 16 % (44 others), so that one in two is within 10 %, and the mean of ten by 5 %
    assert found[:, 2].std(ddof=1) / k == pytest.approx(0.16, abs=0.11)  # 3 σ of a deviation from ten
    assert found[:, 2].mean() == pytest.approx(k, rel=0.1)


def test_drift_is_the_true_bias_of_the_reference():
    errors = TriadErrors(noise=1e-9, instability=1e-3, walk=1e-5, bias=0.01, offset=(0.1, 0.0, 0.0))
    recording = measure(rest(50.0), SensorErrors(gyr=errors), 1)
    assert np.abs(recording.gyr - recording.reference.gyr_bias).max() < 1e-7
    assert recording.reference.gyr_bias.std(axis=0).min() > 1e-5


CASES = [
    pytest.param(getattr(errors, sensor), id=f"{name}-{sensor}")
    for name, errors in PRESETS.items()
    for sensor in ("gyr", "acc", "mag")
    if getattr(errors, sensor) is not None and getattr(errors, sensor).coefficients.any()
]


@pytest.mark.parametrize("errors", CASES)
def test_every_preset_gives_its_own_coefficients_back(errors):
    coefficients = errors.coefficients
    bare = dataclasses.replace(
        errors, bias=0.0, scale=0.0, misalignment=0.0, resolution=0.0, limit=math.inf, rate=None
    )
    rate, duration = 100.0, 400.0
    if coefficients[1].any():
        # 100 clusters of the length at which the floor has long shown itself, and samples at which it does not yet
        crossing = 20.0 * errors.correlation_times[0]
        rate, duration = 20.0 / crossing, 2000.0 * crossing
    values = samples(bare, rate, duration)
    which = tuple(bool(row.any()) for row in coefficients)
    alike = np.ptp(coefficients[0]) == 0.0
    for axes in [[0, 1, 2]] if alike else [[0], [1], [2]]:
        assert fit(values[:, axes], rate, which) == pytest.approx(coefficients[:, axes[0]], rel=0.1)


def gauss_markov_variance(tau: np.ndarray, time: float) -> np.ndarray:
    """Allan variance of a process of variance 1 and exponential correlation, in closed form."""
    x = tau / time
    return 2.0 / x * (1.0 - (3.0 - 4.0 * np.exp(-x) + np.exp(-2.0 * x)) / (2.0 * x))


@pytest.mark.parametrize("errors", [*CASES, TriadErrors(noise=1e-3, instability=2e-3)])
def test_default_flicker_noise_is_neither_too_slow_nor_too_short(errors):
    """White noise and the sum of processes that stands for flicker noise, against N²/τ and the floor."""
    n, b = errors.coefficients[0, 0], errors.coefficients[1, 0]
    if not b:
        return
    shortest, longest = errors.correlation_times
    steps = math.ceil(math.log(longest / shortest) / math.log(4.0))
    times = np.geomspace(shortest, longest, steps + 1)
    size = b * b * math.log(times[1] / times[0]) / math.pi
    tau = np.geomspace(0.01, 1000.0, 60)
    variance = n * n / tau + size * sum(gauss_markov_variance(tau, t) for t in times)
    deviation = np.sqrt(variance / (n * n / tau + (FLOOR * b) ** 2))
    # what is left out at both ends is 2 %, and a little more on an axis that is better than the worst
    assert np.abs(deviation - 1.0).max() < 0.03


def test_quantisation_of_the_coarsest_preset_is_within_a_tenth():
    # 3.9 mg steps and 2.9 mg of noise: the rounding error's variance, a twelfth of the step's square, adds 7 %
    values = samples(dataclasses.replace(ADXL345, bias=0.0, instability=0.0), 100.0, 200.0)
    assert fit(values[:, :2], 100.0, (True, False, False))[0] == pytest.approx(ADXL345.noise[0], rel=0.1)


def test_names_of_presets():
    names = {"k06-high", "k06-medium", "k06-low", "j14", "mpu-9250", "icm-20948", "bmi088", "lsm6dso", "adis16470"}
    assert names <= set(PRESETS)
    deg = math.pi / 180.0
    high = PRESETS["k06-high"]
    # K06 table 4.1: 100 (µg)²/Hz, 1e-9 (°/s)²/Hz, 50 µg, 0.01 °/h
    assert high.acc.noise == pytest.approx([10e-6 * 9.80665] * 3)
    assert high.gyr.noise == pytest.approx([math.sqrt(1e-9) * deg] * 3)
    assert high.acc.bias == pytest.approx([50e-6 * 9.80665] * 3)
    assert high.gyr.bias == pytest.approx([0.01 * deg / 3600.0] * 3)
    grades = [PRESETS[f"k06-{g}"] for g in ("high", "medium", "low")]
    for sensor in ("gyr", "acc"):
        sizes = [getattr(g, sensor).noise[0] for g in grades]
        assert sizes == sorted(sizes)
    # chapter 4: 0.1 m/s² and 0.01 gauss in samples at 400 Hz
    chapter = PRESETS["k06-chapter-4"]
    assert chapter.gyr is None
    assert chapter.acc.noise * 20.0 == pytest.approx([0.1] * 3)
    assert chapter.mag.noise * 20.0 == pytest.approx([1.0] * 3)
    assert PRESETS["j14"].mag.rate == 50.0
