"""The closed-form error budget against integration of noise, and against the Riccati equation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

from northdown.arrays import ErrorBudget, analyse, coplanar7, cube6
from northdown.errors import InputError

N_ACC, RATE = 0.005, 100.0


@pytest.fixture(scope="module")
def budget():
    return ErrorBudget(analyse(coplanar7(0.0175)), N_ACC)


def test_integrated_noise(budget):
    rng = np.random.default_rng(2)
    runs, n = 400, 1000
    noise = N_ACC * np.sqrt(RATE) * rng.standard_normal((runs, n, 7))
    rate = np.cumsum(noise @ budget.analysis.inverse[:3].T, axis=1) / RATE
    angle = np.cumsum(rate, axis=1) / RATE
    # standard deviation over 400 runs: 3.5 % (1 σ) for each of the six figures
    np.testing.assert_allclose(rate[:, -1].std(axis=0), budget.rate_error(n / RATE), rtol=0.12)
    np.testing.assert_allclose(angle[:, -1].std(axis=0), budget.angle_error(n / RATE), rtol=0.12)
    np.testing.assert_allclose(budget.rate_random_walk, N_ACC * budget.analysis.angular_noise)


def test_bias_grows_as_a_ramp():
    # of all axes alike: 1/(√2 a/2) for the cube of six
    found = ErrorBudget(analyse(cube6(0.1)), 1e-9, bias=0.02)
    per_second = 0.02 / (np.sqrt(2) * 0.05)
    np.testing.assert_allclose(found.rate_error(10.0), 10.0 * per_second, rtol=1e-6)
    np.testing.assert_allclose(found.angle_error(10.0), 50.0 * per_second, rtol=1e-6)


def test_equal_gyroscope(budget):
    t = 7.0
    # an angle random walk N gives N √t
    np.testing.assert_allclose(budget.equal_gyro_noise(t) * np.sqrt(t), budget.angle_error(t))
    n = float(budget.equal_gyro_noise(t)[0])
    assert budget.equal_time(n)[0] == pytest.approx(t)


def test_aided_by_a_measured_angle_is_the_riccati_solution(budget):
    r = 5.2e-4
    for k, angle, rate, equal in zip(
        budget.rate_random_walk,
        budget.aided_angle(r),
        budget.aided_rate(r),
        budget.equal_aided_gyro_noise(r),
        strict=True,
    ):
        f, h = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[1.0, 0.0]])
        p = solve_continuous_are(f.T, h.T, np.diag([0.0, k * k]), np.array([[r * r]]))
        np.testing.assert_allclose(np.sqrt(np.diag(p)), [angle, rate], rtol=1e-6)
        one = solve_continuous_are(np.zeros((1, 1)), np.ones((1, 1)), [[equal**2]], [[r * r]])
        assert np.sqrt(one[0, 0]) == pytest.approx(angle)


def test_k06_s_printed_rate_sigma(budget):
    # K06 tables 4.2 and 4.5 (at rest): ωx 0.0489 to 0.0511 rad/s; roll measured to 0.594° at 400 Hz (table 4.14).
    # A filter of the whole state is not one of a single axis: 30 %
    r = np.deg2rad(0.594) / np.sqrt(400.0)
    assert budget.aided_rate(r)[0] == pytest.approx(0.05, rel=0.3)


def test_words_and_mistakes(budget):
    text = budget.summary()
    assert text.count("\n") == 3
    assert "0.233" in text
    for make in (
        lambda: ErrorBudget(budget.analysis, 0.0),
        lambda: ErrorBudget(budget.analysis, 0.1, bias=-1.0),
        lambda: ErrorBudget("a", 0.1),
        lambda: budget.equal_gyro_noise(0.0),
        lambda: budget.equal_time(-1.0),
        lambda: budget.aided_rate(np.nan),
    ):
        with pytest.raises(InputError):
            make()
