"""The calibrating filter and its smoother against dense matrices: stacked measurements, Rauch–Tung–Striebel."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown.estimators import _calibrating_layout as layout
from northdown.kernels.runner import N_RUNNER
from northdown.simulation import simulate

GRAVITY_N = np.array([0.0, 0.0, 1.0])
N = 22
THETA, BIAS, SPEED, MATRIX, OFFSET = (slice(a, a + 3) for a in (0, 3, 6, 9, 18))
MATRIX = slice(9, 18)
DELAY = 21


def cross_matrix(v):
    return np.cross(np.eye(3), v)


def derivative(f, h=1e-3):
    """At 0, to fourth order: good to 1e-12."""
    return (8.0 * (f(h) - f(-h)) - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h)


class Dense:
    """The equations of the docstring with full matrices; keeps what a smoother needs."""

    def __init__(self, f, start, still=None):
        self.f, self.R, self.still_given = f, start, still
        self.b, self.v, self.M, self.e, self.delay = (
            np.zeros(3),
            np.zeros(3),
            np.zeros((3, 3)),
            np.zeros(3),
            f.mag_delay,
        )
        sigma = [f.start_tilt] * 2 + [f.start_heading] + [f.start_bias] * 3 + [0.1] * 3
        self.P = np.diag(sigma + [f.gyr_matrix] * 9 + [f.rest_offset] * 3 + [f.mag_delay_sigma]) ** 2
        self.motion = self.clock = self.age_acc = self.age_mag = self.learnt = self.mean_u = 0.0
        self.reference = np.zeros(2)
        self.turned, self.history = np.zeros(3), [(0.0, np.zeros(3))]
        self.still, self.blocks, self.epochs, self.taken, self.seen = False, [], [], [], []
        self.begin()

    def begin(self):
        self.T = self.T_acc = self.rate_square = self.acc_square = 0.0
        self.F = np.eye(N)
        self.force, self.shift = np.zeros(3), np.zeros(3)
        self.fields, self.slopes, self.block = [], [], []

    def sample(self, k, dt, gyr, acc, mag):
        f = self.f
        self.T += dt
        if self.still_given is not None:
            self.still = bool(self.still_given[k])
        rate = gyr - self.b - (self.e if self.still else self.M @ gyr)
        self.clock += dt
        self.turned = self.turned + rate * dt
        if self.clock - self.history[-1][0] >= 2e-3:
            self.history.append((self.clock, self.turned))
        self.R = self.R @ Rotation.from_rotvec(rate * dt).as_matrix()
        self.F[THETA, BIAS] -= self.R * dt
        if self.still:
            self.F[THETA, OFFSET] -= self.R * dt
        else:
            self.F[THETA, MATRIX] -= np.hstack([self.R * g * dt for g in gyr])
        self.rate_square += rate @ rate * dt
        self.age_acc += dt
        self.age_mag += dt
        if acc is not None:
            force, age = self.R @ acc, min(self.age_acc, 0.1)
            a = force + f.gravity * GRAVITY_N
            self.T_acc += age
            self.acc_square += a @ a * age
            self.motion += (a @ a - self.motion) * min(1.0, self.age_acc / f.motion_window)
            self.force, self.shift = self.force + force * age, self.shift + a * age
            self.age_acc = 0.0
            self.block.append((age, *gyr, *acc))
        if mag is not None:
            self.field(rate, mag)
        if self.T + 0.5 * dt >= f.epoch:
            self.close(k)

    def field(self, rate, mag):
        then, d, time = rate, rate * self.delay, self.clock - self.delay
        older = [h for h in self.history if h[0] <= time]
        if self.delay > 0.0 and older:
            newer = [h for h in self.history if h[0] > time]
            (t0, x0), (t1, x1) = older[-1], newer[0] if newer else (self.clock, self.turned)
            then = (x1 - x0) / (t1 - t0)
            d = self.turned - x1 + (t1 - time) * then
        b = Rotation.from_rotvec(-d).apply(mag)
        self.fields.append(self.R @ b)
        self.slopes.append(self.R @ np.cross(b, then))

    def close(self, k):
        f, T = self.f, self.T
        self.F[SPEED, THETA] = -cross_matrix(self.force)
        self.F[SPEED, 2] = 0.0
        Q = np.zeros(N)
        Q[THETA] = f.gyr_noise**2 * T + f.gyr_scale**2 * self.rate_square
        Q[BIAS] = f.gyr_bias_walk**2 * T
        Q[SPEED] = f.acc_noise**2 * (T + f.acc_motion * self.acc_square)
        Q[MATRIX], Q[OFFSET], Q[DELAY] = f.gyr_matrix**2, f.rest_offset**2, f.mag_delay_sigma**2
        Q[9:] *= T / f.calibration_time
        self.P = self.F @ self.P @ self.F.T + np.diag(Q)
        self.v = self.v + self.shift
        rest_noise = f.rest_noise**2
        if self.still_given is None:
            self.still, density = self.window()
            rest_noise = max(rest_noise, density)
        mean = (
            np.average([r[1:4] for r in self.block], axis=0, weights=[r[0] for r in self.block]) if self.block else 0
        )
        rest_H = np.zeros((3, N))
        rest_H[:, BIAS] = rest_H[:, OFFSET] = np.eye(3)
        rest_y = mean - self.b - self.e
        S = rest_H @ self.P @ rest_H.T + rest_noise / T * np.eye(3)
        self.still = self.still and len(self.block) > 0 and 3.0 * rest_y @ rest_y < 16.0 * np.trace(S)
        rows, y, r = [], [], []
        if self.T_acc > 0.0:
            rows += list(np.eye(N)[SPEED])
            y += list(-self.v)
            r += [(1e-5 if self.still else f.speed_noise**2 * (1 + f.speed_motion * self.motion)) / self.T_acc] * 3
        if self.fields:
            H, innovation, variance = self.heading()
            rows, y, r = [*rows, H], [*y, innovation], [*r, variance]
        if self.still:
            rows, y, r = [*rows, *rest_H], [*y, *rest_y], [*r, *[rest_noise / T] * 3]
        H = np.array(rows)
        K = self.P @ H.T @ np.linalg.inv(H @ self.P @ H.T + np.diag(r))
        d = K @ np.array(y)
        prior, before = self.P, self.R
        self.P = (np.eye(N) - K @ H) @ self.P
        self.R = Rotation.from_rotvec(d[THETA]).as_matrix() @ self.R
        self.b, self.v, self.e = self.b + d[BIAS], self.v + d[SPEED], self.e + d[OFFSET]
        self.v = Rotation.from_rotvec([0.0, 0.0, d[2]]).apply(self.v)
        self.M = self.M + d[MATRIX].reshape(3, 3).T
        self.delay += d[DELAY]
        self.epochs.append((k, self.F, prior, self.P, d, before, self.R, self.b))
        heading = 3 * (self.T_acc > 0.0) if self.fields else None
        seen = (np.mean(self.fields, axis=0), self.age) if self.fields else None
        self.taken.append((self.F, Q, H, np.array(y), np.array(r), d, heading, seen))
        self.begin()

    def heading(self):
        f = self.f
        x, y, z = h = np.mean(self.fields, axis=0)
        sample, age = np.array([math.hypot(x, y), z]), min(self.age_mag, 1.0)
        self.age, self.age_mag = age, 0.0
        self.learnt += age
        u, gain = 0.0, min(1.0, age / self.learnt)
        if self.learnt > 1.0 + 0.5 * age:
            size = np.linalg.norm(self.reference)
            along = self.reference / size
            off = (sample - self.reference) / size
            across = off - (off @ along) * along
            u = min(60.0, (off @ along / f.norm_gate) ** 2 + across @ across / f.dip_gate**2)
            gain = min(1.0, age / min(self.learnt, f.field_window)) / (1.0 + u)
        self.reference = self.reference + gain * (sample - self.reference)
        if f.gate_window > 0.0:
            kept = max(0.0, 1.0 - age / f.gate_window)
            self.mean_u = kept * self.mean_u + (1.0 - kept) * u
            u = max(u, self.mean_u)
        self.u = u

        self.seen.append((age / (1.0 + u) ** f.gate_power, self.R, h))

        def angle(v):
            return math.atan2(v[1], v[0])

        slope = np.mean(self.slopes, axis=0)
        H = np.zeros(N)
        for j in range(3):
            axis = np.eye(3)[j]
            H[j] = -derivative(lambda e, axis=axis: angle(Rotation.from_rotvec(e * axis).apply(h)))
        H[DELAY] = -derivative(lambda e: angle(h + e * slope))
        return H, angle(h), f.mag_noise**2 / age * (1.0 + u) ** f.gate_power

    def heading_doubt(self):
        """By stacked least squares for the field of the place and that of the body, with 0.1 s of no iron."""
        rows = [math.sqrt(w) * np.hstack([np.eye(3), R]) for w, R, _ in self.seen]
        rows = np.vstack([*rows, math.sqrt(0.1) * np.hstack([np.zeros((3, 3)), np.eye(3)])])
        fields = np.concatenate([*(math.sqrt(w) * m for w, _, m in self.seen), np.zeros(3)])
        iron = np.linalg.lstsq(rows, fields, rcond=None)[0][3:]
        weight = np.array([w for w, *_ in self.seen])
        R = np.average([R for _, R, _ in self.seen], axis=0, weights=weight)
        x, y, _ = np.average([m for *_, m in self.seen], axis=0, weights=weight)
        across = np.array([-y, x, 0.0]) / math.hypot(x, y)
        psi = across @ R @ iron / math.hypot(x, y)
        spread = 0.1 * np.linalg.inv(rows.T @ rows)[3:, 3:]
        d = across @ R @ spread @ R.T @ across
        return self.f.heading_sigma**2 * (max(0.04, d) + (psi / 0.01) ** 2)

    def window(self):
        self.blocks.append(np.array(self.block).reshape(-1, 7))
        rows, time = [], 0.0
        for block in reversed(self.blocks):
            rows.append(block)
            time += block[:, 0].sum()
            if time >= 0.999 * self.f.rest_window:
                break
        else:
            return False, 0.0
        rows = np.vstack(rows)
        dt = rows[:, 0]
        mean = (rows[:, 1:].T @ dt) / time
        scatter = ((rows[:, 1:] - mean) ** 2).T @ dt / time
        gyr, acc = scatter[:3].sum(), scatter[3:].sum()
        near = np.linalg.norm(mean[:3] - self.b - self.e) < self.f.rest_rate
        quiet = len(rows) >= 10 and gyr < self.f.rest_gyr**2 and acc < self.f.rest_acc**2
        return bool(near and quiet), gyr / 3.0 * time / len(rows)

    def run(self, recording):
        for k in range(len(recording)):
            dt = recording.time[k] - recording.time[k - 1] if k else 0.0
            vectors = [v[k] if np.isfinite(v[k]).all() else None for v in (recording.acc, recording.mag)]
            self.sample(k, dt, recording.gyr[k], *vectors)
        return self


@pytest.fixture(scope="module")
def recording():
    """Ten seconds at 100 Hz, beginning at rest; magnetometer at 25 Hz; a third of a second without accelerometer."""
    r = simulate(10.0, rate=100.0, seed=21)
    acc = r.acc.copy()
    acc[700:733] = np.nan
    mag = np.where((np.arange(len(r)) % 4 == 0)[:, None], r.mag, np.nan)
    return dataclasses.replace(r, acc=acc, mag=mag)


CASES = [
    {},
    {"inflation": 1.0, "tilt_sigma": 0.0, "heading_sigma": 0.0, "time_sigma": 0.0, "rest_gyr": 0.0},
    {"gate_window": 0.0, "norm_gate": 0.01},
    {
        "mag_delay": 0.013,
        "mag_delay_sigma": 0.01,
        "mag_noise": 0.005,
        "gyr_matrix": 0.02,
        "norm_gate": 0.01,
        "gate_window": 0.3,
        "epoch": 0.07,
    },
]


@pytest.mark.parametrize("parameters", CASES, ids=["defaults", "no rest", "gate of the moment", "delay"])
def test_agrees_with_a_dense_implementation(recording, parameters):
    f = nd.CalibratingEKF(**parameters)
    start = recording.reference.rotation[0]
    stream = f.stream(frame="NED", initial=start)
    result = stream.run(recording)
    dense = Dense(f, start.as_matrix()).run(recording)
    state = stream._work.state[N_RUNNER:]
    # rounding of a thousand steps, carried along by the filter, and derivatives that are numerical there
    assert (Rotation.from_matrix(dense.epochs[-1][6]).inv() * result.rotation[dense.epochs[-1][0]]).magnitude() < 1e-9
    last = dense.epochs[-1][0]
    assert np.abs(result.gyr_bias[last] - dense.b).max() < 1e-9
    assert np.abs(state[layout.GYR_MATRIX : layout.GYR_MATRIX + 9] - dense.M.T.ravel()).max() < 1e-9
    assert np.abs(state[layout.REST_OFFSET : layout.REST_OFFSET + 3] - dense.e).max() < 1e-9
    assert abs(result.diagnostics["mag_delay"][last] - dense.delay) < 1e-9
    assert result.diagnostics["field_departure"][last] == pytest.approx(dense.u, rel=1e-6, abs=1e-9)
    rate = result.rotation[last].apply(recording.gyr[last] - dense.b - dense.M @ recording.gyr[last])
    if f.time_sigma == 0.0:
        P = state[layout.COV : layout.COV + 22 * 24].reshape(22, 24)[:, :22]
        scale = np.sqrt(np.outer(np.diag(dense.P), np.diag(dense.P)))
        assert np.abs((P - dense.P) / scale).max() < 1e-6
    floor = np.diag([f.tilt_sigma**2, f.tilt_sigma**2, dense.heading_doubt()]) + f.time_sigma**2 * np.outer(
        rate, rate
    )
    expected = f.inflation**2 * dense.P[:3, :3] + floor
    # the rate that is reported is that of before the last correction: 1e-3 of it at most
    assert np.allclose(result.covariance[last], expected, rtol=1e-3, atol=1e-9)
    if f.rest_gyr:
        assert 0.1 < result.diagnostics["still"].mean() < 0.9  # rest was in the comparison, and motion


def smooth_dense(epochs):
    """Rauch–Tung–Striebel on the errors: smoothed error and covariance after each epoch."""
    error, P = np.zeros(N), epochs[-1][3]
    found = [(error, P)]
    for k in range(len(epochs) - 2, -1, -1):
        _, F, prior, _, d, *_ = epochs[k + 1]
        post = epochs[k][3]
        C = np.linalg.solve(prior, F @ post).T
        error = C @ (d + error)
        P = post + C @ (P - prior) @ C.T
        found.append((error, P))
    return found[::-1]


def test_smoother_agrees_with_a_dense_one(recording):
    plain = {"inflation": 1.0, "tilt_sigma": 0.0, "heading_sigma": 0.0, "time_sigma": 0.0}
    f = nd.CalibratingEKF(rest_gyr=0.0, heading_outlier=0.0, smooth_walk=1.0, **plain)  # the first pass only
    smoothed, first = f.smooth(recording), f.run(recording).rotation[0]
    dense = Dense(f, first.as_matrix(), still=np.zeros(len(recording)))
    # the start is found in the first sample, which is not taken a second time
    for k in range(1, len(recording)):
        vectors = [v[k] if np.isfinite(v[k]).all() else None for v in (recording.acc, recording.mag)]
        dense.sample(k, recording.time[k] - recording.time[k - 1], recording.gyr[k], *vectors)
    epochs = dense.epochs
    for (k, *_, R, b), (error, P) in zip(epochs, smooth_dense(epochs), strict=True):
        turned = Rotation.from_rotvec(error[THETA]) * Rotation.from_matrix(R)
        # the dense one inverts covariances whose entries span twelve powers of ten
        assert (turned.inv() * smoothed.rotation[k]).magnitude() < 1e-7
        assert np.abs(smoothed.gyr_bias[k] - b - error[BIAS]).max() < 1e-7
        assert np.allclose(smoothed.covariance[k], P[:3, :3], rtol=1e-4, atol=1e-12)
        assert np.allclose(smoothed.gyr_bias_sigma[k], np.sqrt(np.diag(P)[BIAS]), rtol=1e-4)
