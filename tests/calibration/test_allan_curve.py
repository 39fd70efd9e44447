"""The Allan deviation against closed forms, against allantools, and its covariance against explicit matrices."""

from __future__ import annotations

import allantools
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import northdown as nd
from northdown.calibration._noise_fit import design_matrix, estimate_covariance
from northdown.calibration.allan import allan_deviation

RATE = 50.0


def white(n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(n, 3))


def freedom(size, n, coefficients):
    """Equivalent degrees of freedom at which a χ² has the relative variance of the estimate."""
    covariance = estimate_covariance(size, [n], np.array(coefficients, float))
    return 2.0 * (design_matrix(size) @ coefficients) ** 2 / np.diag(covariance)


def test_white_noise_falls_with_the_root_of_tau():
    n, density = 200_000, 0.03
    curve = allan_deviation(density * np.sqrt(RATE) * white(n), RATE)
    relative = curve.deviation / (density / np.sqrt(curve.tau[:, None])) - 1.0
    # five standard deviations of the estimate; that of σ is half that of σ²
    limit = 5.0 * np.sqrt(2.0 / freedom(curve.size, n, (0, 1, 0, 0, 0))) / 2.0
    assert (np.abs(relative[:10]) < limit[:10, None]).all()
    assert limit[0] < 0.01


def test_random_walk_rises_with_the_root_of_tau():
    n, walk = 200_000, 0.002
    steps = walk / np.sqrt(RATE) * white(n, 1)
    curve = allan_deviation(np.cumsum(steps, axis=0), RATE)
    m = curve.size.astype(float)
    # exact for a walk in discrete steps; K √(τ/3) for long clusters
    expected = walk * np.sqrt((2.0 * m**2 + 1.0) / (6.0 * m * RATE))
    limit = 5.0 * np.sqrt(2.0 / freedom(curve.size, n, (0, 0, 0, 1, 0))) / 2.0
    relative = curve.deviation / expected[:, None] - 1.0
    assert (np.abs(relative[:10]) < limit[:10, None]).all()
    assert expected[9] == pytest.approx(walk * np.sqrt(curve.tau[9] / 3.0), rel=1e-5)


def test_ramp_is_exact():
    slope = 0.4
    time = np.arange(3000) / RATE
    curve = allan_deviation(np.column_stack([slope * time, -slope * time + 9.8, 2.0 * slope * time]), RATE)
    expected = slope * curve.tau[:, None] / np.sqrt(2.0) * [1.0, 1.0, 2.0]
    np.testing.assert_allclose(curve.deviation, expected, rtol=1e-9)  # rounding of the running sum


def test_counted_angle_of_a_steady_turn():
    # A counter reads an angle that grows by α counts a sample. Its errors are frac(kα), whose covariance at a lag is
    # known: 1/12 − δ(1 − δ)/2 with δ the fraction of the lag times α.
    n, count, alpha = 400_000, 1e-4, (np.sqrt(5.0) - 1.0) / 2.0
    angle = count * np.floor(alpha * np.arange(n + 1))
    curve = allan_deviation(np.column_stack([RATE * np.diff(angle)] * 3), RATE)

    def covariance(lag):
        delta = (lag * alpha) % 1.0
        return 1.0 / 12.0 - delta * (1.0 - delta) / 2.0

    m = curve.size
    square = count**2 * (6.0 / 12.0 - 8.0 * covariance(m) + 2.0 * covariance(2 * m)) / (2.0 * curve.tau**2)
    # a sum over n golden multiples is an integral up to some ln(n)/n
    np.testing.assert_allclose(curve.deviation[:12, 0] ** 2, square[:12], rtol=1e-3)


def test_quantisation_of_a_dithered_angle():
    n, count = 100_000, 1e-4
    rng = np.random.default_rng(4)
    angle = count * np.round(rng.uniform(0.0, 50.0, (n + 1, 3)))
    true = angle + count * rng.uniform(-0.5, 0.5, angle.shape)
    curve = allan_deviation(RATE * np.diff(angle - true, axis=0), RATE)
    expected = np.sqrt(3.0) * count / np.sqrt(12.0) / curve.tau
    np.testing.assert_allclose(curve.deviation[:6], np.tile(expected[:6, None], 3), rtol=0.02)  # about 4σ


@pytest.mark.parametrize(("spacing", "offset"), [("octave", 0.0), ("octave", 9.81), ("decade", 0.0)])
def test_agrees_with_allantools(spacing, offset):
    values = np.cumsum(0.01 * white(20_000, 2), axis=0) + white(20_000, 3) + offset
    curve = allan_deviation(values, RATE, spacing=spacing)
    for axis in range(3):
        tau, deviation, _, count = allantools.oadev(values[:, axis], rate=RATE, data_type="freq", taus=curve.tau)
        np.testing.assert_allclose(curve.tau, tau, rtol=1e-12)
        np.testing.assert_allclose(curve.deviation[:, axis], deviation, rtol=1e-9)
        np.testing.assert_array_equal(curve.count, count)
    assert list(curve.size[:6]) == ([1, 2, 4, 8, 16, 32] if spacing == "octave" else [1, 2, 4, 10, 20, 40])
    assert curve.size[-1] <= 20_000 / 4


def test_missing_rows_split_the_record():
    values = white(4000, 5)
    values[1000:1003, 1] = np.nan  # one missing axis makes a missing sample
    curve = allan_deviation(values, RATE)
    assert list(curve.lengths) == [1000, 2997]
    for k, m in enumerate(curve.size):
        square = []
        for part in (values[:1000, 0], values[1003:, 0]):
            mean = np.convolve(part, np.full(m, 1.0 / m), "valid")
            square.append((mean[m:] - mean[:-m]) ** 2)
        pooled = np.concatenate(square)
        assert curve.count[k] == len(pooled)
        assert curve.deviation[k, 0] == pytest.approx(np.sqrt(pooled.mean() / 2.0), rel=1e-9)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 1000),
    n=st.integers(64, 600),
    scale=st.floats(1e-6, 1e6),
    offset=st.floats(-100.0, 100.0),
)
def test_scale_offset_and_direction_of_time(seed, n, scale, offset):
    values = white(n, seed)
    plain = allan_deviation(values, RATE).deviation
    np.testing.assert_allclose(allan_deviation(-scale * (values + offset), RATE).deviation, scale * plain, rtol=1e-9)
    np.testing.assert_allclose(allan_deviation(values[::-1], RATE).deviation, plain, rtol=1e-9)
    np.testing.assert_allclose(allan_deviation(values[:, [2, 0, 1]], RATE).deviation, plain[:, [2, 0, 1]], rtol=1e-12)


@pytest.mark.parametrize(
    ("values", "rate", "spacing", "message"),
    [
        (np.zeros(100), RATE, "octave", "shape"),
        (np.zeros((3, 100)), RATE, "octave", r"values\.T"),
        (np.full((100, 3), np.inf), RATE, "octave", "at sample 0"),
        (np.full((100, 3), np.nan), RATE, "octave", "without a gap"),
        (np.zeros((7, 3)), RATE, "octave", "got 7 samples"),
        (np.zeros((0, 3)), RATE, "octave", "got 0 samples"),
        (np.ones((100, 3)), 0.0, "octave", "rate"),
        (np.ones((100, 3)), RATE, "thirds", "octave, decade"),
        (1e200 * white(100), RATE, "octave", "unit"),
        ([["a", "b", "c"]] * 100, RATE, "octave", "real numbers"),
    ],
)
def test_bad_input_is_told(values, rate, spacing, message):
    with pytest.raises(nd.InputError, match=message):
        allan_deviation(values, rate, spacing=spacing)


# ---- covariance of the estimates ----


def explicit_covariance(sizes, n, angle_covariance):
    """From the covariance matrix of the angle (n + 1, n + 1), by the law of quadratic forms of Gaussian variables."""
    rows = []
    for m in sizes:
        difference = np.zeros((n - 2 * m + 1, n + 1))
        i = np.arange(n - 2 * m + 1)
        difference[i, i], difference[i, i + m], difference[i, i + 2 * m] = 1.0, -2.0, 1.0
        rows.append(difference)
    result = np.zeros((len(sizes), len(sizes)))
    for a, (m, left) in enumerate(zip(sizes, rows, strict=True)):
        for b, (k, right) in enumerate(zip(sizes, rows, strict=True)):
            c = left @ angle_covariance @ right.T
            result[a, b] = 2.0 * (c**2).sum() / (4.0 * m**2 * k**2 * c.size)
    return result


SIZES, LENGTH = [1, 2, 3, 8, 20, 64, 100], 300


@pytest.mark.parametrize("kind", ["quantisation", "white", "walk", "mixed"])
def test_covariance_against_explicit_matrices(kind):
    grid = np.arange(LENGTH + 1.0)
    low = np.minimum.outer(grid, grid)
    high = np.maximum.outer(grid, grid)
    # a steady turn counted with errors; a walk of the angle; the integral of a walk
    parts = {"quantisation": np.eye(LENGTH + 1), "white": low, "walk": low**2 * (3.0 * high - low) / 6.0}
    c = {
        "quantisation": [1, 0, 0, 0, 0],
        "white": [0, 1, 0, 0, 0],
        "walk": [0, 0, 0, 1, 0],
        "mixed": [2, 1, 0, 0.01, 0],
    }
    coefficients = np.array(c[kind], float)
    angle = sum(x * parts[name] for x, name in zip(coefficients[[0, 1, 3]], parts, strict=True))
    expected = explicit_covariance(SIZES, LENGTH, angle)
    found = estimate_covariance(SIZES, [LENGTH], coefficients)
    spread = np.sqrt(np.diag(expected))
    # sums over long stretches of lags are integrals, good to the inverse square of their length
    np.testing.assert_allclose(found / np.outer(spread, spread), expected / np.outer(spread, spread), atol=1e-3)


@pytest.mark.parametrize(("exponent", "term"), [(0, 1), (-1, 2), (-2, 3)])
def test_degrees_of_freedom_against_greenhall(exponent, term):
    n, sizes = 20_000, [64, 256, 1024, 4096]
    coefficients = np.eye(5)[term]
    expected = [
        allantools.edf_greenhall(alpha=exponent, d=2, m=m, N=n + 1, overlapping=True, modified=False) for m in sizes
    ]
    # his tables and continuous approximations are good to about a percent
    np.testing.assert_allclose(freedom(sizes, n, coefficients), expected, rtol=0.03)


def test_runs_add_up_as_independent():
    one = estimate_covariance([1, 4, 16], [500], np.array([0.0, 1.0, 0.1, 0.0, 0.0]))
    two = estimate_covariance([1, 4, 16], [500, 500], np.array([0.0, 1.0, 0.1, 0.0, 0.0]))
    np.testing.assert_allclose(two, one / 2.0, rtol=1e-12)
