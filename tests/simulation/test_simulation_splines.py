"""Spline motions: rests, sizes, waypoints and replays."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.signal import welch
from scipy.spatial.transform import Rotation

from northdown import InputError, Orientation
from northdown.simulation import _quaternions as quaternions
from northdown.simulation import random_motion, replay, waypoints
from northdown.simulation.motion_fit import _sensitivity
from northdown.simulation.motion_spline import SplineTurning, basis, find_intervals


def angles(a: Rotation, b: Rotation) -> np.ndarray:
    return np.atleast_1d((a * b.inv()).magnitude())


def test_quaternion_rows_are_scipy_rotations():
    rng = np.random.default_rng(0)
    v, w = rng.normal(0.0, 1.5, (2, 400, 3))
    v[:4] = [[0, 0, 0], [1e-9, 0, 0], [0, 1e-5, 0], [0, 0, 1e-4]]
    p, q = quaternions.exp(v.T), quaternions.exp(w.T)
    a, b = Rotation.from_rotvec(v), Rotation.from_rotvec(w)
    assert angles(quaternions.to_rotation(p), a).max() < 1e-15
    assert angles(quaternions.to_rotation(quaternions.multiply(p, q)), a * b).max() < 1e-15
    assert np.allclose(quaternions.log(p).T, a.as_rotvec(), atol=1e-14)
    assert np.allclose(quaternions.log(-p).T, a.as_rotvec(), atol=1e-14)
    assert np.allclose(quaternions.rotate(p, w.T).T, a.apply(w), atol=1e-14)
    assert np.allclose(quaternions.rotate_inverse(p, w.T).T, a.inv().apply(w), atol=1e-14)
    product = Rotation.identity()
    for k in range(400):
        product = product * a[k]
    assert angles(quaternions.to_rotation(quaternions.cumulative(p))[-1], product).max() < 1e-13


def test_basis_is_that_of_scipy():
    knots = np.array([0, 0, 0, 0, 0, 0, 1, 1.5, 3, 3, 4, 7, 7, 7, 7, 7, 7.0])
    time = np.linspace(0.0, 7.0, 301)
    i = find_intervals(knots, 5, time)
    matrix = BSpline.design_matrix(time, knots, 5).toarray()
    mine = np.zeros_like(matrix)
    for k, row in enumerate(basis(knots, 5, time, i)):
        mine[np.arange(301), i - 5 + k] = row
    assert np.abs(mine - matrix).max() < 1e-14


def test_turning_about_one_axis_is_the_scalar_spline():
    rng = np.random.default_rng(1)
    knots, steps = np.arange(20.0), rng.normal(0.0, 2.0, 13)  # also turns of more than half a circle
    turning = SplineTurning(knots, np.array([[1.0], [0], [0], [0]]), np.outer([0, 0, 1], steps), rests=False)
    spline = BSpline(knots, np.concatenate([[0.0], np.cumsum(steps)]), 5)
    time = np.linspace(5.0, 14.0, 500)
    quat, rate, acceleration = turning.evaluate(time)
    assert angles(quaternions.to_rotation(quat), Rotation.from_euler("z", spline(time)[:, None])).max() < 1e-13
    assert np.allclose(rate[2], spline.derivative(1)(time), atol=1e-13)
    assert np.allclose(acceleration[2], spline.derivative(2)(time), atol=1e-12)


def test_random_motion_rests_at_both_ends_and_begins_smoothly():
    motion = random_motion(40.0, 2)
    ends = motion.at(np.concatenate([np.linspace(0.0, 5.0, 100), np.linspace(35.0, 40.0, 100)]))
    for name in ("rate", "angular_acceleration", "velocity", "acceleration"):
        assert not getattr(ends, name).any()
    assert angles(ends.rotation[:100], ends.rotation[0]).max() < 1e-15
    # continuous fourth derivatives: what has begun a moment ago is still as small as the third power of the moment
    begun = motion.at([5.0 + 1e-3, 35.0 - 1e-3])
    assert np.abs(begun.angular_acceleration).max() < 1e-6
    assert np.abs(begun.acceleration).max() < 1e-6
    inside = motion.at(np.linspace(10.0, 30.0, 100))
    assert inside.rate.std() > 0.2
    assert inside.acceleration.std() > 0.1


def test_random_motion_has_the_stated_size_and_bandwidth():
    rates, places, spectra = [], [], []
    for seed in range(40):
        motion = random_motion(210.0, seed, turn=0.9, reach=0.4, bandwidth=0.5)
        state = motion.at(np.arange(15.0, 195.0, 0.1))
        rates.append((state.rate**2).mean())
        places.append((state.position**2).mean())
        frequency, power = welch(state.rate, fs=10.0, nperseg=256, axis=0)
        spectra.append(power.mean(axis=1))
    # 40 · 3 · 180 s · 2 · 0.5 Hz independent values: standard error 1/√(2 · 21600) = 0.5 % of a root mean square
    assert np.sqrt(np.mean(rates)) == pytest.approx(0.9, rel=0.02)
    assert np.sqrt(np.mean(places)) == pytest.approx(0.4, rel=0.02)
    power = np.mean(spectra, axis=0)
    low = power[(frequency > 0.03) & (frequency < 0.15)].mean()
    half = frequency[np.argmax((power < 0.5 * low) & (frequency > 0.15))]
    # the window's resolution is 0.06 Hz, and turning in space mixes the axes a little
    assert half == pytest.approx(0.5, abs=0.07)


@pytest.mark.parametrize("duration", [0.5, 1.0, 3.0])
def test_short_random_motions_move_too(duration):
    state = random_motion(duration, 3).at(np.linspace(0.0, duration, 400))
    assert np.abs(state.rate).max() > 0.1
    assert not state.rate[[0, -1]].any()


@pytest.mark.parametrize("spread", [0.3, 0.8, 1.4])
def test_waypoints_are_passed(spread):
    rng = np.random.default_rng(5)
    time = np.cumsum(rng.uniform(0.5, 2.0, 25))
    attitude = [Rotation.identity()]
    for _ in range(24):
        attitude.append(attitude[-1] * Rotation.from_rotvec(rng.normal(0.0, spread, 3)))
    places = rng.normal(size=(25, 3))
    motion = waypoints(time, Rotation.concatenate(attitude), places)
    state = motion.at(time)
    assert angles(state.rotation, Rotation.concatenate(attitude)).max() < 1e-13
    assert np.allclose(state.position, places, atol=1e-13)
    for name in ("rate", "angular_acceleration", "velocity", "acceleration"):
        assert np.abs(getattr(state, name)[[0, -1]]).max() < 1e-12
        # nothing jumps at a waypoint
        before, after = (getattr(motion.at(time[1:-1] + d), name) for d in (-1e-9, 1e-9))
        assert np.abs(before - after).max() < 1e-5


def test_waypoints_of_steady_rotation_keep_steady_inside():
    attitude = Rotation.from_rotvec(np.outer(np.arange(8), [0.0, 0.0, 1.2]))
    state = waypoints(2.0 * np.arange(8.0), attitude).at(np.linspace(2.0, 12.0, 100))
    assert np.allclose(state.rate, [0.0, 0.0, 0.6], atol=1e-13)


def test_the_sensitivity_of_a_spline_is_its_derivative():
    rng = np.random.default_rng(2)
    knots = np.concatenate([np.zeros(5), np.arange(6.0), np.full(5, 5.0)])
    n = len(knots) - 6
    controls = quaternions.exp(rng.normal(0.0, 0.7, (3, n)))
    time = np.linspace(0.0, 5.0, 37)

    def spline(q):
        steps = quaternions.log(quaternions.multiply(quaternions.conjugate(q[:, :-1]), q[:, 1:]))
        return SplineTurning(knots, q[:, :1], steps, rests=False)

    matrix = _sensitivity(spline(controls), time).toarray()
    base = quaternions.conjugate(spline(controls).quat(time))
    for k in range(3 * n):
        delta = np.zeros((3, n))
        delta[k % 3, k // 3] = 1e-6
        moved = spline(quaternions.multiply(quaternions.exp(delta), controls)).quat(time)
        difference = quaternions.log(quaternions.multiply(moved, base)).T.ravel() / 1e-6
        assert np.abs(difference - matrix[:, k]).max() < 1e-5  # first order in 1e-6


def test_replay_follows_and_smooths():
    motion = random_motion(40.0, 6)
    truth = motion.orientation(rate=50.0)
    exact = replay(truth, bandwidth=25.0).orientation(rate=50.0)
    assert angles(exact.rotation, truth.rotation).max() < 1e-12  # one knot for each sample: through all of them
    noise = Rotation.from_rotvec(np.random.default_rng(1).normal(0.0, 0.01, (len(truth), 3)))
    noisy = Orientation.from_rotation(truth.time, noise * truth.rotation)
    smooth = replay(noisy.to_frame("ENU"), bandwidth=2.0)
    error = angles(smooth.orientation(rate=50.0).rotation, truth.rotation)
    # 4 knots/s for 50 samples/s leave √(4/50) of the noise's 0.01 · √3 rad
    assert np.sqrt((error**2).mean()) == pytest.approx(0.01 * np.sqrt(3.0 * 4.0 / 50.0), rel=0.15)
    assert smooth.start == 0.0
    assert smooth.stop == 40.0


def test_replay_bridges_gaps_and_repeated_times():
    truth = random_motion(30.0, 8).orientation(rate=50.0)
    keep = np.ones(len(truth), np.bool_)
    keep[700:740] = False
    holed = truth[keep]
    twice = holed[np.sort(np.concatenate([np.arange(len(holed)), [10, 20]]))]
    motion = replay(twice, bandwidth=10.0)
    assert angles(motion.at(holed.time).rotation, holed.rotation).max() < 1e-5
    # 0.8 s without samples in a motion of 0.25 Hz
    assert angles(motion.at(truth.time).rotation, truth.rotation).max() < 0.05


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: waypoints([0.0], Rotation.identity(1)), "two increasing times or more"),
        (lambda: waypoints([0.0, 0.0], Rotation.identity(2)), "two increasing times or more"),
        (lambda: waypoints([0.0, 1.0], Rotation.identity(3)), "2 attitudes, one for each time, got 3"),
        (lambda: waypoints([0.0, 1.0], Rotation.identity(2), [[0, 0, 0], [0, np.nan, 0]]), "got NaN, at sample 1"),
        (lambda: replay(Orientation(np.arange(3.0), np.tile([1.0, 0, 0, 0], (3, 1)))), "8 samples or more, got 3"),
        (lambda: replay(random_motion(5.0, 0).orientation(rate=20.0), bandwidth=0.0), "bandwidth above 0"),
        (lambda: replay(random_motion(5.0, 0).orientation(rate=20.0)).at(5.1), "times from 0 to 5 s, got 5.1 s"),
    ],
)
def test_mistakes_are_told(make, match):
    with pytest.raises(InputError, match=match):
        make()


def test_attitudes_without_a_smooth_curve_are_an_error_not_a_guess():
    rng = np.random.default_rng(0)
    wild = Rotation.random(30, random_state=rng)
    with pytest.raises(InputError, match=r"a smooth curve can follow.*give more attitudes"):
        replay(Orientation.from_rotation(np.arange(30.0), wild), bandwidth=1.0)
