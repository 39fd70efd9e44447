"""`Orientation` as a value: frames, turns, Euler angles, interpolation, with SciPy as the second opinion."""

from __future__ import annotations

import copy
import math
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from northdown.errors import InputError
from northdown.frames import rotation_between
from northdown.orientation import Flag, Orientation

FRAMES = ("NED", "ENU", "NWU")
# Rounding (rad) of a few quaternion products, and of the norm that is made one again.
ROUNDING = 1e-14
N = 40


def make(n: int = N, frame: str = "NED", seed: int = 0) -> Orientation:
    rng = np.random.default_rng(seed)
    spread = rng.normal(size=(n, 3, 3))
    return Orientation.from_rotation(
        np.arange(n) / 10.0,
        Rotation.random(n, random_state=seed) if n else Rotation.from_quat(np.zeros((0, 4))),
        frame,
        covariance=spread @ np.swapaxes(spread, 1, 2),
        gyr_bias=rng.normal(size=(n, 3)),
        flags=rng.integers(0, 16, n),
        name="made",
    )


def apart(a: Rotation, b: Rotation) -> Any:
    return (a * b.inv()).magnitude()


def same(a: Orientation, b: Orientation, atol: float = 20 * ROUNDING) -> None:
    assert a.frame == b.frame
    assert (a.time == b.time).all()
    np.testing.assert_allclose(apart(a.rotation, b.rotation), 0.0, atol=atol)
    np.testing.assert_allclose(a.covariance, b.covariance, atol=atol)
    np.testing.assert_allclose(a.gyr_bias, b.gyr_bias, atol=atol)
    assert (a.flags == b.flags).all()


# ---- building ----


def test_quaternions_are_scalar_first_and_take_body_to_frame() -> None:
    half = math.sqrt(0.5)
    o = Orientation([0.0], [[half, 0, 0, half]])  # a quarter turn about down: the nose points east
    np.testing.assert_allclose(o.rotation[0].apply([1, 0, 0]), [0, 1, 0], atol=ROUNDING)
    np.testing.assert_allclose(o.as_euler(degrees=True), [[0, 0, 90]], atol=1e-12)
    assert (o.frame, len(o), o.covariance, o.gyr_bias) == ("NED", 1, None, None)
    assert o.flags.tolist() == [0]


def test_a_single_rotation_becomes_one_sample() -> None:
    assert len(Orientation.from_rotation([3.0], Rotation.identity())) == 1


def test_the_norm_is_made_one() -> None:
    quat = Rotation.random(N, random_state=2).as_quat()[:, [3, 0, 1, 2]]
    scale = np.linspace(0.991, 1.009, N)[:, None]
    o = Orientation(np.arange(N), quat * scale)
    np.testing.assert_allclose(np.linalg.norm(o.quat, axis=1), 1.0, atol=4e-16)
    np.testing.assert_allclose(o.quat, quat, atol=4e-16)
    # what is already unit is not touched, so that a copy is a copy
    assert np.array_equal(Orientation(np.arange(N), o.quat).quat, o.quat)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"quat": [[1, 0, 0]]}, r"quat of shape \(1, 4\), order w, x, y, z, got shape \(1, 3\)"),
        ({"quat": [[0, 0, 0, 0]]}, "unit quaternions, got norm 0, at sample 0"),
        ({"quat": [[math.nan] * 4]}, "got norm nan"),
        ({"quat": [[math.inf, 0, 0, 0]]}, "got norm inf"),
        ({"quat": [[1.02, 0, 0, 0]]}, "got norm 1.02"),
        ({"quat": [[1e200, 0, 0, 0]]}, "unit quaternions"),
        ({"time": [0.0, 1.0]}, r"quat of shape \(2, 4\)"),
        ({"time": [math.nan]}, "finite time"),
        ({"frame": "UEN"}, "frame to be one of"),
        ({"covariance": np.eye(3)}, r"covariance of shape \(1, 3, 3\), got shape \(3, 3\)"),
        ({"covariance": np.full((1, 3, 3), np.inf)}, "finite numbers in covariance"),
        ({"gyr_bias": [0, 0, 0]}, "gyr_bias of shape"),
        ({"flags": [0.0]}, "of integers"),
        ({"flags": [0, 0]}, r"flags of shape \(1,\)"),
        ({"flags": [256]}, "flags between 0 and 255, got 256 to 256"),
        ({"flags": [-1]}, "flags between 0 and 255"),
        ({"gyr_bias_sigma": [[0, 0]]}, "gyr_bias_sigma of shape"),
        ({"diagnostics": {"dip": [0.0, 1.0]}}, r"dip of shape \(1,\) in diagnostics, got shape \(2,\)"),
        ({"diagnostics": {"dip": ["low"]}}, "real numbers in dip"),
    ],
    ids=str,
)
def test_bad_values(values: dict[str, Any], message: str) -> None:
    with np.errstate(over="ignore"), pytest.raises(InputError, match=message):
        Orientation(**({"time": [0.0], "quat": [[1, 0, 0, 0]]} | values))


def test_time_must_not_run_backwards_but_may_stand() -> None:
    quat = [[1, 0, 0, 0]] * 3
    assert len(Orientation([1, 1, 2], quat)) == 3
    with pytest.raises(InputError, match=r"does not run backwards, got 0\.5\d* s after 1\.0* s, at sample 2"):
        Orientation([0, 1, 0.5], quat)


def test_from_rotation_wants_a_rotation_of_that_length() -> None:
    with pytest.raises(InputError, match="rotation as a SciPy Rotation, got list"):
        Orientation.from_rotation([0.0], [[1, 0, 0, 0]])  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"shape \(2, 4\)"):
        Orientation.from_rotation([0.0, 1.0], Rotation.identity(3))
    with pytest.raises(TypeError, match="covarianc"):  # a typo is not swallowed
        Orientation.from_rotation([0.0], Rotation.identity(), covarianc=None)


def test_repr_names_the_frame() -> None:
    assert "40 samples, 0 to 3.9 s, body → ENU, with covariance and gyr_bias" in repr(make(frame="ENU"))
    assert "no samples" in repr(make(0))


def test_copies() -> None:
    o = make()
    assert o.rotation is o.rotation  # computed once
    for other in (copy.copy(o), copy.deepcopy(o), pickle.loads(pickle.dumps(o))):
        same(o, other, atol=0.0)
    with pytest.raises(AttributeError):
        o.frame = "ENU"  # type: ignore[misc]


def test_methods_leave_the_original_alone() -> None:
    o = make()
    before = copy.deepcopy(o)
    o.to_frame("ENU"), o.turned(Rotation.random(random_state=1), Rotation.random(random_state=2)), o.at([0.33])
    o.as_euler(), o.as_euler("rfu"), o.to_pandas(), o[3:7], o.has(Flag.GYRO_HELD)
    same(o, before, atol=0.0)
    o.as_euler()[:] = 7.0  # a result is the caller's own
    table = o.to_pandas()
    table.loc[:, "qw"] = 7.0
    same(o, before, atol=0.0)


# ---- parts ----


def test_parts() -> None:
    o = make()
    mask = o.time > 2.0
    for index in (slice(3, 30, 4), mask, np.array([1, 5, 6]), slice(0, 0), np.array([], int)):
        part = o[index]
        for name in ("time", "quat", "covariance", "gyr_bias", "flags"):
            assert np.array_equal(getattr(part, name), getattr(o, name)[index])
        assert (part.frame, part.name) == (o.frame, o.name)


@pytest.mark.parametrize(
    "index", [3, [1, 2], np.array([99]), np.ones(3, bool), np.array([5, 1]), slice(None, None, -1)]
)
def test_bad_parts(index: Any) -> None:
    with pytest.raises(InputError):
        make()[index]


def test_flags() -> None:
    o = Orientation([0, 1, 2], [[1, 0, 0, 0]] * 3, flags=[0, 3, 8])
    assert o.has(Flag.TILT_UNKNOWN).tolist() == [False, True, False]
    assert o.has(Flag.HEADING_UNKNOWN | Flag.LONG_STEP).tolist() == [False, True, True]


# ---- frames and turns ----


@pytest.mark.parametrize("source", FRAMES)
@pytest.mark.parametrize("target", FRAMES)
def test_frames_and_back(source: str, target: str) -> None:
    o = make(frame=source)
    there = o.to_frame(target)
    assert there.frame == target
    turn = rotation_between(source, target)
    # the same vector, fixed to the body, has the components of the other frame
    v = np.array([0.3, -0.5, 0.8])
    np.testing.assert_allclose(there.rotation.apply(v), turn.apply(o.rotation.apply(v)), atol=ROUNDING)
    np.testing.assert_array_equal(there.gyr_bias, o.gyr_bias)  # in body axes
    same(there.to_frame(source), o)


def test_covariance_belongs_to_the_axes_of_the_frame() -> None:
    # uncertain about north only: in ENU that is y
    o = Orientation([0.0], [[1, 0, 0, 0]], covariance=np.diag([4.0, 1.0, 9.0])[None])
    np.testing.assert_allclose(o.to_frame("ENU").covariance, np.diag([1.0, 4.0, 9.0])[None], atol=ROUNDING)
    np.testing.assert_allclose(o.to_frame("NWU").covariance, np.diag([4.0, 1.0, 9.0])[None], atol=ROUNDING)


def test_covariance_predicts_errors_after_a_turn() -> None:
    # errors drawn from the covariance, turned as rotations, have the turned covariance
    rng = np.random.default_rng(8)
    cov = np.array([[4.0, 1.0, 0.5], [1.0, 2.0, -0.3], [0.5, -0.3, 1.0]]) * 1e-6
    truth = Rotation.random(random_state=3)
    left, right = Rotation.random(2, random_state=4)
    errors = Rotation.from_rotvec(rng.multivariate_normal(np.zeros(3), cov, 20_000))
    o = Orientation([0.0], np.roll(truth.as_quat(), 1)[None], covariance=cov[None]).turned(left, right)
    turned_truth = left * errors * truth * right
    delta = (turned_truth * o.rotation[0].inv()).as_rotvec()
    # 1/√20 000 of statistics, times three
    np.testing.assert_allclose(np.cov(delta.T), o.covariance[0], atol=3 * 4e-6 / math.sqrt(20_000))


def test_turns_compose() -> None:
    o = make()
    a, b, c, d = Rotation.random(4, random_state=6)
    same(o.turned(a, c).turned(b, d), o.turned(b * a, c * d), atol=100 * ROUNDING)
    same(o.turned(a, c).turned(a.inv(), c.inv()), o, atol=100 * ROUNDING)
    same(o.turned(), o)
    same(o.turned(Rotation.concatenate([a])), o.turned(a), atol=0.0)


def test_a_remounted_sensor_reads_its_bias_in_the_new_axes() -> None:
    # v_b = right v_b', so a bias b reads right⁻¹ b
    right = Rotation.from_euler("z", 90, degrees=True)
    o = Orientation([0.0], [[1, 0, 0, 0]], gyr_bias=[[1.0, 0, 0]]).turned(right=right)
    np.testing.assert_allclose(o.gyr_bias, [[0, -1, 0]], atol=ROUNDING)
    np.testing.assert_allclose(o.rotation[0].apply(o.gyr_bias[0]), [1, 0, 0], atol=ROUNDING)


@pytest.mark.parametrize("bad", [Rotation.identity(2), Rotation.identity(0), np.eye(3), "x"], ids=str)
def test_turns_want_one_rotation(bad: Any) -> None:
    for side in ("left", "right"):
        with pytest.raises(InputError, match=side):
            make().turned(**{side: bad})


# ---- Euler angles ----


@pytest.mark.parametrize("frame", FRAMES)
def test_aerospace_angles_are_scipys_in_any_frame(frame: str) -> None:
    o = make(frame=frame)
    np.testing.assert_allclose(o.as_euler(), o.rotation.as_euler("ZYX")[:, ::-1], atol=1e-12)
    np.testing.assert_allclose(o.as_euler(degrees=True), np.degrees(o.as_euler()), atol=1e-12)


def test_heading_is_clockwise_from_north_whatever_the_frame() -> None:
    level_east = Rotation.from_euler("z", -90, degrees=True)  # right-forward-up in ENU, forward points east
    o = Orientation.from_rotation([0.0], level_east, "ENU")
    for frame in FRAMES:
        np.testing.assert_allclose(o.to_frame(frame).as_euler("rfu", degrees=True), [[0, 0, 90]], atol=1e-12)


def test_the_sign_of_a_quaternion_says_nothing() -> None:
    o = make()
    other = Orientation(o.time, -o.quat, o.frame)
    np.testing.assert_allclose(o.as_euler(), other.as_euler(), atol=ROUNDING)
    np.testing.assert_allclose(apart(o.at([0.55]).rotation, other.at([0.55]).rotation), 0, atol=ROUNDING)
    mixed = o.quat * np.where(np.arange(N) % 2, 1.0, -1.0)[:, None]
    times = o.time[:-1] + 0.03
    np.testing.assert_allclose(
        apart(Orientation(o.time, mixed).at(times).rotation, o.at(times).rotation), 0, atol=10 * ROUNDING
    )


# ---- interpolation ----


def test_interpolation_is_scipys() -> None:
    o = make()
    times = np.sort(np.random.default_rng(1).uniform(0, 3.9, 200))
    np.testing.assert_allclose(apart(o.at(times).rotation, Slerp(o.time, o.rotation)(times)), 0, atol=1e-13)


def test_at_its_own_times_it_is_itself() -> None:
    o = make()
    same(o.at(o.time), o)
    assert np.array_equal(o.at(o.time).flags, o.flags)


def test_a_constant_rate_is_met_exactly() -> None:
    axis = np.array([0.2, -0.5, 1.0])
    o = Orientation.from_rotation([0.0, 2.0], Rotation.from_rotvec(np.outer([0.0, 2.0], axis)))
    times = np.linspace(0, 2, 21)
    np.testing.assert_allclose(o.at(times).rotation.as_rotvec(), np.outer(times, axis), atol=ROUNDING)


def test_what_goes_along() -> None:
    o = Orientation(
        [0, 1, 2],
        [[1, 0, 0, 0]] * 3,
        covariance=np.arange(3.0)[:, None, None] * np.eye(3),
        gyr_bias=np.arange(9.0).reshape(3, 3),
        gyr_bias_sigma=np.arange(9.0).reshape(3, 3) + 1.0,
        flags=[1, 2, 4],
        diagnostics={"dip": [10, 20, 30]},
    )
    p = o.at([0.25, 1.0, 1.5])
    np.testing.assert_allclose(p.covariance[:, 0, 0], [0.25, 1.0, 1.5])
    np.testing.assert_allclose(p.gyr_bias[:, 0], [0.75, 3.0, 4.5])
    np.testing.assert_allclose(p.gyr_bias_sigma[:, 0], [1.75, 4.0, 5.5])
    np.testing.assert_allclose(p.diagnostics["dip"], [12.5, 20, 25])
    assert p.flags.tolist() == [1 | 2, 2, 2 | 4]
    assert o[1:].diagnostics["dip"].tolist() == [20.0, 30.0]
    assert o[1:].gyr_bias_sigma.tolist() == o.gyr_bias_sigma[1:].tolist()
    assert o.to_frame("ENU").diagnostics["dip"].tolist() == [10.0, 20.0, 30.0]
    # sigmas along the old axes say nothing of others
    assert o.turned(right=Rotation.from_rotvec([0, 0, 1])).gyr_bias_sigma is None
    assert o.turned(left=Rotation.from_rotvec([0, 0, 1])).gyr_bias_sigma is not None


def test_at_a_time_that_occurs_twice_the_last_counts() -> None:
    o = Orientation.from_rotation([0, 0, 1, 1, 1, 2, 2], Rotation.from_rotvec(np.outer(np.arange(7), [0, 0, 0.1])))
    angle = o.at([0.0, 0.5, 1.0, 1.5, 2.0]).rotation.as_rotvec()[:, 2]
    np.testing.assert_allclose(angle, [0.1, 0.15, 0.4, 0.45, 0.6], atol=ROUNDING)


def test_one_sample() -> None:
    o = make(1)
    same(o.at(0.0), o)
    same(o.at([0.0, 0.0]), o[np.array([0, 0])])
    with pytest.raises(InputError, match="within the orientation's span"):
        o.at(0.1)


@pytest.mark.parametrize("time", [-0.1, 4.0, [0.0, 4.0], [1.0, 0.5], math.nan, "now", [[1.0]]])
def test_times_it_cannot_give(time: Any) -> None:
    with pytest.raises(InputError):
        make().at(time)


def test_long_epoch_times() -> None:
    o = make()
    late = Orientation(o.time + 1.7e9, o.quat)
    # times have a resolution of 2e-7 s there, and the body turns by up to π in 0.1 s
    gap = apart(late.at([1.7e9 + 0.55]).rotation, o.at([0.55]).rotation)
    np.testing.assert_allclose(gap, 0, atol=math.pi * 2.4e-7 / 0.1 * 2)


def test_nothing_at_all() -> None:
    empty = make(0)
    for o in (empty, empty.to_frame("ENU"), empty.turned(Rotation.identity(), Rotation.identity()), make()[:0]):
        assert len(o) == 0
        assert len(o.rotation) == 0
        assert o.as_euler().shape == (0, 3)
        assert o.as_euler("rfu").shape == (0, 3)
        assert o.covariance.shape == (0, 3, 3)
        assert len(o.to_pandas()) == 0
    assert len(make().at([])) == 0
    for time in (0.0, []):
        with pytest.raises(InputError, match="no samples"):
            empty.at(time)


# ---- table ----


def test_table() -> None:
    o = make(frame="ENU")
    table = o.to_pandas()
    assert list(table.columns[:8]) == ["time", "qw", "qx", "qy", "qz", "roll", "pitch", "yaw"]
    assert np.array_equal(table[["qw", "qx", "qy", "qz"]].to_numpy(), o.quat)
    assert np.array_equal(table["cov_xz"].to_numpy(), o.covariance[:, 0, 2])
    assert np.array_equal(table["gyr_bias_y"].to_numpy(), o.gyr_bias[:, 1])
    assert table.attrs == {"frame": "ENU", "name": "made"}
    assert list(o.to_pandas("rfu").columns[5:8]) == ["pitch", "roll", "heading"]
    plain = Orientation([0.0], [[1, 0, 0, 0]]).to_pandas()
    assert list(plain.columns) == ["time", "qw", "qx", "qy", "qz", "roll", "pitch", "yaw", "flags"]
    with pytest.raises(InputError, match="convention"):
        o.to_pandas("xyz")


# ---- algebra ----

component = st.floats(-1, 1, allow_subnormal=False)
quaternion = st.tuples(*[component] * 4).filter(lambda q: sum(x * x for x in q) > 1e-3)


@settings(max_examples=60, deadline=None)
@given(st.lists(quaternion, min_size=2, max_size=5), st.sampled_from(FRAMES), st.floats(0, 1))
def test_interpolation_and_change_of_frame_commute(quats: Any, frame: str, where: float) -> None:
    quat = np.array(quats) / np.linalg.norm(quats, axis=1, keepdims=True)
    o = Orientation(np.arange(len(quat)), quat)
    # at half a turn between samples the shortest way is a matter of rounding
    steps = apart(o.rotation[1:], o.rotation[:-1])
    if (steps > math.pi - 1e-6).any():
        return
    t = where * (len(quat) - 1)
    first, second = o.at(t).to_frame(frame), o.to_frame(frame).at(t)
    np.testing.assert_allclose(apart(first.rotation, second.rotation), 0, atol=1e-9)
