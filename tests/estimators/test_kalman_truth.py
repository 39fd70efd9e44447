"""The Kalman filters against dense implementations: full matrices, stacked measurements, numerical Jacobians."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown.estimators import get
from northdown.simulation import simulate

UP = np.array([0.0, 0.0, -1.0])
# rad: rounding of a thousand steps, carried along by the filter
AGREE = 1e-9


@pytest.fixture(scope="module")
def recording():
    """Ten seconds at 50 Hz, magnetometer at 12.5 Hz, and half a second without accelerometer."""
    r = simulate(10.0, rate=50.0, seed=21)
    acc = r.acc.copy()
    acc[200:225] = np.nan
    mag = np.where((np.arange(len(r)) % 4 == 0)[:, None], r.mag, np.nan)
    return dataclasses.replace(r, acc=acc, mag=mag)


def rot(q):
    return Rotation.from_quat(np.roll(q, -1))


def wxyz(r):
    return np.roll(r.as_quat(), 1)


def product(p, q):
    w, v = p[0], p[1:]
    return np.concatenate([[w * q[0] - v @ q[1:]], w * q[1:] + q[0] * v + np.cross(v, q[1:])])


def jacobian(f, x, h=1e-6):
    return np.array([(f(x + d) - f(x - d)) / (2.0 * h) for d in h * np.eye(len(x))]).T


class Weights:
    """The noise model of the docstrings, from the filter's parameters."""

    def __init__(self, f):
        self.f, self.motion, self.age, self.u, self.reference = f, 0.0, 0.0, 0.0, np.ones(2)

    @property
    def dip(self):
        return math.atan2(self.reference[1], self.reference[0])

    def gyr(self, rate, dt):
        return (self.f.gyr_noise**2 + self.f.gyr_scale**2 * (rate @ rate)) * dt

    def acc(self, force_n, dt):
        f = self.f
        square = np.sum((force_n - np.array([0.0, 0.0, -f.gravity])) ** 2)
        self.motion += (square - self.motion) * min(1.0, dt / f.motion_window)
        return (f.acc_noise**2 + f.motion_time * self.motion) / (f.gravity**2 * dt)

    def mag(self, h, dt):
        f = self.f
        sample = np.array([math.hypot(h[0], h[1]), h[2]])
        self.age += dt
        if self.age == dt:
            self.reference = sample
        else:
            size = np.linalg.norm(self.reference)
            off = (sample - self.reference) / size
            along = self.reference / size
            across = off - (off @ along) * along
            u = min(60.0, (off @ along / f.norm_gate) ** 2 + across @ across / f.dip_gate**2)
            self.u = u * np.clip(self.age - 1.0, 0.0, 1.0)
            k = math.exp(-self.u) * dt / min(self.age, f.field_window + dt)
            self.reference = self.reference + k * (sample - self.reference)
        return (f.mag_noise / f.field) ** 2 * math.exp(self.u) / dt


def samples(recording):
    """Gyroscope, accelerometer, magnetometer or None, and the age of the latter two."""
    ages = np.zeros(2)
    for k in range(1, len(recording)):
        dt = recording.time[k] - recording.time[k - 1]
        ages += dt
        vectors = [v[k] if np.isfinite(v[k]).all() else None for v in (recording.acc, recording.mag)]
        yield k, dt, recording.gyr[k], vectors, ages.copy()
        ages[[v is not None for v in vectors]] = 0.0


def dense_mekf(f, recording, q):
    b, noise, nis = np.zeros(3), Weights(f), []
    P = np.diag([f.start_tilt**2] * 2 + [f.start_heading**2] + [f.start_bias**2] * 3)
    for _, dt, gyr, (acc, mag), (age_acc, age_mag) in samples(recording):
        R = rot(q).as_matrix()
        F = np.block([[np.eye(3), -R * dt], [np.zeros((3, 3)), np.eye(3)]])
        Q = block_diag(noise.gyr(gyr - b, dt) * np.eye(3), f.gyr_bias_walk**2 * dt * np.eye(3))
        P = F @ P @ F.T + Q
        q = wxyz(rot(q) * Rotation.from_rotvec((gyr - b) * dt))
        R = rot(q).as_matrix()
        H, z, r = [], [], []
        if acc is not None:
            force = R @ acc
            H += [[0, 1, 0, 0, 0, 0], [-1, 0, 0, 0, 0, 0]]
            z += [force[0] / f.gravity, force[1] / f.gravity]
            r += [noise.acc(force, age_acc)] * 2
        if mag is not None:
            h = R @ mag
            slope = h[2] / math.hypot(h[0], h[1])
            H += [[slope, 0, -1, 0, 0, 0]]
            z += [math.atan2(h[1], h[0])]
            r += [noise.mag(h, age_mag) * (1.0 + slope**2)]
        if z:
            H = np.array(H, float)
            S = np.linalg.inv(H @ P @ H.T + np.diag(r))
            nis.append(np.array(z) @ S @ z)
            K = P @ H.T @ S
            d = K @ np.array(z)
            P = (np.eye(6) - K @ H) @ P
            q, b = wxyz(Rotation.from_rotvec(d[:3]) * rot(q)), b + d[3:]
    return q, b, P[:3, :3], np.sqrt(np.diag(P)[3:]), nis


def up_and_field(q, dip):
    """Body components of up and of the field, in the homogeneous form of the rotation matrix."""
    w, x, y, z = q
    R = np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )
    return R.T @ UP, R.T @ np.array([math.cos(dip), 0.0, math.sin(dip)])


def rotation_basis(q):
    return 2.0 * np.array([product(np.concatenate([[0.0], e]), q) for e in np.eye(3)])


def start7(f, q):
    E = 0.5 * rotation_basis(q)
    r = 0.01 * min(f.start_tilt, f.start_heading) ** 2
    quat = 0.25 * (E.T @ np.diag([f.start_tilt**2, f.start_tilt**2, f.start_heading**2]) @ E + r * np.outer(q, q))
    return block_diag(quat, f.start_bias**2 * np.eye(3))


def predict7(f, noise, q, b, P, gyr, dt):
    turn = wxyz(Rotation.from_rotvec((gyr - b) * dt))
    F = np.eye(7)
    F[:4, :4] = np.array([product(e, turn) for e in np.eye(4)]).T
    F[:4, 4:] = -0.5 * dt * np.array([product(product(q, np.concatenate([[0.0], e])), turn) for e in np.eye(3)]).T
    Q = block_diag(0.25 * noise.gyr(gyr - b, dt) * np.eye(4), f.gyr_bias_walk**2 * dt * np.eye(3))
    return product(q, turn), F @ P @ F.T + Q


def carried(P, old, new):
    """P of the quaternion (and bias), such that the error e in (1 + e) ⊗ q keeps its covariance while q moves."""
    moved = product(old * [1.0, -1.0, -1.0, -1.0], new)
    M = np.eye(len(P))
    M[:4, :4] = np.array([product(unit, moved) for unit in np.eye(4)]).T
    return M @ P @ M.T


def dense_quaternion_ekf(f, recording, q):
    b, noise, P, nis = np.zeros(3), Weights(f), start7(f, q), []
    for _, dt, gyr, (acc, mag), (age_acc, age_mag) in samples(recording):
        q, P = predict7(f, noise, q, b, P, gyr, dt)
        R = rot(q).as_matrix()
        H, z, r = [], [], []
        if acc is not None:
            H.append(jacobian(lambda q: up_and_field(q, 0.0)[0], q))
            z.append(acc / f.gravity - R.T @ UP)
            r += [noise.acc(R @ acc, age_acc)] * 3
        if mag is not None:
            r += [noise.mag(R @ mag, age_mag)] * 3
            dip = noise.dip if f.dip is None else f.dip
            H.append(jacobian(lambda q, dip=dip: up_and_field(q, dip)[1], q))
            z.append(mag / np.linalg.norm(mag) - up_and_field(q, dip)[1])
        if z:
            H = np.hstack([np.vstack(H), np.zeros((len(r), 3))])
            z, S = np.concatenate(z), np.linalg.inv(H @ P @ H.T + np.diag(r))
            nis.append(z @ S @ z)
            K = P @ H.T @ S
            d = K @ z
            P = (np.eye(7) - K @ H) @ P
            old, q, b = q, (q + d[:4]) / np.linalg.norm(q + d[:4]), b + d[4:]
            P = carried(P, old, q)
    E = rotation_basis(q)
    return q, b, E @ P[:4, :4] @ E.T, np.sqrt(np.diag(P)[4:]), nis


def dense_double_stage(f, recording, q):
    b, noise, P, nis = np.zeros(3), Weights(f), start7(f, q), []

    def stage(q, b, P, measured, expected, r, keep):
        H = np.hstack([jacobian(expected, q), np.zeros((3, 3))])
        y, S = measured - expected(q), np.linalg.inv(H @ P @ H.T + r * np.eye(3))
        nis[-1] += y @ S @ y
        K = P @ H.T @ S
        d = K @ y
        old = q
        if f.isolation == "additive":
            kept = np.where([True, *keep], d[:4], 0.0)
            q = q + kept
        else:
            delta = np.where(keep, rotation_basis(q) @ d[:4], 0.0)
            q = wxyz(Rotation.from_rotvec(delta) * rot(q))
        q = q / np.linalg.norm(q)
        return q, b + f.bias_update * d[4:], carried((np.eye(7) - K @ H) @ P, old, q)

    for _, dt, gyr, (acc, mag), (age_acc, age_mag) in samples(recording):
        q, P = predict7(f, noise, q, b, P, gyr, dt)
        if acc is not None or mag is not None:
            nis.append(0.0)
        if acc is not None:
            r = noise.acc(rot(q).as_matrix() @ acc, age_acc)
            q, b, P = stage(q, b, P, acc / f.gravity, lambda q: up_and_field(q, 0.0)[0], r, [True, True, False])
        if mag is not None:
            R = rot(q).as_matrix()
            h = R @ mag / np.linalg.norm(mag)
            r = noise.mag(R @ mag, age_mag)
            dip = math.atan2(h[2], math.hypot(h[0], h[1]))
            q, b, P = stage(
                q,
                b,
                P,
                mag / np.linalg.norm(mag),
                lambda q, dip=dip: up_and_field(q, dip)[1],
                r,
                [False, False, True],
            )
    E = rotation_basis(q)
    return q, b, E @ P[:4, :4] @ E.T, np.sqrt(np.diag(P)[4:]), nis


def of_angles(x):
    return Rotation.from_euler("ZYX", x[::-1])


def angles_of(r):
    return r.as_euler("ZYX")[::-1].copy()


def circular(d):
    return (d + math.pi) % (2.0 * math.pi) - math.pi


def dense_ukf(f, recording, q):
    """All 2L + 1 points of the augmented state, nothing left out."""
    x, noise, nis = angles_of(rot(q)), Weights(f), []
    P = np.diag([f.start_tilt**2, f.start_tilt**2, f.start_heading**2])
    for _, dt, gyr, (acc, mag), (age_acc, age_mag) in samples(recording):
        m = 6 if mag is not None else 3
        L = 6 + m
        lam = f.alpha**2 * (L + f.kappa) - L
        wm = np.full(2 * L + 1, 0.5 / (L + lam))
        wc = wm.copy()
        wm[0] = lam / (L + lam)
        wc[0] = wm[0] + 1.0 - f.alpha**2 + f.beta

        def points(P, gyr_var, R, L=L, lam=lam, m=m):
            A = block_diag(P, gyr_var * np.eye(3), R)
            C = np.linalg.cholesky((L + lam) * A).T
            return np.vstack([np.zeros(6 + m), C, -C])

        gyr_var = noise.gyr(gyr, dt) / dt**2
        chi = points(P, gyr_var, np.eye(m))
        y = np.array([angles_of(of_angles(x + c[:3]) * Rotation.from_rotvec((gyr - c[3:6]) * dt)) for c in chi])
        d = circular(y - y[0])
        mean = wm @ d
        x = circular(y[0] + mean)
        P = sum(w * np.outer(e, e) for w, e in zip(wc, d - mean, strict=True))
        if acc is None and mag is None:
            continue
        R0, r, z = of_angles(x).as_matrix(), [1e12] * 3, np.zeros(m)
        if acc is not None:
            r = [noise.acc(R0 @ acc, age_acc)] * 3
            z[:3] = acc / f.gravity
        if mag is not None:
            r = r + [noise.mag(R0 @ mag, age_mag)] * 3
            z[3:] = mag / np.linalg.norm(mag)
        dip = noise.dip if f.dip is None else f.dip
        field = np.array([math.cos(dip), 0.0, math.sin(dip)])
        chi = points(P, gyr_var, np.diag(r))
        zeta = []
        for c in chi:
            R = of_angles(x + c[:3]).as_matrix()
            zeta.append(np.concatenate([R.T @ UP, R.T @ field])[:m] + c[6:])
        zeta = np.array(zeta)
        mean = wm @ zeta
        Pzz = sum(w * np.outer(e, e) for w, e in zip(wc, zeta - mean, strict=True))
        Pxz = sum(w * np.outer(c[:3], e) for w, c, e in zip(wc, chi, zeta - mean, strict=True))
        nis.append((z - mean) @ np.linalg.inv(Pzz) @ (z - mean))
        K = Pxz @ np.linalg.inv(Pzz)
        x = x + K @ (z - mean)
        P = P - K @ Pzz @ K.T
    cp, sp, cy, sy = math.cos(x[1]), math.sin(x[1]), math.cos(x[2]), math.sin(x[2])
    J = np.array([[cy * cp, -sy, 0.0], [sy * cp, cy, 0.0], [-sp, 0.0, 1.0]])
    return wxyz(of_angles(x)), None, J @ P @ J.T, None, nis


def dense_gyro_euler(f, recording, q):
    b, noise, nis = np.zeros(3), Weights(f), []
    E = 0.5 * rotation_basis(q)
    r = 0.01 * min(f.start_tilt, f.start_heading) ** 2
    P = 0.25 * (E.T @ np.diag([f.start_tilt**2, f.start_tilt**2, f.start_heading**2]) @ E + r * np.outer(q, q))
    age = 0.0
    for _, dt, gyr, (acc, mag), _ in samples(recording):
        turn = wxyz(Rotation.from_rotvec((gyr - b) * dt))
        F = np.array([product(e, turn) for e in np.eye(4)]).T
        P = F @ P @ F.T + 0.25 * noise.gyr(gyr, dt) * np.eye(4)
        q = product(q, turn)
        age += dt
        if acc is None or mag is None:
            continue
        roll, pitch = math.atan2(-acc[1], -acc[2]), math.atan2(acc[0], math.hypot(acc[1], acc[2]))
        level = Rotation.from_euler("YX", [pitch, roll])
        h = level.as_matrix() @ mag
        measured = np.array([roll, pitch, -math.atan2(h[1], h[0])])
        x = angles_of(rot(q))
        tilt = noise.acc(rot(q).as_matrix() @ acc, age)
        direction = noise.mag(h, age)
        slope2 = h[2] ** 2 / (h[0] ** 2 + h[1] ** 2)
        c2 = math.cos(x[1]) ** 2
        heading = direction * (1.0 + slope2) + slope2 * tilt
        R = np.diag([tilt / c2, tilt, heading + tilt * (1.0 - c2) / c2])
        H = jacobian(lambda q: angles_of(rot(q / np.linalg.norm(q))), q)
        y, S = circular(measured - x), np.linalg.inv(H @ P @ H.T + R)
        nis.append(y @ S @ y)
        K = P @ H.T @ S
        old, q = q, q + K @ y
        q /= np.linalg.norm(q)
        P = carried((np.eye(4) - K @ H) @ P, old, q)
        age = 0.0
    E = rotation_basis(q)
    return q, None, E @ P @ E.T, None, nis


CASES = [
    ("mekf", {}, dense_mekf),
    (
        "mekf",
        {"gyr_scale": 0.0, "motion_time": 0.0, "gyr_noise": 2e-4, "acc_noise": 3e-3, "mag_noise": 0.06},
        dense_mekf,
    ),
    ("quaternion-ekf", {}, dense_quaternion_ekf),
    ("quaternion-ekf", {"dip": 1.1}, dense_quaternion_ekf),
    ("double-stage-ekf", {}, dense_double_stage),
    ("double-stage-ekf", {"isolation": "additive"}, dense_double_stage),
    ("double-stage-ekf", {"bias_update": False}, dense_double_stage),
    ("euler-ukf", {}, dense_ukf),
    ("euler-ukf", {"alpha": 1.0, "kappa": 1.0, "dip": 1.1}, dense_ukf),
    ("gyro-euler-ekf", {}, dense_gyro_euler),
]


@pytest.mark.parametrize(("name", "parameters", "dense"), CASES, ids=[f"{c[0]}-{'-'.join(c[1])}" for c in CASES])
def test_agrees_with_a_dense_implementation(recording, name, parameters, dense):
    filter_ = get(name)(**parameters)
    result = filter_.run(recording)
    q, bias, covariance, sigma, nis = dense(filter_, recording, wxyz(result.rotation[0]))
    # a numerical Jacobian is known to about 1e-10
    assert (rot(q) * result.rotation[-1].inv()).magnitude() < AGREE
    assert np.abs(result.covariance[-1] / covariance - 1.0).max() < 1e-5
    if bias is not None:
        assert np.abs(result.gyr_bias[-1] - bias).max() < AGREE
        assert np.allclose(result.gyr_bias_sigma[-1], sigma, rtol=1e-7)
    assert (result.diagnostics["nis_dof"] > 0.0).sum() == len(nis)
    # a numerical Jacobian again, and innovations that are differences of numbers near 1
    assert np.allclose(result.diagnostics["nis"][result.diagnostics["nis_dof"] > 0.0], nis, rtol=1e-5, atol=1e-8)


def test_stages_leave_each_others_angles_alone():
    # tilted 50° and heading 70°, off in everything; the accelerometer alone, then the magnetometer alone
    n = 200
    truth = Rotation.from_euler("ZYX", [1.2, 0.5, 0.9])
    acc = np.tile(truth.inv().apply([0.0, 0.0, -9.80665]), (n, 1))
    mag = np.tile(truth.inv().apply([20.0, 0.0, 45.0]), (n, 1))
    start = Rotation.from_rotvec([0.05, -0.08, 0.1]) * truth
    time = np.arange(n) * 0.01
    nothing = np.full((n, 3), np.nan)
    for sensor, kept in (("acc", "heading"), ("mag", "tilt")):
        given = {"acc": nothing, "mag": nothing, sensor: {"acc": acc, "mag": mag}[sensor]}
        recording = nd.Recording(time, np.zeros((n, 3)), **given)
        for isolation, exact in (("navigation", True), ("additive", False)):
            filter_ = get("double-stage-ekf")(isolation=isolation, bias_update=False)
            moved = filter_.run(recording, initial=start).rotation[-1] * start.inv()
            delta = moved.as_rotvec()
            wrong = abs(delta[2]) if kept == "heading" else np.hypot(delta[0], delta[1])
            assert np.linalg.norm(delta) > 0.005
            # several small turns about horizontal axes make one that is horizontal to second order
            assert (wrong < 0.05 * np.linalg.norm(delta)) == exact


def test_near_singular_is_flagged_and_the_mekf_is_not_disturbed():
    n = 1201
    time = np.arange(n) * 0.01
    pitch = np.linspace(0.0, math.radians(120), n)
    truth = Rotation.from_euler("Y", pitch[:, None])
    gyr = np.zeros((n, 3))
    gyr[:, 1] = pitch[1] / 0.01
    acc = truth.inv().apply([0.0, 0.0, -9.80665])
    mag = truth.inv().apply([20.0, 0.0, 45.0])
    recording = nd.Recording(time, gyr, acc, mag)
    beyond = np.abs(np.sin(pitch)) > math.sin(1.4)
    before = int(np.argmax(beyond))
    for name in ("euler-ukf", "gyro-euler-ekf"):
        result = get(name)().run(recording)
        assert result.has(nd.Flag.NEAR_SINGULAR)[before + 1 :][beyond[before + 1 :]].all()
        error = (result.rotation * truth.inv()).magnitude()
        assert error[:before].max() < 5e-3
        if name == "euler-ukf":
            # it breaks, for seconds, and its own covariance says so
            sigma = np.sqrt(np.trace(result.covariance, axis1=1, axis2=2))
            assert error.max() > math.radians(90)
            assert (error[before:] < 4.0 * sigma[before:] + 1e-3).mean() > 0.95
    assert (get("mekf")().run(recording).rotation * truth.inv()).magnitude().max() < 1e-6


def test_rfu_axes_are_the_same_filter_on_renamed_axes(recording):
    plain = get("euler-ukf")().run(recording)
    # v_frd = (y, x, −z) of v_rfu and the other way round
    renamed = recording.rotate_body(np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]]))
    rfu = get("euler-ukf")(axes="rfu").run(renamed)
    turn = Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])
    assert (rfu.rotation * turn * plain.rotation.inv()).magnitude().max() < AGREE


def test_rejected_field_is_flagged_with_its_statistic():
    n = 1000
    field = np.tile([20.0, 0.0, 45.0], (n, 1))
    field[500:600] += [15.0, 10.0, 0.0]
    recording = nd.Recording(np.arange(n) * 0.01, np.zeros((n, 3)), np.tile([0, 0, -9.80665], (n, 1)), field)
    for name in ("mekf", "quaternion-ekf", "double-stage-ekf", "euler-ukf", "gyro-euler-ekf"):
        result = get(name)().run(recording)
        disturbed = (np.arange(n) >= 500) & (np.arange(n) < 600)
        assert np.array_equal(result.has(nd.Flag.MAG_REJECTED), disturbed), name
        assert np.array_equal(result.diagnostics["field_departure"] > 4.6, disturbed), name
        assert np.rad2deg(np.abs(result.as_euler()[:, 2]).max()) < 0.1, name


def test_strong_acceleration_is_flagged_with_its_statistic():
    # at rest but for 15 m/s² straight up from 1 s to 2 s, which tilts nothing
    n, dt, window = 400, 0.01, 0.5
    t = np.arange(n) * dt
    accelerating = (t > 0.995) & (t < 1.995)
    acc = np.tile([0.0, 0.0, -9.80665], (n, 1))
    acc[accelerating, 2] -= 15.0
    acc[1::2] = np.nan
    recording = nd.Recording(t, np.zeros((n, 3)), acc, np.tile([20.0, 0.0, 45.0], (n, 1)))
    # each sample stands for 2 dt; a low pass of the square, by hand
    expected, mean = np.zeros(n), 0.0
    for k in range(2, n):
        if k % 2 == 0:
            mean += (225.0 * accelerating[k] - mean) * 2 * dt / window
        expected[k] = math.sqrt(mean)
    for name in ("mekf", "quaternion-ekf", "double-stage-ekf", "euler-ukf", "gyro-euler-ekf"):
        result = get(name)(motion_window=window, acc_noise=0.4, motion_time=0.02).run(recording)
        # m/s²; the means over the UKF's sigma points are no unit vectors, so that the field tips it a little
        tolerance = 0.01 if name == "euler-ukf" else 1e-9
        assert np.abs(result.diagnostics["acceleration"] - expected).max() < tolerance, name
        flagged = (expected > 3.0 * 0.4 / math.sqrt(0.02)) & (np.arange(n) % 2 == 0)
        assert 20 < flagged.sum() < 80, name
        assert np.array_equal(result.has(nd.Flag.ACC_REJECTED), flagged), name


def test_covariance_turns_with_the_frame(recording):
    ned = get("mekf")().run(recording)
    enu = get("mekf")().run(recording, frame="ENU")
    assert np.allclose(enu.covariance, ned.to_frame("ENU").covariance, rtol=1e-9, atol=1e-18)
