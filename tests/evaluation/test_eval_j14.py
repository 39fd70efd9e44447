"""J14's experiment: what its table's columns are, and that the two filters are one without a bias."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from northdown.errors import InputError
from northdown.evaluation import reproduce_j14 as j14
from northdown.orientation import Orientation


@pytest.fixture(scope="module")
def recording():
    return j14.board(120.0, seed=3)


@pytest.mark.parametrize("angle", j14.ANGLES)
@pytest.mark.parametrize("name", ["EKF", "UKF"])
def test_printed_error_is_rms_over_root_two(angle, name):
    std, bias, error = j14.PUBLISHED[angle][name]
    # four printed digits of each
    assert j14.AngleStatistics(std, bias).error == pytest.approx(error, abs=1.01e-4)


def test_board_is_level_with_x_to_the_north(recording):
    x, y, z = recording.reference.rotation[0].as_matrix().T
    np.testing.assert_allclose((x, y, z), ((0, 1, 0), (-1, 0, 0), (0, 0, 1)), atol=1e-12)
    # mean of 12 000 samples of 0.03 to 0.05 m/s², and a drift of some 1e-3
    np.testing.assert_allclose(recording.acc.mean(axis=0), (0, 0, 9.80665), atol=0.01)
    mag = recording.mag[np.isfinite(recording.mag[:, 0])]
    assert len(mag) == pytest.approx(len(recording) / 2, abs=1)
    expected = 54.0 * np.array([math.cos(j14.DIP), 0.0, -math.sin(j14.DIP)])
    np.testing.assert_allclose(mag.mean(axis=0), expected, atol=0.05)


def test_uncalibrated_board_has_constant_errors():
    tilt = j14.board(20.0, seed=3, calibrated=False).acc.mean(axis=0)
    assert np.linalg.norm(tilt[:2]) > 0.1


def test_angles_are_those_of_the_body_axes(recording):
    turn = Rotation.from_rotvec([0.3, -0.2, 0.1], degrees=True)
    estimate = Orientation.from_rotation(recording.time, recording.reference.rotation * turn, "ENU")
    # heading is clockwise, against the rotation about z up
    np.testing.assert_allclose(j14.angle_errors(estimate, recording)[-1], (0.3, -0.2, -0.1), atol=1e-10)


def test_statistics_leave_out_the_start():
    errors = np.full((7000, 3), 0.5)
    errors[:6000] = 100.0
    errors[6000::2] = -0.1
    row = j14.statistics(errors)["heading"]
    assert (row.std, row.bias) == (pytest.approx(0.3), pytest.approx(0.2))


def test_settling_time():
    errors = np.zeros((500, 3))
    assert j14.settling_time(errors) == 0.0
    errors[:42] = 2.0
    assert j14.settling_time(errors) == 0.42


def test_ukf_is_the_ekf_without_bias(recording):
    filters = j14.filters()
    ekf, ukf = (j14.angle_errors(filters[n].run(recording), recording) for n in ("EKF without bias", "UKF"))
    # errors of 0.05° leave second-order differences of about (1e-3 rad)² = 6e-5° and less
    np.testing.assert_allclose(ekf[1000:], ukf[1000:], atol=1e-3)


def test_duration_is_checked():
    with pytest.raises(InputError, match="duration"):
        j14.board(-1.0)
