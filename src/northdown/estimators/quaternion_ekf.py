r"""Quaternion extended Kalman filter: seven states (attitude quaternion, gyroscope bias), six measurements at once.

.. math::

    q_{k+1} = q_k \otimes \exp\bigl((\omega - b)\,\Delta t\bigr), \qquad
    z = \begin{pmatrix} f_b / g \\ m_b / \lVert m_b \rVert \end{pmatrix}, \qquad
    h(q) = \begin{pmatrix} R_{nb}^{\mathsf T}\, u_n \\ R_{nb}^{\mathsf T}\, m_n \end{pmatrix}

with u_n = (0, 0, −1) and m_n = (cos D, 0, sin D), D the dip. The derivative of h is that of the homogeneous form
(w² + x² − y² − z² for 1 − 2(y² + z²)). Gyroscope noise of density σ enters each component of the quaternion with
¼σ²Δt. The quaternion is renormalised after each update; its norm is observed through the accelerometer, so that P
stays positive definite.

The six measurements have uncorrelated noise and are taken one after the other with the linearisation of the
first, which equals the stacked update (10)–(13) and needs no inverse. A missing sensor's rows are left out.

Linear acceleration and magnetic disturbance raise the measurement noise as in `mekf`, whose docstring gives the
formulas. Unlike there the whole direction of the field is used, so a wrong dip tilts the result.

Source: R.-C. Jia, Optics and Precision Engineering 22(12), 2014, doi:10.3788/OPE.20142212.3280 (J14), section 2.

Deviations: J14's P(0) is σ²/T of each sensor, which presumes a start at rest and a known T; here the start's
uncertainty is given in radians, and P(0) = ¼ Ξ diag(tilt², tilt², heading²) Ξᵀ, its (7). Vectors are normalised; the
disturbance weighting is added (`motion_time=0` and wide gates switch it off). In J14 (6) q2 uses T13 − T31.

A correction moves q to q⁺, and P_qq to M P_qq Mᵀ with M v = v ⊗ q* ⊗ q⁺, so that the error e of (e + 1) ⊗ q keeps its
covariance. J14 leaves P_qq, an error added to q⁺. What no measurement tells, the turn about the vertical without a
magnetometer, is then another direction after each correction than before; P loses variance along both, and heading
is claimed to be known that nobody has measured: over a minute, 3° for errors of 57°. Source of the effect:
G. P. Huang, A. I. Mourikis, S. I. Roumeliotis, Int. J. Robotics Research 29(5), 2010, doi:10.1177/0278364909353640.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from northdown.estimators._quaternion_kalman import (
    N_OUT,
    N_STATE,
    QuaternionKalmanFilter,
    aligned,
    flagged,
    output,
    predict,
)
from northdown.estimators.base import parameter
from northdown.frames import Frame
from northdown.kernels.direction_error import is_sample
from northdown.kernels.jit import inline
from northdown.kernels.kalman import NO_CORRECTION
from northdown.kernels.quaternion import dot, multiply, normalize, rotate, unit
from northdown.kernels.quaternion_kalman import correct_both, correct_field, correct_up
from northdown.kernels.runner import Kernel
from northdown.kernels.weighting import field_departure, field_direction, linear_acceleration


@inline
def step(p: Any, s: Any, dt: float, gyr: Any, acc: Any, mag: Any) -> Any:
    """One sample; the state is that of `_quaternion_kalman`."""
    acc_var, motion_time, motion_window, mag_var, g = p[3:8]
    q, b = (s[0], s[1], s[2], s[3]), (s[4], s[5], s[6])
    along, cov = s[7], s[8:29]
    motion, age_acc, age_mag = s[29], s[30] + dt, s[31] + dt
    field = (s[32], s[33], s[34])
    u = 0.0

    q, along, cov = predict(p, q, b, along, cov, gyr, dt)

    has_acc = is_sample(acc) and age_acc > 0.0
    has_mag = dot(mag, mag) > 0.0 and age_mag > 0.0
    up, h = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    r_acc, r_mag, north, down = 0.0, 0.0, 0.0, 0.0
    if has_acc:
        force = rotate(q, acc)
        motion = linear_acceleration(motion, force, g, age_acc, motion_window)
        r_acc = (acc_var + motion_time * motion) * (1.0 / (g * g * age_acc))
        k = 1.0 / g
        up = (k * force[0], k * force[1], k * force[2] + 1.0)
        age_acc = 0.0
    if has_mag:
        h = rotate(q, mag)
        u, factor, field = field_departure((p[8], p[9], p[10]), field, h, age_mag)
        north, down = p[14], p[15]
        if north != north:
            north, down = field_direction(field)
        h = unit(h)
        h = (h[0] - north, h[1], h[2] - down)
        r_mag = mag_var / age_mag * factor
        age_mag = 0.0

    scale, d, dof = 0.0, NO_CORRECTION, 0.0
    if has_acc and has_mag:
        along, cov, scale, d = correct_both(along, cov, d, up, r_acc, h, north, down, r_mag)
        dof = 5.0
    elif has_acc:
        dof = 3.0
        along, cov, scale, d = correct_up(along, cov, d, up, r_acc)
    elif has_mag:
        dof = 2.0
        along, cov, scale, d = correct_field(along, cov, d, h, north, down, r_mag)
    # P stays as it is while q moves: see the deviations above
    q = normalize(multiply((1.0 + scale, 0.5 * d[0], 0.5 * d[1], 0.5 * d[2]), q))
    b = (b[0] + d[3], b[1] + d[4], b[2] + d[5])
    return q + b + (along,) + cov + (motion, age_acc, age_mag) + field + (u, d[6], dof)


@dataclass(frozen=True, kw_only=True)
class QuaternionEKF(QuaternionKalmanFilter):
    """Quaternion EKF with gyroscope bias and stacked measurement of gravity and field.

    Noise densities are those that an Allan deviation gives; the defaults are larger and stand also for what the model
    leaves out, see `MEKF`.

    Parameters
    ----------
    dip : float or None
        Angle of the field below the horizontal, rad. None: the mean of the past over
        `field_window`. Raising it tips the result about the east axis.

    References
    ----------
    R.-C. Jia, Optics and Precision Engineering 22(12), 2014, section 2.
    """

    name = "quaternion-ekf"
    kernel = Kernel(
        "quaternion-ekf",
        step,
        n_params=16,
        n_state=N_STATE,
        n_out=N_OUT,
        output=output,
        aligned=aligned,
        flagged=flagged,
        covariance=7,
    )

    dip: float | None = parameter(None, unit="rad", low=-1.56, high=1.56)

    def _parameters(self, frame: Frame) -> Sequence[float]:
        return (
            *self._bias_noise(),
            *((math.nan, math.nan) if self.dip is None else (math.cos(self.dip), math.sin(self.dip))),
        )
