"""A long time without any sample: what the body did then is not known, so the attitude begins anew."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import northdown as nd
from northdown.estimators import get
from northdown.simulation import measure, random_motion

FILTERS = (
    "calibrating-ekf",
    "mekf",
    "quaternion-ekf",
    "double-stage-ekf",
    "euler-ukf",
    "gyro-euler-ekf",
    "mahony",
    "madgwick",
    "complementary",
    "cross-product",
)


@pytest.fixture(scope="module")
def whole():
    rng = np.random.default_rng(8)
    exact = measure(random_motion(110.0, seed=8), rate=100.0, seed=8)
    n = len(exact)
    return dataclasses.replace(
        exact,
        gyr=exact.gyr + 2e-3 * rng.normal(size=(n, 3)),
        acc=exact.acc + 0.03 * rng.normal(size=(n, 3)),
        mag=exact.mag + 0.3 * rng.normal(size=(n, 3)),
    )


def with_hole(recording, seconds):
    return recording[(recording.time < 60.0) | (recording.time > 60.0 + seconds)]


def total(estimate, truth, start, stop):
    return nd.attitude_error(estimate, truth, mask=(truth.time > start) & (truth.time < stop)).rmse().total_deg


@pytest.mark.parametrize("name", FILTERS)
def test_the_attitude_is_found_anew(whole, name):
    holed = with_hole(whole, 10.0)
    estimator = get(name)()
    estimate = estimator.run(holed)
    # as good as an estimate that begins there (degrees); the body has turned by 120 meanwhile
    second = holed[holed.time > 70.0]
    for start, stop in ((70.0, 75.0), (75.0, 80.0), (80.0, 110.0)):
        assert total(estimate, holed, start, stop) < 1.1 * total(estimator.run(second), second, start, stop) + 0.1
    assert estimate.flags[holed.time > 70.0][0] & nd.Flag.LONG_STEP
    # one who says that it may be held has it held
    assert total(estimator.run(holed, max_gap=20.0), holed, 70.0, 71.0) > 40.0


@pytest.mark.parametrize("name", ["calibrating-ekf", "mekf", "quaternion-ekf"])
def test_the_covariance_says_so(whole, name):
    holed = with_hole(whole, 10.0)
    estimate = get(name)().run(holed)
    error = nd.attitude_error(estimate, holed, mask=holed.time > 70.0)
    sigma = np.sqrt(np.einsum("nii->ni", estimate.covariance[error.index]))
    assert (np.abs(error.rotvec) < 3.0 * sigma).mean() > 0.95


@pytest.mark.parametrize("seconds", [0.3, 0.6])
def test_a_shorter_one_widens_the_covariance(whole, seconds):
    holed = with_hole(whole, seconds)
    estimate = nd.CalibratingEKF().run(holed)
    at = int(np.flatnonzero(holed.time > 60.0)[0]) + 4  # the epoch's end
    before, after = (np.trace(estimate.covariance[k]) for k in (at - 20, at))
    assert after > 10.0 * before
    end = 60.0 + seconds
    assert total(estimate, holed, end + 5.0, end + 15.0) < total(nd.MEKF().run(holed), holed, end + 5.0, end + 15.0)


def test_a_smoother_has_both_sides(whole):
    holed = with_hole(whole, 10.0)
    estimate, learnt = nd.CalibratingEKF().learn(holed, offline=True)
    plain = nd.CalibratingEKF().smooth(whole)
    for start, stop in ((50.0, 60.0), (70.0, 75.0), (90.0, 110.0)):
        assert total(estimate, holed, start, stop) < total(plain, whole, start, stop) + 0.15  # degrees
    assert estimate.flags[holed.time > 70.0][0] & nd.Flag.LONG_STEP
    assert np.array_equal(estimate.time, holed.time)
    # the second part begins with what the first has shown
    alone = nd.CalibratingEKF().learn(holed[holed.time > 70.0], offline=True)[1]
    assert learnt.gyr_matrix_sigma.max() < alone.gyr_matrix_sigma.max()


def test_what_is_wrong_after_a_hole_is_named_by_its_sample(whole):
    holed = with_hole(whole, 10.0)
    gyr = holed.gyr.copy()
    gyr[8000:8050] = np.nan
    with pytest.raises(nd.InputError, match="at sample 80"):
        nd.CalibratingEKF().smooth(dataclasses.replace(holed, gyr=gyr))


def test_a_stream_begins_anew_too(whole):
    holed = with_hole(whole, 10.0)[5500:6500]
    filter_ = nd.CalibratingEKF()
    stream = filter_.stream(frame=holed.frame)
    quat = [stream.update(holed.gyr[i], holed.acc[i], holed.mag[i], time=holed.time[i]) for i in range(len(holed))]
    assert np.array_equal(np.array(quat), filter_.run(holed).quat)
