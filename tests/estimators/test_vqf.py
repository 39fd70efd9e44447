"""VQF against its authors' own implementation, the package `vqf`, and against closed forms."""

from __future__ import annotations

import dataclasses
import math
from types import ModuleType

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown import VQF, Flag, InputError, Recording
from northdown.estimators import _vqf_bias

SAME_DEG = 0.01
# Theirs starts with the body's axes for those of the frame, and takes the first correction of the tilt for a bias.
# With the body turned so that it starts level and to the north there is none.
# What is left is one sample's reduction of the bias' variance, which theirs takes before there is a second sample.
SAME_START_DEG = 2e-3
SETTLED = 5.0  # s


def degrees(a: Rotation, b: Rotation) -> np.ndarray:
    return np.rad2deg((a * b.inv()).magnitude())


def rotation(quat: np.ndarray) -> Rotation:
    return Rotation.from_quat(np.roll(quat, -1, axis=1))


def upright(recording: Recording, start: Rotation) -> Recording:
    """The recording in body axes that begin as those of ENU, and with no rate before the first sample."""
    turned = recording.rotate_body(start.as_matrix())
    gyr = turned.gyr.copy()
    gyr[0] = 0.0
    return dataclasses.replace(turned, gyr=gyr)


def disturbed(duration: float, rate: float, seed: int) -> Recording:
    """Simulation with a gyroscope's bias, a rest, and a magnet near by for 80 s: longer than it is left out."""
    moving = nd.simulate(duration, rate=rate, seed=seed, frame="ENU")
    mag, gyr = moving.mag.copy(), moving.gyr + np.deg2rad([0.6, -0.4, 0.3])
    near = (moving.time > 0.2 * duration) & (moving.time < 0.2 * duration + 80.0)
    mag[near] += [25.0, -10.0, 12.0]
    return dataclasses.replace(moving, gyr=gyr, mag=mag)


@pytest.fixture(scope="module")
def vqf() -> ModuleType:
    return pytest.importorskip("vqf")


@pytest.fixture(scope="module")
def recording() -> Recording:
    return disturbed(160.0, 50.0, 5)


SWITCHES = {
    "defaults": ({}, {}),
    "no bias in motion": ({"motion_bias": False}, {"motionBiasEstEnabled": False}),
    "no bias at rest": ({"rest_bias": False}, {"restBiasEstEnabled": False}),
    "no rejection": ({"mag_rejection": False}, {"magDistRejectionEnabled": False}),
    "all numbers": (
        {
            "tau_acc": 2.0,
            "tau_mag": 5.0,
            "bias_sigma_init": math.radians(0.8),
            "bias_forgetting_time": 60.0,
            "bias_clip": math.radians(1.5),
            "bias_sigma_motion": math.radians(0.08),
            "bias_vertical_forgetting": 1e-3,
            "bias_sigma_rest": math.radians(0.02),
            "rest_min_time": 1.0,
            "rest_filter_tau": 0.4,
            "rest_gyr_threshold": math.radians(3.0),
            "rest_acc_threshold": 0.6,
            "mag_current_tau": 0.1,
            "mag_ref_tau": 15.0,
            "mag_norm_threshold": 0.15,
            "mag_dip_threshold": math.radians(8.0),
            "mag_new_time": 10.0,
            "mag_new_first_time": 4.0,
            "mag_new_min_rate": math.radians(15.0),
            "mag_min_undisturbed_time": 0.7,
            "mag_max_rejection_time": 30.0,
            "mag_rejection_factor": 3.0,
        },
        {
            "tauAcc": 2.0,
            "tauMag": 5.0,
            "biasSigmaInit": 0.8,
            "biasForgettingTime": 60.0,
            "biasClip": 1.5,
            "biasSigmaMotion": 0.08,
            "biasVerticalForgettingFactor": 1e-3,
            "biasSigmaRest": 0.02,
            "restMinT": 1.0,
            "restFilterTau": 0.4,
            "restThGyr": 3.0,
            "restThAcc": 0.6,
            "magCurrentTau": 0.1,
            "magRefTau": 15.0,
            "magNormTh": 0.15,
            "magDipTh": 8.0,
            "magNewTime": 10.0,
            "magNewFirstTime": 4.0,
            "magNewMinGyr": 15.0,
            "magMinUndisturbedTime": 0.7,
            "magMaxRejectionTime": 30.0,
            "magRejectionFactor": 3.0,
        },
    ),
}


@pytest.mark.parametrize(("ours", "theirs"), SWITCHES.values(), ids=SWITCHES)
def test_equals_its_authors_on_simulated_data(vqf, recording, ours, theirs):
    estimator = VQF(**ours)
    start = estimator.run(recording[:1]).rotation[0]
    turned = upright(recording, start)
    result = estimator.run(turned)
    peer = vqf.VQF(1.0 / turned.rate, **theirs).updateBatchFullState(turned.gyr, turned.acc, turned.mag)
    assert degrees(result.rotation, rotation(peer["quat9D"])).max() < SAME_START_DEG
    settled = turned.time > SETTLED
    diagonal = np.sqrt(peer["biasP"][:, [0, 4, 8]]) / 100.0
    assert np.rad2deg(np.abs(result.gyr_bias - peer["bias"])[settled].max()) < 1e-3
    assert np.rad2deg(np.abs(result.diagnostics["bias_sigma"] - peer["biasSigma"]).max()) < 1e-4
    assert np.abs(np.rad2deg(result.gyr_bias_sigma) - diagonal)[settled].max() < 1e-3
    if "motion_bias" in ours:  # then nothing is left
        assert degrees(result.rotation, rotation(peer["quat9D"])).max() < 1e-9
    if estimator.rest_bias:
        assert np.array_equal(result.diagnostics["rest"], peer["restDetected"])
        assert 0.01 < result.diagnostics["rest"].mean() < 0.9
    if estimator.mag_rejection:
        rejected = result.has(Flag.MAG_REJECTED)
        assert np.array_equal(rejected, peer["magDistDetected"])
        assert 0.2 < rejected.mean() < 0.9
    else:
        assert not result.has(Flag.MAG_REJECTED).any()


def test_short_run_equals_its_authors(vqf):
    short = nd.simulate(10.0, rate=100.0, seed=2, frame="ENU")
    short = upright(short, VQF().run(short[:1]).rotation[0])
    result = VQF().run(short)
    peer = vqf.VQF(0.01).updateBatch(short.gyr, short.acc, short.mag)
    assert degrees(result.rotation, rotation(peer["quat9D"])).max() < SAME_START_DEG


def test_slower_magnetometer_and_accelerometer_equal_its_authors(vqf, recording):
    start = VQF().run(recording[:1]).rotation[0]
    r = upright(recording, start)[:4000]
    acc, mag = r.acc.copy(), r.mag.copy()
    index = np.arange(len(r))
    acc[index % 2 != 0] = np.nan
    mag[index % 5 != 0] = np.nan
    result = VQF().run(dataclasses.replace(r, acc=acc, mag=mag))
    peer, quats = vqf.VQF(1.0 / r.rate, 2.0 / r.rate, 5.0 / r.rate), []
    for i in index:
        peer.updateGyr(r.gyr[i].copy())
        if i % 2 == 0:
            peer.updateAcc(r.acc[i].copy())
        if i % 5 == 0:
            peer.updateMag(r.mag[i].copy())
        quats.append(peer.getQuat9D())
    assert degrees(result.rotation, rotation(np.array(quats))).max() < SAME_DEG


def test_without_magnetometer_equals_its_authors(vqf, recording):
    start = VQF().run(recording[:1]).rotation[0]
    r = dataclasses.replace(upright(recording, start), mag=None)
    result = VQF().run(r, frame="ENU")
    peer = vqf.VQF(1.0 / r.rate).updateBatch(r.gyr, r.acc)
    assert degrees(result.rotation, rotation(peer["quat6D"])).max() < SAME_START_DEG
    assert result.has(Flag.HEADING_UNKNOWN).all()
    assert not result.has(Flag.MAG_REJECTED).any()


@pytest.mark.parametrize("trial", [1, 15, 29])
def test_equals_its_authors_on_broad(vqf, data_root, trial):
    r = nd.datasets.broad(trial, data_root)
    result = VQF().run(r)
    peer = vqf.VQF(1.0 / r.rate).updateBatchFullState(r.gyr, r.acc, r.mag)
    assert degrees(result.rotation, rotation(peer["quat9D"])).max() < SAME_DEG
    assert np.array_equal(result.diagnostics["rest"], peer["restDetected"])
    assert np.array_equal(result.has(Flag.MAG_REJECTED), peer["magDistDetected"])
    settled = r.time - r.time[0] > SETTLED
    assert np.rad2deg(np.abs(result.gyr_bias - peer["bias"])[settled].max()) < 1e-3
    assert np.rad2deg(np.abs(result.diagnostics["bias_sigma"] - peer["biasSigma"]).max()) < 1e-4


def test_jitter_of_times_changes_little():
    """Samples at irregular times of the same motion: no coefficient is tied to a constant step."""
    rng = np.random.default_rng(8)
    motion = nd.simulation.random_motion(60.0, seed=4)
    steps = rng.choice([0.004, 0.008, 0.012, 0.016], 6000)
    jittered = nd.simulation.measure(motion, time=np.cumsum(steps)[np.cumsum(steps) < 59.9])
    even = nd.simulation.measure(motion, rate=100.0)
    errors = [nd.attitude_error(VQF().run(r), r.reference).rmse().total_deg for r in (even, jittered)]
    assert errors[1] < 1.2 * errors[0] + 0.05


def test_variance_gives_the_steady_state_that_was_asked_for():
    sigma, walk = 0.3, 0.02
    w = sigma**4 / walk + sigma**2
    cov, rows = (4.0, 0.0, 0.0, 4.0, 0.0, 4.0), Rotation.random(random_state=1).as_matrix()
    for _ in range(300):
        cov = _vqf_bias.grow.py_func(cov, 1e9, walk)
        for row in rows:
            cov, _ = _vqf_bias.correct(cov, (0.0, 0.0, 0.0), tuple(row), 0.0, w)
    assert cov == pytest.approx([sigma**2, 0.0, 0.0, sigma**2, 0.0, sigma**2], abs=1e-12)


def test_scalar_updates_are_the_vector_update():
    rng = np.random.default_rng(6)
    a = rng.normal(size=(3, 3))
    p, rows, w, e = a @ a.T, rng.normal(size=(3, 3)), np.array([0.5, 0.7, 40.0]), rng.normal(size=3)
    gain = p @ rows.T @ np.linalg.inv(rows @ p @ rows.T + np.diag(w))
    upper = tuple(p[np.triu_indices(3)])
    bias, cov = _vqf_bias.update((0.1, -0.2, 0.0), upper, tuple(map(tuple, rows)), tuple(e), tuple(w), 100.0)
    assert bias == pytest.approx(np.array([0.1, -0.2, 0.0]) + gain @ e, abs=1e-13)
    assert cov == pytest.approx((p - gain @ rows @ p)[np.triu_indices(3)], abs=1e-13)


def test_bias_is_found_at_rest_and_its_sigma_holds():
    bias = np.deg2rad([0.5, -0.3, 0.2])
    z = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        n = 3000
        gyr = bias + rng.normal(0.0, 2e-3, (n, 3))
        rest = Recording(np.arange(n) * 0.01, gyr, np.tile([0.0, 0.0, -9.81], (n, 1)), np.tile([20.0, 0, 40], (n, 1)))
        result = VQF().run(rest)
        assert result.diagnostics["rest"][-1] == 1.0
        z.append((result.gyr_bias[-1] - bias) / result.gyr_bias_sigma[-1])
    # the filter's sigma is a design figure far above what such noise leaves: no error may exceed it
    assert np.abs(z).max() < 1.0


def test_given_start_is_trusted(recording):
    r = recording[:500]
    truth = r.reference.to_frame("ENU").rotation[0]
    turn = Rotation.from_euler("z", 30.0, degrees=True)
    result = VQF().run(r, initial=turn * truth)
    off = degrees(result.rotation, VQF().run(r).rotation)
    # tilt moves a little meanwhile, and the other run's heading is a mean of few samples
    assert off[50] == pytest.approx(30.0, abs=4.0)  # 1 s
    # with no reference of the field yet, half of 1 − exp(−Δt/9 s) a step: after 10 s 30° · exp(−10/18)
    assert off[-1] == pytest.approx(30.0 * math.exp(-10.0 / 18.0), abs=4.0)


def test_parameters_have_ranges():
    for bad in ({"tau_acc": 0.0}, {"bias_sigma_rest": -1.0}, {"mag_rejection_factor": 0.5}, {"rest_bias": 1}):
        with pytest.raises(InputError, match=next(iter(bad))):
            VQF(**bad)
