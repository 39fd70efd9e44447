"""Ten million samples: the quaternion stays of unit norm and P stays a covariance."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown.estimators import get
from northdown.kernels.runner import N_RUNNER

COUNT, CHUNK, RATE = 10_000_000, 250_000, 100.0
FIELD = 50.0 * np.array([math.cos(1.13), 0.0, math.sin(1.13)])
GYR_NOISE, ACC_NOISE, MAG_NOISE = 2e-4, 2e-3, 0.05
# Where the 6 × 6 covariance stands in the state. The two with seven states have the variance of the quaternion's
# length, correlated with nothing, before it.
FIRST = {"mekf": 7, "quaternion-ekf": 8, "double-stage-ekf": 8}
# A small noise makes P small against its start, which is where rounding could harm it.
QUIET = {
    "gyr_noise": GYR_NOISE,
    "acc_noise": ACC_NOISE,
    "mag_noise": MAG_NOISE,
    "gyr_scale": 0.0,
    "motion_time": 0.0,
    "gyr_bias_walk": 1e-6,
}


def chunk(moving):
    """One period of a motion that closes on itself, with noise that repeats with it."""
    angle = 2.0 * math.pi * np.arange(CHUNK + 1) / CHUNK
    # rates of up to about 3 rad/s, through all attitudes
    turns = (331, 257, 199) if moving else (0, 0, 0)
    attitude = Rotation.from_euler("ZYX", np.outer(angle, turns))
    rng = np.random.default_rng(5)
    spread = math.sqrt(RATE)
    body = attitude[1:].inv()
    gyr = (attitude[:-1].inv() * attitude[1:]).as_rotvec() * RATE + 0.01
    return (
        gyr + GYR_NOISE * spread * rng.standard_normal((CHUNK, 3)),
        body.apply([0.0, 0.0, -9.80665]) + ACC_NOISE * spread * rng.standard_normal((CHUNK, 3)),
        body.apply(FIELD) + MAG_NOISE * spread * rng.standard_normal((CHUNK, 3)),
    )


@pytest.fixture(scope="module", params=["rest", "tumbling"])
def sensors(request):
    return chunk(request.param == "tumbling")


def state_covariance(stream, name):
    """P as the kernel holds it: an upper triangle by rows, so that it cannot but be symmetric."""
    state = stream._work.state[N_RUNNER:]
    covariance = np.zeros((6, 6))
    covariance[np.triu_indices(6)] = state[FIRST[name] :][:21]
    covariance += np.triu(covariance, 1).T
    return block_diag(state[7 : FIRST[name]], covariance) if FIRST[name] > 7 else covariance


@pytest.mark.parametrize("name", FIRST)
def test_ten_million_samples(sensors, name):
    stream = get(name)(**QUIET).stream(initial=Rotation.identity())
    time = np.arange(CHUNK) / RATE
    for k in range(COUNT // CHUNK):
        result = stream.run(nd.Recording(time + k * (CHUNK / RATE), *sensors))
        covariance = state_covariance(stream, name)
        assert np.linalg.eigvalsh(covariance).min() > 0.0
        # the same after scaling to correlations, which rounding spoils first
        scale = 1.0 / np.sqrt(np.diag(covariance))
        assert np.linalg.eigvalsh(scale[:, None] * covariance * scale).min() > 1e-4
        assert np.linalg.eigvalsh(result.covariance[::500]).min() > 0.0
        # normalised after each step: off by a few roundings
        assert np.abs(np.linalg.norm(result.quat[::10], axis=1) - 1.0).max() < 1e-14
    # the filter has not gone to sleep: the bias that was put in is there, 0.01 rad/s
    assert np.abs(result.gyr_bias[-1] - 0.01).max() < 1e-3
