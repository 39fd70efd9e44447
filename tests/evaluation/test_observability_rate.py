"""The body rate as a series: against the motions' own rate and acceleration, closed forms, and differences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from northdown.errors import InputError
from northdown.evaluation.observability_rate import rate_series
from northdown.simulation import (
    AboutAxis,
    FromRate,
    coning,
    k06_sine,
    pitch_sweep,
    random_motion,
    replay,
    rest,
    sines,
    steady,
    tumbling,
    waypoints,
)
from northdown.simulation.motion import Turning

MOTIONS = {
    "rest": rest(8.0).turning,
    "k06": k06_sine(8.0).turning,
    "pitch": pitch_sweep(8.0, frequency=0.5).turning,
    "coning": coning(8.0).turning,
    "tumbling": tumbling(8.0).turning,
    "sines": FromRate(Rotation.identity(), sines((1.0, 2.0, 3.0), (1.0, 0.5, 0.3)), step=0.01),
    "random": random_motion(8.0, 1).turning,
    "replay": replay(random_motion(8.0, 2).orientation(rate=50.0), bandwidth=2.0).turning,
    "waypoints": waypoints([0.0, 2.0, 4.5, 8.0], Rotation.random(4, rng=np.random.default_rng(1))).turning,
}
TIME = np.array([0.517, 1.013, 2.231, 3.377, 4.919, 6.203, 7.411])


@pytest.mark.parametrize("turning", MOTIONS.values(), ids=MOTIONS)
def test_rate_and_acceleration_are_those_of_the_motion(turning):
    found = rate_series(turning, TIME, 3)
    _, rate, acceleration = turning.evaluate(TIME)
    # rad/s, rad/s²: rounding
    np.testing.assert_allclose(found.coefficients[0], rate, atol=1e-13 * max(1.0, np.abs(rate).max()))
    np.testing.assert_allclose(found.coefficients[1], acceleration, atol=1e-12 * max(1.0, np.abs(acceleration).max()))


@pytest.mark.parametrize("turning", MOTIONS.values(), ids=MOTIONS)
def test_higher_derivatives_by_differences(turning):
    h = 1e-3
    found = rate_series(turning, TIME, 3)
    around = [turning.evaluate(TIME + k * h)[2] for k in (-2, -1, 0, 1, 2)]
    second = (around[0] - 8.0 * around[1] + 8.0 * around[3] - around[4]) / (12.0 * h)
    third = (-around[0] + 16.0 * around[1] - 30.0 * around[2] + 16.0 * around[3] - around[4]) / (12.0 * h * h)
    size = max(float(np.abs(second).max()), 1e-6)
    # a fourth-order formula with steps of 1 ms: its own error is some 1e-8; no knot of a spline lies within it
    np.testing.assert_allclose(2.0 * found.coefficients[2], second, atol=1e-6 * size)
    np.testing.assert_allclose(6.0 * found.coefficients[3], third, atol=1e-5 * max(float(np.abs(third).max()), 1e-3))


def test_swing_in_closed_form():
    w = 2.0 * math.pi * 2.0
    amplitude = np.array([[1.0966], [2.1932], [2.1932]])
    found = rate_series(k06_sine(4.0).turning, TIME, 6)
    sine, cosine = np.sin(w * TIME), np.cos(w * TIME)
    for k, wave in enumerate([sine, cosine, -sine, -cosine, sine, cosine, -sine]):
        value = math.factorial(k) * found.coefficients[k]
        # the law carries a phase of −π/2, whose rounding shows where the wave crosses zero
        np.testing.assert_allclose(value, amplitude * wave * w**k, atol=1e-13 * w**k)


def test_at_rest_before_and_after_a_spline():
    turning = random_motion(8.0, 1).turning  # rests for its first and last two seconds
    for c in rate_series(turning, np.array([0.5, 1.9, 6.1, 7.9]), 4).coefficients:
        assert not c.any()


def test_order_zero():
    found = rate_series(MOTIONS["coning"], TIME, 0)
    assert found.order == 0
    assert found.shape == (3, len(TIME))


def test_own_laws():
    def doubled(time):
        angle, rate, acceleration = steady(1.0)(time)
        return 2.0 * angle, 2.0 * rate, 2.0 * acceleration

    found = rate_series(AboutAxis(Rotation.identity(), (0, 0, 1), doubled), TIME, 2)
    np.testing.assert_allclose(found.coefficients[0][2], 2.0)

    class Jerky(Turning):
        def evaluate(self, time):
            return np.ones((4, len(time))), np.floor(time), time

    with pytest.raises(InputError, match=r"Jerky, which cannot be differentiated .*orientation\(rate"):
        rate_series(Jerky(), TIME, 2)
