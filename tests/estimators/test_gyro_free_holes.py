"""A long time without any sample, without a gyroscope: attitude, rate and their covariance begin anew."""

from __future__ import annotations

import numpy as np
import pytest
from array_truth import recorded, scattered

import northdown as nd
from northdown.simulation import random_motion

FILTERS = [nd.GyroFreeDirect(), nd.GyroFreeIndirect(), nd.GyroFreeMEKF()]


@pytest.fixture(scope="module")
def whole():
    # body held about one place, so that gravity can be told from acceleration
    return recorded(random_motion(35.0, seed=3, turn=0.3, reach=0.0), scattered(9), seed=3)


@pytest.mark.parametrize("f", FILTERS, ids=lambda f: f.name)
def test_begins_anew_as_if_it_began_there(whole, f):
    holed = whole[(whole.time < 12.0) | (whole.time >= 22.0)]
    after = holed.time >= 22.0
    second = holed[after]
    estimate, alone = f.run(holed), f.run(second)
    assert estimate.flags[after][0] & nd.Flag.LONG_STEP
    error = nd.attitude_error(estimate, holed, mask=after)
    of_alone = nd.attitude_error(alone, second)
    # from the first sample on; degrees
    assert error.rmse().total_deg < 1.1 * of_alone.rmse().total_deg + 0.1
    assert error.total[:400].max() < 1.5 * of_alone.total[:400].max() + np.deg2rad(0.1)
    # so does the reported covariance over the first second; it is not the same, as biases once found are kept
    size, of_begin = (np.trace(e.covariance, axis1=1, axis2=2) for e in (estimate, alone))
    ratio = size[after][:400] / of_begin[:400]
    assert ratio.min() > 1 / 3
    assert ratio.max() < 3.0


@pytest.mark.parametrize("f", FILTERS, ids=lambda f: f.name)
def test_a_short_one_is_carried_over(whole, f):
    holed = whole[(whole.time < 12.0) | (whole.time >= 12.2)]
    estimate, plain = f.run(holed), f.run(whole)
    error = nd.attitude_error(estimate, holed, mask=holed.time > 14.0).rmse().total_deg
    assert error < 1.1 * nd.attitude_error(plain, whole, mask=whole.time > 14.0).rmse().total_deg + 0.05
