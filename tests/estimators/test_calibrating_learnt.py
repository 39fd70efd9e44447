"""What the calibrating filter has learnt: through files and back, and worth something in the next run."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import northdown as nd
from northdown.errors import FormatError, InputError
from northdown.estimators import LearntCalibration
from northdown.simulation import measure, random_motion

FIELDS = [f.name for f in dataclasses.fields(LearntCalibration)]
NUMBERS, SIGMAS = st.floats(-1e6, 1e6), st.floats(0.0, 1e6)
VECTORS, MATRICES = (arrays(np.float64, shape, elements=NUMBERS) for shape in ((3,), (3, 3)))
VECTOR_SIGMAS, MATRIX_SIGMAS = (arrays(np.float64, shape, elements=SIGMAS) for shape in ((3,), (3, 3)))
CALIBRATIONS = st.builds(
    LearntCalibration,
    *(VECTORS, VECTOR_SIGMAS, MATRICES, MATRIX_SIGMAS, VECTORS, VECTOR_SIGMAS),
    *(st.floats(-0.05, 0.05), SIGMAS, VECTORS, VECTOR_SIGMAS, VECTORS, VECTOR_SIGMAS),
)


def same(a, b):
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in FIELDS)


def recording(seed, seconds=80.0):
    """Lively motion; a gyroscope 5 ‰ off, a magnetometer 15 ms late."""
    rng = np.random.default_rng(seed)
    motion = random_motion(seconds + 1.0, seed=seed, reach=0.0)
    time = np.arange(0.5, seconds, 0.01)
    exact = measure(motion, time=time)
    matrix = np.array([[5e-3, 2e-3, 0.0], [-3e-3, -5e-3, 1e-3], [2e-3, 0.0, 4e-3]])
    n = len(time)
    return dataclasses.replace(
        exact,
        gyr=np.linalg.solve(np.eye(3) - matrix, (exact.gyr + np.array([0.01, -0.02, 0.005])).T).T
        + 1e-3 * rng.normal(size=(n, 3)),
        acc=exact.acc + 0.02 * rng.normal(size=(n, 3)),
        mag=measure(motion, time=time - 0.015).mag + 0.3 * rng.normal(size=(n, 3)),
    )


@settings(max_examples=30, deadline=None)
@given(CALIBRATIONS, st.sampled_from([".toml", ".json"]))
def test_files_are_read_back_exactly(tmp_path_factory, known, suffix):
    path = tmp_path_factory.mktemp("learnt") / f"k{suffix}"
    known.save(path)
    assert same(LearntCalibration.load(path), known)
    first = path.read_bytes()
    known.save(path)
    assert path.read_bytes() == first
    assert [p.name for p in path.parent.iterdir()] == [path.name]  # no draft is left


def test_the_second_half_begins_better(tmp_path):
    whole = recording(3, seconds=160.0)
    first, second = whole[: len(whole) // 2], whole[len(whole) // 2 :]
    filter_ = nd.CalibratingEKF(gyr_matrix=3e-3)
    estimate, found = filter_.learn(first)
    assert np.array_equal(estimate.quat, filter_.run(first).quat)
    found.save(tmp_path / "k.toml")
    known = LearntCalibration.load(tmp_path / "k.toml")
    beginning = second.time < second.time[0] + 20.0

    def error(o):
        return nd.attitude_error(o, second, mask=beginning).rmse().total

    assert error(filter_.run(second, known=known)) < 0.7 * error(filter_.run(second))
    assert error(filter_.smooth(second, known=known)) < 0.95 * error(filter_.smooth(second))
    # as by hand
    stream = filter_.warm_stream(known)
    assert np.array_equal(stream.run(second).quat, filter_.run(second, known=known).quat)
    assert same(filter_.learn(second, known=known)[1], filter_.learnt(stream))


def test_smoothing_learns_the_same():
    part = recording(5, seconds=40.0)
    filter_ = nd.CalibratingEKF(rest_gyr=0.0)  # rest is what a smoother sees otherwise
    estimate, found = filter_.learn(part, offline=True)
    assert np.array_equal(estimate.quat, filter_.smooth(part).quat)
    live = filter_.learn(part)[1]
    for name in FIELDS:
        assert np.allclose(getattr(found, name), getattr(live, name), rtol=1e-6, atol=1e-9), name


@pytest.fixture
def good():
    zero, matrix = np.zeros(3), np.zeros((3, 3))
    return LearntCalibration(zero, zero, matrix, matrix, zero, zero, 0.01, 0.001, zero, zero, zero, zero)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t | {"format": "northdown calibration"}, "expected a learnt calibration"),
        (lambda t: t | {"version": 2}, "expected version = 1 .*update northdown"),
        (lambda t: t | {"version": True}, "expected version = 1"),
        (lambda t: t | {"frame": "ENU"}, "expected frame = 'body'"),
        (lambda t: t | {"estimator": "mekf"}, "expected estimator = 'calibrating-ekf'"),
        (lambda t: t | {"more": 1}, "only format, version, estimator, frame"),
        (lambda t: {k: v for k, v in t.items() if k != "gyr_bias"}, r"unit 'rad/s' in \[gyr_bias\]"),
        (lambda t: t | {"gyr_bias": 3}, "gyr_bias as a table"),
        (lambda t: t | {"gyr_bias": t["gyr_bias"] | {"unit": "deg/s"}}, r"unit 'rad/s' in \[gyr_bias\], got 'deg/s'"),
        (lambda t: t | {"gyr_bias": t["gyr_bias"] | {"value": [1, 2]}}, r"3 numbers for value in \[gyr_bias\]"),
        (lambda t: t | {"gyr_bias": t["gyr_bias"] | {"value": [1, 2, "x"]}}, "a number for"),
        (lambda t: t | {"gyr_bias": t["gyr_bias"] | {"value": [1, 2, 1e300]}}, "below 1e30"),
        (lambda t: t | {"gyr_bias": t["gyr_bias"] | {"sigma": [1, 2, -1]}}, "sigmas at least 0"),
        (lambda t: t | {"gyr_matrix": t["gyr_matrix"] | {"value": [[0, 0, 0]]}}, r"gyr_matrix of shape \(3, 3\)"),
        (lambda t: t | {"mag_delay": {"unit": "s", "value": 3.0, "sigma": 0.0}}, "mag_delay"),
        (lambda t: t | {"mag_delay": {"unit": "s", "value": 0.0}}, r"sigma in \[mag_delay\]"),
    ],
)
def test_hostile_files_get_one_line(tmp_path, good, change, message):
    path = tmp_path / "k.json"
    good.save(path)
    path.write_text(json.dumps(change(json.loads(path.read_text()))))
    with pytest.raises(FormatError, match=message) as caught:
        LearntCalibration.load(path)
    assert "\n" not in str(caught.value)


def test_files_that_are_none(tmp_path, good):
    path = tmp_path / "k.toml"
    for data in (b"\x00\x01", b"[[[[", b"{" * 50_000, b"format = nan", b"[1, 2]", b'{"format": NaN}'):
        path.write_bytes(data)
        with pytest.raises(InputError) as caught:
            LearntCalibration.load(path)
        assert "\n" not in str(caught.value)
    path.write_bytes(b"#" * (1 << 17))
    with pytest.raises(InputError):
        LearntCalibration.load(path)
    with pytest.raises(InputError):
        LearntCalibration.load(tmp_path / "missing.toml")
    with pytest.raises(InputError, match=r"ends in \.toml or \.json"):
        good.save(tmp_path / "k.csv")
