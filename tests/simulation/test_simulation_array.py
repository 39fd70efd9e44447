"""Simulated arrays of accelerometers against closed forms, differences, statistics, and the other sensors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown.arrays import AccelerometerArray, analyse, coplanar7, ring, tetrahedron12, triads
from northdown.errors import InputError
from northdown.simulation import (
    LOW_COST,
    MOTIONS,
    AboutAxis,
    ArrayErrors,
    Motion,
    Still,
    TriadErrors,
    measure,
    measure_chunks,
    random_motion,
    rest,
    simulate_array,
    swing,
)

G = 9.80665


@pytest.mark.parametrize("rate", [50.0, 6000.0])  # within a block of samples, and three of them
def test_turntable_in_closed_form(rate):
    # about the vertical z at θ = A sin(wt): tangential A θ̈ r, centripetal −θ̇² r, and gravity along −z
    amplitude, frequency, r = 0.8, 0.7, 0.3
    turning = AboutAxis(Rotation.identity(), [0, 0, 1], swing(amplitude, frequency))
    motion = Motion(turning, Still(), 0.0, 3.0)
    array = AccelerometerArray([[r, 0, 0]] * 3, np.eye(3), ["radial", "tangential", "down"])
    got = simulate_array(motion, array, rate=rate)
    w = 2 * math.pi * frequency
    turn, change = amplitude * w * np.cos(w * got.time), -amplitude * w * w * np.sin(w * got.time)
    expected = np.column_stack([-r * turn**2, r * change, np.full(len(got), -G)])
    np.testing.assert_allclose(got.array_acc, expected, rtol=0, atol=1e-12)  # m/s², rounding


@pytest.mark.parametrize("name", MOTIONS)
def test_second_difference_of_where_it_is(name):
    # position of a point of the body in NED, twice differenced; nothing of the simulation's own derivatives
    motion = MOTIONS[name](4.0, 3)
    array = tetrahedron12(0.2)
    recording = simulate_array(motion, array, rate=20.0, mag=None)
    t = recording.time[4:-4]
    h = 1e-3

    def place(time, arm):
        state = motion.at(time)
        return state.position + state.rotation.apply(arm)

    for corner in range(4):
        arm = array.position[3 * corner]
        # central difference of fourth order: error of about h⁴/90 of the sixth derivative
        steps = [place(t + k * h, arm) for k in (-2, -1, 0, 1, 2)]
        second = (-steps[0] + 16 * steps[1] - 30 * steps[2] + 16 * steps[3] - steps[4]) / (12 * h * h)
        force = motion.at(t).rotation.apply(second - [0, 0, G], inverse=True)
        # m/s²: rounding of positions, some 1e-16/h² = 1e-10 each; a few 1e-7 where splines of degree five join
        np.testing.assert_allclose(recording.array_acc[4:-4, 3 * corner : 3 * corner + 3], force, rtol=0, atol=2e-6)


@pytest.mark.parametrize("name", MOTIONS)
def test_angular_acceleration_is_the_derivative_of_the_rate(name):
    motion = MOTIONS[name](6.0, 5)
    t = np.linspace(0.1, 5.9, 80)
    h = 1e-5
    difference = (motion.at(t + h).rate - motion.at(t - h).rate) / (2 * h)
    # rad/s²: third derivative of the rate times h²/6, of a swinging foot 2e4 rad/s⁴, and rounding of 1e-10
    np.testing.assert_allclose(motion.at(t).angular_acceleration, difference, rtol=0, atol=2e-6)


def test_solution_gives_back_rate_of_change_and_force():
    motion = random_motion(12.0, 4)
    array = ring(8, 0.1)
    recording = simulate_array(motion, array, rate=100.0, gyr=TriadErrors())
    state = motion.at(recording.time)
    x, y, z = state.rate.T
    products = np.column_stack([x * x, y * y, z * z, x * y, x * z, y * z])
    got = (recording.array_acc - products @ array.products.T) @ analyse(array).inverse.T
    np.testing.assert_allclose(got[:, :3], state.angular_acceleration, atol=1e-11)
    np.testing.assert_allclose(got[:, 3:], state.specific_force(), atol=1e-12)
    # integrated, it is the gyroscope, whose samples are means of the rate
    turned = np.cumsum(got[:, :3], axis=0) / 100.0
    np.testing.assert_allclose(turned[300:], recording.gyr[300:], atol=0.02)  # rad/s; sums instead of integrals


def test_same_seed_same_bytes_and_others_undisturbed():
    motion, array = random_motion(8.0, 1), coplanar7()
    errors = ArrayErrors.of(LOW_COST.acc, misplacement=1e-3)
    a, b = (simulate_array(motion, array, errors, seed=5) for _ in range(2))
    assert a.array_acc.tobytes() == b.array_acc.tobytes()
    assert a.mag.tobytes() == b.mag.tobytes()
    assert not np.array_equal(a.array_acc, simulate_array(motion, array, errors, seed=6).array_acc)
    # the array leaves the other sensors as they are without it
    alone = measure(motion, LOW_COST, seed=5)
    beside = measure(motion, LOW_COST, seed=5, array=array, array_errors=errors)
    for name in ("gyr", "acc", "mag"):
        assert np.array_equal(getattr(alone, name), getattr(beside, name))
    # one more error does not change the draws of the others
    noisy = simulate_array(motion, array, ArrayErrors(noise=0.01), seed=5).array_acc
    biased = simulate_array(motion, array, ArrayErrors(noise=0.01, offset=0.5), seed=5).array_acc
    np.testing.assert_allclose(biased - noisy, 0.5, atol=1e-12)


def test_what_is_there():
    motion, array = random_motion(5.0), coplanar7()
    both = simulate_array(motion, array, gyr=TriadErrors(), frame="ENU", name="free")
    assert (both.frame, both.name, both.reference.frame) == ("ENU", "free", "ENU")
    assert both.mag is not None
    assert both.gyr is not None
    assert both.acc is None
    alone = simulate_array(motion, array, mag=None)
    assert alone.mag is None
    assert alone.gyr is None
    assert alone.reference.gyr_bias is None
    assert alone.array is array


@pytest.mark.parametrize("chunk", [700, 8192])
def test_chunks_are_the_whole(chunk):
    motion, array = random_motion(100.0, 2), ring(8)
    errors = ArrayErrors(noise=0.01, instability=0.001, walk=1e-4, bandwidth=20.0, dropout=0.1, dropout_length=3.0)
    whole = measure(motion, seed=3, array=array, array_errors=errors)
    parts = list(measure_chunks(motion, seed=3, array=array, array_errors=errors, chunk=chunk))
    assert np.array_equal(np.concatenate([p.array_acc for p in parts]), whole.array_acc, equal_nan=True)


# ---- errors ----


def still(errors, array=None, seconds=100.0, seed=1):
    """Samples of an array at rest, without gravity."""
    array = triads([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]]) if array is None else array
    return simulate_array(rest(seconds), array, errors, seed, rate=100.0, gravity=0.0, mag=None).array_acc


def test_noise_of_each():
    size = np.linspace(0.001, 0.02, 9)
    values = still(ArrayErrors(noise=size))
    # N √f; 10 000 samples: 0.7 % (1 σ)
    np.testing.assert_allclose(values.std(axis=0), 10.0 * size, rtol=0.03)
    correlation = np.corrcoef(values.T) - np.eye(9)
    assert np.abs(correlation).max() < 0.05  # 1 % (1 σ)


def test_constant_errors():
    drawn = np.stack([still(ArrayErrors(bias=0.3), seconds=1.0, seed=s)[0] for s in range(60)])
    assert drawn.std() == pytest.approx(0.3, rel=0.12)  # of 540: 3 % (1 σ)
    array = tetrahedron12(0.1)
    gravity = simulate_array(rest(1.0), array, ArrayErrors(scale=0.1), seed=2, mag=None).array_acc[0]
    factor = gravity[2::3] / -G
    assert np.ptp(factor) > 0.01
    assert np.abs(gravity[[0, 1]]).max() < 1e-12  # of zero


def test_limit_and_resolution():
    values = still(ArrayErrors(noise=0.05, limit=0.8, resolution=0.1), seconds=20.0)
    assert np.abs(values).max() == pytest.approx(0.8)
    np.testing.assert_allclose(values / 0.1, np.round(values / 0.1), atol=1e-9)


def test_dropouts_take_the_whole_row():
    values = still(ArrayErrors(dropout=0.2, dropout_length=4.0))
    gone = np.isnan(values)
    assert np.array_equal(gone.any(axis=1), gone.all(axis=1))
    assert gone.mean() == pytest.approx(0.2, abs=0.04)


def test_misplacement_is_felt_in_turning_only():
    array = tetrahedron12(0.1)
    errors = ArrayErrors(misplacement=0.002)
    assert not still(errors, array, seconds=1.0).any()
    # about the vertical at 10 rad/s: −ω² along x for each metre along x, so samples tell the true positions
    turning = AboutAxis(Rotation.identity(), [0, 0, 1], lambda t: (10 * t, np.full_like(t, 10.0), np.zeros_like(t)))
    found = []
    for seed in range(60):
        got = simulate_array(Motion(turning, Still(), 0.0, 1.0), array, errors, seed, mag=None).array_acc[0]
        found.append(-got[0::3] / 100.0 - array.position[0::3, 0])
    assert np.std(found) == pytest.approx(0.002, rel=0.2)  # of 240: 5 % (1 σ)


def test_misalignment_leans_sensing_directions():
    array = triads([[0, 0, 0]])
    samples = [
        simulate_array(rest(1.0), array, ArrayErrors(misalignment=0.01), seed, mag=None).array_acc[0]
        for seed in range(150)
    ]
    lean = np.stack(samples) / -G
    np.testing.assert_allclose(lean[:, :2].std(axis=0), 0.01, rtol=0.2)  # 6 % (1 σ)
    np.testing.assert_allclose(lean[:, 2], 1.0, atol=1e-3)  # cosines


def test_delay_and_bandwidth():
    turning = AboutAxis(Rotation.identity(), [1, 0, 0], swing(0.5, 1.0))
    motion = Motion(turning, Still(), 0.0, 20.0)
    array = coplanar7(0.1)
    exact = simulate_array(motion, array, rate=100.0).array_acc
    late = simulate_array(motion, array, ArrayErrors(delay=0.05), rate=100.0).array_acc
    np.testing.assert_allclose(late[5:], exact[:-5], atol=1e-9)
    slow = simulate_array(motion, array, ArrayErrors(bandwidth=1.0), rate=100.0).array_acc
    # A3y feels gravity as g sin θ, mostly at 1 Hz, which passes a first-order filter of that bandwidth with 1/√2
    assert slow[500:, 3].std() / exact[500:, 3].std() == pytest.approx(1 / math.sqrt(2), rel=0.05)


def test_errors_like_those_of_a_sensor():
    own = ArrayErrors.of(LOW_COST.acc, misplacement=1e-4)
    assert own.noise == LOW_COST.acc.noise[0]
    assert (own.scale, own.misalignment, own.misplacement) == (LOW_COST.acc.scale, LOW_COST.acc.misalignment, 1e-4)


@pytest.mark.parametrize(
    "values",
    [
        {"noise": -1.0},
        {"noise": [[1.0]]},
        {"bias": np.nan},
        {"offset": np.inf},
        {"misplacement": -1.0},
        {"misalignment": 2.0},
        {"scale": -1.0},
        {"dropout": 1.0},
        {"limit": 0.0},
        {"order": 3},
    ],
)
def test_wrong_errors(values):
    with pytest.raises(InputError):
        ArrayErrors(**values)


def test_wrong_arguments():
    motion = rest(2.0)
    with pytest.raises(InputError, match="an AccelerometerArray"):
        simulate_array(motion, "coplanar7")
    with pytest.raises(InputError, match="noise of 7 accelerometers, got 3"):
        simulate_array(motion, coplanar7(), ArrayErrors(noise=[1.0] * 3))
    with pytest.raises(InputError, match="ArrayErrors"):
        simulate_array(motion, coplanar7(), LOW_COST.acc)
    with pytest.raises(InputError, match="array with array_errors"):
        measure(motion, array_errors=ArrayErrors())
    with pytest.raises(InputError, match="TriadErrors"):
        ArrayErrors.of(LOW_COST)


def test_by_name():
    got = nd.simulate(
        3.0, motion="k06-sine", rate=400.0, array=coplanar7(0.0175), array_errors=ArrayErrors(noise=0.005)
    )
    assert got.array_acc.shape == (1201, 7)
    assert got.gyr is not None
