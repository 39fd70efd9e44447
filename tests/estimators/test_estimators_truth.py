"""Each estimator against a closed form or a second, plain implementation."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown import Recording
from northdown.estimators.complementary import gain_factor
from northdown.simulation import simulate

UP = np.array([0.0, 0.0, -1.0])  # NED


@pytest.fixture(scope="module")
def noisy() -> Recording:
    return simulate(20.0, rate=100.0, seed=8)


def angle(a, b):
    return float((a * b.inv()).magnitude().max())


def plain_filter(recording, start, correction):
    """Euler steps with SciPy matrices: rate = gyr + correction(R, acc, mag, dt)."""
    q = np.roll(start.as_quat(), 1)
    result = [q]
    for k in range(1, len(recording)):
        dt = recording.time[k] - recording.time[k - 1]
        mat = Rotation.from_quat(np.roll(q, -1)).as_matrix()
        w = recording.gyr[k] + correction(mat, recording.acc[k], recording.mag[k], dt)
        rate_matrix = np.array(
            [[0, -w[0], -w[1], -w[2]], [w[0], 0, w[2], -w[1]], [w[1], -w[2], 0, w[0]], [w[2], w[1], -w[0], 0]]
        )
        q = q + 0.5 * dt * rate_matrix @ q  # M20 5.4
        q /= np.linalg.norm(q)
        result.append(q)
    return Rotation.from_quat(np.roll(np.array(result), -1, axis=1))


def direction_errors(mat, acc, mag):
    a, m = acc / np.linalg.norm(acc), mag / np.linalg.norm(mag)
    h = mat @ m
    return np.cross(a, mat.T @ UP), np.cross(m, mat.T @ np.array([math.hypot(h[0], h[1]), 0.0, h[2]]))


def test_mahony_is_the_textbook_recursion(noisy):
    bias = np.zeros(3)

    def correction(mat, acc, mag, dt):
        e = np.add(*direction_errors(mat, acc, mag))
        bias[:] -= 0.05 * e * dt
        return -bias + 0.9 * e

    result = nd.Mahony(kp=0.9, ki=0.05).run(noisy)
    assert angle(result.rotation, plain_filter(noisy, result.rotation[0], correction)) < 1e-11  # rad, rounding
    assert np.abs(result.gyr_bias[-1] - bias).max() < 1e-12


def test_mahony_learns_the_bias():
    still = 400.0
    n = int(still * 50)
    bias = np.array([0.01, -0.02, 0.015])
    rest = Recording(
        np.arange(n) / 50.0,
        np.tile(bias, (n, 1)),
        np.tile([0.0, 0.0, -9.81], (n, 1)),
        np.tile([20.0, 0.0, 45.0], (n, 1)),
    )
    result = nd.Mahony(kp=1.0, ki=0.1).run(rest)
    # the slowest mode decays with about (field's horizontal part)·ki/kp·… ≤ 60 s: e⁻⁶ of the bias is left
    assert np.abs(result.gyr_bias[-1] - bias).max() < 0.005 * 0.02
    assert angle(result.rotation[-1:], result.rotation[:1]) < 1e-4


def test_madgwick_moves_along_the_error_at_constant_speed(noisy):
    def correction(mat, acc, mag, dt):
        e = np.add(*direction_errors(mat, acc, mag))
        return 2.0 * 0.2 * e / np.linalg.norm(e)

    result = nd.Madgwick(beta=0.2).run(noisy)
    assert angle(result.rotation, plain_filter(noisy, result.rotation[0], correction)) < 1e-10  # rad, rounding


def test_madgwick_direction_is_the_papers_gradient_without_its_radial_part():
    rng = np.random.default_rng(2)
    q = rng.normal(size=4)
    q /= np.linalg.norm(q)
    acc, mag = rng.normal(size=3), rng.normal(size=3)
    acc, mag = acc / np.linalg.norm(acc), mag / np.linalg.norm(mag)
    mat = Rotation.from_quat(np.roll(q, -1)).as_matrix()
    h = mat @ mag
    field = np.array([math.hypot(h[0], h[1]), 0.0, h[2]])

    def misfit(q):
        r = Rotation.from_quat(np.roll(q, -1)).as_matrix()  # normalises: no radial part
        return 0.5 * (np.sum((r.T @ UP - acc) ** 2) + np.sum((r.T @ field - mag) ** 2))

    gradient = np.array([(misfit(q + d) - misfit(q - d)) / 2e-6 for d in 1e-6 * np.eye(4)])
    e = np.add(*direction_errors(mat, acc, mag))
    w, v = q[0], q[1:]
    tangent = -2.0 * np.concatenate([[-v @ e], w * e + np.cross(v, e)])  # −2 q ⊗ (0, e)
    assert np.allclose(gradient, tangent, atol=1e-8)  # central differences of 1e-6


def test_cross_product_is_mahony_without_magnetometer_and_integral(noisy):
    six = dataclasses.replace(noisy, mag=None)
    a, b = nd.CrossProduct(kp=0.5).run(six), nd.Mahony(kp=0.5, ki=0.0).run(six)
    assert angle(a.rotation, b.rotation) < 1e-12


def test_tilt_compass_is_the_formula_with_angles(noisy):
    f, m = noisy.acc.T, noisy.mag.T
    roll, pitch = np.arctan2(-f[1], -f[2]), np.arctan2(f[0], np.hypot(f[1], f[2]))
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    yaw = -np.arctan2(m[1] * cr - m[2] * sr, m[0] * cp + m[1] * sp * sr + m[2] * sp * cr)
    truth = Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, roll]))
    assert angle(nd.TiltCompass().run(noisy).rotation, truth) < 1e-11


def test_triad_meets_the_trusted_direction(noisy):
    gravity = nd.Triad(trusted="gravity").run(noisy).rotation
    assert angle(gravity, nd.TiltCompass().run(noisy).rotation) < 1e-7  # matrix to quaternion loses half the digits
    dip = 1.0
    field = nd.Triad(trusted="field", dip=dip).run(noisy).rotation
    unit = noisy.mag / np.linalg.norm(noisy.mag, axis=1)[:, None]
    assert np.allclose(field.apply(unit), [math.cos(dip), 0.0, math.sin(dip)], atol=1e-7)
    east = np.cross(field.apply(noisy.acc), [math.cos(dip), 0.0, math.sin(dip)])
    assert np.abs(east[:, [0, 2]]).max() < 1e-5
    assert (east[:, 1] != 0.0).all()


def test_gyro_integration_is_the_product_of_turns(noisy):
    steps = Rotation.from_rotvec(noisy.gyr[1:] * np.diff(noisy.time)[:, None])
    truth = Rotation.identity()
    for step in steps:
        truth = truth * step
    result = nd.GyroIntegration().run(noisy, initial=Rotation.identity())
    assert angle(result.rotation[-1:], truth) < 1e-11


def test_the_naive_sum_is_right_about_one_axis_and_wrong_about_two():
    n, dt = 101, 0.01
    time = np.arange(n) * dt
    one = np.zeros((n, 3))
    one[1:, 2] = 1.2
    naive, strapdown = nd.GyroIntegration(method="per-angle"), nd.GyroIntegration()
    start = Rotation.identity()
    for frame in ("NED", "ENU"):
        a = naive.run(Recording(time, one), frame=frame, initial=start)
        b = strapdown.run(Recording(time, one), frame=frame, initial=start)
        assert angle(a.rotation, b.rotation) < 1e-12
        assert a.as_euler()[-1, 2] == pytest.approx(1.2)
    # pitch a quarter turn, then body yaw a quarter turn: the nose, up, goes over to the side
    two = np.zeros((n, 3))
    two[1:51, 1] = math.pi / 2 / (50 * dt)
    two[51:, 2] = math.pi / 2 / (50 * dt)
    truth = Rotation.from_euler("Y", 90, degrees=True) * Rotation.from_euler("Z", 90, degrees=True)
    assert angle(strapdown.run(Recording(time, two), initial=start).rotation[-1:], truth) < 1e-12
    assert angle(naive.run(Recording(time, two), initial=start).rotation[-1:], truth) > math.radians(60)


def at_rest(yaw, n, dt, acc_up=9.80665):
    rot = Rotation.from_euler("Z", yaw)
    field = rot.inv().apply([20.0, 0.0, 45.0])
    return Recording(np.arange(n) * dt, np.zeros((n, 3)), np.tile([0, 0, -acc_up], (n, 1)), np.tile(field, (n, 1)))


@pytest.mark.parametrize("blend", ["rotation", "euler"])
def test_complementary_closes_in_exponentially_whatever_the_rate(blend):
    for dt, every in ((0.01, 1), (0.05, 1), (0.01, 5)):
        n = round(2.0 / dt) + 1
        rest = at_rest(0.0, n, dt)
        mag = np.where((np.arange(n) % every == 0)[:, None], rest.mag, np.nan)
        filter_ = nd.Complementary(tau_acc=0.5, tau_mag=0.8, blend=blend)
        start = Rotation.from_euler("ZYX", [0.6, 0.0, 0.2])
        result = filter_.run(dataclasses.replace(rest, mag=mag), initial=start).as_euler()
        assert result[-1, 2] == pytest.approx(0.6 * math.exp(-2.0 / 0.8), rel=1e-9)
        assert result[-1, 0] == pytest.approx(0.2 * math.exp(-2.0 / 0.5), rel=1e-6)


def test_complementary_takes_the_shorter_arc():
    # from +170° to −170° leads through 180°, not through 0°
    rest = at_rest(math.radians(-170), 200, 0.01)
    for blend in ("rotation", "euler"):
        start = Rotation.from_euler("Z", 170, degrees=True)
        yaw = nd.Complementary(tau_mag=0.5, blend=blend).run(rest, initial=start).as_euler(degrees=True)[:, 2]
        assert (np.abs(yaw) >= 170 - 1e-9).all()


def test_m20_gain_of_a_tenth():
    rate = 256.0
    tau = -1.0 / (rate * math.log(0.9))
    rest = at_rest(0.0, 11, 1.0 / rate)
    start = Rotation.from_euler("Z", 0.5)
    result = nd.Complementary(tau_acc=tau, tau_mag=tau, blend="euler").run(rest, initial=start)
    # α ← (1 − k) α + k α_measured with k = 0.1, ten times (the first sample is the start)
    assert result.as_euler()[-1, 2] == pytest.approx(0.5 * 0.9**10, rel=1e-9)


def test_adaptive_and_fuzzy_gain():
    still = (0.0, 0.0, 0.0)
    g = 9.80665
    factor = {
        e: [gain_factor(kind, 0.1, 0.2, (0.0, 0.0, g * (1.0 + e)), still) for kind in (0.0, 1.0, 2.0)]
        for e in (0.0, 0.1, 0.15, 0.2, 0.5, -0.15)
    }
    assert factor[0.0] == pytest.approx([1.0, 1.0, 1.0])
    assert factor[0.1] == pytest.approx([1.0, 1.0, 1.0])
    assert factor[0.15] == pytest.approx([1.0, 0.5, 0.4])
    assert factor[-0.15] == pytest.approx(factor[0.15])
    assert factor[0.2] == pytest.approx([1.0, 0.0, 0.0])
    assert factor[0.5] == pytest.approx([1.0, 0.0, 0.0])
    fast = [gain_factor(2.0, 0.1, 0.2, (0.0, 0.0, g * (1.0 + e)), (9.0, 0.0, 0.0)) for e in (0.0, 0.15, 0.2)]
    assert fast == pytest.approx([0.7, 0.2, 0.0])
    # a shove of 3 m/s² sideways for a second tilts the fixed gain, not the adaptive one
    rest = at_rest(0.0, 300, 0.01)
    acc = rest.acc.copy()
    acc[100:200, 0] = 8.0
    shoved = dataclasses.replace(rest, acc=acc)
    tilt = {
        k: np.abs(nd.Complementary(tau_acc=1.0, gain=k).run(shoved).as_euler()[:, 1]).max()
        for k in ("fixed", "adaptive")
    }
    assert tilt["fixed"] > math.radians(20)
    assert tilt["adaptive"] < math.radians(0.01)


def test_thresholds_must_be_in_order():
    with pytest.raises(nd.InputError, match=r"high above 0\.3"):
        nd.Complementary(low=0.3, high=0.2)


def test_start_upside_down_keeps_the_x_axis():
    # a sensor lying face down in ENU: gravity alone cannot say about which axis it was turned over
    rest = at_rest(0.0, 3, 0.01)
    face_down = dataclasses.replace(rest, mag=None, acc=rest.acc + np.array([1e-3, -2e-3, 0.0]))
    mat = nd.Mahony().run(face_down, frame="ENU").rotation[0].as_matrix()
    assert mat[0, 0] == pytest.approx(1.0, abs=1e-3)
    assert mat[2, 2] == pytest.approx(-1.0, abs=1e-3)
