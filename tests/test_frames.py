"""Frames, mountings, Euler angles and their rates, against SciPy, closed forms and numerical differentiation."""

from __future__ import annotations

import itertools
import math
import warnings
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from northdown import frames
from northdown.errors import InputError

# Rounding of a few products of numbers of size one.
ROUNDING = 1e-14
FRAMES = ("NED", "ENU", "NWU")
quick = settings(max_examples=60, deadline=None)
angle = st.floats(-math.pi, math.pi)


@pytest.mark.parametrize(
    ("frame", "north", "east", "down"),
    [
        ("NED", (1, 0, 0), (0, 1, 0), (0, 0, 1)),
        ("ENU", (0, 1, 0), (1, 0, 0), (0, 0, -1)),
        ("NWU", (1, 0, 0), (0, -1, 0), (0, 0, -1)),
    ],
)
def test_each_frame_has_its_axes(frame: str, north: Any, east: Any, down: Any) -> None:
    turn = frames.rotation_between("NED", frame)
    np.testing.assert_allclose(turn.apply(np.eye(3)), [north, east, down], atol=ROUNDING)
    np.testing.assert_allclose(frames.up_axis(frame), -np.array(down), atol=0)
    # the quaternion is the same rotation, scalar first
    w, x, y, z = frames.quat_from_ned(frame)
    np.testing.assert_allclose(Rotation.from_quat([x, y, z, w]).as_matrix(), turn.as_matrix(), atol=ROUNDING)


@pytest.mark.parametrize(("a", "b", "c"), list(itertools.product(FRAMES, repeat=3)))
def test_changes_of_frame_chain(a: str, b: str, c: str) -> None:
    chained = frames.rotation_between(b, c) * frames.rotation_between(a, b)
    assert (chained * frames.rotation_between(a, c).inv()).magnitude() < ROUNDING


def test_frame_names_in_any_case() -> None:
    assert frames.check_frame("enu") == "ENU"
    for bad in ("UEN", "", "NED ", None, 3, ["NED"], np.array(["NED", "ENU"])):
        with pytest.raises(InputError, match="expected frame to be one of NED, ENU, NWU"):
            frames.check_frame(bad)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("latitude", "longitude", "north", "east", "down"),
    [
        (0, 0, (0, 0, 1), (0, 1, 0), (-1, 0, 0)),  # Gulf of Guinea: down is −x
        (0, 90, (0, 0, 1), (-1, 0, 0), (0, -1, 0)),
        (0, 180, (0, 0, 1), (0, -1, 0), (1, 0, 0)),
        (90, 0, (-1, 0, 0), (0, 1, 0), (0, 0, -1)),  # the pole, coming up the Greenwich meridian
        (-90, 0, (1, 0, 0), (0, 1, 0), (0, 0, 1)),
        (45, 0, (-math.sqrt(0.5), 0, math.sqrt(0.5)), (0, 1, 0), (-math.sqrt(0.5), 0, -math.sqrt(0.5))),
    ],
)
def test_ecef_at_known_places(latitude: float, longitude: float, north: Any, east: Any, down: Any) -> None:
    mat = frames.mat_ecef_ned(math.radians(latitude), math.radians(longitude))
    np.testing.assert_allclose(mat.T, [north, east, down], atol=ROUNDING)


@quick
@given(st.floats(-1.5, 1.5), angle)
def test_ecef_axes_are_derivatives_of_the_position(lat: float, lon: float) -> None:
    def unit(a: float, b: float) -> Any:
        return np.array([math.cos(a) * math.cos(b), math.cos(a) * math.sin(b), math.sin(a)])

    h = 1e-6
    mat = frames.mat_ecef_ned(lat, lon)
    north = (unit(lat + h, lon) - unit(lat - h, lon)) / (2 * h)
    east = (unit(lat, lon + h) - unit(lat, lon - h)) / (2 * h * math.cos(lat))
    # central difference: h² from the series plus 1e-16/h from rounding, over cos(1.5) = 0.07 for east
    np.testing.assert_allclose(mat, np.column_stack([north, east, -unit(lat, lon)]), atol=3e-9)
    np.testing.assert_allclose(mat.T @ mat, np.eye(3), atol=ROUNDING)
    assert np.linalg.det(mat) > 0


@pytest.mark.parametrize("bad", [2.0, -1.6, math.nan, math.inf, "north", None, 10**400])
def test_ecef_wants_a_latitude_in_radians(bad: Any) -> None:
    with pytest.raises(InputError, match="latitude"):
        frames.mat_ecef_ned(bad, 0.0)


def all_mountings() -> list[str]:
    found = []
    for axes in itertools.permutations("xyz"):
        for signs in itertools.product(("", "-"), repeat=3):
            spec = ",".join(s + a for s, a in zip(signs, axes, strict=True))
            parity = (-1) ** (sum(s == "-" for s in signs)) * (
                1 if "".join(axes) in ("xyz", "yzx", "zxy") else -1
            )  # even permutations by their names
            if parity > 0:
                found.append(spec)
    return found


def test_mountings_are_the_rotation_group_of_the_cube() -> None:
    mats = {spec: frames.mounting_matrix(spec) for spec in all_mountings()}
    keys = {tuple(m.ravel()) for m in mats.values()}
    assert len(keys) == 24
    for m in mats.values():
        assert np.array_equal(m @ m.T, np.eye(3))
        assert tuple(m.T.ravel()) in keys
    for a, b in itertools.product(list(mats.values())[::5], mats.values()):
        assert tuple((a @ b).ravel()) in keys


def test_a_mounting_says_what_each_new_axis_was() -> None:
    new = frames.mounting_matrix("y,-x,z") @ [1.0, 2.0, 3.0]
    assert new.tolist() == [2.0, -1.0, 3.0]
    assert np.array_equal(frames.mounting_matrix(" Y , −x,+z"), frames.mounting_matrix("y,-x,z"))


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("x,y", "name three signed axes"),
        ("x,y,z,x", "name three signed axes"),
        ("x,y,w", "name three signed axes"),
        ("--x,y,z", "name three signed axes"),
        ("", "name three signed axes"),
        (None, "name three signed axes"),
        (("x", "y", "z"), "name three signed axes"),
        ("x,x,z", "each of x, y, z once"),
        ("x,-x,z", "each of x, y, z once"),
        ("x,y,-z", "mirrors space"),
        ("y,x,z", "mirrors space"),
    ],
)
def test_bad_mountings(spec: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        frames.mounting_matrix(spec)


@quick
@given(st.text(alphabet="xyzXYZ+-−, \n", max_size=12))
def test_a_mounting_is_a_rotation_or_an_error(spec: str) -> None:
    try:
        mat = frames.mounting_matrix(spec)
    except InputError:
        return
    assert round(float(np.linalg.det(mat))) == 1


def test_zyx_angles_are_scipys() -> None:
    rotation = Rotation.random(500, random_state=3)
    # within a degree of pitch ±90° the angles lose digits as 1/cos(pitch): there 60 roundings at most
    np.testing.assert_allclose(frames.as_euler(rotation), rotation.as_euler("ZYX")[:, ::-1], atol=100 * ROUNDING)


def test_rfu_angles_are_scipys() -> None:
    rotation = Rotation.random(500, random_state=4)
    heading, pitch, roll = (rotation.as_euler("ZXY") * [-1, 1, 1]).T
    expected = np.column_stack([pitch, roll, heading])
    np.testing.assert_allclose(frames.as_euler(rotation, "rfu"), expected, atol=100 * ROUNDING)


@pytest.mark.parametrize("convention", ["zyx", "rfu"])
def test_a_single_rotation_gives_three_angles(convention: str) -> None:
    angles = np.array([0.1, -0.2, 0.3])
    rotation = frames.from_euler(angles, convention)
    assert rotation.single
    np.testing.assert_allclose(frames.as_euler(rotation, convention), angles, atol=ROUNDING)
    empty = frames.from_euler(np.zeros((0, 3)), convention)
    assert frames.as_euler(empty, convention).shape == (0, 3)


def test_what_the_angles_mean() -> None:
    # NED, body forward-right-down: yaw 90° points the nose east, pitch up lifts it, roll right lowers the right wing
    nose, right = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    np.testing.assert_allclose(frames.from_euler([0, 0, math.pi / 2]).apply(nose), [0, 1, 0], atol=ROUNDING)
    assert frames.from_euler([0, 0.1, 0]).apply(nose)[2] < 0
    assert frames.from_euler([0.1, 0, 0]).apply(right)[2] > 0
    # ENU, body right-forward-up: heading clockwise from north, pitch lifts the nose, roll lowers the right side
    forward, right = np.array([0, 1.0, 0]), np.array([1.0, 0, 0])
    east = frames.from_euler([0, 0, math.pi / 2], "rfu").apply(forward)
    np.testing.assert_allclose(east, [1, 0, 0], atol=ROUNDING)
    assert frames.from_euler([0.1, 0, 0], "rfu").apply(forward)[2] > 0
    assert frames.from_euler([0, 0.1, 0], "rfu").apply(right)[2] < 0


def test_both_conventions_describe_the_same_aircraft() -> None:
    # the same attitude with a forward-right-down body in NED and a right-forward-up body in ENU
    angles = np.random.default_rng(5).uniform([-3, -1.5, -3], [3, 1.5, 3], (200, 3))
    to_frd = Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]])  # right-forward-up → forward-right-down
    enu = frames.rotation_between("NED", "ENU") * frames.from_euler(angles) * to_frd
    pitch, roll, heading = frames.as_euler(enu, "rfu").T
    # 1/cos(1.5) = 14 roundings
    np.testing.assert_allclose(np.column_stack([roll, pitch, heading]), angles, atol=50 * ROUNDING)


@pytest.mark.parametrize("convention", ["zyx", "rfu"])
@pytest.mark.parametrize("sign", [1, -1])
def test_gimbal_lock(convention: str, sign: int) -> None:
    middle = 0 if convention == "rfu" else 1
    angles = np.array([[0.3, 0.3, 0.8], [-2.0, -2.0, 3.0], [0.0, 0.0, -1.0]])
    angles[:, middle] = sign * math.pi / 2
    rotation = frames.from_euler(angles, convention)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        locked = frames.as_euler(rotation, convention)
    assert (locked[:, 1 - middle] == 0).all()  # roll
    np.testing.assert_allclose(locked[:, middle], sign * math.pi / 2, atol=2e-16)
    # still the same rotation; the lock is declared within 1e-9 rad
    np.testing.assert_array_less((frames.from_euler(locked, convention) * rotation.inv()).magnitude(), 2e-9)


def test_gimbal_lock_is_scipys_too() -> None:
    rotation = frames.from_euler([[0.4, math.pi / 2, 1.0], [0.4, -math.pi / 2, 1.0]])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        theirs = rotation.as_euler("ZYX")[:, ::-1]
    np.testing.assert_allclose(frames.as_euler(rotation), theirs, atol=1e-7)  # their threshold is 1e-7 rad


@pytest.mark.parametrize("off", [1e-3, 1e-6, 1e-8])
def test_near_gimbal_lock_pitch_keeps_its_digits(off: float) -> None:
    angles = np.array([0.2, math.pi / 2 - off, -0.7])
    found = frames.as_euler(frames.from_euler(angles))
    assert abs(found[1] - angles[1]) < 4e-16  # asin would be off by 1e-8
    # roll and yaw lose what one over the cosine takes
    np.testing.assert_allclose(found, angles, atol=1e-15 / off)


@pytest.mark.parametrize("convention", ["zyx", "rfu"])
@pytest.mark.parametrize("size", [1e-6, 1e-9, 1e-12, 1e-150])
def test_tiny_angles_keep_their_digits(convention: str, size: float) -> None:
    angles = size * np.array([1.0, -2.0, 3.0])
    # relative: second order in the angles, and rounding
    np.testing.assert_allclose(
        frames.as_euler(frames.from_euler(angles, convention), convention), angles, rtol=10 * size + ROUNDING
    )


@quick
@given(angle, st.floats(-1.55, 1.55), angle, st.sampled_from(["zyx", "rfu"]))
def test_euler_angles_come_back(a: float, b: float, c: float, convention: str) -> None:
    angles = np.array([b, a, c] if convention == "rfu" else [a, b, c])
    again = frames.as_euler(frames.from_euler(angles, convention), convention)
    # modulo a turn; 1/cos(1.55) = 48 roundings of a few 1e-16
    difference = (again - angles + math.pi) % (2 * math.pi) - math.pi
    np.testing.assert_allclose(difference, 0.0, atol=1e-13)


@pytest.mark.parametrize(
    ("angles", "message"),
    [
        ([0.1, 0.2], "angles of shape"),
        ([[[0.1, 0.2, 0.3]]], "angles of shape"),
        ([[0, 0, 0], [0, math.nan, 0]], "finite angles, got NaN or infinity, at sample 1"),
        ([math.inf, 0, 0], "finite angles"),
        (["a", "b", "c"], "real numbers"),
    ],
)
def test_bad_angles(angles: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        frames.from_euler(angles)


def test_unknown_convention() -> None:
    for call in (lambda: frames.as_euler(Rotation.identity(), "xyz"), lambda: frames.from_euler([0, 0, 0], "ZYX")):
        with pytest.raises(InputError, match="convention to be one of zyx, rfu"):
            call()


@quick
@given(angle, st.floats(-1.5, 1.5))
def test_rate_matrices_are_inverses(roll: float, pitch: float) -> None:
    product = frames.rate_from_euler_rate(roll, pitch) @ frames.euler_rate_from_rate(roll, pitch)
    np.testing.assert_allclose(product, np.eye(3), atol=20 * ROUNDING)  # tan(1.5) = 14


@quick
@given(angle, st.floats(-1.4, 1.4), angle, st.tuples(*[st.floats(-3, 3)] * 3))
def test_rates_agree_with_differences_of_the_angles(
    roll: float, pitch: float, yaw: float, rate: tuple[float, float, float]
) -> None:
    start = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    h = 1e-5

    def angles(t: float) -> Any:  # a body that turns at a constant rate, by SciPy alone
        return (start * Rotation.from_rotvec(np.array(rate) * t)).as_euler("ZYX")[::-1]

    difference = (angles(h) - angles(-h) + math.pi) % (2 * math.pi) - math.pi
    expected = difference / (2 * h)
    found = frames.euler_rate_from_rate(roll, pitch) @ rate
    # h² × third derivative (rate³ / cos³ ≈ 27 × 200) and rounding 1e-16 / h / cos
    np.testing.assert_allclose(found, expected, atol=3e-6)
    np.testing.assert_allclose(frames.rate_from_euler_rate(roll, pitch) @ expected, rate, atol=1e-5)


def test_euler_rates_at_the_singularity() -> None:
    for pitch in (math.pi / 2, -math.pi / 2, math.pi / 2 - 1e-10):
        with pytest.raises(InputError, match="pitch away from ±90°"):
            frames.euler_rate_from_rate(0.0, pitch)
    assert np.isfinite(frames.rate_from_euler_rate(0.0, math.pi / 2)).all()  # no singularity this way


@pytest.mark.parametrize("function", [frames.rate_from_euler_rate, frames.euler_rate_from_rate])
@pytest.mark.parametrize("bad", [math.nan, math.inf, "x", None])
def test_rates_want_finite_angles(function: Any, bad: Any) -> None:
    with pytest.raises(InputError, match="roll"):
        function(bad, 0.1)
    with pytest.raises(InputError, match="pitch"):
        function(0.1, bad)
