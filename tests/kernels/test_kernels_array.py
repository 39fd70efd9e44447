"""Covariance helpers of the filters without gyroscope against full matrices, and their Jacobians by complex step."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from northdown.kernels import block_kalman as blocks
from northdown.kernels import rate_kalman as rates

seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=20, deadline=None)
SAME = 1e-12  # rounding of sums of a dozen products of numbers of order one


def covariance(rng, n):
    a = rng.normal(size=(n, n))
    return a @ a.T


def six(p):
    return tuple(p[np.triu_indices(6)])


def whole6(flat):
    p = np.zeros((6, 6))
    p[np.triu_indices(6)] = flat
    return p + np.triu(p, 1).T


def twelve(p):
    """Blocks of a full 12 × 12 matrix."""
    parts = []
    for i in range(4):
        for j in range(i, 4):
            block = p[3 * i : 3 * i + 3, 3 * j : 3 * j + 3]
            parts.append(tuple(block[np.triu_indices(3)]) if i == j else tuple(block.ravel()))
    return tuple(parts)


def whole12(parts):
    p, k = np.zeros((12, 12)), 0
    for i in range(4):
        for j in range(i, 4):
            block = np.array(parts[k]) if i != j else np.array(blocks.full(parts[k]))
            p[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] = block.reshape(3, 3)
            p[3 * j : 3 * j + 3, 3 * i : 3 * i + 3] = block.reshape(3, 3).T
            k += 1
    return p


@few
@given(seeds)
def test_scalar_update_with_any_row(seed):
    rng = np.random.default_rng(seed)
    P, h, d, y, r = covariance(rng, 6), rng.normal(size=6), rng.normal(size=6), rng.normal(), 0.3
    K = P @ h / (h @ P @ h + r)
    after, (*x, nis) = rates.correct_row(six(P), (*d, 0.0), tuple(h), y, r)
    assert nis == pytest.approx((y - h @ d) ** 2 / (h @ P @ h + r))
    assert np.abs(whole6(after) - (P - np.outer(K, h @ P))).max() < SAME * np.abs(P).max()
    assert np.abs(np.array(x) - (d + K * (y - h @ d))).max() < SAME * 10.0
    row = rates.correct_attitude_row(six(P), (*d, 0.0), tuple(h[:3]), y, r)
    same = rates.correct_row(six(P), (*d, 0.0), (*h[:3], 0.0, 0.0, 0.0), y, r)
    assert np.abs(np.array(row[0]) - np.array(same[0])).max() < SAME * np.abs(P).max()


@few
@given(seeds)
def test_rate_and_attitude_of_six_states(seed):
    rng = np.random.default_rng(seed)
    P, X, Q = covariance(rng, 6), rng.normal(size=(3, 6)), covariance(rng, 3)
    F = np.eye(6)
    F[3:] = X
    truth = F @ P @ F.T
    truth[3:, 3:] += Q
    found = rates.change_rate(six(P), *(tuple(row) for row in X), tuple(Q[np.triu_indices(3)]))
    assert np.abs(whole6(found) - truth).max() < SAME * np.abs(truth).max()
    R = Rotation.random(random_state=rng)
    q = tuple(np.roll(R.as_quat(), 1))
    assert np.abs(np.array(rates.matrix_nb(q)) - R.as_matrix()).max() < SAME
    D = np.eye(6)
    D[:3, 3:] = 0.1 * R.as_matrix()
    turned = rates.turn_attitude(six(P), rates.matrix_nb(q), 0.1)
    assert np.abs(whole6(turned) - D @ P @ D.T).max() < SAME * np.abs(P).max()


@few
@given(seeds)
def test_slope_of_products_by_complex_step(seed):
    rng = np.random.default_rng(seed)
    L, w = rng.normal(size=(3, 6)), rng.normal(size=3)

    def of(w):
        x, y, z = w
        return L @ np.array([x * x, y * y, z * z, x * y, x * z, y * z])

    step = 1e-30
    slope = np.array([of(w + 1j * step * e).imag / step for e in np.eye(3)]).T
    assert np.abs(np.array(rates.products_slope(tuple(L.ravel()), tuple(w))) - slope).max() < SAME
    assert np.abs(np.array(rates.products(tuple(L.ravel()), tuple(w))) - of(w)).max() < SAME


@pytest.mark.parametrize("size", [0.0, 1e-9, 0.0099, 0.0101, 0.5, 3.0])
def test_row_from_the_prior_is_the_left_jacobian(size):
    rng = np.random.default_rng(3)
    d, h = rng.normal(size=3), rng.normal(size=3)
    d *= size / np.linalg.norm(d)
    at, step = Rotation.from_rotvec(d), 1e-6
    turned = [
        (Rotation.from_rotvec(d + step * e) * at.inv()).as_rotvec()
        - (Rotation.from_rotvec(d - step * e) * at.inv()).as_rotvec()
        for e in np.eye(3)
    ]
    numerical = h @ np.array(turned).T / (2.0 * step)
    assert np.abs(np.array(rates.from_prior(tuple(h), tuple(d))) - numerical).max() < 1e-9  # of the differences


@few
@given(seeds)
def test_twelve_states_in_blocks(seed):
    rng = np.random.default_rng(seed)
    P, h, y, r = covariance(rng, 12), rng.normal(size=12), rng.normal(), 0.5
    p, d = twelve(P), rng.normal(size=12)
    assert np.array_equal(whole12(blocks.blocks(blocks.flat(p))), P)
    h[6:9] = 0.0
    seen = blocks.joined(
        blocks.joined(blocks.seen_attitude(p, tuple(h[:3])), blocks.seen_rate(p, tuple(h[3:6]))),
        blocks.seen_force_bias(p, tuple(h[9:])),
    )
    assert np.abs(np.concatenate(seen) - P @ h).max() < SAME * np.abs(P).max()
    s = h @ P @ h + r
    after, x = blocks.gain(p, (*map(tuple, d.reshape(4, 3)), 2.0), seen, s, y)
    assert np.abs(whole12(after) - (P - np.outer(P @ h, P @ h) / s)).max() < SAME * np.abs(P).max()
    assert np.abs(np.concatenate(x[:4]) - (d + P @ h * y / s)).max() < SAME * np.abs(P).max()
    assert x[4] == pytest.approx(2.0 + y * y / s, rel=1e-12)


@few
@given(seeds)
def test_rate_and_attitude_of_twelve_states(seed):
    rng = np.random.default_rng(seed)
    P, Xt, Xw, Xf, Q = covariance(rng, 12), *rng.normal(size=(3, 3, 3)), covariance(rng, 3)
    F = np.eye(12)
    F[3:6] = np.hstack([Xt, Xw, -0.2 * np.eye(3), Xf])
    truth = F @ P @ F.T
    truth[3:6, 3:6] += 0.7 * Q
    flat = [tuple(m.ravel()) for m in (Xt, Xw, Xf)]
    found = blocks.change_rate(twelve(P), flat[0], flat[1], 0.2, flat[2], tuple(Q[np.triu_indices(3)]), 0.7)
    assert np.abs(whole12(found) - truth).max() < SAME * np.abs(truth).max()
    D = np.eye(12)
    D[:3, 3:6] = Xt
    assert np.abs(whole12(blocks.turn_attitude(twelve(P), flat[0])) - D @ P @ D.T).max() < SAME * np.abs(P).max() * 10
