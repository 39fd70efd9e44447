"""Integrators against the closed form and their orders of convergence."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from northdown.kernels import strapdown

RATE = (0.4, -1.1, 0.8)
START = (0.5, -0.5, 0.5, 0.5)


def integrate(integrator, n, total=1.0):
    q = START
    for _ in range(n):
        q = strapdown.step(strapdown.code(integrator), q, RATE, total / n)
    return np.array(q)


def truth(total=1.0):
    return Rotation.from_quat(np.roll(START, -1)) * Rotation.from_rotvec(np.multiply(RATE, total))


def error(q):
    return (Rotation.from_quat(np.roll(q, -1)) * truth().inv()).magnitude()


def test_closed_form_is_exact_at_any_step():
    for n in (1, 7, 100):
        assert error(integrate("closed-form", n)) < 1e-14 * n  # rad: rounding of each step


@pytest.mark.parametrize(("integrator", "order"), [("first-order", 2), ("rk4", 4)])
def test_order_of_convergence(integrator, order):
    # The renormalised Euler step's first error term lies along q, so its angle converges with the square.
    ratio = error(integrate(integrator, 20)) / error(integrate(integrator, 40))
    assert ratio == pytest.approx(2.0**order, rel=0.05)


def test_first_order_step_turns_by_the_arctangent():
    # q + ½ q ⊗ (0, ω) Δt has length √(1 + h²) and turns by 2 atan h, h = ½‖ω‖Δt
    dt = 0.3
    h = 0.5 * dt * math.hypot(*RATE)
    q = strapdown.step(0.0, START, RATE, dt)
    turned = (Rotation.from_quat(np.roll(START, -1)).inv() * Rotation.from_quat(np.roll(q, -1))).magnitude()
    assert turned == pytest.approx(2.0 * math.atan(h), abs=1e-14)


def test_kao_form_lets_the_norm_grow_and_slows_down():
    # ‖q‖² grows by exactly Δt²‖ω‖²/4 a step, because the increment is orthogonal to q
    n, dt = 10_000, 0.01
    q, w = (1.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0)
    for _ in range(n):
        q = strapdown.normalized_rate(q, w, dt)
    assert np.dot(q, q) == pytest.approx(1.0 + n * dt * dt / 4.0, rel=1e-12)
    late = strapdown.normalized_rate(q, w, dt)
    turn = 2.0 * math.atan2(math.hypot(*np.subtract(late, q)), math.hypot(*q))
    # 1/‖q‖ = 1/√1.25 = 0.894 of the true rate: the 10.6 % of the module's docstring
    assert turn / dt == pytest.approx(1.0 / math.sqrt(1.25), abs=1e-4)


def test_codes_are_positions():
    assert [strapdown.code(name) for name in strapdown.INTEGRATORS] == [
        strapdown.FIRST_ORDER,
        strapdown.NORMALIZED_RATE,
        strapdown.RK4,
        strapdown.CLOSED_FORM,
    ]
