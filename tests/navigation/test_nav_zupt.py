"""Zero-velocity aided navigation against truth, statistics, and a dense textbook smoother."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import northdown as nd
from northdown.errors import InputError
from northdown.kernels import navigation as kernel
from northdown.navigation import NavigationNoise, Shoe, integrate, navigate, strapdown, zupt
from northdown.orientation import Flag
from northdown.simulation import SensorErrors, TriadErrors, measure, rest, walk

RATE = 200.0
ERRORS = SensorErrors(gyr=TriadErrors(noise=3e-4, bias=5e-3), acc=TriadErrors(noise=3e-3, bias=0.05), mag=None)
# what these sensors are; the simulated foot stands perfectly still
KNOWN = NavigationNoise(
    acc_noise=3e-3,
    gyr_noise=3e-4,
    acc_scale=0.0,
    gyr_scale=0.0,
    acc_bias_walk=0.0,
    gyr_bias_walk=0.0,
    still_velocity=3e-4,
    still_rate=1e-4,
    still_time=0.0,
    rest=1e9,
    start_acc_bias=0.05,
    start_gyr_bias=5e-3,
)


@pytest.fixture(scope="module")
def motion():
    return walk(16.0, rest=2.0)


@pytest.fixture(scope="module")
def truth(motion):
    return motion.at(motion.times(RATE))


@pytest.fixture(scope="module")
def still(truth):
    return (np.linalg.norm(truth.velocity, axis=1) < 1e-9) & (np.linalg.norm(truth.rate, axis=1) < 1e-9)


def errors_of(found, truth):
    return {
        "position": (truth.position - found.position, found.position_covariance),
        "velocity": (truth.velocity - found.velocity, found.velocity_covariance),
        "attitude": (
            (truth.rotation * found.orientation.rotation.inv()).as_rotvec(),
            found.orientation.covariance,
        ),
    }


@pytest.mark.parametrize("smooth", [False, True], ids=["filter", "smoother"])
def test_errors_are_what_the_covariance_says(motion, truth, still, smooth):
    """NEES over 40 seeded runs within χ² bounds, at times that lie several strides apart; 3σ coverage per axis."""
    times = [700, 1300, 1900, 2500]
    nees = {key: [] for key in ("position", "velocity", "attitude")}
    inside = {key: [] for key in nees}
    for seed in range(40):
        found = navigate(measure(motion, ERRORS, seed, rate=RATE), still=still, smooth=smooth, noise=KNOWN)
        for key, (error, cov) in errors_of(found, truth).items():
            e, p = error[times], cov[times]
            nees[key].append(np.einsum("ni,ni->n", e, np.linalg.solve(p, e[:, :, None])[:, :, 0]))
            inside[key].append(np.abs(e) <= 3.0 * np.sqrt(np.diagonal(p, axis1=1, axis2=2)))
    # at each time 40 independent runs of three degrees of freedom: 99.9 % two-sided, as there are 12 such tests
    low, high = chi2.ppf([0.0005, 0.9995], 3 * 40) / 40
    for key in nees:
        mean = np.mean(nees[key], axis=0)
        # conservative where the pseudo-measurement is perfect: its own noise counts, but did not happen
        assert (mean < high).all(), (key, mean)
        assert np.mean(inside[key]) > 0.985, key
    assert (np.mean(nees["position"], axis=0) > low).all()
    assert (np.mean(nees["attitude"], axis=0) > low).all()


def test_biases_are_found_and_both_ways_of_stillness_agree(motion, truth, still):
    recording = measure(motion, ERRORS, 5, rate=RATE)
    biased = replace(recording, acc=recording.acc + np.array([0.0, 0.0, 0.3]))
    found = navigate(biased, noise=replace(KNOWN, start_acc_bias=0.3, rest=1.0))
    assert found.orientation.gyr_bias[-1] == pytest.approx(recording.reference.gyr_bias[-1], abs=1e-3)
    # the vertical bias shows at rest, as gravity of a wrong size
    assert found.acc_bias[-1, 2] == pytest.approx(0.3, abs=0.15)
    known = navigate(biased, still=still, noise=replace(KNOWN, start_acc_bias=0.3, rest=1.0))
    assert np.abs(found.position - known.position).max() < 0.02  # m in 14 m
    assert np.abs(known.position - truth.position).max() < 0.1


def test_error_free_sensors_give_the_walk_back(motion, truth):
    found = navigate(measure(motion, rate=RATE))
    assert np.abs(found.position - truth.position).max() < 0.005  # m; the detector's edges, mm/s for some 50 ms
    assert found.closure(horizontal=True) < 0.005
    assert found.distance(horizontal=True) == pytest.approx(9 * 1.4, rel=0.01)


def test_zero_velocity_is_what_keeps_it(motion, truth):
    recording = measure(motion, ERRORS, 3, rate=RATE)
    aided, drifting = navigate(recording), navigate(recording, zero_velocity=False)
    e = [np.linalg.norm(t.position - truth.position, axis=1)[-1] for t in (aided, drifting)]
    assert e[0] < 0.1 < 3.0 < e[1]  # m


def test_without_zero_velocity_it_is_strapdown(motion):
    recording = measure(motion, ERRORS, 3, rate=RATE)
    start = Rotation.from_euler("ZYX", [0.3, 0.1, -0.2])
    for frame in ("NED", "ENU", "NWU"):
        plain = strapdown(recording, frame=frame, initial=start)
        found = navigate(recording, frame=frame, initial=start, zero_velocity=False)
        assert np.abs(found.position - plain.position).max() < 1e-7  # two implementations, rounding only
        assert found.frame == frame


def test_growth_without_aid_is_the_closed_form():
    # p = ½ b t² + (tilt error) ½ g t² + v₀ t + white noise N² t³/3, all independent
    noise = replace(KNOWN, start_tilt=1e-3, start_velocity=0.02, start_gyr_bias=0.0, gyr_noise=1e-9)
    t = 20.0
    found = navigate(measure(rest(t), rate=100.0), zero_velocity=False, noise=noise)
    terms = [0.02 * t, 0.5 * 0.05 * t**2, 0.5 * noise.gravity * 1e-3 * t**2, noise.acc_noise * np.sqrt(t**3 / 3)]
    assert found.position_sigma[-1, 0] == pytest.approx(np.linalg.norm(terms), rel=2e-3)
    vertical = np.linalg.norm([terms[0], terms[1], terms[3]])
    assert found.position_sigma[-1, 2] == pytest.approx(vertical, rel=2e-3)


def trace_of(recording, still, noise):
    """What the forward kernel writes down, and the arguments it had."""
    n = len(recording)
    state, cov = np.zeros(kernel.N_STATE), noise.covariance(True, False)
    state[0], state[kernel.LAST_TIME] = 1.0, np.nan
    trace = np.empty((n, kernel.N_TRACE))
    stance = zupt._stance(recording.time, still, noise.rest)
    args = (noise.parameters(), recording.time, recording.gyr, recording.acc, stance)
    kernel.forward()(*args, state, cov, trace)
    return trace


def test_smoother_is_the_dense_rauch_tung_striebel_smoother(motion, still):
    """Second implementation: gains P Fᵀ (P⁻)⁻¹ with the transition matrices of the filter."""
    noise = replace(KNOWN, rest=0.5, start_heading=0.1, start_velocity=0.1, acc_bias_walk=1e-3, gyr_bias_walk=1e-4)
    part = slice(250, 900)
    recording = measure(motion, ERRORS, 1, rate=RATE)[part]
    trace = trace_of(recording, still[part], noise)
    found = navigate(recording, still=still[part], noise=noise, initial=Rotation.identity(), smooth=True, frame="NED")
    cov = trace[:, kernel.COVARIANCE :].reshape(-1, 15, 15)
    p = noise.parameters()
    x, s = np.zeros(15), cov[-1]
    for k in range(len(trace) - 2, -1, -1):
        row = trace[k + 1]
        dt, f = row[kernel.STEP], row[kernel.STEP + 1 : kernel.STEP + 4]
        mat = row[kernel.STEP + 4 : kernel.UPDATES].reshape(3, 3).T
        transition = np.eye(15)
        cross = -np.array([[0, -f[2], f[1]], [f[2], 0, -f[0]], [-f[1], f[0], 0]])
        transition[0:3, 3:6] = dt * np.eye(3)
        transition[0:3, 6:9], transition[0:3, 9:12] = 0.5 * dt**2 * cross, -0.5 * dt**2 * mat
        transition[3:6, 6:9], transition[3:6, 9:12] = dt * cross, -dt * mat
        transition[6:9, 12:15] = -dt * mat
        q = np.repeat([0.0, p[1], p[2], p[5], p[6]], 3) * dt
        predicted = transition @ cov[k] @ transition.T + np.diag(q)
        # what the updates of the next sample added to the nominal state belongs to the error before them
        step = np.zeros(15)
        before = predicted.copy()
        for i in range(6):
            weighted, inverse = row[kernel.UPDATES + kernel.N_UPDATE * i :][:2]
            if inverse > 0.0:
                place = 3 + i if i < 3 else 12 + i - 3
                step += before[:, place] * weighted
                before = before - np.outer(before[:, place], before[place]) * inverse
        assert np.allclose(before, cov[k + 1], rtol=1e-6, atol=1e-14)
        gain = np.linalg.solve(predicted, transition @ cov[k]).T
        x = gain @ (x + step)
        s = cov[k] + gain @ (s - predicted) @ gain.T
        if k % 50 == 0:
            assert np.allclose(found.position[k], trace[k, 4:7] + x[0:3], rtol=0, atol=1e-7)
            assert np.allclose(found.velocity[k], trace[k, 7:10] + x[3:6], rtol=0, atol=1e-7)
            assert np.allclose(found.acc_bias[k], trace[k, 10:13] + x[9:12], rtol=0, atol=1e-7)
            for block, claimed in enumerate(
                (found.position_covariance, found.velocity_covariance, found.orientation.covariance)
            ):
                here = slice(3 * block, 3 * block + 3)
                assert np.allclose(claimed[k], s[here, here], rtol=1e-4, atol=1e-12)


def test_parts_of_the_trace_do_not_show(motion, still, monkeypatch):
    recording = measure(motion, ERRORS, 2, rate=RATE)
    whole = navigate(recording, still=still)
    monkeypatch.setattr(zupt, "_CHUNK", 97)
    parts = navigate(recording, still=still)
    assert np.array_equal(whole.position, parts.position)
    assert np.array_equal(whole.position_covariance, parts.position_covariance)


def test_smoothing_only_helps_and_ends_alike(motion):
    recording = measure(motion, ERRORS, 4, rate=RATE)
    forward, smooth = navigate(recording, smooth=False), navigate(recording)
    assert np.allclose(forward.position[-1], smooth.position[-1], atol=1e-9)
    # no sample knows less with the future than without it
    assert (smooth.position_sigma <= forward.position_sigma * (1 + 1e-6) + 1e-9).all()


def test_heading_comes_from_the_magnetometer_at_the_start():
    motion = walk(12.0)
    turn = Rotation.from_euler("Z", 2.0)
    recording = measure(motion, rate=100.0)
    magnetic = navigate(recording)
    assert not magnetic.orientation.has(Flag.HEADING_UNKNOWN).any()
    assert magnetic.orientation.covariance[0, 2, 2] == pytest.approx(0.01, rel=0.01)
    without = replace(recording, mag=None)
    found = navigate(without)
    assert found.orientation.has(Flag.HEADING_UNKNOWN).all()
    turned = navigate(without, initial=turn)
    assert np.allclose(turned.position, turn.apply(found.position), atol=1e-6)
    assert np.allclose(
        turned.position_covariance[-1], turn.as_matrix() @ found.position_covariance[-1] @ turn.as_matrix().T
    )
    # heading sigma turns the path about its start
    wide = navigate(without, noise=NavigationNoise(start_heading=0.1))
    middle = len(found) // 2
    extra = wide.position_covariance[middle] - found.position_covariance[middle]
    r = found.position[middle, :2]
    assert extra[:2, :2] == pytest.approx(
        0.01 * np.array([[r[1] ** 2, -r[0] * r[1]], [-r[0] * r[1], r[0] ** 2]]), rel=0.02, abs=1e-3
    )


def test_navigating_along_another_estimate_agrees(motion, truth):
    """`integrate` along an attitude that comes from elsewhere, here the truth."""
    recording = measure(motion, rate=RATE)
    along = integrate(recording, recording.reference)
    assert np.abs(along.position - truth.position).max() < 1e-3
    assert np.abs(along.position - navigate(recording).position).max() < 5e-3


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**31), st.integers(2, 60), st.floats(-6.0, 12.0), st.booleans(), st.booleans())
def test_anything_gives_numbers_or_one_clear_error(seed, n, size, smooth, aided):
    rng = np.random.default_rng(seed)
    gyr, acc = 10.0**size * rng.normal(size=(2, n, 3))
    for sensor in (gyr, acc):
        sensor[rng.uniform(size=n) < rng.uniform() ** 2] = np.nan
    time = np.cumsum(rng.choice([0.0, 1e-6, 0.01, 0.05], n))
    still = rng.uniform(size=n) < 0.5
    recording = nd.Recording(time, gyr, acc)
    try:
        found = navigate(recording, still=still, smooth=smooth, zero_velocity=aided)
    except InputError:
        return
    assert np.isfinite(found.position).all()
    assert np.isfinite(found.position_covariance).all()


def test_mistakes_are_told(motion):
    recording = measure(motion, rate=100.0)
    with pytest.raises(InputError, match="at which the body stands still, got none"):
        navigate(measure(motion, ERRORS, 0, rate=100.0), detector=Shoe(threshold=1e-9))
    with pytest.raises(InputError, match=r"still of shape \(1601,\)"):
        navigate(recording, still=[True, False])
    with pytest.raises(InputError, match="noise as a NavigationNoise, got dict"):
        navigate(recording, noise={})  # type: ignore[arg-type]
    with pytest.raises(InputError, match="detector as a Detector, got str"):
        navigate(recording, detector="shoe")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="acc_noise above 0"):
        NavigationNoise(acc_noise=0.0)
    with pytest.raises(InputError, match="start_velocity of at least 0"):
        NavigationNoise(start_velocity=-1.0)
    with pytest.raises(InputError, match="no acc in the recording"):
        navigate(replace(recording, acc=None))
    huge = recording.acc.copy()
    huge[500:510] = 1e300
    with pytest.raises(InputError, match=r"an overflow, at sample 50\d"):
        navigate(replace(recording, acc=huge))
    with pytest.raises(InputError, match="a Recording"):
        navigate(None)  # type: ignore[arg-type]
    gap = recording.gyr.copy()
    gap[100:200] = np.nan
    with pytest.raises(InputError, match="without gyr, at sample 100"):
        navigate(replace(recording, gyr=gap))
    assert len(navigate(replace(recording, gyr=gap), max_gap=2.0)) == len(recording)
