r"""What the Kalman filters with seven states (attitude quaternion, gyroscope bias) share.

State tuple: quaternion 4, bias 3, variance of e₀, P 21 of (δ, bias) (see `kernels.quaternion_kalman`), mean square
of linear acceleration, ages of acc and mag, field's horizontal and down part and age, departure u of this field
sample, normalised innovation squared of this sample and its degrees of freedom.

The step from q to q' = q ⊗ exp((ω − b) Δt) leaves e of δq = e ⊗ q as it is, but for the bias. Its derivative by b is
taken as

.. math::  -\tfrac{\Delta t}{2}\, q \otimes (0, e_j) \otimes \exp\bigl((\omega - b) \Delta t\bigr)
           = -\tfrac{\Delta t}{2}\, (0, R_{nb} e_j) \otimes q'

Textbooks leave out the last factor; to first order in Δt that is the same. With it the derivative, like the exact
one, changes no norm: e₀ stays uncorrelated with all else.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from northdown._validation import FloatArray
from northdown.estimators._kalman import BiasKalmanFilter, start_covariance, weighting_flags
from northdown.frames import Frame
from northdown.kernels.jit import inline
from northdown.kernels.kalman import propagate_attitude_bias, symmetric3
from northdown.kernels.quaternion import dot, scaled_axes
from northdown.kernels.so3 import turn_body

N_STATE = 38
N_OUT = 23


@inline
def predict(p: Any, q: Any, b: Any, along: float, cov: Any, gyr: Any, dt: float) -> Any:
    """Attitude and covariance after a step with the rate gyr − b: returns (q, variance of e₀, P)."""
    rate = (gyr[0] - b[0], gyr[1] - b[1], gyr[2] - b[2])
    if dt > 0.0:
        noise = (p[0] + p[1] * dot(rate, rate)) * dt
        along += 0.25 * noise
        cov = propagate_attitude_bias(cov, scaled_axes(dt, q), noise, p[2] * dt)
        q = turn_body(q, (rate[0] * dt, rate[1] * dt, rate[2] * dt))
    return q, along, cov


@inline
def start(p: Any, heading_known: bool) -> Any:
    """Variance of e₀ and P for a fresh attitude; the former a hundredth of the smaller of the latter's."""
    return (0.0025 * min(p[11], p[12]),) + start_covariance(p, heading_known)


@inline
def aligned(p: Any, s: Any, q: Any, heading_known: bool) -> Any:
    """State for an attitude found from the sensors."""
    return q + s[4:7] + start(p, heading_known) + s[29:]


@inline
def output(p: Any, s: Any) -> Any:
    """Attitude, bias, covariance of the attitude, sigma of the bias, diagnostics."""
    sigma = (math.sqrt(s[23]), math.sqrt(s[26]), math.sqrt(s[28]))
    return (
        s[:7] + symmetric3(s[8], s[9], s[10], s[14], s[15], s[19]) + sigma + (math.sqrt(s[29]), s[35], s[36], s[37])
    )


@inline
def flagged(p: Any, s: Any) -> int:
    """Whether linear acceleration or a disturbed field has lowered the weight of this sample."""
    return weighting_flags(p[3], p[4], s[29], s[30], s[35])


@dataclass(frozen=True, kw_only=True)
class QuaternionKalmanFilter(BiasKalmanFilter):
    """A Kalman filter with this state."""

    outputs = {  # noqa: RUF012  (a constant of the class)
        "gyr_bias": slice(4, 7),
        "covariance": slice(7, 16),
        "gyr_bias_sigma": slice(16, 19),
        "acceleration": slice(19, 20),
        "field_departure": slice(20, 21),
        "nis": slice(21, 22),
        "nis_dof": slice(22, 23),
    }

    def _initial_state(self, quat: FloatArray, frame: Frame) -> Sequence[float]:
        return (0.0, 0.0, 0.0, *start(self._bias_noise(), True), *(0.0,) * 9)
