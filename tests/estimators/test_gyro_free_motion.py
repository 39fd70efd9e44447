"""What linear acceleration does to the filters without gyroscope that take specific force for gravity."""

from __future__ import annotations

import numpy as np
import pytest
from array_truth import GRAVITY, coplanar, recorded

import northdown as nd
from northdown.simulation import Motion, Shaking, random_motion, rest

DIP = np.pi / 3.0
BOTH = pytest.mark.parametrize("kind", [nd.GyroFreeDirect, nd.GyroFreeIndirect])


@BOTH
def test_only_the_covariance_changes(kind):
    r = recorded(random_motion(10.0, seed=1, turn=0.3), coplanar(0.05), rate=100.0, seed=1)
    plain, told = kind(motion_time=0.0).run(r), kind().run(r)
    assert np.array_equal(plain.quat, told.quat)
    assert np.array_equal(plain.rate, told.rate)
    assert not np.array_equal(plain.covariance, told.covariance)
    larger = kind(motion_time=1.0).run(r)
    added = [np.trace(o.covariance - plain.covariance, axis1=1, axis2=2).sum() for o in (told, larger)]
    assert 0.0 < added[0] < added[1]
    assert (told.rate_sigma >= plain.rate_sigma).all()


@BOTH
def test_as_the_formula_says(kind):
    """Shaken along the vertical without noise of the sensors: everything in the formula is known in closed form."""
    motion = Motion(rest(3.0).turning, Shaking(np.array([0.0, 0.0, 0.02]), 1.5), 0.0, 3.0)
    r = recorded(motion, coplanar(0.05), rate=100.0)
    tau, window, dt = 0.2, 0.5, 0.01
    f = kind(motion_time=tau, motion_window=window)
    plain, told = kind(motion_time=0.0).run(r), f.run(r)
    departure = np.linalg.norm(motion.at(r.time).specific_force(GRAVITY), axis=1) - GRAVITY
    square = 0.0
    for d in departure[1:]:
        square += (d * d - square) * dt / window
    inverse = np.linalg.pinv(r.array.matrix)
    variance = f.acc_noise**2 * np.trace(inverse[3:] @ inverse[3:].T) / 3.0
    a2 = 3.0 * (square - variance / dt * (1.0 + 2.0 * np.sqrt(dt / window)))
    assert a2 > 0.1
    assert told.diagnostics["acceleration"][-1] == pytest.approx(np.sqrt(a2), rel=1e-6)
    b = 0.5 * (plain.covariance[-1, 0, 0] + plain.covariance[-1, 1, 1]) * GRAVITY**2 / variance
    b_z = plain.covariance[-1, 2, 2] / ((f.mag_noise / f.field) ** 2 / np.cos(DIP) ** 2)
    share, share_z = (x * tau / (1.0 + x * tau) for x in (b, b_z))
    assert share_z < share
    slant = np.tan(DIP)
    x = share_z / share * slant
    added = share * a2 / (3.0 * GRAVITY**2) * np.array([[1.0, 0.0, x], [0.0, 1.0, 0.0], [x, 0.0, slant**2]])
    assert np.abs(told.covariance[-1] - plain.covariance[-1] - added).max() < 1e-6 * added.max()
    m = told.rotation[-1].as_matrix()
    of_rate = np.diag(m.T @ added @ m) * (b / (1.0 + b * tau)) ** 2
    assert told.rate_sigma[-1] ** 2 - plain.rate_sigma[-1] ** 2 == pytest.approx(of_rate, rel=1e-6)


def test_nothing_is_added_at_rest():
    r = recorded(rest(60.0), coplanar(0.05), rate=100.0, seed=2)
    plain, told = (nd.GyroFreeDirect(motion_time=t).run(r) for t in (0.0, 0.3))
    added = np.trace(told.covariance - plain.covariance, axis1=1, axis2=2)
    # two standard deviations of the noise's own mean square are exceeded in some 2 % of the time
    assert np.mean(added > 0.0) < 0.1
    assert added.mean() < 0.01 * np.trace(plain.covariance, axis1=1, axis2=2).mean()


def test_sigma_is_of_the_size_of_the_errors():
    """Random turns and shifts, 0.4 m/s² of acceleration: errors ten times and more what K06's covariance says."""
    factor = {}
    for tau in (0.0, 0.3):
        f, squares, variances = nd.GyroFreeDirect(motion_time=tau), [], []
        for seed in range(8):
            r = recorded(random_motion(20.0, seed=seed), coplanar(0.05), rate=100.0, seed=seed)
            o = f.run(r)
            late = o.time > 1.0
            error = (r.reference.rotation * o.rotation.inv()).as_rotvec()[late]
            squares.append(np.mean(error**2))
            variances.append(np.mean(np.trace(o.covariance[late], axis1=1, axis2=2)) / 3.0)
        factor[tau] = np.sqrt(np.mean(squares) / np.mean(variances))
    assert factor[0.0] > 6.0
    # one motion differs from another in how much of its acceleration is vertical, which is what shows
    assert 0.7 < factor[0.3] < 1.6
