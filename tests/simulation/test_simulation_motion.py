"""Motions: every derivative belongs to the function that it is said to be the derivative of."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from northdown import InputError
from northdown.simulation import (
    AboutAxis,
    FromRate,
    Motion,
    Shaking,
    Still,
    coning,
    free_body,
    k06_sine,
    pitch_sweep,
    random_motion,
    replay,
    rest,
    sines,
    steady,
    tumbling,
    walk,
    waypoints,
)
from northdown.simulation.motion_library import MOTIONS

START = Rotation.from_euler("ZYX", [0.4, 0.2, -0.3])


def way() -> Motion:
    rng = np.random.default_rng(7)
    turns = [Rotation.from_rotvec(rng.normal(0.0, 0.8, 3)) for _ in range(21)]
    attitude = [START]
    for turn in turns:
        attitude.append(attitude[-1] * turn)
    return waypoints(3.0 * np.arange(22), Rotation.concatenate(attitude), rng.normal(size=(22, 3)))


EVERY = {
    "rest": lambda: rest(61.0, attitude=START),
    "k06-sine": lambda: k06_sine(61.0, attitude=START),
    "pitch-sweep": lambda: pitch_sweep(61.0),
    "coning": lambda: coning(61.0, attitude=START),
    "tumbling": lambda: tumbling(61.0, attitude=START),
    "random": lambda: random_motion(61.0, 3),
    "waypoints": way,
    "replay": lambda: replay(random_motion(61.5, 4).orientation(rate=50.0), bandwidth=5.0),
    "sines": lambda: Motion(
        FromRate(START, sines((1.1, 2.2, 2.2), (2.0, 1.7, 2.3), (0.0, 0.3, 0.9)), step=0.005),
        Shaking((0.1, 0.2, 0.05), 1.3),
        0.0,
        61.0,
    ),
    "turntable": lambda: Motion(AboutAxis(START, (1.0, 2.0, 3.0), steady(2.0)), Still((1.0, 2.0, 3.0)), 0.0, 61.0),
}


@pytest.fixture(scope="module", params=list(EVERY))
def motion(request) -> Motion:
    return EVERY[request.param]()


def gauss_legendre(motion: Motion, start: float, step: float, count: int) -> np.ndarray:
    """Matrix (4, 4) that takes the quaternion at `start` to that after `count` steps.

    q̇ = ½ G(ω) q by the implicit Runge–Kutta method of three Gauss nodes, order six.
    """
    root = math.sqrt(15.0)
    nodes = np.array([0.5 - root / 10, 0.5, 0.5 + root / 10])
    a = np.array(
        [
            [5 / 36, 2 / 9 - root / 15, 5 / 36 - root / 30],
            [5 / 36 + root / 24, 2 / 9, 5 / 36 - root / 24],
            [5 / 36 + root / 30, 2 / 9 + root / 15, 5 / 36],
        ]
    )
    time = start + step * np.arange(count)
    slopes = np.zeros((3, count, 4, 4))
    for k, node in enumerate(nodes):
        x, y, z = 0.5 * motion.at(time + node * step).rate.T
        for (i, j), value in {(0, 1): -x, (0, 2): -y, (0, 3): -z, (1, 2): z, (1, 3): -y, (2, 3): x}.items():
            slopes[k, :, i, j], slopes[k, :, j, i] = value, -value
    system, right = np.zeros((count, 12, 12)), np.zeros((count, 12, 4))
    for i in range(3):
        right[:, 4 * i : 4 * i + 4] = slopes[i]
        for j in range(3):
            block = (i == j) * np.eye(4) - step * a[i, j] * slopes[i]
            system[:, 4 * i : 4 * i + 4, 4 * j : 4 * j + 4] = block
    stages = np.linalg.solve(system, right)
    steps = np.eye(4) + step * sum(w * stages[:, 4 * i : 4 * i + 4] for i, w in enumerate((5 / 18, 8 / 18, 5 / 18)))
    while len(steps) > 1:
        if len(steps) % 2:
            steps = np.concatenate([steps, np.eye(4)[None]])
        steps = steps[1::2] @ steps[0::2]
    return steps[0]


def test_rate_integrates_to_the_attitude(motion):
    count, step = 15_000, 0.004
    q = gauss_legendre(motion, motion.start, step, count) @ motion.at(motion.start).quat[0]
    there = motion.at(motion.start + count * step).rotation
    error = (Rotation.from_quat(np.roll(q, -1)) * there.inv()).magnitude()
    # rad; the local error of order six at these rates is 1e-15 a step. FromRate adds 1e-12 a minute of its own.
    assert error < 1e-9


def test_derivatives_agree_with_differences(motion):
    time = np.linspace(motion.start + 0.01, motion.stop - 0.01, 1500)
    h = 1e-4
    far, near, next_, beyond = (motion.at(time + k * h) for k in (-2, -1, 1, 2))
    here = motion.at(time)
    # Of fourth order: h⁴ times the fifth derivative is under 1e-9 with 15 rad/s; rounding 1e-16/h.
    for name, derivative in (
        ("rate", "angular_acceleration"),
        ("position", "velocity"),
        ("velocity", "acceleration"),
    ):
        values = [getattr(k, name) for k in (far, near, next_, beyond)]
        difference = (values[0] - 8.0 * values[1] + 8.0 * values[2] - values[3]) / (12.0 * h)
        # splines of degree five have jumps in their fifth derivative; those through waypoints in their third
        assert np.abs(difference - getattr(here, derivative)).max() < 1e-7 * max(1.0, np.abs(difference).max())


def test_any_order_of_times_gives_the_same(motion):
    time = np.linspace(motion.start, motion.stop, 300)
    shuffled = np.random.default_rng(0).permutation(300)
    whole, part = motion.at(time), motion.at(time[shuffled])
    assert np.array_equal(whole.quat[shuffled], part.quat)
    assert np.array_equal(whole.acceleration[shuffled], part.acceleration)
    assert np.abs(np.linalg.norm(whole.quat, axis=1) - 1.0).max() < 1e-14


def test_k06_sine_has_the_rate_of_the_thesis():
    time = np.linspace(0.0, 2.0, 801)
    expected = np.outer(np.sin(2.0 * np.pi * 2.0 * time), [1.0966, 2.1932, 2.1932])
    assert np.allclose(k06_sine(2.0).at(time).rate, expected, atol=1e-14)
    assert k06_sine().at(0.0).rotation.magnitude().max() == 0.0


def test_fixed_axis_agrees_with_the_integrated_rate():
    amplitude = (1.0966, 2.1932, 2.1932)
    integrated = FromRate(START, sines(amplitude, (2.0, 2.0, 2.0)), step=0.005)
    time = np.linspace(0.0, 60.0, 999)
    closed = k06_sine(60.0, attitude=START).at(time).rotation
    other = Motion(integrated, Still(), 0.0, 60.0).at(time).rotation
    assert (closed * other.inv()).magnitude().max() < 1e-11  # rad; 1e-14 a step at w · step = 0.06


def test_rates_asked_late_first_are_those_asked_in_order():
    make = lambda: FromRate(START, sines((1.0, 2.0, 3.0), (0.5, 0.7, 0.9)), step=0.004)  # noqa: E731
    late, early = make(), make()
    time = np.linspace(0.0, 50.0, 500)
    last = late.quat(time[-1:])
    assert np.array_equal(early.quat(time)[:, -1:], last)
    assert np.array_equal(early.quat(time), late.quat(time))


def test_coning_goes_round_a_cone():
    motion = coning(10.0, half_angle=0.3, frequency=2.0)
    time = np.linspace(0.0, 10.0, 777)
    axis = motion.at(time).rotation.apply([0.0, 0.0, 1.0])
    assert np.allclose(np.arccos(axis[:, 2]), 0.3, atol=1e-12)
    heading = np.unwrap(np.arctan2(axis[:, 1], axis[:, 0]))
    assert np.ptp(heading) == pytest.approx(2.0 * np.pi * 20.0, abs=1e-9)
    # the solid angle of the cone, which the rate about z must make up for in each turn
    assert motion.at(time).rate[:, 2].mean() == pytest.approx(-2.0 * np.pi * 2.0 * (1.0 - math.cos(0.3)))


def test_tumbling_keeps_angular_momentum_and_energy():
    motion = tumbling(60.0, attitude=START)
    state = motion.at(np.linspace(0.0, 60.0, 4001))
    inertia = np.array([1.0, 2.0, 3.0])
    momentum = state.rotation.apply(inertia * state.rate)
    assert np.abs(momentum - momentum[0]).max() < 1e-10
    energy = (inertia * state.rate**2).sum(axis=1)
    assert np.ptp(energy) < 1e-12 * energy[0]
    assert state.rotation.as_matrix()[:, 0, 0].min() < -0.9  # it does turn over


def test_pitch_sweep_passes_both_poles():
    x = pitch_sweep(20.0).at(np.linspace(0.0, 20.0, 2001)).rotation.apply([1.0, 0.0, 0.0])
    assert x[:, 2].min() < -0.9999
    assert x[:, 2].max() > 0.9999


@pytest.mark.parametrize("name", MOTIONS)
def test_named_motions(name):
    motion = MOTIONS[name](12.0, 5)
    assert motion.name == name
    assert motion.duration == 12.0
    assert np.array_equal(motion.at(3.0).quat, MOTIONS[name](12.0, 5).at(3.0).quat)
    assert (name == "random") == (not np.array_equal(motion.at(6.0).quat, MOTIONS[name](12.0, 6).at(6.0).quat))


@given(
    fast=st.floats(0.1, 5.0), slow=st.floats(-0.9, 0.9), inertia=st.lists(st.floats(0.2, 2.0), min_size=3, max_size=3)
)
@settings(max_examples=30, deadline=None)
def test_free_body_obeys_euler(fast, slow, inertia):
    i = np.cumsum(inertia)
    limit = fast * math.sqrt(i[2] * (i[2] - i[1]) / (i[0] * (i[1] - i[0])))
    rate, change = free_body(i, slow * limit, fast)(np.linspace(0.0, 3.0, 50))
    torque = i[:, None] * change + np.cross(rate.T, (i[:, None] * rate).T).T
    assert np.abs(torque).max() < 1e-9 * max(1.0, (rate**2).max() * i.max())


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: rest(0.0), "duration above 0 s"),
        (lambda: rest(5.0, attitude=Rotation.identity(2)), "one SciPy Rotation"),
        (lambda: coning(5.0, half_angle=4.0), "half_angle between"),
        (lambda: AboutAxis(START, (0.0, 0.0, 0.0), steady(1.0)), "axis with a direction"),
        (lambda: free_body((1.0, 3.0, 2.0), 1.0, 1.0), "three increasing moments"),
        (lambda: free_body((1.0, 2.0, 3.0), 9.0, 1.0), "goes round its z axis.*raise rate_z"),
        (
            lambda: Motion(FromRate(START, sines((1, 1, 1), (1, 1, 1)), step=0.1), Still(), -1.0, 2.0),
            "from 0 to inf s",
        ),
        (lambda: rest(5.0).at([1.0, np.nan]), "times from -inf to inf s, got nan s, at sample 1"),
        (lambda: Shaking((0.0, 0.0, np.inf), 1.0), "three finite numbers for amplitude"),
        (lambda: random_motion(5.0, -1), "whole number of 0 or more"),
        (lambda: random_motion(5.0, 1.5), "whole number of 0 or more"),
        (lambda: random_motion(float("nan")), "duration"),
    ],
)
def test_mistakes_are_told(make, match):
    with pytest.raises(InputError, match=match):
        make()


def test_walk_comes_back_and_stands_between_its_steps():
    motion = walk(30.0, stride=1.2, period=1.1)
    state = motion.at(motion.times(500.0))
    still = (np.linalg.norm(state.velocity, axis=1) < 1e-12) & (np.linalg.norm(state.rate, axis=1) < 1e-12)
    stances = np.flatnonzero(np.diff(still.astype(int)) == 1)
    assert len(stances) == 21  # strides of 1.1 s in 24 s
    assert np.allclose(state.position[-1], state.position[0], atol=1e-12)
    steps = np.linalg.norm(np.diff(state.position[stances + 1], axis=0), axis=1)
    assert np.allclose(steps, 2.0 * 1.2 * 21 / (2.0 * np.pi) * np.sin(np.pi / 21))  # chords of the circle
    assert np.abs(state.position[still, 2]).max() < 1e-12
    down = state.rotation[still].apply([0.0, 0.0, 1.0])
    assert np.allclose(down, [0.0, 0.0, 1.0], atol=1e-12)
