"""Covariances in rows, and the detection of rest, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from northdown.kernels.rows import WIDTH, add_row, add_three_rows, mirror_row, take_measurement, weigh_rows
from northdown.kernels.stillness import is_quiet, noise_density, quiet_windows

N = 22
COV, GAIN, ERROR = 0, N * WIDTH, (N + 1) * WIDTH


def state(seed):
    """Array with a covariance of 22 states, a gain row and an error row, and the covariance by itself."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(N, N))
    P = root @ root.T
    s = np.zeros((N + 2) * WIDTH)
    s[: N * WIDTH].reshape(N, WIDTH)[:, :N] = P
    return s, P, rng


@pytest.mark.parametrize("seed", range(3))
def test_scalar_measurement(seed):
    s, P, rng = state(seed)
    H, r, y = rng.normal(size=N), 0.7, 0.3
    for j in range(N):
        add_row(s, GAIN, H[j], COV + j * WIDTH)
    take_measurement(s, COV, N, GAIN, ERROR, H @ P @ H + r, y)
    K = P @ H / (H @ P @ H + r)
    # rounding of entries of size 100
    assert np.abs(s[GAIN : GAIN + N] - K).max() < 1e-12
    assert np.abs(s[ERROR : ERROR + N] - K * y).max() < 1e-12
    assert np.abs(s[: N * WIDTH].reshape(N, WIDTH)[:, :N] - (P - np.outer(K, H @ P))).max() < 1e-10
    assert not s[: N * WIDTH].reshape(N, WIDTH)[:, N:].any()


def test_mirror():
    s, _, _ = state(5)
    s[3 * WIDTH : 3 * WIDTH + N] = np.arange(N)
    mirror_row(s, COV, N, 3)
    assert np.array_equal(s[: N * WIDTH].reshape(N, WIDTH)[:, 3], np.arange(N))


def test_sums_of_rows():
    s, P, rng = state(6)
    weights = rng.normal(size=N + 4)
    weigh_rows(s, GAIN, weights, 4, N, COV)
    assert np.abs(s[GAIN : GAIN + N] - weights[4:] @ P).max() < 1e-12  # rounding of entries of size 100
    row = s[GAIN : GAIN + N].copy()
    add_three_rows(s, GAIN, (0.3, -2.0, 1.5), COV + 4 * WIDTH)
    assert np.abs(s[GAIN : GAIN + N] - row - np.array([0.3, -2.0, 1.5]) @ P[4:7]).max() < 1e-12


def test_quiet_windows_are_those_of_a_direct_search():
    rng = np.random.default_rng(3)
    n, window = 600, 0.5
    time = np.cumsum(rng.uniform(0.005, 0.015, n))
    lively = np.abs(np.sin(0.7 * time))[:, None] > 0.5
    gyr = 0.02 + rng.normal(size=(n, 3)) * np.where(lively, 0.5, 1e-3)
    acc = np.array([0.0, 0.0, -9.8]) + rng.normal(size=(n, 3)) * np.where(lively, 2.0, 0.01)
    acc[50:60] = np.nan
    rate = np.empty((n, 4))
    quiet_windows()(time, gyr, acc, window, 0.006**2, 0.15**2, rate)
    step = np.diff(time, prepend=time[0])
    quiet = 0
    for i in range(n):
        inside = (np.abs(time - time[i]) <= 0.5 * window) & ~np.isnan(acc).any(axis=1)
        w, g, a = step[inside], gyr[inside], acc[inside]
        mean = np.average(g, axis=0, weights=w)
        scatter = [np.average((x - np.average(x, axis=0, weights=w)) ** 2, axis=0, weights=w).sum() for x in (g, a)]
        if scatter[0] < 0.006**2 and scatter[1] < 0.15**2:
            quiet += 1
            assert np.abs(rate[i, :3] - mean).max() < 1e-9
            assert rate[i, 3] == pytest.approx(scatter[0] / 3.0 * w.sum() / inside.sum(), rel=1e-5)
        else:
            assert np.isnan(rate[i, :3]).all()
    assert 50 < quiet < n - 50


def test_few_samples_say_nothing():
    block = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -9.8, 96.04, 9.0)
    assert not is_quiet(block, 1.0, 1.0)
    assert is_quiet((*block[:9], 10.0), 1.0, 1.0)
    assert noise_density(block) == 0.0
