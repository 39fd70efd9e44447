"""VQF with past and future against its authors' own implementation, and what must hold of any smoothing."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown import VQF, Flag, InputError, Recording
from northdown.estimators import registry

SAME_DEG = 0.01


def degrees(a: Rotation, b: Rotation) -> np.ndarray:
    return np.rad2deg((a * b.inv()).magnitude())


def compare(recording: Recording, **params) -> tuple[nd.Orientation, dict[str, np.ndarray]]:
    """Ours and theirs, after the assertion that the attitudes are equal."""
    vqf = pytest.importorskip("vqf")
    result = VQF(**params).smooth(recording, frame="ENU")
    peer = vqf.offlineVQF(recording.gyr, recording.acc, recording.mag, 1.0 / recording.rate)
    assert degrees(result.rotation, Rotation.from_quat(np.roll(peer["quat9D"], -1, axis=1))).max() < SAME_DEG
    return result, peer


@pytest.fixture(scope="module")
def recording() -> Recording:
    made = nd.simulate(120.0, rate=50.0, seed=9, frame="ENU")
    mag = made.mag.copy()
    mag[2000:3500] += [25.0, -10.0, 12.0]
    return dataclasses.replace(made, mag=mag, gyr=made.gyr + np.deg2rad([0.6, -0.4, 0.3]))


def test_equals_its_authors_on_simulated_data(recording):
    result, peer = compare(recording)
    assert np.rad2deg(np.abs(result.gyr_bias - peer["bias"]).max()) < 1e-3
    assert np.rad2deg(np.abs(result.diagnostics["bias_sigma"] - peer["biasSigma"]).max()) < 1e-4
    assert np.array_equal(result.diagnostics["rest"], peer["restDetected"])
    assert np.array_equal(result.has(Flag.MAG_REJECTED), peer["magDistDetected"])
    assert 0.1 < result.has(Flag.MAG_REJECTED).mean() < 0.9


def test_equals_its_authors_where_the_field_is_never_known():
    """A turn too slow for a first reference: the field counts as disturbed for longer than it is left out."""
    n, rate = 9000, 50.0
    time = np.arange(n) / rate
    heading = 0.3 * np.sin(0.05 * time)
    noise = np.random.default_rng(3).normal(size=(3, n, 3))
    gyr = np.column_stack([np.zeros((n, 2)), 0.015 * np.cos(0.05 * time)]) + 2e-3 * noise[0] + [0.0, 0.0, 5e-3]
    acc = np.array([0.0, 0.0, 9.81]) + 0.02 * noise[1]
    field = np.column_stack([20.0 * np.sin(heading), 20.0 * np.cos(heading), np.full(n, -40.0)]) + 0.2 * noise[2]
    result, _ = compare(Recording(time, gyr, acc, field, frame="ENU"))
    assert result.has(Flag.MAG_REJECTED).all()


@pytest.mark.parametrize("trial", [1, 27])
def test_equals_its_authors_on_broad(data_root, trial):
    result, peer = compare(nd.datasets.broad(trial, data_root))
    assert np.rad2deg(np.abs(result.gyr_bias - peer["bias"]).max()) < 1e-3
    assert np.array_equal(result.diagnostics["rest"], peer["restDetected"])
    assert np.array_equal(result.has(Flag.MAG_REJECTED), peer["magDistDetected"])


def test_smoothing_is_better_than_the_filter(recording):
    errors = [
        nd.attitude_error(o, recording.reference).rmse() for o in (VQF().smooth(recording), VQF().run(recording))
    ]
    assert errors[0].inclination_deg < errors[1].inclination_deg


def test_frame_and_mounting_turn_the_result(recording):
    r = recording[:2000]
    plain = VQF().smooth(r)
    assert plain.frame == "ENU"
    assert degrees(VQF().smooth(r, frame="NED").to_frame("ENU").rotation, plain.rotation).max() < 1e-8
    turn = Rotation.random(random_state=np.random.default_rng(7))
    turned = VQF().smooth(r.rotate_body(turn.as_matrix()))
    assert degrees(turned.rotation * turn, plain.rotation).max() < 1e-5


def test_truth_from_error_free_sensors_with_holes():
    motion = nd.simulation.random_motion(10.0, seed=11, reach=0.0)
    exact = nd.simulation.measure(motion, rate=1000.0)
    gyr, acc, mag = exact.gyr.copy(), exact.acc.copy(), exact.mag.copy()
    acc[:500] = np.nan
    acc[5000::3, 1] = np.nan
    mag[:1500] = np.nan
    mag[np.arange(len(mag)) % 7 != 0] = np.nan
    gyr[9000:9005] = np.nan
    holed = dataclasses.replace(exact, gyr=gyr, acc=acc, mag=mag)
    for recording in (exact, holed):
        result = VQF(motion_bias=False, rest_bias=False).smooth(recording)
        # rad, as for the filter; a rate held for 5 ms costs less
        assert (result.rotation * exact.reference.rotation.inv()).magnitude().max() < 2e-3
    assert np.array_equal(np.flatnonzero(result.has(Flag.GYRO_HELD)), np.arange(9000, 9005))
    # past and future know tilt and heading from the first sample on
    assert not result.has(Flag.TILT_UNKNOWN | Flag.HEADING_UNKNOWN).any()


def test_without_magnetometer_heading_is_flagged(recording):
    result = VQF().smooth(dataclasses.replace(recording[:2000], mag=None))
    assert result.has(Flag.HEADING_UNKNOWN).all()
    assert not result.has(Flag.TILT_UNKNOWN).any()
    inclination = nd.attitude_error(result, recording.reference).rmse().inclination_deg
    assert inclination < 2.0


def test_without_any_accelerometer_sample_tilt_is_flagged(recording):
    r = recording[:300]
    result = VQF().smooth(dataclasses.replace(r, acc=np.full_like(r.acc, np.nan)))
    assert result.has(Flag.TILT_UNKNOWN).all()


@pytest.mark.parametrize("n", [0, 1, 2])
def test_few_samples(recording, n):
    result = VQF().smooth(recording[:n])
    assert len(result) == n
    assert np.isfinite(result.quat).all()
    if n:
        assert degrees(result.rotation, VQF().run(recording[:n]).rotation).max() < 2.0  # noise of one sample


def test_equal_times_are_taken(recording):
    time = recording.time[:500].copy()
    time[100:103] = time[100]
    result = VQF().smooth(dataclasses.replace(recording[:500], time=time))
    assert np.abs(np.linalg.norm(result.quat, axis=1) - 1.0).max() < 1e-12


def test_faults_are_those_of_run(recording):
    r = recording[:300]
    with pytest.raises(InputError, match=r"for vqf, got no acc"):
        VQF().smooth(dataclasses.replace(r, acc=None))
    time = r.time.copy()
    time[7] = time[5]
    with pytest.raises(InputError, match="at sample 7; sort"):
        VQF().smooth(dataclasses.replace(r, time=time))
    gyr = r.gyr.copy()
    gyr[100:120] = np.nan
    with pytest.raises(InputError, match="NaN for longer"):
        VQF().smooth(dataclasses.replace(r, gyr=gyr))


def test_smoothing_leaves_the_recording_alone(recording):
    r = recording[:300]
    before = [r.time.copy(), r.gyr.copy(), r.acc.copy(), r.mag.copy()]
    VQF().smooth(r)
    assert all(np.array_equal(a, b) for a, b in zip(before, (r.time, r.gyr, r.acc, r.mag), strict=True))


@pytest.mark.parametrize("name", [name for name, e in registry().items() if not e.smooths])
def test_others_say_that_they_cannot(recording, name):
    with pytest.raises(InputError, match=rf"an estimator that smooths \(.*vqf.*\), got {name}; use run"):
        registry()[name]().smooth(recording)
