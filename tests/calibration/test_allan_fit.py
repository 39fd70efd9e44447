"""Coefficients of known noise are found within their stated confidence, and none where the record has none."""

from __future__ import annotations

import numpy as np
import pytest
from allan_noise import make_noise
from scipy.signal import lfilter
from scipy.stats import binom

import northdown as nd
from northdown.calibration._noise_fit import WALK, fit_axis
from northdown.calibration.noise import identify_noise

RATE = 100.0
# °/s/√Hz, °/h and so on of a low-cost gyroscope, in SI
N, B, K = 1.7e-4, 1.2e-4, 4e-5


def record(n, seed, rate=RATE, **coefficients):
    rng = np.random.default_rng(seed)
    gyr = np.column_stack([make_noise(n, rate, rng, **coefficients) for _ in range(3)])
    return nd.Recording(np.arange(n) / rate, gyr=gyr + np.array([0.01, -0.02, 0.005]))


def identify(n, seed, **coefficients):
    return identify_noise(record(n, seed, **coefficients), "gyr", start=0.0)


@pytest.fixture(scope="module")
def mixtures():
    """Fifty-one axes of white noise, bias instability and random walk, 400 s each."""
    results = [identify(40_000, seed, white=N, bias_instability=B, random_walk=K) for seed in range(17)]
    return [model for result in results for model in result.axes]


def covered(coefficients, truth):
    return sum(c.low <= truth <= c.high for c in coefficients)


# Of so many intervals of 95 %, fewer than this hold the truth once in a thousand cases (binomial law).
LEAST = int(binom.ppf(1e-3, 51, 0.95))


@pytest.mark.parametrize(
    ("field", "truth"), [("white_noise", N), ("bias_instability", B), ("random_walk", K), ("quantisation", 0.0)]
)
def test_intervals_hold_the_truth_as_often_as_they_say(mixtures, field, truth):
    assert LEAST == 43
    assert covered([getattr(model, field) for model in mixtures], truth) >= LEAST


def test_errors_are_as_large_as_the_intervals_say(mixtures):
    # from 95 % to one standard deviation; an interval that is far too wide would always hold the truth
    z = [3.92 * (m.white_noise.value - N) / (m.white_noise.high - m.white_noise.low) for m in mixtures]
    assert 0.6 < np.sqrt(np.mean(np.square(z))) < 1.4  # ±4σ of a standard deviation from 51 values


def test_coefficients_of_a_mixture(mixtures):
    white = [m.white_noise.value for m in mixtures]
    flicker = [m.bias_instability.value for m in mixtures if m.bias_instability.value is not None]
    walk = [m.random_walk.value for m in mixtures if m.random_walk.value is not None]
    assert np.mean(white) == pytest.approx(N, rel=0.005)
    assert len(flicker) > 40
    assert np.mean(flicker) == pytest.approx(B, rel=0.1)  # the mean of 40 with 30 % each
    # those that show at all are the larger ones
    assert len(walk) > 25
    assert np.mean(walk) == pytest.approx(K, rel=0.25)
    assert all(m.widening == 1.0 and m.shortest == 1.0 / RATE for m in mixtures)


def test_what_is_not_there_is_not_found():
    models = [m for seed in range(15) for m in identify(20_000, 100 + seed, white=N).axes]
    most = int(binom.ppf(0.999, len(models), 0.05))
    for field in ("quantisation", "bias_instability", "random_walk"):
        found = [getattr(m, field) for m in models]
        assert sum(c.value is not None for c in found) <= most
        assert all((c.value is None) == (c.low == 0.0) and (c.value is None) == bool(c.reason) for c in found)
    assert all(m.white_noise.value == pytest.approx(N, rel=0.1) for m in models)
    assert covered([m.white_noise for m in models], N) >= int(binom.ppf(1e-3, 45, 0.95))


def test_a_longer_record_lowers_the_limit():
    limit = [identify(n, 7, white=N).axes[0].random_walk.high for n in (2_000, 20_000, 200_000)]
    # the limit of K falls about with the square of the length
    assert limit[0] > 5.0 * limit[1] > 25.0 * limit[2]


def test_bias_instability_and_walk_that_cannot_be_told_apart():
    results = [identify(30_000, seed, white=N, bias_instability=0.6 * B, random_walk=0.4 * K) for seed in range(4)]
    reasons = {
        (c.symbol, c.reason) for r in results for m in r.axes for c in m if c.reason.startswith("cannot be told from")
    }
    assert ("K", "cannot be told from bias instability in 300 s") in reasons
    assert ("B", "cannot be told from random walk in 300 s") in reasons


def test_quantisation():
    q = 3e-5
    models = [m for seed in range(4) for m in identify(30_000, seed, white=N, quantisation=q).axes]
    assert np.mean([m.quantisation.value for m in models]) == pytest.approx(q, rel=0.02)
    assert covered([m.quantisation for m in models], q) >= 9
    assert np.mean([m.white_noise.value for m in models]) == pytest.approx(N, rel=0.02)


def test_ramp_when_asked_for():
    slope = 3e-6
    recording = record(40_000, 3, white=N)
    ramped = nd.Recording(recording.time, gyr=recording.gyr + slope * recording.time[:, None])
    plain = identify_noise(ramped, "gyr", start=0.0).axes[0]
    assert plain.ramp.value is None
    assert plain.ramp.reason == "not looked for"
    assert plain.random_walk.value is not None  # the nearest that it was allowed to fit
    for model in identify_noise(ramped, "gyr", start=0.0, ramp=True).axes:
        assert model.ramp.low < slope < model.ramp.high
        assert model.ramp.value == pytest.approx(slope, rel=0.15)


def test_low_pass_filter_is_noticed():
    # a one-pole filter passes the density at low frequencies, and takes nine tenths of the variance of single samples
    models = []
    for seed in range(4):
        recording = record(50_000, seed, white=N)
        filtered = nd.Recording(recording.time, gyr=lfilter([0.2], [1.0, -0.8], recording.gyr, axis=0))
        result = identify_noise(filtered, "gyr", start=0.0)
        assert any("low-pass" in note for note in result.notes)
        models += result.axes
    assert all(1.0 / RATE < m.shortest < 1.0 and m.widening == 1.0 for m in models)
    assert all(m.quantisation.reason == "the shortest cluster times are left out" for m in models)
    assert covered([m.white_noise for m in models], N) >= 9  # of 12; fewer once in 2000 cases
    assert np.mean([m.white_noise.value for m in models]) == pytest.approx(N, rel=0.02)
    # the delay of the filter, 4 samples and half a sample of averaging, takes 3 N² T/(2 τ²)
    expected = N * np.sqrt(4.5 / RATE / 2.0)
    assert np.median([m.lag for m in models]) == pytest.approx(expected, rel=0.3)


def test_vibration_widens_intervals():
    recording = record(50_000, 6, white=N)
    # a beat far slower than one second, which leaving out short clusters does not remove
    shaken = recording.gyr + 4.0 * N * np.sin(2.0 * np.pi * 0.05 * recording.time)[:, None]
    result = identify_noise(nd.Recording(recording.time, gyr=shaken), "gyr", start=0.0)
    assert all(model.widening > 1.5 for model in result.axes)
    assert sum("misses the curve" in note for note in result.notes) == 3


def test_units_of_time_and_signal():
    # the same numbers, said to be sampled four times as fast, or of another size
    base = record(20_000, 8, white=N, bias_instability=4 * B, random_walk=20 * K, quantisation=1e-5)
    result = identify_noise(base, "gyr", start=0.0).axes[0]
    fast = identify_noise(nd.Recording(base.time / 4.0, gyr=base.gyr), "gyr", start=0.0).axes[0]
    large = identify_noise(nd.Recording(base.time, gyr=1000.0 * base.gyr), "gyr", start=0.0).axes[0]
    for k, power in enumerate((1.0, 0.5, 0.0, -0.5, -1.0)):
        np.testing.assert_allclose(fast.fitted[k] * 4.0**power, result.fitted[k], rtol=1e-6)
        np.testing.assert_allclose(large.fitted[k], 1000.0 * result.fitted[k], rtol=1e-6)
    assert result.white_noise.unit == "rad/s/√Hz"


def test_few_degrees_of_freedom_do_not_lower_the_estimate():
    # From clusters of which a record holds a few, χ² is skew and the mean of its logarithm lies below zero; without
    # correction the square of the walk would come out a quarter too small.
    n, size, logs = 1000, np.array([250]), []
    for seed in range(300):
        walk = np.cumsum(np.random.default_rng(seed).normal(size=n))
        angle = np.concatenate([[0.0], np.cumsum(walk)])
        variance = [np.mean((angle[2 * m :] - 2 * angle[m:-m] + angle[: -2 * m]) ** 2) / (2 * m**2) for m in size]
        fit = fit_axis(np.array(variance), size, [n], terms=(WALK,), confidence=0.95, longest_skip=0.0)
        logs.append(np.log(fit.values[WALK]))
    assert abs(np.mean(logs)) < 3.0 * np.std(logs) / np.sqrt(len(logs)) < 0.2


def test_curve_interval_has_the_freedom_of_its_noise():
    # of 3 × 20 estimates of σ at the same τ, all of the same noise, about 19 of 20 hold the truth
    inside = total = 0
    for seed in range(20):
        result = identify(8_000, 200 + seed, white=N)
        truth = N / np.sqrt(result.curve.tau[:, None])
        inside += int(((result.low <= truth) & (truth <= result.high))[[0, 4, 8]].sum())
        total += 9
    assert total == 180
    assert binom.ppf(1e-3, total, 0.95) <= inside <= binom.ppf(0.9999, total, 0.95)
