"""Updates of covariances of size seven, against matrices."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from northdown.kernels import quaternion
from northdown.kernels import quaternion_kalman as kalman

UPPER = np.triu_indices(6)
# from the units (e₀, δ, bias) of the kernels to (e, bias)
TO_E = np.diag([1.0, 0.5, 0.5, 0.5, 1.0, 1.0, 1.0])


def triangle(P):
    return tuple(float(v) for v in P[UPPER])


def matrix(along, upper):
    P = np.zeros((6, 6))
    P[UPPER] = upper
    return TO_E @ block_diag(along, P + np.triu(P, 1).T) @ TO_E


def jacobian(u):
    """Derivative by (e, bias) of q* u q in navigation axes: 2 e₀ u + 2 u × e."""
    u = np.asarray(u)
    return np.column_stack([2.0 * u, 2.0 * np.cross(u, np.eye(3)).T, np.zeros((3, 3))])


def update(P, H, y, r):
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.diag(r))
    return (np.eye(7) - K @ H) @ P, K @ y


@pytest.fixture
def case():
    rng = np.random.default_rng(5)
    A = rng.normal(size=(6, 6))
    return 0.7, A @ A.T, rng.normal(size=3), rng.normal(size=3)


ZERO = (0.0,) * 7
NORTH, DOWN = 0.6, 0.8
TOLERANCE = {"rtol": 1e-9, "atol": 1e-11}  # rounding of an inverse of condition 1e3


def check(found, case, H, y, r):
    along, cov, scale, d = found
    P, correction = update(TO_E @ block_diag(case[0], case[1]) @ TO_E, H, y, r)
    np.testing.assert_allclose(matrix(along, cov), P, **TOLERANCE)
    np.testing.assert_allclose(TO_E @ [scale, *d[:6]], correction, **TOLERANCE)
    S = H @ TO_E @ block_diag(case[0], case[1]) @ TO_E @ H.T + np.diag(r)
    np.testing.assert_allclose(d[6], y @ np.linalg.inv(S) @ y, **TOLERANCE)


def test_up(case):
    along, P, y, _ = case
    found = kalman.correct_up(along, triangle(P), ZERO, tuple(y), 0.3)
    check(found, case, jacobian([0, 0, -1]), y, [0.3] * 3)


def test_field(case):
    along, P, _, y = case
    found = kalman.correct_field(along, triangle(P), ZERO, tuple(y), NORTH, DOWN, 0.2)
    check(found, case, jacobian([NORTH, 0, DOWN]), y, [0.2] * 3)


def test_both_at_once_are_the_stacked_update(case):
    along, P, up, field = case
    found = kalman.correct_both(along, triangle(P), ZERO, tuple(up), 0.3, tuple(field), NORTH, DOWN, 0.2)
    H = np.vstack([jacobian([0, 0, -1]), jacobian([NORTH, 0, DOWN])])
    check(found, case, H, np.concatenate([up, field]), [0.3] * 3 + [0.2] * 3)


@pytest.mark.parametrize(
    "frame", [np.eye(3), [[0, 1, 0], [1, 0, 0], [0, 0, -1]], [[1, 0, 0], [0, -1, 0], [0, 0, -1]]]
)
def test_covariance_in_another_frame(case, frame):
    m = np.array(frame, float)
    q = tuple(np.roll(Rotation.from_matrix(m).as_quat(), 1))
    C = case[1][:3, :3]
    axes = quaternion.whole_axes(q)
    np.testing.assert_array_equal(axes, m)
    found = np.reshape(quaternion.congruent(axes, tuple(C.ravel())), (3, 3))
    # only entries change places and signs
    np.testing.assert_array_equal(found, m @ C @ m.T)
