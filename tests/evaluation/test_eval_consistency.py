"""Statistics of errors over their covariance: closed forms, laws, and hostile input."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, kstest

import northdown as nd
from northdown.errors import InputError
from northdown.evaluation import chi2_bounds, coverage, nees, nis
from northdown.evaluation.consistency import NORMAL_SHARES

N = 20_000
MIX = np.array([[2.0, 0.0, 0.0], [0.7, 0.5, 0.0], [-0.4, 0.3, 1.0]]) * 1e-2
COVARIANCE = MIX @ MIX.T


def pair(n=N, seed=1, covariance=COVARIANCE, frame="NED", bias_error=1.0):
    """An estimate and the truth, with errors drawn from the covariance that it claims."""
    rng = np.random.default_rng(seed)
    time = np.arange(n) * 0.01
    attitude = Rotation.random(n, random_state=seed)
    delta = rng.standard_normal((n, 3)) @ MIX.T
    bias = rng.standard_normal((n, 3))
    sigma = np.tile([1e-3, 2e-3, 3e-3], (n, 1))
    estimate = nd.Orientation.from_rotation(
        time,
        attitude,
        frame,
        covariance=np.tile(covariance, (n, 1, 1)),
        gyr_bias=bias,
        gyr_bias_sigma=sigma,
        name="drawn",
    )
    true = nd.Orientation.from_rotation(
        time,
        Rotation.from_rotvec(delta) * attitude,
        frame,
        gyr_bias=bias + bias_error * sigma * rng.standard_normal((n, 3)),
    )
    return estimate, true, delta


def test_errors_drawn_from_the_covariance_are_chi_square():
    estimate, truth, delta = pair()
    found = nees(estimate, truth)
    # logarithm of an exponential: rounding only
    assert np.abs(found.error - delta).max() < 1e-14
    assert np.abs(found.nees - np.einsum("ni,ij,nj->n", delta, np.linalg.inv(COVARIANCE), delta)).max() < 1e-9
    # a right distribution fails this once in a thousand seeds
    assert kstest(found.nees, chi2(3).cdf).pvalue > 1e-3
    assert kstest(found.bias.ravel(), "norm").pvalue > 1e-3
    low, high = chi2_bounds(3, N, 0.999)
    assert low < found.nees.mean() < high
    assert np.allclose(found.sigma, np.sqrt(np.diag(COVARIANCE)), rtol=1e-14)


def test_the_error_is_in_navigation_axes():
    # a covariance in body axes, or an error of the wrong side, would fail: attitudes are random
    time = np.arange(3.0)
    attitude = Rotation.random(3, random_state=2)
    estimate = nd.Orientation.from_rotation(
        time, attitude, covariance=np.tile(np.diag([1e-4, 4e-4, 9e-4]), (3, 1, 1))
    )
    truth = nd.Orientation.from_rotation(time, Rotation.from_rotvec(0.1 * np.eye(3)) * attitude)
    found = nees(estimate, truth)
    assert np.allclose(found.error, 0.1 * np.eye(3), atol=1e-15)
    assert np.allclose(found.nees, [100.0, 25.0, 100.0 / 9.0], rtol=1e-12)
    assert np.allclose(found.error / found.sigma, np.diag([10.0, 5.0, 10.0 / 3.0]), atol=1e-12)
    assert found.bias is None


@given(st.floats(1e-6, 1e6))
@settings(max_examples=20, deadline=None)
def test_scaling_the_covariance_scales_nees_by_the_inverse(k):
    estimate, truth, _ = pair(n=50)
    plain = nees(estimate, truth).nees
    scaled = nees(replace(estimate, covariance=k * estimate.covariance), truth).nees
    assert np.allclose(scaled * k, plain, rtol=1e-10)


@pytest.mark.parametrize("frame", ["ENU", "NWU"])
def test_nees_is_the_same_in_every_frame(frame):
    estimate, truth, _ = pair(n=200)
    turned = nees(estimate.to_frame(frame), truth)
    assert np.allclose(turned.nees, nees(estimate, truth).nees, rtol=1e-9)
    assert turned.frame == frame


def test_coverage_of_normal_errors():
    estimate, truth, delta = pair()
    found = coverage(estimate, truth)
    # four standard deviations of a share of N independent samples
    for row, share in zip(found.share, NORMAL_SHARES, strict=True):
        assert np.abs(row - share).max() < 4.0 * math.sqrt(share * (1.0 - share) / N)
    assert np.allclose(found.rms_error, np.sqrt(np.mean(delta**2, axis=0)), rtol=1e-12)
    assert np.allclose(found.rms_sigma, np.sqrt(np.diag(COVARIANCE)), rtol=1e-12)
    # √(χ² / 3) with 3 N degrees of freedom: 0.3 % is four standard deviations
    assert found.factor == pytest.approx(1.0, abs=4.0 / math.sqrt(6.0 * N))
    too_sure = coverage(replace(estimate, covariance=estimate.covariance / 4.0), truth)
    assert too_sure.factor == pytest.approx(2.0 * found.factor, rel=1e-9)
    assert np.allclose(too_sure.share[1], found.share[0])


def test_coverage_counts_masked_samples_only():
    estimate, truth, delta = pair(n=1000)
    mask = np.abs(delta[:, 0]) < MIX[0, 0]
    found = coverage(estimate, truth, mask)
    assert found.count == mask.sum()
    assert found.share[0, 0] == 1.0
    assert coverage(nees(estimate, truth, mask=mask)).share.tolist() == found.share.tolist()


def test_bounds_are_those_of_the_tables():
    # table of χ²: 3 degrees of freedom 0.2158 and 9.348; 100 degrees 74.22 and 129.56
    assert chi2_bounds(3) == pytest.approx((0.2158, 9.348), rel=1e-3)
    assert chi2_bounds(2, 50) == pytest.approx((74.22 / 50, 129.56 / 50), rel=1e-4)
    low, high = chi2_bounds(3, 1_000_000)
    # many runs: normal, with a variance of 2 · 3 / runs
    assert (high - low) / 2.0 == pytest.approx(1.959964 * math.sqrt(6e-6), rel=1e-3)


def test_nis_of_drawn_innovations():
    rng = np.random.default_rng(3)
    root = rng.standard_normal((N, 4, 4))
    s = root @ np.swapaxes(root, 1, 2) + 0.1 * np.eye(4)
    y = np.einsum("nij,nj->ni", np.linalg.cholesky(s), rng.standard_normal((N, 4)))
    y[7] = np.nan
    found = nis(y, s)
    assert np.isnan(found[7])
    there = np.delete(np.arange(N), 7)
    direct = np.einsum("ni,ni->n", y[there], np.linalg.solve(s[there], y[there][..., None])[..., 0])
    # the condition number of s reaches 1e3
    assert np.allclose(found[there], direct, rtol=1e-10)
    assert kstest(found[there], chi2(4).cdf).pvalue > 1e-3
    assert nis(np.zeros((0, 2)), np.zeros((0, 2, 2))).shape == (0,)


BAD = [
    np.diag([1.0, -1.0, 1.0]),
    np.zeros((3, 3)),
    np.ones((3, 3)),
    np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    np.diag([1.0, np.nan, 1.0]),
]


@pytest.mark.parametrize("bad", BAD)
def test_what_is_no_covariance_is_named_with_its_sample(bad):
    estimate, truth, _ = pair(n=20)
    covariance = estimate.covariance.copy()
    covariance[13] = bad
    with pytest.raises(InputError, match=r"positive definite.*at sample 13"):
        nees(replace(estimate, covariance=covariance), truth)
    innovations = np.ones((20, 3))
    innovations[4] = np.nan
    with pytest.raises(InputError, match="at sample 13"):
        nis(innovations, covariance)


def test_mistakes_are_one_line():
    estimate, truth, _ = pair(n=20)
    for call in (
        lambda: nees(replace(estimate, covariance=None), truth),
        lambda: coverage(estimate),
        lambda: nis(np.ones(3), np.ones((3, 3))),
        lambda: nis(np.ones((3, 2)), np.ones((3, 3))),
        lambda: nis(np.full((1, 2), np.inf), np.eye(2)[None]),
        lambda: chi2_bounds(0),
        lambda: chi2_bounds(3, 0),
        lambda: chi2_bounds(3, 5, 1.0),
    ):
        with pytest.raises(InputError) as caught:
            call()
        assert str(caught.value).startswith("expected ")
        assert "\n" not in str(caught.value)


def test_body_alignment_leaves_the_bias_out():
    estimate, truth, _ = pair(n=400)
    assert nees(estimate, truth, alignment="rotations").bias is None
