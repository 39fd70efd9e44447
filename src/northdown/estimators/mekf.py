r"""Multiplicative (error-state) extended Kalman filter with gyroscope bias.

The attitude is a quaternion; the filter's state is the small error about it, in NED axes, and the bias:

.. math::

    R_{nb} = \exp(\delta)\, \hat R_{nb}, \qquad \dot\delta = -\hat R_{nb}\,(b - \hat b) + \hat R_{nb}\,w_g, \qquad
    \dot b = w_b

In navigation axes the transition matrix is simply [[I, −R̂Δt], [0, I]], and isotropic gyroscope noise needs no
rotation.

Accelerometer: f_n = R̂ f_b should be (0, 0, −g). To first order f_n / g = (δ_y, −δ_x, ·): two scalar measurements,
each of one component of the error. Linear acceleration is noise with the spectral density that its own mean square
suggests:

.. math::  R_a = \bigl(\sigma_a^2 + \tau_m\, \overline{\lVert f_n - (0,0,-g) \rVert^2}\bigr) / (g^2\, \Delta t)

with the mean taken over `motion_window` seconds and τ_m (`motion_time`) the time over which accelerations stay
correlated. Where that leaves less than a tenth of the weight at rest (9 σ_a² < τ_m mean), samples carry the flag
`ACC_REJECTED`.

Magnetometer: the heading ε = atan2(h_y, h_x) of h = R̂ m_b, one scalar:

.. math::  \varepsilon = -\delta_z + \delta_x\, h_z / h_h, \qquad
           R_m = \sigma_m^2 / (B_h^2\, \Delta t) \cdot e^{u}, \qquad
           u = (\Delta_\text{norm} / w_1)^2 + (\Delta_\text{dip} / w_2)^2

so that a disturbed field, known by its norm or its dip, is weighted down smoothly. Norm and dip are compared with a
reference, the mean of the past over `field_window`, weighted by e⁻ᵘ; the first second is not judged. A sample with
u above 4.6, that is, of less than 1 % of its weight, carries the flag `MAG_REJECTED`.

Δt is the time since that sensor's last sample: densities in, variances of samples out. Components are uncorrelated,
so that the update is a sequence of scalar ones.

Sources: F. L. Markley, J. Guidance Control Dynamics 26(2), 2003, doi:10.2514/2.5048; J. Solà, arXiv:1711.02508
(2017), section 7 (global angular errors). The weighting of both sensors is this project's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from northdown._validation import FloatArray
from northdown.estimators._kalman import BiasKalmanFilter, start_covariance, weighting_flags
from northdown.frames import Frame
from northdown.kernels.direction_error import is_sample
from northdown.kernels.jit import inline
from northdown.kernels.kalman import (
    NO_CORRECTION,
    correct_north_down,
    correct_tilt,
    propagate_attitude_bias,
    symmetric3,
)
from northdown.kernels.quaternion import dot, rotate, scaled_axes
from northdown.kernels.runner import Kernel
from northdown.kernels.so3 import turn_body, turn_navigation
from northdown.kernels.wahba import has_horizontal
from northdown.kernels.weighting import field_departure, linear_acceleration


@inline
def step(p: Any, s: Any, dt: float, gyr: Any, acc: Any, mag: Any) -> Any:
    """One sample; s = (q, b, P, motion, ages of acc and mag, field's horizontal, down and age, u, NIS, dof)."""
    gyr_var, scale_var, walk_var, acc_var, motion_time, motion_window, mag_var, g, norm_gate, dip_gate, window = p[
        :11
    ]
    q = (s[0], s[1], s[2], s[3])
    bx, by, bz = s[4], s[5], s[6]
    cov = s[7:28]
    motion, age_acc, age_mag = s[28], s[29] + dt, s[30] + dt
    field = (s[31], s[32], s[33])
    u = 0.0

    rate = (gyr[0] - bx, gyr[1] - by, gyr[2] - bz)
    if dt > 0.0:
        cov = propagate_attitude_bias(
            cov, scaled_axes(dt, q), (gyr_var + scale_var * dot(rate, rate)) * dt, walk_var * dt
        )
        q = turn_body(q, (rate[0] * dt, rate[1] * dt, rate[2] * dt))

    d, dof = NO_CORRECTION, 0.0
    if is_sample(acc) and age_acc > 0.0:
        f = rotate(q, acc)
        motion = linear_acceleration(motion, f, g, age_acc, motion_window)
        r = (acc_var + motion_time * motion) * (1.0 / (g * g * age_acc))
        cov, d = correct_tilt(cov, d, (f[0] / g, f[1] / g), r)
        age_acc = 0.0
        dof = 2.0
    h = rotate(q, mag)
    if has_horizontal(h) and age_mag > 0.0:
        u, factor, field = field_departure((norm_gate, dip_gate, window), field, h, age_mag)
        square = h[0] * h[0] + h[1] * h[1]
        r = mag_var / age_mag * (1.0 + h[2] * h[2] / square) * factor
        cov, d = correct_north_down(cov, d, h[2] / math.sqrt(square), -1.0, math.atan2(h[1], h[0]), r)
        age_mag = 0.0
        dof += 1.0
    q = turn_navigation((d[0], d[1], d[2]), q)  # of unit norm, and normalised at the next step
    return q + (bx + d[3], by + d[4], bz + d[5]) + cov + (motion, age_acc, age_mag) + field + (u, d[6], dof)


@inline
def aligned(p: Any, s: Any, q: Any, heading_known: bool) -> Any:
    """State for an attitude found from the sensors."""
    return q + s[4:7] + start_covariance(p, heading_known) + s[28:]


@inline
def output(p: Any, s: Any) -> Any:
    """Attitude, bias, covariance of the attitude, sigma of the bias, diagnostics."""
    sigma = (math.sqrt(s[22]), math.sqrt(s[25]), math.sqrt(s[27]))
    return s[:7] + symmetric3(s[7], s[8], s[9], s[13], s[14], s[18]) + sigma + (math.sqrt(s[28]), s[34], s[35], s[36])


@inline
def flagged(p: Any, s: Any) -> int:
    """Whether linear acceleration or a disturbed field has lowered the weight of this sample."""
    return weighting_flags(p[3], p[4], s[28], s[29], s[34])


@dataclass(frozen=True, kw_only=True)
class MEKF(BiasKalmanFilter):
    """Multiplicative extended Kalman filter: attitude, gyroscope bias, and their covariance.

    References
    ----------
    F. L. Markley, J. Guidance Control Dynamics 26(2), 2003; J. Solà, arXiv:1711.02508, 2017, section 7.
    """

    name = "mekf"
    kernel = Kernel(
        "mekf", step, n_params=14, n_state=37, n_out=23, output=output, aligned=aligned, flagged=flagged, covariance=7
    )
    outputs = {  # noqa: RUF012  (a constant of the class)
        "gyr_bias": slice(4, 7),
        "covariance": slice(7, 16),
        "gyr_bias_sigma": slice(16, 19),
        "acceleration": slice(19, 20),
        "field_departure": slice(20, 21),
        "nis": slice(21, 22),
        "nis_dof": slice(22, 23),
    }

    def _parameters(self, frame: Frame) -> Sequence[float]:
        return self._bias_noise()

    def _initial_state(self, quat: FloatArray, frame: Frame) -> Sequence[float]:
        covariance = start_covariance(self._parameters(frame), True)
        return (0.0, 0.0, 0.0, *covariance, *(0.0,) * 9)
