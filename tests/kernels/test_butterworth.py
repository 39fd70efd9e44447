"""The low-pass filter against SciPy's design, and against its differential equation for steps that vary."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import signal

from northdown.kernels import butterworth

TAU = 3.0  # s
NATURAL = math.sqrt(2.0) / TAU  # rad/s
# the same source, without waiting for a compiler
gains, channel = butterworth.gains.py_func, butterworth.channel.py_func


def run(steps: np.ndarray, u: np.ndarray, start: float = 0.0) -> np.ndarray:
    """Output for inputs u, each after its step (s), from rest at `start`."""
    gain, f, out = (0.0, 0.0, 0.0), (start, 0.0, start), []
    for dt, value in zip(steps, u, strict=True):
        gain, ratio = gains(gain, dt, 0.5 * NATURAL)
        f = channel((False, ratio, gain[1], gain[2]), f, value)
        out.append(f[0])
    return np.array(out)


@pytest.mark.parametrize("dt", [0.0035, 0.05, 2.0])
def test_constant_step_is_scipy(dt):
    u = np.random.default_rng(1).normal(3.0, 1.0, 400)
    b, a = signal.butter(2, NATURAL / (2.0 * math.pi), fs=1.0 / dt)
    expected, _ = signal.lfilter(b, a, u, zi=signal.lfilter_zi(b, a) * 2.5)
    # rounding only; at 0.0035 s the direct form itself loses four digits
    assert np.abs(run(np.full(400, dt), u, 2.5) - expected).max() < 1e-11


def test_varying_steps_follow_the_differential_equation():
    rng = np.random.default_rng(2)
    time = np.cumsum(rng.choice([0.01, 0.02, 0.05], 3000))
    fine = np.arange(0.0, time[-1] + 0.001, 0.001)

    def u(t):
        return np.sin(0.4 * t) + 0.3 * np.sin(2.1 * t)

    a = signal.lti([NATURAL**2], [1.0, math.sqrt(2.0) * NATURAL, NATURAL**2])
    _, expected, _ = signal.lsim(a, u(fine), fine)
    got = run(np.diff(time, prepend=0.0), u(time))
    # the trapezoidal rule errs by (ω Δt)²/12 of the input's fast part, 0.3 · (2.1 · 0.05)²/12 = 3e-4
    assert np.abs(got - np.interp(time, fine, expected)).max() < 3e-4


def test_jitter_of_steps_does_not_change_the_gain():
    rng = np.random.default_rng(3)
    steps = 0.01 * rng.uniform(0.5, 1.5, 4000)
    u = np.where(np.cumsum(steps) > 5.0, 1.0, 0.0)
    after = np.cumsum(steps) - 5.0
    after[after < 0.0] = 0.0
    k = NATURAL / math.sqrt(2.0)
    truth = 1.0 - np.exp(-k * after) * (np.cos(k * after) + np.sin(k * after))
    assert np.abs(run(steps, u) - truth).max() < 0.5 * 0.015 * NATURAL  # the step's time is known to half a step


def test_steps_longer_than_the_time_constant_stay_bounded():
    rng = np.random.default_rng(4)
    steps = 10.0 ** rng.uniform(-3.0, 3.0, 2000)
    out = run(steps, rng.uniform(-1.0, 1.0, 2000))
    assert np.isfinite(out).all()
    assert np.abs(out).max() < 10.0


def test_steps_equal_but_for_rounding_keep_their_gains():
    gain, _ = gains((0.0, 0.0, 0.0), 0.01, 0.3)
    assert gains(gain, 0.01 * (1.0 + 1e-9), 0.3) == (gain, 1.0)
    other, ratio = gains(gain, 0.02, 0.3)
    assert other != gain
    assert ratio == pytest.approx(2.0)


def test_averaging_gives_means():
    u = np.random.default_rng(5).normal(size=10)
    f = (0.0, 0.0, 0.0)
    for k, value in enumerate(u):
        f = channel((True, 1.0, 1.0 / (k + 1), 0.0), f, value)
        assert f == (pytest.approx(u[: k + 1].mean()), 0.0, f[0])
