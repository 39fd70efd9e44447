r"""Double-stage extended Kalman filter: the accelerometer corrects tilt, then the magnetometer corrects heading.

Seven states, quaternion and gyroscope bias. Prediction, with the corrected forms of M20 6.2.2,

.. math::

    q \leftarrow q \otimes \exp\bigl((\omega - b)\Delta t\bigr), \qquad
    A_k = \begin{pmatrix} M & L_k \\ 0 & I \end{pmatrix}, \qquad
    L_k = -\tfrac{\Delta t}{2} \begin{pmatrix} -q_1 & -q_2 & -q_3 \\ q_0 & -q_3 & q_2 \\ q_3 & q_0 & -q_1 \\
          -q_2 & q_1 & q_0 \end{pmatrix}

Stage 1: z₁ = f_b / g, h₁ = R_nbᵀ (0, 0, −1). Stage 2, from the attitude and the P of stage 1: z₂ = m̂_b, h₂ = R_nbᵀ
(b_x, 0, b_z) with h = R_nb m̂_b, b_x = √(h_x² + h_y²), b_z = h_z, so that only the horizontal direction of the
field is compared. Each stage:

.. math::  K = P H^{\mathsf T} (H P H^{\mathsf T} + R)^{-1}, \quad \epsilon = K (z - h), \quad
           P \leftarrow (I - K H) P

What keeps the stages apart: M20 sets the component q₃ of ε₁ and the components q₁, q₂ of ε₂ to zero. Taken as parts
of an additive correction (``isolation="additive"``) that leaves yaw, or roll and pitch, untouched only for a body
that is level and points north: the four components of a quaternion increment are no rotations about the axes of the
navigation frame. With δq = ½ (0, δ) ⊗ q they are: ``isolation="navigation"`` (default) converts ε into the small
rotation δ about north, east and down, δ_j = 2 ⟨(0, e_j) ⊗ q, ε⟩, and drops δ_down in stage 1, δ_north and δ_east in
stage 2. That is exact to first order in every attitude and in every mounting.

L_k is taken at the end of the step, times exp((ω − b) Δt) from the right: the same to first order, and it does not
mix the quaternion's length with the rest.

As in `quaternion_ekf`, P belongs to the error e of (1 + e) ⊗ q and stays as it is when q moves; its docstring says
why.

P does not know of what was dropped, so it is too small where the two sensors disagree; use `mekf` for a covariance
to rely on.

Sources: fusion tutorial of 2020 (M20), section 6.2; S. Sabatelli et al., IEEE Trans. Instrumentation and
Measurement 62(3), 2013, doi:10.1109/TIM.2012.2223315. Misprints of M20 corrected: A¹ = I + ½ΩT (not ½T times a
matrix of ones and rates); the last sign in the third row of L_k is +; ∂h₂/∂q lacks the factor 2; stage 2's gain
uses P after stage 1; roll and pitch of its start are swapped. M20's text corrects only the quaternion:
`bias_update=False` does that.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from northdown.estimators._quaternion_kalman import (
    N_OUT,
    N_STATE,
    QuaternionKalmanFilter,
    aligned,
    flagged,
    output,
    predict,
)
from northdown.frames import Frame
from northdown.kernels.direction_error import is_sample
from northdown.kernels.jit import inline
from northdown.kernels.kalman import NO_CORRECTION
from northdown.kernels.quaternion import dot, multiply, normalize, rotate
from northdown.kernels.quaternion_kalman import correct_field, correct_up
from northdown.kernels.runner import Kernel
from northdown.kernels.so3 import turn_navigation
from northdown.kernels.wahba import has_horizontal
from northdown.kernels.weighting import field_departure, linear_acceleration


@inline
def tilt_only(q: Any, scale: float, d: Any, additive: float) -> Any:
    """What stage 1 may change of the correction δq = (scale, ½ d) ⊗ q, as a turn from the left."""
    if additive != 0.0:
        e = multiply((scale, 0.5 * d[0], 0.5 * d[1], 0.5 * d[2]), q)
        return normalize((q[0] + e[0], q[1] + e[1], q[2] + e[2], q[3]))
    return turn_navigation((d[0], d[1], 0.0), q)


@inline
def heading_only(q: Any, scale: float, d: Any, additive: float) -> Any:
    """What stage 2 may change, likewise."""
    if additive != 0.0:
        e = multiply((scale, 0.5 * d[0], 0.5 * d[1], 0.5 * d[2]), q)
        return normalize((q[0] + e[0], q[1], q[2], q[3] + e[3]))
    return turn_navigation((0.0, 0.0, d[2]), q)


@inline
def step(p: Any, s: Any, dt: float, gyr: Any, acc: Any, mag: Any) -> Any:
    """One sample; the state is that of `_quaternion_kalman`."""
    acc_var, motion_time, motion_window, mag_var, g = p[3:8]
    additive, bias_update = p[14], p[15]
    q, b = (s[0], s[1], s[2], s[3]), (s[4], s[5], s[6])
    along, cov = s[7], s[8:29]
    motion, age_acc, age_mag = s[29], s[30] + dt, s[31] + dt
    field = (s[32], s[33], s[34])
    u = 0.0

    q, along, cov = predict(p, q, b, along, cov, gyr, dt)

    nis, dof = 0.0, 0.0
    if is_sample(acc) and age_acc > 0.0:
        force = rotate(q, acc)
        motion = linear_acceleration(motion, force, g, age_acc, motion_window)
        r = (acc_var + motion_time * motion) * (1.0 / (g * g * age_acc))
        k = 1.0 / g
        up = (k * force[0], k * force[1], k * force[2] + 1.0)
        along, cov, scale, d = correct_up(along, cov, NO_CORRECTION, up, r)
        q = tilt_only(q, scale, d, additive)
        b = (b[0] + bias_update * d[3], b[1] + bias_update * d[4], b[2] + bias_update * d[5])
        age_acc = 0.0
        nis, dof = d[6], 3.0
    h = rotate(q, mag)
    if has_horizontal(h) and age_mag > 0.0:
        u, factor, field = field_departure((p[8], p[9], p[10]), field, h, age_mag)
        horizontal = math.sqrt(h[0] * h[0] + h[1] * h[1])
        k = 1.0 / math.sqrt(dot(h, h))
        h, north = (k * h[0], k * h[1], k * h[2]), k * horizontal
        r = mag_var / age_mag * factor
        along, cov, scale, d = correct_field(along, cov, NO_CORRECTION, (h[0] - north, h[1], 0.0), north, h[2], r)
        q = heading_only(q, scale, d, additive)
        b = (b[0] + bias_update * d[3], b[1] + bias_update * d[4], b[2] + bias_update * d[5])
        age_mag = 0.0
        nis += d[6]
        dof += 1.0
    return q + b + (along,) + cov + (motion, age_acc, age_mag) + field + (u, nis, dof)


@dataclass(frozen=True, kw_only=True)
class DoubleStageEKF(QuaternionKalmanFilter):
    """Double-stage EKF: tilt from the accelerometer, then heading from the magnetometer; gyroscope bias.

    Noise densities are those that an Allan deviation gives; the defaults are larger and stand also for what the model
    leaves out, see `MEKF`.

    Parameters
    ----------
    isolation : {"navigation", "additive"}
        How a stage is kept from the other's angles: about the axes of the navigation frame, or by M20's zeroed
        components of the quaternion increment.
    bias_update : bool
        Whether the bias is corrected too; M20's text corrects only the quaternion.

    References
    ----------
    M20 section 6.2; S. Sabatelli et al., IEEE Trans. Instrumentation and Measurement 62(3), 2013.
    """

    name = "double-stage-ekf"
    kernel = Kernel(
        "double-stage-ekf",
        step,
        n_params=16,
        n_state=N_STATE,
        n_out=N_OUT,
        output=output,
        aligned=aligned,
        flagged=flagged,
        covariance=7,
    )

    isolation: Literal["navigation", "additive"] = "navigation"
    bias_update: bool = True

    def _parameters(self, frame: Frame) -> Sequence[float]:
        return (
            *self._bias_noise(),
            float(self.isolation == "additive"),
            float(self.bias_update),
        )
