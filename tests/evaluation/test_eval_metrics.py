"""Error metrics: closed forms, algebraic laws, and an independent decomposition."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from northdown.errors import InputError
from northdown.evaluation import ErrorSummary, attitude_error
from northdown.orientation import Orientation
from northdown.recording import Recording

TIME = np.arange(50) * 0.01
# Quaternions carry 1e-16 per component; products and arctangents of them a few of these.
ROUNDING = 1e-14  # rad


def some(seed: int = 1, frame: str = "NED", n: int = 50) -> Orientation:
    return Orientation.from_rotation(np.arange(n) * 0.01, Rotation.random(n, rng=np.random.default_rng(seed)), frame)


def turned(truth: Orientation, rotvec: object) -> Orientation:
    """exp(rotvec) · truth, rotvec (3,) or (N, 3) in rad."""
    return Orientation.from_rotation(truth.time, Rotation.from_rotvec(rotvec) * truth.rotation, truth.frame)


@pytest.mark.parametrize("frame", ["NED", "ENU", "NWU"])
def test_equal_orientations_have_no_error(frame: str) -> None:
    truth = some(frame=frame)
    error = attitude_error(truth, truth)
    assert len(error) == 50
    for value in (error.total, error.heading, error.inclination, error.rotvec):
        assert np.abs(value).max() < ROUNDING


@pytest.mark.parametrize("degrees", [1e-9, 0.1, -30.0, 179.0, -179.9])
def test_turn_about_the_vertical_is_heading_only(degrees: float) -> None:
    truth = some()
    error = attitude_error(turned(truth, [0.0, 0.0, math.radians(degrees)]), truth)
    np.testing.assert_allclose(error.heading_signed, math.radians(degrees), rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(error.total, abs(math.radians(degrees)), rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(error.heading, abs(math.radians(degrees)), rtol=0, atol=ROUNDING)
    assert error.inclination.max() < ROUNDING


@pytest.mark.parametrize("degrees", [1e-9, 0.1, 90.0, 179.0])
def test_turn_about_the_horizontal_is_inclination_only(degrees: float) -> None:
    truth = some()
    axis = np.array([0.6, -0.8, 0.0])
    error = attitude_error(turned(truth, math.radians(degrees) * axis), truth)
    np.testing.assert_allclose(error.inclination, math.radians(degrees), rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(error.total, math.radians(degrees), rtol=0, atol=ROUNDING)
    # w = cos(179°/2) is 0.0087, so that rounding in z is enlarged a hundredfold
    assert error.heading.max() < 100 * ROUNDING


def test_half_turns_are_defined() -> None:
    truth = some()
    about_z = attitude_error(turned(truth, [0.0, 0.0, math.pi]), truth)
    np.testing.assert_allclose(about_z.heading, math.pi, rtol=0, atol=ROUNDING)
    none, half = Orientation([0.0], [[1.0, 0.0, 0.0, 0.0]]), [0.0, 0.0, 0.0, 1.0]
    for sign in (1.0, -1.0):
        exact = attitude_error(Orientation([0.0], sign * np.array([half])), none)
        assert exact.heading_signed[0] == math.pi  # of −π and π, both of which fit, always the same
    about_x = attitude_error(turned(truth, [math.pi, 0.0, 0.0]), truth)
    np.testing.assert_allclose(about_x.inclination, math.pi, rtol=0, atol=ROUNDING)
    # upside down there is no heading error to speak of, but there is a number
    assert np.isfinite(about_x.heading).all()


def test_heading_and_inclination_against_the_direction_of_the_vertical() -> None:
    """Inclination is the angle between where the two say that up is; the rest is a turn about the vertical."""
    truth, estimate = some(1), some(2)
    error = attitude_error(estimate, truth)
    up_error = (estimate.rotation * truth.rotation.inv()).apply([0.0, 0.0, 1.0])
    np.testing.assert_allclose(
        error.inclination, np.arccos(up_error[:, 2]), rtol=0, atol=1e-7
    )  # rad, arccos loses half
    tilt_axis = np.cross([0.0, 0.0, 1.0], up_error)
    tilt = Rotation.from_rotvec(tilt_axis / np.linalg.norm(tilt_axis, axis=1)[:, None] * error.inclination[:, None])
    heading = (tilt.inv() * estimate.rotation * truth.rotation.inv()).as_rotvec()
    np.testing.assert_allclose(heading[:, :2], 0.0, atol=1e-7)
    np.testing.assert_allclose(heading[:, 2], error.heading_signed, rtol=0, atol=1e-7)


def test_published_formulas() -> None:
    """The formulas as BROAD's authors print them, and SciPy's angle of the rotation."""
    truth, estimate = some(3, "ENU"), some(4, "ENU")
    error = attitude_error(estimate, truth)
    _, _, z, w = (estimate.rotation * truth.rotation.inv()).as_quat().T
    np.testing.assert_allclose(error.total, 2 * np.arccos(np.abs(w)), rtol=0, atol=1e-7)
    np.testing.assert_allclose(error.heading, 2 * np.arctan(np.abs(z / w)), rtol=0, atol=1e-12)
    np.testing.assert_allclose(error.inclination, 2 * np.arccos(np.sqrt(w**2 + z**2)), rtol=0, atol=1e-7)
    angle = (estimate.rotation * truth.rotation.inv()).magnitude()
    np.testing.assert_allclose(error.total, angle, rtol=0, atol=1e-12)


def test_rotvec_turns_the_truth_into_the_estimate() -> None:
    truth, estimate = some(5), some(6, "ENU")
    error = attitude_error(estimate, truth)
    again = Rotation.from_rotvec(error.rotvec) * truth.to_frame("ENU").rotation
    assert (again.inv() * estimate.rotation).magnitude().max() < ROUNDING
    assert error.frame == "ENU"


small = st.floats(-3.0, 3.0, allow_nan=False)


@settings(max_examples=30, deadline=None)
@given(st.tuples(small, small, small), st.tuples(small, small, small), st.floats(-3.0, 3.0))
def test_common_rotations_change_nothing(error: tuple, body: tuple, heading: float) -> None:
    """Remounting the body, or turning the navigation frame about the vertical, alike for both."""
    truth = some(7, n=5)
    estimate = turned(truth, error)
    plain = attitude_error(estimate, truth)
    left, right = Rotation.from_rotvec([0.0, 0.0, heading]), Rotation.from_rotvec(body)
    common = attitude_error(estimate.turned(left, right), truth.turned(left, right))
    # rad; near upside down heading depends on rounding, everything else never does
    np.testing.assert_allclose(common.total, plain.total, rtol=0, atol=1e-7)
    np.testing.assert_allclose(common.inclination, plain.inclination, rtol=0, atol=1e-7)
    if plain.inclination.max() < 3.1 and plain.heading.max() < 3.1:
        np.testing.assert_allclose(common.heading_signed, plain.heading_signed, rtol=0, atol=1e-6)


@settings(max_examples=30, deadline=None)
@given(st.tuples(small, small, small), st.sampled_from(["NED", "ENU", "NWU"]), st.sampled_from(["NED", "ENU", "NWU"]))
def test_frames_and_double_cover_do_not_matter(error: tuple, frame: str, other: str) -> None:
    truth = some(8, n=5)
    estimate = turned(truth, error)
    plain = attitude_error(estimate, truth).rmse()
    negative = Orientation(truth.time, -truth.quat, truth.frame)
    again = attitude_error(estimate.to_frame(frame), negative.to_frame(other)).rmse()
    assert again.total == pytest.approx(plain.total, abs=1e-7)  # rad
    assert again.inclination == pytest.approx(plain.inclination, abs=1e-7)


def test_sizes_are_those_of_the_samples() -> None:
    degrees = np.array([1.0, 2.0, 3.0, 10.0])
    truth = some(9, n=4)
    rotvec = np.zeros((4, 3))
    rotvec[:, 2] = np.deg2rad(degrees) * [1, -1, 1, -1]
    error = attitude_error(turned(truth, rotvec), truth)
    assert error.rmse().heading_deg == pytest.approx(math.sqrt((1 + 4 + 9 + 100) / 4), abs=1e-12)
    assert error.mean().heading_deg == pytest.approx(4.0, abs=1e-12)
    assert error.max().total_deg == pytest.approx(10.0, abs=1e-12)
    assert error.percentile(50.0).total_deg == pytest.approx(2.5, abs=1e-12)
    assert str(ErrorSummary(math.radians(1.5), 0.0, 0.0)).startswith("total 1.500°")
    with pytest.raises(InputError, match="percent between 0 and 100"):
        error.percentile(101.0)


def test_small_errors_keep_their_digits() -> None:
    truth = some(10)
    error = attitude_error(turned(truth, [3e-10, 0.0, 4e-10]), truth)
    np.testing.assert_allclose(error.total, 5e-10, rtol=1e-5)  # 2 acos|w| would give 0 or 2e-8
    np.testing.assert_allclose(error.inclination, 3e-10, rtol=1e-5)
    np.testing.assert_allclose(error.heading, 4e-10, rtol=1e-5)


def test_recording_brings_mask_and_alignment() -> None:
    truth = some(11)
    movement = np.arange(50) >= 20
    turn = Rotation.from_rotvec([0.0, 0.0, 0.7])
    estimate = truth.turned(left=turn)
    recording = Recording(
        TIME, np.zeros((50, 3)), reference=truth, movement=movement, reference_offset="heading", name="r"
    )
    error = attitude_error(estimate, recording)
    assert error.index.tolist() == list(range(20, 50))
    assert error.total.max() < ROUNDING
    assert error.alignment is not None
    plain = attitude_error(estimate, recording, alignment="none")
    np.testing.assert_allclose(plain.heading_signed, 0.7, atol=1e-12)
    assert plain.alignment is None
    both = attitude_error(estimate, recording, mask=np.arange(50) < 25)
    assert both.index.tolist() == list(range(20, 25))
    given_before = attitude_error(estimate.to_frame("ENU"), truth, alignment=error.alignment)
    assert given_before.total.max() < ROUNDING


def test_table_has_a_row_per_sample() -> None:
    truth = some(12)
    table = attitude_error(turned(truth, [0.1, 0.2, 0.3]), truth).to_pandas()
    assert list(table)[:5] == ["time", "total", "heading", "inclination", "heading_signed"]
    np.testing.assert_allclose(table["rotvec_y"], 0.2, atol=1e-12)
    assert table.attrs["frame"] == "NED"
    assert "RMSE total" in repr(attitude_error(truth, truth))


@pytest.mark.parametrize("alignment", ["yaw", "", 3])
def test_unknown_alignment_is_named(alignment: object) -> None:
    with pytest.raises(InputError, match="alignment to be one of none, heading, rotations"):
        attitude_error(some(), some(), alignment=alignment)  # type: ignore[arg-type]
