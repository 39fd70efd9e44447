"""Alignment: offsets are recovered, also from spoilt data, and motion that cannot tell is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from northdown.errors import InputError
from northdown.evaluation import align, attitude_error
from northdown.orientation import Orientation

N = 1500
TIME = np.arange(N) * 0.02


def lively() -> Orientation:
    """Turns about all axes, up to about 1 rad."""
    phase = np.outer(TIME, [0.9, 0.61, 1.3]) + np.array([0.3, 1.0, 2.0])
    return Orientation.from_rotation(TIME, Rotation.from_euler("ZYX", np.sin(phase) * [1.0, 0.7, 0.9]), "ENU")


def spoilt(orientation: Orientation, rotvec: np.ndarray) -> Orientation:
    return Orientation.from_rotation(orientation.time, Rotation.from_rotvec(rotvec) * orientation.rotation, "ENU")


def off(a: Rotation, b: Rotation) -> float:
    """Angle between two rotations, rad."""
    return float((a.inv() * b).magnitude())


any_turn = st.tuples(*[st.floats(-3.0, 3.0)] * 3).filter(lambda v: np.linalg.norm(v) < 3.1)


@settings(max_examples=15, deadline=None)
@given(any_turn, any_turn)
def test_both_rotations_are_found_exactly(left: tuple, right: tuple) -> None:
    estimate = lively()[::5]
    true_left, true_right = Rotation.from_rotvec(left), Rotation.from_rotvec(right)
    truth = estimate.turned(true_left, true_right)
    found = align(estimate, truth, "rotations")
    assert off(found.left, true_left) < 1e-9  # rad; rounding only
    assert off(found.right, true_right) < 1e-9
    assert found.residual < 1e-9
    assert found.inliers == 1.0
    assert [f.kind for f in found.findings] == ["alignment-fitted"]
    applied = found.apply(estimate)
    assert (applied.rotation.inv() * truth.rotation).magnitude().max() < 1e-9
    back = found.apply_inverse(truth)
    assert (back.rotation.inv() * estimate.rotation).magnitude().max() < 1e-9


def test_error_after_alignment_is_about_the_vertical_of_the_estimate() -> None:
    """A truth whose world frame lies on its side must not turn a heading error into an inclination error."""
    estimate = lively()
    rotvec = np.zeros((N, 3))
    rotvec[:, 2] = 0.05 * np.where(np.arange(N) % 2, 1.0, -1.0)
    truth = estimate.turned(Rotation.from_rotvec([1.6, 0.0, 0.0]), Rotation.from_rotvec([0.0, 0.4, 0.0]))
    error = attitude_error(spoilt(estimate, rotvec), truth, alignment="rotations")
    assert error.rmse().heading == pytest.approx(0.05, rel=1e-3)
    assert error.rmse().inclination < 1e-4  # rad


@pytest.mark.parametrize("frame", ["NED", "ENU", "NWU"])
def test_alignment_serves_orientations_in_any_frame(frame: str) -> None:
    estimate = lively()
    truth = estimate.turned(Rotation.from_rotvec([0.1, -0.4, 2.0]), Rotation.from_rotvec([1.0, 0.2, 0.0]))
    found = align(estimate, truth, "rotations")
    other = found.apply(estimate.to_frame(frame))
    assert other.frame == frame
    assert (other.to_frame("ENU").rotation.inv() * truth.rotation).magnitude().max() < 1e-9


@pytest.mark.parametrize("sigma", [1e-3, 0.03])
def test_noise_gives_an_error_within_its_statistical_bound(sigma: float) -> None:
    rng = np.random.default_rng(3)
    estimate = lively()
    true_left, true_right = Rotation.from_rotvec([0.5, -0.2, 2.5]), Rotation.from_rotvec([-1.0, 0.7, 0.1])
    noisy = spoilt(estimate.turned(true_left, true_right), rng.normal(0.0, sigma, (N, 3)))
    found = align(estimate, noisy, "rotations")
    # Least squares has covariance σ² (JᵀJ)⁻¹, J = [1, truth]; 5 sigma of the worst
    # direction, and 10 % for the robust loss
    mean = noisy.rotation.as_matrix().mean(axis=0)
    normal = N * np.block([[np.eye(3), mean], [mean.T, np.eye(3)]])
    bound = 5.0 * 1.1 * sigma / np.sqrt(np.linalg.eigvalsh(normal)[0])
    assert off(found.left, true_left) < bound
    assert off(found.right, true_right) < bound
    # rms of a vector of three components
    assert found.residual == pytest.approx(sigma * np.sqrt(3.0), rel=0.05)
    assert found.inliers > 0.995


def test_sigma_tells_the_true_error() -> None:
    """Over 30 sets of slowly varying errors, error ÷ sigma is of the order of one."""
    estimate = lively()[::5]
    true_right = Rotation.from_rotvec([0.3, 0.1, -0.2])
    ratio = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        drift = np.repeat(rng.normal(0.0, 0.02, (len(estimate) // 15, 3)), 15, axis=0)
        found = align(estimate, spoilt(estimate.turned(right=true_right), drift), "rotations")
        ratio.append(off(found.right, true_right) / found.sigma)
    # of three components along the worst direction: between one sigma and √3 sigma; ten parts estimate sigma to ±25 %
    assert 0.5 < np.sqrt(np.mean(np.square(ratio))) < 2.0


def test_a_part_that_drifts_or_is_clipped_has_little_say() -> None:
    rng = np.random.default_rng(5)
    estimate = lively()
    true_left, true_right = Rotation.from_rotvec([0.0, 0.3, -2.0]), Rotation.from_rotvec([0.2, -0.1, 0.05])
    rotvec = rng.normal(0.0, 0.002, (N, 3))
    rotvec[1100:] += np.linspace(0.0, 1.5, N - 1100)[:, None] * [0.3, 0.2, 1.0]  # 27 % drifts away by up to 90°
    found = align(estimate, spoilt(estimate.turned(true_left, true_right), rotvec), "rotations")
    assert np.rad2deg(off(found.left, true_left)) < 0.1  # least squares is 14° off
    assert np.rad2deg(off(found.right, true_right)) < 0.1
    assert 0.7 < found.inliers < 0.78
    assert "alignment-outliers" in [f.kind for f in found.findings]


@pytest.mark.parametrize("spoil", ["scattered", "last"])
def test_nearly_half_may_be_wrong(spoil: str) -> None:
    rng = np.random.default_rng(1)
    estimate = lively()
    true_left, true_right = Rotation.from_rotvec([0.0, 0.3, -2.0]), Rotation.from_rotvec([1.2, -0.1, 2.0])
    wrong = rng.random(N) < 0.4 if spoil == "scattered" else np.arange(N) >= 0.6 * N
    rotvec = rng.normal(0.0, 0.01, (N, 3))
    rotvec[wrong] = Rotation.random(int(wrong.sum()), rng=rng).as_rotvec()
    found = align(estimate, spoilt(estimate.turned(true_left, true_right), rotvec), "rotations")
    # noise of 0.6° over 900 good samples
    assert np.rad2deg(off(found.left, true_left)) < 0.2
    assert np.rad2deg(off(found.right, true_right)) < 0.2
    assert found.inliers == pytest.approx(0.6, abs=0.03)


def test_unrelated_orientations_give_a_warning_and_no_mirror_image() -> None:
    """The best map between unrelated rotation vectors is a reflection in half of the cases."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        truth = Orientation.from_rotation(TIME[:200], Rotation.random(200, rng=rng), "ENU")
        found = align(lively()[:200], truth, "rotations")
        assert np.rad2deg(found.residual) > 60.0
        assert found.findings[0].kind == "alignment-weak"


@pytest.mark.parametrize("degrees", [0.0, 1e-7, 57.0, -179.999, 180.0])
def test_heading_offset_is_found_exactly(degrees: float) -> None:
    turn = Rotation.from_euler("z", degrees, degrees=True)
    estimate = lively()
    found = align(estimate, estimate.turned(left=turn), "heading")
    assert off(found.left, turn) < 1e-12  # rad
    assert found.right.magnitude() == 0.0
    assert found.residual < 1e-12


def test_heading_offset_is_the_least_squares_one() -> None:
    rng = np.random.default_rng(6)
    estimate = lively()
    truth = spoilt(estimate.turned(left=Rotation.from_euler("z", 1.0)), rng.normal(0.0, 0.5, (N, 3)))
    found = align(estimate, truth, "heading")

    def cost(angle: float) -> float:
        left = Rotation.from_euler("z", angle).as_matrix()
        return float(np.sum((truth.rotation.as_matrix() - left @ estimate.rotation.as_matrix()) ** 2))

    best = minimize_scalar(cost, bracket=(0.5, 1.5), options={"xtol": 1e-10})
    # a minimum is found to the square root of the rounding in the cost
    assert found.left.as_rotvec()[2] == pytest.approx(best.x, abs=1e-6)  # rad


def test_none_leaves_everything_as_it_is() -> None:
    estimate = lively()
    found = align(estimate, estimate.turned(left=Rotation.from_euler("z", 0.1)), "none")
    assert found.left.magnitude() == found.right.magnitude() == 0.0
    assert found.residual == pytest.approx(0.1, abs=1e-12)
    assert not found.findings


def about_one_axis(wobble: float) -> Orientation:
    angle = np.sin(TIME) * 2.0
    small = np.column_stack([wobble * np.sin(2.7 * TIME), wobble * np.cos(1.9 * TIME), np.zeros(N)])
    return Orientation.from_rotation(
        TIME, Rotation.from_rotvec(np.outer(angle, [0, 0, 1])) * Rotation.from_rotvec(small), "ENU"
    )


@pytest.mark.parametrize("wobble", [0.0, 0.001, 0.005])
def test_rotation_about_one_axis_is_refused(wobble: float) -> None:
    estimate = about_one_axis(wobble)
    with pytest.raises(
        InputError, match="rotation about at least two axes, to find the alignment, got a spread of 0"
    ):
        align(estimate, estimate, "rotations")


@pytest.mark.parametrize("n", [1, 2])
def test_too_few_samples_are_refused(n: int) -> None:
    with pytest.raises(InputError, match="rotation about at least two axes"):
        align(lively()[:n], lively()[:n], "rotations")


def test_a_body_at_rest_is_refused() -> None:
    rest = Orientation(TIME, np.tile([1.0, 0.0, 0.0, 0.0], (N, 1)), "ENU")
    with pytest.raises(InputError, match="rotation about at least two axes"):
        align(rest, rest, "rotations")


def test_poor_motion_is_reported() -> None:
    rng = np.random.default_rng(7)
    truth = about_one_axis(0.05)
    drift = np.repeat(rng.normal(0.0, 0.03, (15, 3)), 100, axis=0)
    found = align(spoilt(truth, drift), truth, "rotations")
    finding = found.findings[0]
    assert (finding.kind, finding.severity) == ("alignment-weak", "warning")
    assert found.sigma > np.deg2rad(1.0)
    assert "use a part with more of it" in finding.message


def test_mask_limits_what_is_used() -> None:
    estimate = lively()
    rotvec = np.zeros((N, 3))
    rotvec[:900] = [0.0, 0.0, 1.0]  # the larger part is wrong
    keep = np.arange(N) >= 900
    found = align(spoilt(estimate, rotvec), estimate, "heading", mask=keep)
    assert found.left.magnitude() < 1e-12
    assert "residual" in repr(found)


def test_unknown_kind_is_named() -> None:
    with pytest.raises(InputError, match="kind to be one of none, heading, rotations, got 'yaw'"):
        align(lively(), lively(), "yaw")  # type: ignore[arg-type]
