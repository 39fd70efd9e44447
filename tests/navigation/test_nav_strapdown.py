"""Strapdown integration against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown.errors import InputError
from northdown.navigation import integrate, strapdown
from northdown.simulation import AboutAxis, Motion, Shaking, measure, rest, swing

G = 9.80665
UP = {"NED": np.array([0.0, 0.0, -1.0]), "ENU": np.array([0.0, 0.0, 1.0]), "NWU": np.array([0.0, 0.0, 1.0])}


def held(rotation: Rotation, acceleration: np.ndarray, time: np.ndarray, frame: str = "NED"):
    """Recording of a body in one attitude with a given acceleration (N, 3) in the navigation frame."""
    force = rotation.inv().apply(acceleration + G * UP[frame])
    recording = nd.Recording(time, np.zeros_like(force), force, frame=frame)
    turns = Rotation.concatenate([rotation] * len(time))
    return recording, nd.Orientation.from_rotation(time, turns, frame)


@pytest.mark.parametrize("frame", UP)
def test_constant_and_linear_acceleration_are_exact_at_any_steps(frame):
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.001, 0.09, 400))
    t = (time - time[0])[:, None]
    a0, a1, v0, p0 = rng.normal(size=(4, 3))
    recording, orientation = held(Rotation.random(rng=rng), a0 + a1 * t, time, frame)
    found = integrate(recording, orientation, velocity=v0, position=p0)
    # rounding only: 400 sums of numbers up to 1e4 m
    assert np.allclose(found.velocity, v0 + a0 * t + a1 * t**2 / 2, rtol=0, atol=1e-9)
    assert np.allclose(found.position, p0 + v0 * t + a0 * t**2 / 2 + a1 * t**3 / 6, rtol=0, atol=1e-8)
    assert found.frame == frame


@pytest.mark.parametrize("frame", UP)
def test_free_fall(frame):
    time = np.arange(201) / 100
    recording = nd.Recording(time, np.zeros((201, 3)), np.zeros((201, 3)), frame=frame)
    found = integrate(recording, nd.Orientation(time, np.tile([1.0, 0, 0, 0], (201, 1)), frame))
    assert np.allclose(found.height, -0.5 * G * time**2, rtol=0, atol=1e-10)
    assert found.distance() == pytest.approx(0.5 * G * 4.0)
    assert found.closure(horizontal=True) == 0.0


def circle(rate: float, seconds: float = 4.0, turn: float = 1.3, radius: float = 2.0):
    """Body that points along a horizontal circle, turning at `turn` rad/s; position in NED from the centre."""
    time = np.arange(round(seconds * rate) + 1) / rate
    angle = turn * time
    gyr = np.tile([0.0, 0.0, turn], (len(time), 1))
    acc = np.tile([0.0, radius * turn**2, -G], (len(time), 1))  # towards the centre, which is on the right
    place = radius * np.column_stack([np.sin(angle), -np.cos(angle), 0 * angle])
    return nd.Recording(time, gyr, acc), place, np.array([radius * turn, 0.0, 0.0])


def test_circle_is_of_second_order():
    errors = []
    for rate in (25.0, 50.0, 100.0, 200.0):
        recording, place, velocity = circle(rate)
        found = strapdown(recording, initial=Rotation.identity(), velocity=velocity, position=place[0])
        errors.append(np.abs(found.position - place).max())
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.abs(order - 2.0).max() < 0.05
    assert errors[-1] < 1e-4  # m


def test_turning_and_shaking_together_do_not_drift():
    # Sculling: roll θ sin 2πft with a shift of −a sin 2πft / (2πf)² across it. Body axes averaged over one shake
    # would see the acceleration ½ θ a, 0.3 m/s² here.
    f, theta, a = 5.0, 0.06, 10.0
    turning = AboutAxis(Rotation.identity(), (1.0, 0.0, 0.0), swing(theta, f))
    motion = Motion(turning, Shaking((0.0, -a / (2 * np.pi * f) ** 2, 0.0), f), 0.0, 10.0)
    found, truth = {}, motion.at(motion.times(200.0))
    for rate in (200.0, 400.0):
        state = motion.at(motion.times(rate))
        recording = measure(motion, rate=rate)
        trajectory = strapdown(recording, initial=state.rotation[0], velocity=state.velocity[0])
        found[rate] = np.abs(trajectory.velocity - state.velocity)[-1].max()
    assert np.abs(truth.velocity).max() > 0.3
    assert found[200.0] < 0.01 * (0.5 * theta * a * 10.0)  # 1 % of what sculling would leave after 10 s
    assert found[400.0] < 0.3 * found[200.0] + 1e-9  # second order


def test_bias_of_accelerometer_and_gyroscope_at_rest():
    b, w, seconds = 0.05, 1e-4, 100.0
    recording = measure(rest(seconds), rate=50.0)
    time = recording.time
    moved = nd.Recording(time, recording.gyr, recording.acc + np.array([b, 0.0, 0.0]))
    found = strapdown(moved, initial=Rotation.identity())
    assert np.allclose(found.position, 0.5 * b * time[:, None] ** 2 * [1, 0, 0], atol=1e-8)
    # pitching at w leaves f_n = g (−sin wt, 0, −cos wt): north −g (t/w − sin(wt)/w²)
    turned = nd.Recording(time, recording.gyr + np.array([0.0, w, 0.0]), recording.acc)
    found = strapdown(turned, initial=Rotation.identity())
    north = -G * (time / w - np.sin(w * time) / w**2)
    assert found.position[-1, 0] == pytest.approx(north[-1], rel=1e-4)
    assert north[-1] == pytest.approx(-G * w * seconds**3 / 6, rel=1e-4)


def test_agrees_with_a_differential_equation_solver():
    # second implementation: SciPy's DOP853 on q, v, p with smooth rate and specific force
    def rate(t):
        return np.array([0.9 * np.sin(2 * t), 0.7 * np.cos(3 * t), 1.1 * np.sin(t + 1)])

    def force(t):
        return np.array([2.0 * np.cos(t), 3.0 * np.sin(2 * t), -G + np.sin(5 * t)])

    def slope(t, y):
        x, yy, z, w = q = y[:4]
        p, r, s = rate(t)
        dq = 0.5 * np.array(
            [w * p + yy * s - z * r, w * r + z * p - x * s, w * s + x * r - yy * p, -np.dot(q[:3], [p, r, s])]
        )
        return np.concatenate([dq, Rotation.from_quat(q).apply(force(t)) + np.array([0, 0, G]), y[4:7]])

    time = np.arange(4001) / 1000
    start = Rotation.from_euler("ZYX", [0.4, -0.3, 0.2])
    y = solve_ivp(slope, (0, 4), [*start.as_quat(), *np.zeros(6)], "DOP853", t_eval=time, rtol=1e-11, atol=1e-11).y.T
    turns = Rotation.from_quat(y[:, :4])
    gyr = np.vstack([rate(0.0), 1000 * (turns[:-1].inv() * turns[1:]).as_rotvec()])
    found = strapdown(nd.Recording(time, gyr, np.array([force(t) for t in time])), initial=start)
    assert np.abs(found.velocity - y[:, 4:7]).max() < 2e-5  # m/s; Δt²/12 · jerk of some 30 m/s³
    assert np.abs(found.position - y[:, 7:]).max() < 2e-5


def test_frames_agree():
    recording, _, velocity = circle(50.0)
    ned = strapdown(recording, initial=Rotation.identity(), velocity=velocity)
    turn = nd.frames.rotation_between("NED", "ENU")
    enu = strapdown(recording, frame="ENU", initial=turn, velocity=turn.apply(velocity))
    assert np.allclose(ned.to_frame("ENU").position, enu.position, atol=1e-9)
    assert np.allclose(ned.height, enu.height, atol=1e-9)


def test_slower_accelerometer_is_interpolated():
    recording, place, velocity = circle(200.0)
    acc = recording.acc.copy()
    acc[1::2] = np.nan
    acc[-3:] = np.nan
    found = strapdown(
        nd.Recording(recording.time, recording.gyr, acc),
        initial=Rotation.identity(),
        velocity=velocity,
        position=place[0],
    )
    assert np.abs(found.position - place).max() < 2e-3  # m; the last three samples hold 3.4 m/s² for 15 ms


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**31), st.floats(0.0, 0.3))
def test_turning_everything_turns_the_path(seed, gap):
    """Independence of heading and mounting: law of vectors."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.005, 0.02, 50))
    turns = Rotation.from_rotvec(np.cumsum(0.1 * rng.normal(size=(50, 3)), axis=0))
    acc = rng.normal(size=(50, 3)) * 5
    acc[rng.uniform(size=50) < gap] = np.nan
    acc[0] = 1.0
    plain = integrate(nd.Recording(time, acc=acc), nd.Orientation.from_rotation(time, turns), max_gap=1.0)
    heading, mount = Rotation.from_rotvec([0, 0, rng.uniform(-3, 3)]), Rotation.random(rng=rng)
    other = integrate(
        nd.Recording(time, acc=mount.apply(acc)),
        nd.Orientation.from_rotation(time, heading * turns * mount.inv()),
        max_gap=1.0,
    )
    assert np.allclose(other.position, heading.apply(plain.position), atol=1e-9)


def test_mistakes_are_told():
    recording, orientation = held(Rotation.identity(), np.zeros((50, 3)), np.arange(50) / 50)
    with pytest.raises(InputError, match="expected acc for navigation, got no acc"):
        integrate(nd.Recording(recording.time, recording.gyr), orientation)
    with pytest.raises(InputError, match="no gyr in the recording"):
        strapdown(nd.Recording(recording.time, acc=recording.acc))
    silent = recording.acc.copy()
    silent[10:20] = np.nan
    with pytest.raises(
        InputError, match=r"gaps of at most 0.1 s, got 0.22 s without acc, at sample 10; .* max_gap=0.22"
    ):
        integrate(nd.Recording(recording.time, acc=silent), orientation)
    jump = recording.time + 5.0 * (recording.time > 0.5)
    with pytest.raises(InputError, match="gaps of at most"):
        integrate(nd.Recording(jump, acc=recording.acc), nd.Orientation(jump, orientation.quat))
    with pytest.raises(InputError, match="within the orientation's span"):
        integrate(recording, orientation[:10])
    with pytest.raises(InputError, match="orientation as an Orientation"):
        integrate(recording, recording)
    with pytest.raises(InputError, match="a Recording"):
        integrate(orientation, orientation)
    with pytest.raises(InputError, match="three finite numbers for velocity"):
        integrate(recording, orientation, velocity=(1.0, np.nan, 0.0))
    with pytest.raises(InputError, match="two samples or more"):
        integrate(recording[:1], orientation)
    with pytest.raises(InputError, match="run backwards"):
        integrate(recording[np.arange(49, -1, -1)], orientation)
