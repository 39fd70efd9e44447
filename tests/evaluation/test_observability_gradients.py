"""Gradients of measurements and their derivatives against differences of measurements along disturbed motions.

The disturbed motions are not computed with northdown: attitudes are SciPy's, in closed form for a known rate and by
DOP853 for a biased one; derivatives by time are those of Chebyshev polynomials through the measurements.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.polynomial import chebyshev
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from northdown.evaluation import observability
from northdown.evaluation.observability_changes import Changes, transitions
from northdown.evaluation.observability_equations import gradients
from northdown.evaluation.observability_models import Model, parse_sensors
from northdown.evaluation.observability_rate import rate_series
from northdown.simulation import FromRate, Motion, Still, k06_sine, random_motion, rest, sines, waypoints

ORDER = 3
STEP = 1e-3  # of the states
HALF = 0.1  # s, half the time over which polynomials are fitted
NODES = HALF * chebyshev.chebpts1(20)
FIELD = (0.4, 0.9)
AXIS = np.array([1.0966, 2.1932, 2.1932])
START = Rotation.from_euler("ZYX", [-0.4, 0.1, -0.4])  # so that the tangents stay below one


def k06_rate(t):
    return AXIS * math.sin(4.0 * math.pi * t)


def measured(sensors: str, attitude: Rotation, scale: float, rates: np.ndarray, field, method: str) -> np.ndarray:
    """Rows of measurements for attitudes body to NED; `scale` is the square of the quaternion's length."""
    down = attitude.inv().apply([0.0, 0.0, 1.0]).T
    mag = attitude.inv().apply([field[0], 0.0, field[1]]).T
    if method == "indirect":
        yaw, pitch, roll = attitude.as_euler("ZYX").T
        return np.array([-np.tan(yaw), -np.sin(pitch), np.tan(roll)])
    rows = {f"acc_{c}": scale * down[k] for k, c in enumerate("xyz")}
    rows |= {f"mag_{c}": scale * mag[k] for k, c in enumerate("xyz")}
    rows |= {f"gyr_{c}": rates[k] for k, c in enumerate("xyz")}
    return np.array([rows[s] for s in parse_sensors(sensors)])


def turned(at: float, first: Rotation, bias: np.ndarray, rate_change: np.ndarray) -> Rotation:
    """Attitudes at the nodes after `at`, where it is `first`, with a wrong rate, by integration."""

    def slope(t, v):
        rate = k06_rate(at + t) - bias + rate_change
        # v̇ = J⁻¹(v) ω for R = exp(v), right Jacobian
        angle = np.linalg.norm(v)
        k = 1.0 / 12.0 if angle < 1e-3 else 1.0 / angle**2 - 1.0 / (2.0 * angle * math.tan(0.5 * angle))
        return rate + 0.5 * np.cross(v, rate) + k * np.cross(v, np.cross(v, rate))

    order = np.argsort(np.abs(NODES))
    result = np.empty((len(NODES), 3))
    for sign in (-1.0, 1.0):
        side = [k for k in order if np.sign(NODES[k]) == sign]
        found = solve_ivp(slope, (0.0, sign * HALF), np.zeros(3), "DOP853", NODES[side], rtol=1e-13, atol=1e-14)
        result[side] = found.y.T
    return first * Rotation.from_rotvec(result)


def slope_at_zero(function) -> np.ndarray:
    """Derivative by the state of a function of multiples of `STEP`; the formula's own error is STEP⁴."""
    far, near = function(2.0) - function(-2.0), function(1.0) - function(-1.0)
    return (8.0 * near - far) / (12.0 * STEP)


def by_differences(model: Model, sensors: str, at: float, attitude: Rotation) -> np.ndarray:
    """Rows and columns as `gradients` has them."""
    q = attitude.as_quat(scalar_first=True)
    angles = attitude.as_euler("ZYX")[::-1]

    def measure(change: np.ndarray) -> np.ndarray:
        parts = dict.fromkeys(("gyr_bias", "rate"), np.zeros(3)) | {"field": np.zeros(2), "dip": np.zeros(1)}
        first = {"euler": 3, "tangent": 3}.get(model.state, 4)
        k = first
        for name in model.unknown:
            parts[name] = change[k : k + len(parts[name])]
            k += len(parts[name])
        scale = 1.0
        if model.state == "euler":
            start = Rotation.from_euler("ZYX", (angles + change[:3])[::-1])
        elif model.state == "tangent":
            start = Rotation.from_rotvec(change[:3]) * attitude
        else:
            start = Rotation.from_quat(q + change[:4], scalar_first=True)
            scale = float(np.sum((q + change[:4]) ** 2))
        field = np.array(FIELD) + parts["field"]
        if "dip" in model.unknown:
            size, dip = math.hypot(*FIELD), math.atan2(FIELD[1], FIELD[0]) + parts["dip"][0]
            field = np.array([size * math.cos(dip), size * math.sin(dip)])
        sees_bias = "rate" in model.unknown  # else it enters by the rate that drives the motion
        path = turned(at, start, np.zeros(3) if sees_bias else parts["gyr_bias"], parts["rate"])
        rates = np.array([k06_rate(at + t) for t in NODES]).T + (parts["rate"] + parts["gyr_bias"])[:, None]
        rows = measured(sensors, path, scale, rates, field, model.method)
        if model.state == "quaternion+norm":
            rows = np.vstack([rows, np.full(len(NODES), scale)])
        fits = chebyshev.chebfit(NODES / HALF, rows.T, len(NODES) - 1)
        taken = [chebyshev.chebval(0.0, chebyshev.chebder(fits, k)) / HALF**k for k in range(ORDER + 1)]
        return np.concatenate(taken)

    n = len(model.state_names)
    columns = [slope_at_zero(lambda c, e=e: measure(c * STEP * e)) for e in np.eye(n)]
    return np.stack(columns, axis=1)


CASES = [
    ("acc, mag", "quaternion", (), "direct"),
    ("acc, mag", "euler", (), "direct"),
    ("acc yz, mag xy", "tangent", (), "direct"),
    ("acc, mag", "quaternion", (), "indirect"),
    ("acc, mag", "euler", (), "indirect"),
    ("acc, mag", "tangent", (), "indirect"),
    ("acc", "quaternion+norm", ("gyr_bias",), "direct"),
    ("acc, mag", "euler", ("gyr_bias", "field"), "direct"),
    ("acc, mag z", "tangent", ("dip", "gyr_bias"), "direct"),
    ("acc, mag", "tangent", ("rate",), "direct"),
    ("acc, gyr xz", "euler", ("rate", "gyr_bias"), "direct"),
]


@pytest.mark.parametrize(("sensors", "state", "unknown", "method"), CASES)
def test_gradients_by_differences(sensors, state, unknown, method):
    at = 0.17
    model = Model(parse_sensors(sensors), state, unknown, method, field=FIELD)
    motion = k06_sine(2.0, attitude=START)
    quat = np.ascontiguousarray(motion.at(at).quat.T)
    attitude = Rotation.from_quat(quat[:, 0], scalar_first=True)
    found = gradients(model, quat, rate_series(motion.turning, np.array([at]), ORDER), ORDER)[0]
    wanted = by_differences(model, sensors, at, attitude)
    assert found.shape == wanted.shape == ((ORDER + 1) * len(model.measurement_names), len(model.state_names))
    m = len(model.measurement_names)
    for k in range(ORDER + 1):
        rows = slice(k * m, (k + 1) * m)
        size = max(1.0, float(np.abs(wanted[rows]).max()))
        # integration leaves 1e-13 over steps of 1e-3, times 20³/0.1³ for the third derivative of a polynomial
        np.testing.assert_allclose(found[rows], wanted[rows], atol=(1e-9, 1e-8, 1e-7, 1e-6)[k] * size)


def test_printed_variants():
    """K06's z₂ and its 1/‖q‖ change only the columns along q, and these as the length of q says."""
    motion = k06_sine(2.0, attitude=START)
    time = np.array([0.17])
    quat = np.ascontiguousarray(motion.at(time).quat.T)
    rate = rate_series(motion.turning, time, ORDER)
    q = quat[:, 0]
    along = {
        variant: gradients(
            Model(parse_sensors("acc, mag"), "quaternion", (), "indirect", variant), quat, rate, ORDER
        )[0]
        @ q
        for variant in ("scale-free", "printed-pitch", "printed-rate", "printed")
    }
    np.testing.assert_allclose(along["scale-free"], 0.0, atol=1e-9)  # of up to 1e3
    # with z₂ ∝ |q|²: its derivatives by the length are twice themselves; z₂ is the second of three rows
    pitch = attitude_rows(time[0])
    np.testing.assert_allclose(along["printed-pitch"].reshape(ORDER + 1, 3)[:, 1], 2.0 * pitch, rtol=1e-5)
    np.testing.assert_allclose(along["printed-pitch"].reshape(ORDER + 1, 3)[:, [0, 2]], 0.0, atol=1e-9)
    # with q̇ ∝ 1/‖q‖: a longer quaternion turns more slowly, so ż changes by −ż
    first = along["printed-rate"].reshape(ORDER + 1, 3)[:2, 1]
    np.testing.assert_allclose(first, [0.0, -pitch[1]], rtol=1e-5, atol=1e-12)
    both = along["printed"].reshape(ORDER + 1, 3)[:2, 1]
    np.testing.assert_allclose(both, [2.0 * pitch[0], pitch[1]], rtol=1e-5)


def attitude_rows(at: float) -> np.ndarray:
    """−sin(pitch) and its derivatives along K06's motion, which turns about one axis."""
    unit = AXIS / np.linalg.norm(AXIS)
    angles = np.linalg.norm(AXIS) * (1.0 - np.cos(4.0 * math.pi * (at + NODES))) / (4.0 * math.pi)
    path = START * Rotation.from_rotvec(angles[:, None] * unit)
    fit = chebyshev.chebfit(NODES / HALF, -np.sin(path.as_euler("ZYX")[:, 1]), len(NODES) - 1)
    return np.array([chebyshev.chebval(0.0, chebyshev.chebder(fit, k)) / HALF**k for k in range(ORDER + 1)])


LAW = sines((1.0, 0.7, -0.8), (0.5, 0.8, 0.3), (0.3, 0.1, 0.2))
LONG = Motion(FromRate(START, LAW, step=0.01), Still(), 0.0, 2.0)
TIMES = np.linspace(0.0, 2.0, 41)


def disturbed(turn: np.ndarray, bias: np.ndarray) -> Rotation:
    """Attitudes along `LONG` at `TIMES` that start turned about axes of NED, with a biased gyroscope."""

    def slope(t, q):
        w = LAW(np.array([t]))[0][:, 0] - bias
        return 0.5 * np.array(
            [
                -q[1:] @ w,
                q[0] * w[0] + q[2] * w[2] - q[3] * w[1],
                q[0] * w[1] - q[1] * w[2] + q[3] * w[0],
                q[0] * w[2] + q[1] * w[1] - q[2] * w[0],
            ]
        )

    start = (Rotation.from_rotvec(turn) * START).as_quat(scalar_first=True)
    found = solve_ivp(slope, (0.0, 2.0), start, "DOP853", TIMES, rtol=1e-12, atol=1e-13)
    return Rotation.from_quat(found.y.T, scalar_first=True)


def disturbances() -> list[tuple[np.ndarray, np.ndarray]]:
    """Turns about north, east, down, and biases about them, `STEP` each."""
    none, mat = np.zeros(3), START.as_matrix()
    return [(STEP * e, none) for e in np.eye(3)] + [(none, STEP * mat[k]) for k in range(3)]


def test_transitions_by_differences():
    nominal = disturbed(np.zeros(3), np.zeros(3))
    columns = [
        slope_at_zero(lambda c, d=d: (disturbed(c * d[0], c * d[1]) * nominal.inv()).as_rotvec())
        for d in disturbances()
    ]
    model = Model(parse_sensors("acc"), "tangent", ("gyr_bias",))
    quat = np.ascontiguousarray(LONG.at(TIMES).quat.T)
    found = transitions(model, Changes(model, quat), LONG, TIMES)
    # integration leaves 1e-12 over steps of 1e-3
    np.testing.assert_allclose(found[:, :3], np.stack(columns, axis=-1), atol=1e-8)
    # a bias is constant in the body
    np.testing.assert_allclose(found[:, 3:, 3:], nominal.as_matrix() @ START.as_matrix().T, atol=1e-10)
    # a wrong rate is a bias of the other sign
    other = Model(parse_sensors("acc"), "tangent", ("rate",))
    opposite = transitions(other, Changes(other, quat), LONG, TIMES)
    np.testing.assert_array_equal(opposite[:, :3, 3:], -found[:, :3, 3:])


def test_a_longer_quaternion_turns_more_slowly_as_printed():
    """With q̇ = ½ q ⊗ ω/‖q‖ a relative change of length ℓ takes ℓ ω from the rate."""
    model = Model(parse_sensors("acc"), "quaternion", (), "direct", "printed-rate")
    quat = np.ascontiguousarray(LONG.at(TIMES).quat.T)
    found = transitions(model, Changes(model, quat), LONG, TIMES)
    nodes, weights = np.polynomial.legendre.leggauss(30)
    for k in (10, 40):
        t = 0.5 * TIMES[k] * (1.0 + nodes)
        state = LONG.at(t)
        swept = 0.5 * TIMES[k] * weights @ state.rotation.apply(state.rate)
        np.testing.assert_allclose(found[k, 1:, 0], -swept, atol=1e-9)
    plain = Model(parse_sensors("acc"), "quaternion")
    np.testing.assert_array_equal(transitions(plain, Changes(plain, quat), LONG, TIMES), [np.eye(4)] * 41)


def test_all_times_together_by_differences():
    """What the accelerometer shows over two seconds, of disturbances at their start."""
    columns = [
        slope_at_zero(lambda c, d=d: disturbed(c * d[0], c * d[1]).inv().apply([0.0, 0.0, 1.0]).ravel())
        for d in disturbances()
    ]
    wanted = np.linalg.svd(np.stack(columns, axis=1) / math.sqrt(len(TIMES)), compute_uv=False)
    found = observability(LONG, "acc", state="tangent", unknown="gyr_bias", order=0, times=TIMES)
    # integration leaves 1e-12 over steps of 1e-3
    np.testing.assert_allclose(found.overall, wanted, atol=1e-8)
    assert found.overall_rank == 5
    assert found.overall_unobservable == ("heading",)
    # written otherwise, the same changes: only that of the length is added
    for state in ("euler", "quaternion"):
        other = observability(LONG, "acc", state=state, unknown="gyr_bias", order=0, times=TIMES)
        values = np.sort(np.append(found.overall, 2.0))[::-1] if state == "quaternion" else found.overall
        np.testing.assert_allclose(other.overall, values, atol=1e-12)


def test_bias_about_the_vertical_needs_two_attitudes():
    still = observability(rest(5.0), "acc", state="tangent", unknown="gyr_bias")
    assert still.overall_rank == 4
    assert still.overall_unobservable == ("heading", "gyroscope bias about the vertical")
    tilts = Rotation.from_euler("X", [[0.0], [1.0], [1.0]])
    moved = observability(waypoints([0.0, 2.0, 6.0], tilts), "acc", state="tangent", unknown="gyr_bias", order=1)
    # of first order no time shows it; all of them together do
    assert set(moved.rank) == {4}
    assert moved.overall_rank == 5
    assert moved.overall_unobservable == ("heading",)


def test_unknown_rate_carried_along():
    motion = random_motion(10.0, 4)
    found = observability(motion, "acc", state="tangent", unknown="rate", order=0)
    assert set(found.rank) == {2}
    assert (found.overall_rank, found.overall_unobservable) == (5, ("heading",))
