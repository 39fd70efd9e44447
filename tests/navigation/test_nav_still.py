"""Zero-velocity detectors against the definition, and against the truth of a walk."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown.errors import InputError
from northdown.navigation import AngularRateEnergy, Shoe
from northdown.simulation import LOW_COST, measure, walk

RATE = 200.0


def noise(seed: int, n: int = 300) -> nd.Recording:
    rng = np.random.default_rng(seed)
    shape = rng.uniform(size=(n, 1)) * 10.0 ** rng.uniform(-3, 1)
    gyr, acc = shape * rng.normal(size=(n, 3)), shape * rng.normal(size=(n, 3)) + [1.0, 2.0, 9.4]
    return nd.Recording(np.arange(n) / RATE, gyr, acc)


def by_definition(recording: nd.Recording, width: int, shoe: Shoe) -> np.ndarray:
    values = []
    for first in range(len(recording) - width + 1):
        f, w = recording.acc[first : first + width], recording.gyr[first : first + width]
        mean = f.mean(axis=0)
        around = f - shoe.gravity * mean / np.linalg.norm(mean)
        terms = (around**2).sum(axis=1) / shoe.acc_noise**2 + (w**2).sum(axis=1) / shoe.gyr_noise**2
        values.append(terms.mean())
    before = (width - 1) // 2
    return np.concatenate([[values[0]] * before, values, [values[-1]] * (width - 1 - before)])


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**31), st.integers(3, 40))
def test_statistic_is_the_definition(seed, width):
    recording = noise(seed)
    shoe = Shoe(window=width / RATE, acc_noise=0.3, gyr_noise=0.02)
    truth = by_definition(recording, width, shoe)
    # running sums of up to 1e5 lose some 1e-10 of them, seen against the squares of the noise
    assert np.allclose(shoe.statistic(recording), truth, rtol=1e-6, atol=1e-6)
    assert np.array_equal(shoe.find(recording), shoe.statistic(recording) < shoe.threshold)
    rate = AngularRateEnergy(window=width / RATE, gyr_noise=0.02)
    quiet = nd.Recording(recording.time, recording.gyr, np.tile([0, 0, shoe.gravity], (300, 1)))
    assert np.allclose(rate.statistic(recording), shoe.statistic(quiet), rtol=1e-6, atol=1e-6)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**31))
def test_mounting_does_not_matter(seed):
    recording = noise(seed)
    turned = recording.rotate_body(Rotation.random(rng=seed).as_matrix())
    assert np.allclose(Shoe().statistic(turned), Shoe().statistic(recording), rtol=1e-6, atol=1e-3)


def test_closed_form():
    time = np.arange(100) / RATE
    recording = nd.Recording(time, np.tile([0.0, 0.3, 0.4], (100, 1)), np.tile([0.0, 0.0, 10.0], (100, 1)))
    # rate 0.5 rad/s; gravity is off by 0.2 m/s²
    assert np.allclose(Shoe(acc_noise=0.1, gyr_noise=0.25, gravity=9.8).statistic(recording), 4.0 + 4.0)
    assert np.allclose(AngularRateEnergy(gyr_noise=0.25).statistic(recording), 4.0)


@pytest.mark.parametrize("detector", [Shoe(), AngularRateEnergy()], ids=["shoe", "rate"])
def test_stances_of_a_walk_are_found(detector):
    motion = walk(30.0)
    state = motion.at(motion.times(RATE))
    recording = measure(motion, LOW_COST, 1, rate=RATE)
    truly = (np.linalg.norm(state.velocity, axis=1) < 1e-6) & (np.linalg.norm(state.rate, axis=1) < 1e-6)
    found = detector.find(recording)
    count = [int((np.diff(m.astype(int)) == 1).sum()) for m in (truly, found)]
    assert count[0] == count[1] == 19  # one for each stride, and the end
    assert found[truly].mean() > 0.95
    speed = np.linalg.norm(state.velocity, axis=1)[found & ~truly]
    assert speed.max() < 0.05  # m/s: at the edges of stances only


def test_threshold_and_window_do_what_they_say():
    recording = measure(walk(20.0), LOW_COST, 1, rate=RATE)
    shares = [Shoe(threshold=t).find(recording).mean() for t in (1e2, 1e3, 1e4, 1e5)]
    assert shares == sorted(shares)
    assert shares[0] < shares[-1]
    short, long = (Shoe(window=w).find(recording).mean() for w in (0.05, 0.5))
    assert long < short


def test_short_recordings_and_gaps():
    recording = noise(1)
    assert Shoe(window=100.0).statistic(recording).shape == (300,)
    assert np.ptp(Shoe(window=100.0).statistic(recording)) == 0.0
    assert Shoe().find(recording[:2]).shape == (2,)
    twice = nd.Recording(np.zeros(5), np.zeros((5, 3)), np.tile([0, 0, 9.80665], (5, 1)))
    assert Shoe().find(twice).all()
    gap = recording.gyr.copy()
    gap[5:8] = np.nan
    held = recording.gyr.copy()
    held[5:8] = held[4]
    a, b = (Shoe().statistic(nd.Recording(recording.time, g, recording.acc)) for g in (gap, held))
    assert np.array_equal(a, b)


def test_a_wild_sample_spoils_only_its_windows():
    recording = measure(walk(10.0), LOW_COST, 1, rate=RATE)
    wild = recording.acc.copy()
    wild[100] = 1e150
    before, after = Shoe().statistic(recording), Shoe().statistic(nd.Recording(recording.time, recording.gyr, wild))
    far = np.abs(np.arange(len(recording)) - 100) > 20
    assert np.allclose(after[far], before[far], rtol=1e-6, atol=0.05)  # T; the threshold is 1e4
    assert not Shoe().find(nd.Recording(recording.time, recording.gyr, wild))[100]


def test_mistakes_are_told():
    with pytest.raises(InputError, match="threshold above 0"):
        Shoe(threshold=-1.0)
    with pytest.raises(InputError, match="a number for window"):
        Shoe(window="wide")  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        Shoe(treshold=3.0)  # type: ignore[call-arg]
    with pytest.raises(InputError, match="no gyr in the recording"):
        Shoe().find(nd.Recording(np.arange(9.0), acc=np.zeros((9, 3))))
    with pytest.raises(InputError, match="gaps of at most"):
        Shoe().find(nd.Recording(np.arange(9.0), np.zeros((9, 3)), np.zeros((9, 3))))
