"""Quaternion, SO(3), Euler and direction kernels against SciPy and algebraic laws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from northdown.kernels import euler, quaternion, so3, wahba
from northdown.kernels.direction_error import field_error, gravity_error

# A few roundings of numbers near 1.
ROUNDING = 1e-14

component = st.floats(-1.0, 1.0)
quaternions = (
    st.tuples(component, component, component, component)
    .filter(lambda q: sum(c * c for c in q) > 1e-3)
    .map(lambda q: tuple(c / math.sqrt(sum(d * d for d in q)) for c in q))
)
vectors = st.tuples(*[st.floats(-100.0, 100.0)] * 3)
directions = vectors.filter(lambda v: sum(c * c for c in v) > 1e-2)


def scipy_of(q):
    return Rotation.from_quat(np.roll(q, -1))


@given(quaternions, quaternions)
@settings(max_examples=60, deadline=None)
def test_product_is_scipys(p, q):
    expected = (scipy_of(p) * scipy_of(q)).as_matrix()
    assert np.allclose(scipy_of(quaternion.multiply(p, q)).as_matrix(), expected, atol=ROUNDING)


@given(quaternions, st.sampled_from([1e-9, 1e-3, 0.1, 3.0]), directions)
@settings(max_examples=60, deadline=None)
def test_turns_in_body_and_navigation_axes_are_scipys(q, size, v):
    v = tuple(size * np.array(v) / np.linalg.norm(v))
    long = tuple(1.00001 * c for c in q)  # as rounding would leave it after very many steps
    turned = so3.turn_body(long, v)
    assert np.allclose(
        scipy_of(turned).as_matrix(), (scipy_of(q) * Rotation.from_rotvec(v)).as_matrix(), atol=ROUNDING
    )
    assert abs(np.linalg.norm(turned) - 1.0) < ROUNDING
    turned = so3.turn_navigation(v, long)
    assert np.allclose(
        scipy_of(turned).as_matrix(), (Rotation.from_rotvec(v) * scipy_of(q)).as_matrix(), atol=ROUNDING
    )
    assert abs(np.linalg.norm(turned) - 1.00001) < ROUNDING


@given(quaternions, vectors)
@settings(max_examples=60, deadline=None)
def test_rotate_is_scipys_and_its_inverse_undoes_it(q, v):
    turned = quaternion.rotate(q, v)
    assert np.allclose(turned, scipy_of(q).apply(v), atol=1e-12)  # 1e-12: components up to 100
    assert np.allclose(quaternion.rotate_inverse(q, turned), v, atol=1e-12)


@given(quaternions)
@settings(max_examples=60, deadline=None)
def test_matrix_and_down(q):
    m = scipy_of(q).as_matrix()
    back = quaternion.from_matrix(*m.ravel())
    assert min(np.abs(np.subtract(back, q)).max(), np.abs(np.add(back, q)).max()) < ROUNDING * 10
    assert np.allclose(quaternion.down_b(q), m[2], atol=ROUNDING)


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-12, 1e-5, 6.3e-3, 6.4e-3, 0.1, 1.0, 3.0, math.pi])
def test_exp_and_log_at_every_size(angle):
    axis = np.array([2.0, -3.0, 6.0]) / 7.0
    q = so3.exp(tuple(angle * axis))
    truth = (math.cos(angle / 2), *(math.sin(angle / 2) * axis))
    # both branches: relative precision of the vector part, also where angle² underflows
    assert np.allclose(q, truth, rtol=4e-16, atol=3e-16 * angle)
    assert np.allclose(so3.log(q), angle * axis, rtol=1e-14, atol=1e-300)


@given(quaternions)
@settings(max_examples=60, deadline=None)
def test_log_takes_the_shorter_way_whatever_the_sign(q):
    v = np.array(so3.log(q))
    assert np.linalg.norm(v) <= math.pi + ROUNDING
    assert np.allclose(Rotation.from_rotvec(v).as_matrix(), scipy_of(q).as_matrix(), atol=1e-12)
    w = so3.log(tuple(-c for c in q))
    # at exactly half a turn the sign of the axis is free
    assert np.allclose(v, w, atol=1e-12) or np.isclose(np.linalg.norm(v), math.pi)


@given(quaternions)
@settings(max_examples=60, deadline=None)
def test_euler_round_trip_and_scipy(q):
    angles = euler.to_zyx(q)
    back = euler.from_zyx(angles)
    # near pitch ±90° roll and yaw are ill-defined but together still right
    assert np.allclose(scipy_of(back).as_matrix(), scipy_of(q).as_matrix(), atol=1e-7)
    if abs(angles[1]) < 1.5:
        off = np.subtract(angles, scipy_of(q).as_euler("ZYX")[::-1])
        assert np.allclose(np.sin(off / 2.0), 0.0, atol=1e-11)  # equal but for whole turns


@given(st.floats(-50.0, 50.0))
@settings(max_examples=40, deadline=None)
def test_wrap(angle):
    w = euler.wrap(angle)
    assert -math.pi - 1e-12 <= w <= math.pi + 1e-12
    assert math.isclose(math.cos(w), math.cos(angle), abs_tol=1e-12)
    assert math.isclose(math.sin(w), math.sin(angle), abs_tol=1e-12)


@given(quaternions, directions)
@settings(max_examples=60, deadline=None)
def test_tilt_correction_levels_about_a_horizontal_axis(q, acc):
    arc = wahba.tilt_correction(q, acc)
    level = quaternion.rotate(quaternion.multiply(arc, q), quaternion.unit(acc))
    assert np.allclose(level, (0.0, 0.0, -1.0), atol=1e-6)  # 1e-6: the half turn is taken within that of it
    assert arc[3] == 0.0


@given(quaternions, directions, directions)
@settings(max_examples=60, deadline=None)
def test_triad_is_tilt_and_heading(q, acc, mag):
    if np.linalg.norm(np.cross(acc, mag)) < 1e-2 * np.linalg.norm(acc) * np.linalg.norm(mag):
        return
    level = quaternion.multiply(wahba.tilt_correction(q, acc), q)
    compass = wahba.turn_about_down(wahba.heading_error(level, mag), level)
    triad = wahba.triad(acc, mag, (0.0, 0.0, -1.0), (1.0, 0.0, 0.3))
    # 1e-4: near the half turn the tilt correction's axis is lost to rounding
    assert (scipy_of(compass) * scipy_of(triad).inv()).magnitude() < 1e-4


@given(quaternions, directions, st.floats(-1.2, 1.2))
@settings(max_examples=60, deadline=None)
def test_direction_errors_vanish_at_the_truth_and_point_home(q, small, dip):
    up_b = quaternion.rotate_inverse(q, (0.0, 0.0, -9.81))
    field_b = quaternion.rotate_inverse(q, (40.0 * math.cos(dip), 0.0, 40.0 * math.sin(dip)))
    assert np.allclose(gravity_error(q, up_b), 0.0, atol=1e-13)
    assert np.allclose(field_error(q, field_b), 0.0, atol=1e-13)
    # an estimate off by a small body rotation δ: the gravity error is −(δ without its part along up)
    delta = 1e-5 * np.array(small) / np.linalg.norm(small)
    off = quaternion.multiply(q, so3.exp(tuple(delta)))
    up = np.array(up_b) / np.linalg.norm(up_b)
    assert np.allclose(gravity_error(off, up_b), -(delta - up * (up @ delta)), atol=1e-9)  # second order in δ
