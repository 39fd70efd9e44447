"""What the Kalman filters with seven states (attitude quaternion, gyroscope bias) share.

State tuple: quaternion 4, bias 3, P 28 (of (e, bias) with δq = e ⊗ q, see `kernels.quaternion_kalman`), mean square
of linear acceleration, ages of acc and mag, field's horizontal and down part and age, departure u of the last field
sample.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from northdown._validation import FloatArray
from northdown.estimators._kalman import BiasKalmanFilter
from northdown.frames import Frame
from northdown.kernels.jit import inline
from northdown.kernels.quaternion import dot, multiply, normalize
from northdown.kernels.quaternion_kalman import attitude_covariance, propagate_quaternion_bias, quaternion_covariance
from northdown.kernels.so3 import exp
from northdown.kernels.weighting import REJECTED
from northdown.orientation import Flag

N_STATE = 42
N_OUT = 20

_MAG_REJECTED = int(Flag.MAG_REJECTED)


@inline
def predict(p: Any, q: Any, b: Any, cov: Any, gyr: Any, dt: float) -> Any:
    """Attitude and covariance after a step with the rate gyr − b: returns (q, P)."""
    rate = (gyr[0] - b[0], gyr[1] - b[1], gyr[2] - b[2])
    if dt > 0.0:
        turn = exp((rate[0] * dt, rate[1] * dt, rate[2] * dt))
        noise = 0.25 * (p[0] + p[1] * dot(rate, rate)) * dt
        after = normalize(multiply(q, turn))
        cov = propagate_quaternion_bias(cov, q, after, dt, noise, p[2] * dt)
        q = after
    return q, cov


@inline
def aligned(p: Any, s: Any, q: Any, heading_known: bool) -> Any:
    """State for an attitude found from the sensors; an unknown heading is uniform over the circle."""
    heading = p[12] if heading_known else math.pi * math.pi / 3.0
    return q + s[4:7] + quaternion_covariance(p[11], heading, p[13]) + s[35:]


@inline
def output(p: Any, s: Any) -> Any:
    """Attitude, bias, covariance of the attitude, sigma of the bias, field's departure u."""
    sigma = (math.sqrt(s[29]), math.sqrt(s[32]), math.sqrt(s[34]))
    return s[:7] + attitude_covariance(s[7:35]) + sigma + (s[41],)


@inline
def flagged(p: Any, s: Any) -> int:
    """Whether the magnetometer's sample was all but rejected."""
    return _MAG_REJECTED if s[41] > REJECTED else 0


@dataclass(frozen=True, kw_only=True)
class QuaternionKalmanFilter(BiasKalmanFilter):
    """A Kalman filter with this state."""

    outputs = {  # noqa: RUF012  (a constant of the class)
        "gyr_bias": slice(4, 7),
        "covariance": slice(7, 16),
        "gyr_bias_sigma": slice(16, 19),
        "field_departure": slice(19, 20),
    }

    def _initial_state(self, quat: FloatArray, frame: Frame) -> Sequence[float]:
        noise = self._bias_noise()
        covariance = quaternion_covariance(noise.tilt, noise.heading, noise.bias)
        return (0.0, 0.0, 0.0, *covariance, *(0.0,) * 7)
