"""The error-state filter on an accelerometer array: against a dense one, its biases, and linear acceleration."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from array_truth import jacobian, products, recorded, scattered
from scipy.linalg import null_space
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import northdown as nd
from northdown.estimators._array import redundancy
from northdown.simulation import Motion, Shaking, random_motion, rest

DIP = np.pi / 3.0
DOWN = np.array([0.0, 0.0, 1.0])
QUIET = {"motion_time": 0.0, "dip": DIP, "norm_gate": 1e3, "dip_gate": 1e3}


def biased(recording, sigma, seed):
    """The recording with a constant bias on each channel, drawn with sigma (m/s²)."""
    b = np.random.default_rng(500 + seed).normal(0.0, sigma, len(recording.array))
    return dataclasses.replace(recording, array_acc=recording.array_acc + b)


class Dense:
    """Twelve states (δ, ω, biases) in full matrices; extra measurements in turn, each from the point reached."""

    def __init__(self, f, array, R):
        self.f, self.R, self.w, self.b = f, R, np.zeros(3), np.zeros(6)
        self.J = np.linalg.pinv(array.matrix)
        self.L, self.C = self.J @ array.products, self.J @ self.J.T
        self.combine, self.seen = redundancy(array)
        self.P = np.zeros((12, 12))
        self.P[:6, :6] = np.diag([f.start_tilt**2] * 2 + [f.start_heading**2] + [f.start_rate**2] * 3)
        self.P[6:, 6:] = f.start_bias**2 * self.C
        self.motion, self.loose, self.before = 0.0, 0.0, 0.0
        self.y, self.acceleration, self.rate = None, np.zeros(3), np.zeros(3)

    def force(self, R):
        return R.inv().apply(-self.f.gravity * DOWN)

    def moved(self, x):
        return Rotation.from_rotvec(x[:3]) * self.R, self.w + x[3:6], self.b + x[6:]

    def G(self):
        return self.C[:3, 3:] @ np.linalg.inv(self.C[3:, 3:] + self.loose * np.eye(3))

    def turning(self, y, R, rate, b):
        six = self.J @ y - b - self.L @ products(rate)
        return six[:3] - self.G() @ (six[3:] - self.force(R))

    def predict(self, dt):
        h, f = 0.5 * (self.before + dt), self.f
        shift, F = self.rate - self.w, np.eye(12)

        def after(x):
            R, w, b = self.moved(x)
            return w + h * self.turning(self.y, R, w + shift, b)

        F[3:6] = jacobian(after, np.zeros(12))
        self.P = F @ self.P @ F.T
        self.P[3:6, 3:6] += h * f.acc_noise**2 * (self.C[:3, :3] - self.G() @ self.C[3:, :3])
        self.w = self.w + h * self.acceleration
        D = np.eye(12)
        D[:3, 3:6] = dt * self.R.as_matrix()
        self.P = D @ self.P @ D.T
        self.P[6:, 6:] += dt * f.acc_bias_walk**2 * self.C
        self.R = self.R * Rotation.from_rotvec(dt * self.w)

    def update(self, x, residual, H, noise):
        K = self.P @ H.T @ np.linalg.inv(H @ self.P @ H.T + noise)
        self.P = (np.eye(12) - K @ H) @ self.P
        return x + K @ residual

    def measure(self, y, mag, dt):
        f, x = self.f, np.zeros(12)
        u = np.array([math.cos(f.dip), 0.0, math.sin(f.dip)])
        if mag is not None:
            H = jacobian(lambda x: self.moved(x)[0].inv().apply(u), x)
            r = (f.mag_noise / f.field) ** 2 / mag[1] * np.eye(3)
            x = self.update(x, mag[0] / np.linalg.norm(mag[0]) - self.R.inv().apply(u), H, r)
        shift = 0.5 * dt * self.turning(y, self.R, self.w, self.b)
        for row, e in zip(self.seen, self.combine @ y, strict=True):
            if not row.any():
                continue
            at = self.w + shift + x[3:6]
            M = 0.5 * jacobian(
                lambda w, row=row: jacobian(lambda v: np.array([row @ products(v)]), w, 1e-3)[0], at, 1e-3
            )
            MP = M @ self.P[3:6, 3:6]
            H = np.zeros((1, 12))
            H[0, 3:6] = 2.0 * M @ at
            noise = 2.0 * np.trace(MP @ MP) + (f.acc_noise**2 + f.start_bias**2 * f.bias_time) / dt
            x = self.update(x, np.array([e - row @ products(at) - np.trace(MP)]), H, noise)

        def explained(x):
            R, w, b = self.moved(x)
            return b[3:] + self.L[3:] @ products(w + shift) + self.force(R)

        per, six, here = f.acc_noise**2 / dt, self.J @ y, np.zeros(12)
        f_n = self.R.apply(six[3:] - self.b[3:] - self.L[3:] @ products(self.w + shift))
        self.motion += (np.sum((f_n + f.gravity * DOWN) ** 2) - self.motion) * min(1.0, dt / f.motion_window)
        excess = max(0.0, self.motion - per * np.trace(self.C[3:, 3:]))
        self.loose = f.motion_time * excess / f.acc_noise**2
        H = jacobian(explained, here)
        noise = per * (self.C[3:, 3:] + self.loose * np.eye(3))
        x = self.update(x, six[3:] - explained(here) - H @ x, H, noise)
        self.R, self.w, self.b = self.moved(x)

    def finish(self, y, dt):
        self.y, self.before = y, dt
        self.rate = self.w + 0.5 * dt * self.turning(y, self.R, self.w, self.b)
        self.acceleration = self.turning(y, self.R, self.rate, self.b)


@pytest.mark.parametrize("count", [6, 8, 12])
def test_against_dense(count):
    motion = random_motion(6.0, seed=21, turn=0.5, reach=0.3)
    r = biased(recorded(motion, scattered(count), rate=50.0, seed=4), 0.05, 1)
    f = nd.GyroFreeMEKF(dip=DIP, norm_gate=1e6, dip_gate=1e6, start_bias=0.05)
    start = r.reference.rotation[0] * Rotation.from_rotvec([0.05, -0.04, 0.03])
    dense = Dense(f, r.array, start)
    dense.finish(r.array_acc[0], 0.0)
    for k in range(1, len(r)):
        dt = r.time[k] - r.time[k - 1]
        dense.predict(dt)
        dense.measure(r.array_acc[k], (r.mag[k], dt), dt)
        dense.finish(r.array_acc[k], dt)
    result = f.run(r, initial=start)
    # rad and rad/s: rounding and that of numerical derivatives, in three hundred steps
    assert (result.rotation[-1] * dense.R.inv()).magnitude() < 1e-9
    assert np.abs(result.rate[-1] - dense.rate).max() < 1e-8
    assert np.abs(result.covariance[-1] - dense.P[:3, :3]).max() < 1e-6 * np.diag(dense.P)[:3].min()
    assert result.diagnostics["acceleration"][-1] == pytest.approx(math.sqrt(dense.motion), rel=1e-6)


def test_redundant_combinations_see_products_of_rates_alone():
    """Against SciPy's null space: no angular acceleration, no specific force, white noise, nothing lost."""
    assert not any(part.any() for part in redundancy(scattered(6)))
    for count in (7, 9, 12, 15):
        array = scattered(count)
        matrix, seen = redundancy(array)
        used = seen.any(axis=1)
        assert used.sum() == min(6, count - 6)
        assert np.abs(matrix @ array.matrix).max() < 1e-14
        assert np.abs(matrix @ array.products - seen).max() < 1e-14
        assert np.abs(matrix[used] @ matrix[used].T - np.eye(used.sum())).max() < 1e-14
        whole = null_space(array.matrix.T).T @ array.products
        assert np.abs(seen.T @ seen - whole.T @ whole).max() < 1e-14


@pytest.mark.parametrize("sigma", [0.0, 0.05], ids=["no bias", "bias"])
def test_covariance_is_honest(sigma):
    """50 runs of in-model noise and biases: mean NEES within the 95 % interval of χ² of three degrees of freedom."""
    runs, found, rates = 50, [], []
    f = nd.GyroFreeMEKF(**QUIET, start_bias=sigma, acc_bias_walk=0.0)
    for seed in range(runs):
        r = recorded(random_motion(4.0, seed=seed, turn=1.0, reach=0.0), scattered(9), seed=seed)
        r = biased(r, sigma, seed)
        error = np.random.default_rng(seed).normal(size=3) * [f.start_tilt, f.start_tilt, f.start_heading]
        result = f.run(r, initial=Rotation.from_rotvec(error) * r.reference.rotation[0])
        v = (r.reference.rotation[-1] * result.rotation[-1].inv()).as_rotvec()
        found.append(v @ np.linalg.solve(result.covariance[-1], v))
        rates.append(((result.rate - r.reference.rate) / result.rate_sigma)[-1] ** 2)
    low, high = chi2.ppf([0.025, 0.975], 3 * runs) / runs
    assert low < np.mean(found) < high
    assert low < 3.0 * np.mean(rates) < high


def test_biases_are_learned():
    """Half a minute of turning: the direct filter, which has no biases, stays off, this one does not."""
    array = scattered(9)
    r = biased(recorded(random_motion(30.0, seed=1, turn=1.0, reach=0.0), array, seed=1), 0.2, 1)
    errors = {}
    for f in (nd.GyroFreeDirect(dip=DIP), nd.GyroFreeMEKF(dip=DIP, start_bias=0.2)):
        error = (f.run(r).rotation * r.reference.rotation.inv()).magnitude()[-4000:]
        errors[f.name] = np.sqrt(np.mean(error**2))
    assert errors["gyro-free-mekf"] < 0.6 * errors["gyro-free-direct"]


class TestLinearAcceleration:
    """Turning about all axes, at 0.6 rad/s RMS, while the body is shaken once a second, 4 m/s² RMS, for 20 s."""

    @pytest.fixture(scope="class", params=[0, 1, 2])
    @staticmethod
    def shaken(request):
        turning = random_motion(20.0, seed=request.param, turn=1.0, reach=0.0).turning
        reach = 4.0 * math.sqrt(2.0) / (2.0 * np.pi) ** 2 * np.array([0.7, 0.55, 0.46])
        return recorded(Motion(turning, Shaking(reach, 1.0), 0.0, 20.0), scattered(12), seed=request.param)

    @staticmethod
    def errors(f, r):
        """RMS of attitude (rad) and rate (rad/s) after five seconds."""
        result = f.run(r)
        angle = (result.rotation * r.reference.rotation.inv()).magnitude()[2000:]
        rate = (result.rate - r.reference.rate)[2000:]
        return np.sqrt(np.mean(angle**2)), np.sqrt(np.mean(rate**2))

    def test_attitude_and_rate_stay_right_with_redundancy(self, shaken):
        f = nd.GyroFreeMEKF(dip=DIP)
        angle, rate = self.errors(f, shaken)
        assert angle < np.deg2rad(10.0)
        assert rate < 0.15
        # what takes all for gravity is lost
        assert self.errors(nd.GyroFreeDirect(dip=DIP), shaken)[0] > 4.0 * angle
        # and without the redundant combinations (their biases counted as huge) rates are lost with gravity
        without = self.errors(dataclasses.replace(f, bias_time=1e12), shaken)
        assert without[0] > 2.0 * angle
        assert without[1] > 2.0 * rate


def test_at_rest_redundancy_does_no_harm():
    """Where rates are zero their products tell nothing to first order: no overshoot, no false certainty."""
    r = recorded(rest(10.0), scattered(12), seed=2)
    result = nd.GyroFreeMEKF(**QUIET, start_bias=0.0).run(r)
    z = (result.rate / result.rate_sigma)[400:]
    assert np.abs(z).max() < 5.0
    assert np.mean(z**2) == pytest.approx(1.0, abs=0.35)
