"""The filters without gyroscope against dense ones: full matrices, stacked measurements, numerical Jacobians."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from array_truth import GRAVITY, coplanar, jacobian, products, recorded, scattered
from scipy.linalg import solve_discrete_are
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown.arrays import AccelerometerArray
from northdown.simulation import random_motion

RATE = 50.0
DOWN = np.array([0.0, 0.0, 1.0])
# rad and rad/s: rounding, and that of differences over 1e-6, in five hundred steps
AGREE = 1e-9


def cube(half: float = 0.05) -> AccelerometerArray:
    """Twelve accelerometers, two on each face, in its plane: by symmetry rates do not leak into specific force."""
    axes = np.eye(3)
    places = [(s * half * axes[i], axes[j]) for i in range(3) for s in (1, -1) for j in range(3) if j != i]
    return AccelerometerArray(np.array([p for p, _ in places]), np.array([d for _, d in places]))


@pytest.fixture(scope="module")
def recordings():
    """Ten seconds at 50 Hz, field at 12.5 Hz, single samples of the array missing."""
    made = {}
    motion = random_motion(10.0, seed=21, turn=0.15, reach=0.0)
    for name, array in (("scattered", scattered(8)), ("cube", cube()), ("coplanar", coplanar(0.05))):
        r = recorded(motion, array, rate=RATE, seed=4)
        channels, mag = r.array_acc.copy(), r.mag.copy()
        channels[[200, 203, 204], [0, 1, 2]] = np.nan
        mag[np.arange(len(r)) % 4 != 0] = np.nan
        made[name] = dataclasses.replace(r, array_acc=channels, mag=mag)
    return made


class Dense:
    """States (δ, ω) about a rotation R; the model in the words of the modules' docstrings."""

    def __init__(self, f, array, R):
        self.f, self.R, self.w = f, R, np.zeros(3)
        self.P = np.diag([f.start_tilt**2] * 2 + [f.start_heading**2] + [f.start_rate**2] * 3)
        inverse = np.linalg.pinv(array.matrix)
        self.inverse, self.leak = inverse, inverse @ array.products
        self.noise = f.acc_noise**2 * inverse @ inverse.T  # densities
        self.use(getattr(f, "force_axes", "xyz"))
        self.acceleration, self.rate, self.fresh, self.before = np.zeros(3), np.zeros(3), False, 0.0

    def use(self, axes):
        """Components of f that are measured: their noise tells something of that of angular acceleration."""
        e = np.eye(3)[["xyz".index(a) for a in axes]]
        self.G = self.noise[:3, 3:] @ e.T @ np.linalg.inv(e @ self.noise[3:, 3:] @ e.T) @ e
        self.rate_noise = self.noise[:3, :3] - self.G @ self.noise[3:, :3]
        self.rate_leak = self.leak[:3] - self.G @ self.leak[3:]

    def force(self, R):
        return R.inv().apply(-self.f.gravity * DOWN)

    def turning(self, y, R, w, shift):
        six = self.inverse @ y
        free = six[:3] - self.G @ (six[3:] - self.force(R))
        return free - self.rate_leak @ products(w + shift)

    def predict(self, dt, y):
        h = 0.5 * (self.before + dt)
        F = np.eye(6)
        if self.fresh:
            shift = self.rate - self.w

            def after(x):
                R, w = Rotation.from_rotvec(x[:3]) * self.R, self.w + x[3:]
                return w + h * self.turning(y, R, w, shift)

            F[3:] = jacobian(after, np.zeros(6))
        self.P = F @ self.P @ F.T
        self.P[3:, 3:] += h * self.rate_noise
        self.w = self.w + h * self.acceleration
        D = np.eye(6)
        D[:3, 3:] = dt * self.R.as_matrix()
        self.P = D @ self.P @ D.T
        self.R = self.R * Rotation.from_rotvec(dt * self.w)

    def shift_at(self, y, dt):
        return 0.5 * dt * self.turning(y, self.R, self.w, 0.0)

    def finish(self, y, dt):
        self.fresh, self.before = y is not None, dt
        if self.fresh:
            shift = self.shift_at(y, dt)
            self.rate = self.w + shift
            self.acceleration = self.turning(y, self.R, self.w, shift)
        else:
            self.rate = self.w + 0.5 * dt * self.acceleration

    def update(self, residual, noise, by_rate=None):
        """Iterated update; residual(x) is z − h at the error x, with noise its covariance.

        by_rate is how z, less what rates leak into it, depends on the rate, where that is not to be differentiated.
        """
        x, P, y = np.zeros(6), self.P, None
        for _ in range(self.f.iterations):
            H = -jacobian(residual, x)
            if by_rate is not None:
                H[:, 3:] = by_rate
            S = H @ P @ H.T + noise
            K = P @ H.T @ np.linalg.inv(S)
            y = residual(x) + H @ x
            x = K @ y
            self.P = (np.eye(6) - K @ H) @ P
        self.nis = y @ np.linalg.solve(S, y)
        self.R, self.w = Rotation.from_rotvec(x[:3]) * self.R, self.w + x[3:]

    def at(self, x):
        return Rotation.from_rotvec(x[:3]) * self.R, self.w + x[3:]


class DenseDirect(Dense):
    def measure(self, y, mag, dt, age_force, age_mag):
        f, parts, noise = self.f, [], []
        if y is not None:
            six, shift = self.inverse @ y, self.shift_at(y, dt)
            used = ["xyz".index(a) for a in f.force_axes]

            def force(x):
                R, w = self.at(x)
                return (six[3:] - self.leak[3:] @ products(w + shift) - self.force(R))[used]

            parts.append(force)
            noise.append(self.noise[3:, 3:][np.ix_(used, used)] / age_force)
        if mag is not None:
            seen = ["xyz".index(a) for a in f.mag_axes]
            u = np.array([np.cos(f.dip), 0.0, np.sin(f.dip)])
            m = mag / (np.linalg.norm(mag) if len(seen) == 3 else f.field)
            parts.append(lambda x: (m - self.at(x)[0].inv().apply(u))[seen])
            noise.append((f.mag_noise / f.field) ** 2 / age_mag * np.eye(len(seen)))
        if parts:
            size = sum(map(len, noise))
            R, row = np.zeros((size, size)), 0
            for block in noise:
                R[row : row + len(block), row : row + len(block)] = block
                row += len(block)
            self.update(lambda x: np.concatenate([part(x) for part in parts]), R)
        return y is not None, mag is not None


class DenseIndirect(Dense):
    def angles(self, force, mag):
        """K06 (3.11) to (3.15) in the sign of specific force: roll, pitch and, with a field, yaw."""
        pitch, roll = np.arcsin(force[0] / self.f.gravity), np.arctan2(-force[1], -force[2])
        if mag is None:
            return np.array([roll, pitch])
        v = Rotation.from_euler("ZYX", [0.0, pitch, roll]).apply(mag)
        return np.array([roll, pitch, np.arctan2(-v[1], v[0])])

    def measure(self, y, mag, dt, age_force, age_mag):
        if y is None:
            return False, False
        f, six, shift = self.f, self.inverse @ y, self.shift_at(y, dt)
        n = 2 if mag is None else 3
        h = None if mag is None else self.R.apply(mag)
        expected = self.force(self.R)
        there = np.zeros(3) if h is None else self.R.inv().apply([np.hypot(h[0], h[1]), 0.0, h[2]])
        by = jacobian(lambda x: self.angles(x[:3], x[3:] if n == 3 else None), np.append(expected, there))
        C = np.zeros((6, 6))
        C[:3, :3] = self.noise[3:, 3:] / age_force
        if n == 3:
            C[3:, 3:] = (f.mag_noise / f.field) ** 2 / age_mag * (mag @ mag) * np.eye(3)
        noise = by @ C @ by.T
        pitch = self.R.as_euler("ZYX")[1]
        by_pitch = by[:, 0] / by[1, 0]
        by_force = by[:, :3] @ C[:3, :3] @ by[:, :3].T
        bend = 0.5 * (by_force[1, 1] * np.tan(pitch)) ** 2
        noise += bend * np.outer(by_pitch, by_pitch)
        by_roll = by_force[:, 0] / by_force[0, 0] / np.cos(pitch)
        ahead = Rotation.from_euler("Z", self.R.as_euler("ZYX")[0]).as_matrix()
        spread = np.diag(ahead.T @ self.P[:3, :3] @ ahead)
        v_1 = by_force[0, 0] * np.cos(pitch) ** 2
        v_2 = by_force[1, 1] - by_force[0, 1] ** 2 / by_force[0, 0] + bend
        mixed = (v_1 + spread[0]) * (v_2 + spread[1]) / np.cos(pitch) ** 2
        noise += mixed * np.outer(by_roll, by_roll)
        if n == 3:
            noise[2, 2] += (h[2] / np.hypot(h[0], h[1])) ** 2 * mixed
        prior, R0 = self.R.as_euler("ZYX")[::-1][:n], self.R

        def residual(x):
            R, w = self.at(x)
            z = self.angles(six[3:] - self.leak[3:] @ products(w + shift), mag)
            if f.residual == "rotation":
                yaw = z[2] if n == 3 else R0.as_euler("ZYX")[0]
                return to_angles @ ((Rotation.from_euler("ZYX", [yaw, z[1], z[0]]) * R0.inv()).as_rotvec() - x[:3])
            a = R.as_euler("ZYX")[::-1][:n]
            scale = np.cos(prior) ** 2
            scale[1] = 1.0 / np.cos(prior[1])
            forms = (np.tan, np.sin, np.tan)[:n]
            return np.array([form(p) - form(q) for form, p, q in zip(forms, z, a, strict=True)]) * scale

        to_angles = jacobian(lambda d: (Rotation.from_rotvec(d) * R0).as_euler("ZYX")[::-1][:n], np.zeros(3))
        # z itself changes with the rate; at the prediction, as its noise does
        by_rate = by[:, :3] @ self.leak[3:] @ jacobian(products, self.w + shift)
        self.update(residual, noise, by_rate)
        return True, mag is not None


def run_dense(kind, f, recording, start):
    dense = kind(f, recording.array, start)
    last = recording.array_acc[0]
    dense.finish(last, 0.0)
    age_force = age_mag = 0.0
    for k in range(1, len(recording)):
        dt = recording.time[k] - recording.time[k - 1]
        age_force, age_mag = age_force + dt, age_mag + dt
        y = recording.array_acc[k] if np.isfinite(recording.array_acc[k]).all() else None
        mag = recording.mag[k] if np.isfinite(recording.mag[k]).all() else None
        dense.predict(dt, last)
        done = dense.measure(y, mag, dt, age_force, age_mag)
        age_force, age_mag = [0.0 if d else a for d, a in zip(done, (age_force, age_mag), strict=True)]
        dense.finish(y, dt)
        last = y
    return dense


CASES = {
    "direct": (DenseDirect, "scattered", nd.GyroFreeDirect(motion_time=0.0, dip=1.0)),
    "direct iterated": (DenseDirect, "scattered", nd.GyroFreeDirect(motion_time=0.0, dip=1.0, iterations=3)),
    "direct K06": (
        DenseDirect,
        "coplanar",
        nd.GyroFreeDirect(motion_time=0.0, dip=1.0, force_axes="yz", mag_axes="xy", iterations=2),
    ),
    "indirect": (DenseIndirect, "scattered", nd.GyroFreeIndirect(motion_time=0.0)),
    "indirect iterated": (DenseIndirect, "cube", nd.GyroFreeIndirect(motion_time=0.0, iterations=3)),
    "indirect K06": (DenseIndirect, "cube", nd.GyroFreeIndirect(motion_time=0.0, residual="tangent", iterations=2)),
}


@pytest.mark.parametrize("case", CASES)
def test_against_dense(recordings, case):
    kind, array, f = CASES[case]
    r = recordings[array]
    start = r.reference.rotation[0] * Rotation.from_rotvec([0.05, -0.04, 0.03])
    dense = run_dense(kind, f, r, start)
    result = f.run(r, initial=start)
    assert (result.rotation[-1] * dense.R.inv()).magnitude() < AGREE
    assert np.abs(result.rate[-1] - dense.rate).max() < AGREE
    assert np.abs(result.covariance[-1] - dense.P[:3, :3]).max() < 1e-7 * np.diag(dense.P)[:3].min()
    half = 0.25 * (r.time[-1] - r.time[-2]) * np.diag(dense.rate_noise)
    assert np.abs(result.rate_sigma[-1] / np.sqrt(np.diag(dense.P)[3:] + half) - 1.0).max() < 1e-7
    assert result.diagnostics["nis"][-1] == pytest.approx(dense.nis, rel=1e-5)


def test_correlated_noise_as_in_the_riccati_equation_with_cross_term():
    """At rest, with rates below what their products show, the filter's covariance is the equation's solution."""
    array, dt = scattered(7, seed=2), 1.0 / RATE
    f = nd.GyroFreeDirect(motion_time=0.0, dip=1.0, mag_noise=0.02)
    n = 2000
    R = Rotation.from_euler("ZYX", [0.4, 0.3, -0.5])
    y = np.tile(array.matrix[:, 3:] @ R.inv().apply([0.0, 0.0, -GRAVITY]), (n, 1))
    u = np.array([np.cos(1.0), 0.0, np.sin(1.0)])
    recording = nd.Recording(np.arange(n) * dt, mag=np.tile(R.inv().apply(u), (n, 1)), array=array, array_acc=y)
    result = f.run(recording, initial=R)

    inverse = np.linalg.pinv(array.matrix)
    C = f.acc_noise**2 / dt * inverse @ inverse.T
    b = R.as_matrix()

    def measured(x):
        q = Rotation.from_rotvec(x[:3]) * R
        return np.concatenate([q.inv().apply([0.0, 0.0, -GRAVITY]), q.inv().apply(u)])

    H = jacobian(measured, np.zeros(6))
    noise = np.zeros((6, 6))
    noise[:3, :3], noise[3:, 3:] = C[3:, 3:], (f.mag_noise / f.field) ** 2 / dt * np.eye(3)
    F = np.block([[np.eye(3), dt * b], [np.zeros((3, 3)), np.eye(3)]])
    by = np.vstack([dt * dt * b, dt * np.eye(3)])  # of angular acceleration
    cross = np.hstack([-by @ C[:3, 3:], np.zeros((6, 3))])
    prior = solve_discrete_are(F.T, H.T, by @ C[:3, :3] @ by.T, noise, s=cross)
    after = prior - prior @ H.T @ np.linalg.solve(H @ prior @ H.T + noise, H @ prior)
    assert np.abs(result.covariance[-1] / after[:3, :3] - 1.0).max() < 1e-5
    # leaving the correlation out is seen
    blind = solve_discrete_are(F.T, H.T, by @ C[:3, :3] @ by.T, noise)
    blind -= blind @ H.T @ np.linalg.solve(H @ blind @ H.T + noise, H @ blind)
    assert np.abs(np.diag(blind)[:3] / np.diag(after)[:3] - 1.0).max() > 0.05
