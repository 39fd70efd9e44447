r"""K06's reference filter: quaternion driven by the gyroscope, measured as Euler angles.

State q, predicted with the gyroscope (K06 (2.16), here by the closed form). Measurement: roll, pitch and yaw that
accelerometer and magnetometer give at one sample (`tilt_compass`), compared with those of q (K06 (2.15)):

.. math::

    z = (\phi, \theta, \psi), \qquad H = J^{-1} \cdot 2 E^{\mathsf T}, \qquad
    E_j = (0, e_j) \otimes q

where δ_j = 2 ⟨E_j, δq⟩ is the rotation about north, east and down, and J⁻¹ turns it into angles: dφ = (δ_x cos ψ +
δ_y sin ψ) / cos θ, dθ = −δ_x sin ψ + δ_y cos ψ, dψ = δ_z + sin θ dφ. Variances follow from the sensors' noise in
the same way; their correlation is left out, as K06 leaves it. Residuals are wrapped to ±π.

There is no bias state, and the measurement is singular at pitch ±90°: samples beyond `singular_pitch` are flagged
and not used, and the filter runs on the gyroscope.

Source: C.-F. Kao, thesis, National Chiao Tung University, 2006 (K06), section 4-5 and figure 4.59. It is the
filter with which its gyro-free ones are compared in table 4.14.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from northdown._validation import FloatArray
from northdown.estimators._kalman import KalmanFilter
from northdown.estimators._quaternion_kalman import N_STATE, aligned, flagged, predict, start
from northdown.estimators.base import parameter
from northdown.frames import Frame
from northdown.kernels import euler
from northdown.kernels.jit import inline
from northdown.kernels.kalman import NO_CORRECTION, correct6, symmetric3
from northdown.kernels.quaternion import dot, down_b, multiply, normalize, rotate
from northdown.kernels.runner import Kernel
from northdown.kernels.wahba import has_heading, heading_error, tilt_correction, turn_about_down
from northdown.kernels.weighting import field_departure, linear_acceleration
from northdown.orientation import Flag

_NEAR_SINGULAR = int(Flag.NEAR_SINGULAR)


@inline
def correct_angles(p: Any, angles: Any, residual: Any, r: Any) -> Any:
    """Three scalar updates with roll, pitch and yaw; returns (P, correction).

    δφ = (cos ψ δ_x + sin ψ δ_y) / cos θ, δθ = cos ψ δ_y − sin ψ δ_x, δψ = δ_z + sin θ δφ.
    """
    sp, cp = math.sin(angles[1]), math.cos(angles[1])
    sy, cy = math.sin(angles[2]), math.cos(angles[2])
    p, d = correct_rotation(p, NO_CORRECTION, (cy / cp, sy / cp, 0.0), residual[0], r[0])
    p, d = correct_rotation(p, d, (-sy, cy, 0.0), residual[1], r[1])
    return correct_rotation(p, d, (sp * cy / cp, sp * sy / cp, 1.0), residual[2], r[2])


@inline
def correct_rotation(p: Any, d: Any, h: Any, residual: float, r: float) -> Any:
    """Scalar update with h · δ."""
    a, b, c = h
    ph = (
        a * p[0] + b * p[1] + c * p[2],
        a * p[1] + b * p[6] + c * p[7],
        a * p[2] + b * p[7] + c * p[11],
        a * p[3] + b * p[8] + c * p[12],
        a * p[4] + b * p[9] + c * p[13],
        a * p[5] + b * p[10] + c * p[14],
    )
    s = a * ph[0] + b * ph[1] + c * ph[2] + r
    return correct6(p, d, ph, s, residual - (a * d[0] + b * d[1] + c * d[2]))


@inline
def step(p: Any, s: Any, dt: float, gyr: Any, acc: Any, mag: Any) -> Any:
    """One sample; the state is that of `_quaternion_kalman` with a bias of zero and of zero variance."""
    acc_var, motion_time, motion_window, mag_var, g = p[3:8]
    motion, age = s[29], s[30] + dt
    field = (s[32], s[33], s[34])
    u, nis, dof = 0.0, 0.0, 0.0

    q, along, cov = predict(p, (s[0], s[1], s[2], s[3]), (0.0, 0.0, 0.0), s[7], s[8:29], gyr, dt)

    if age > 0.0 and dot(acc, acc) > 0.0 and has_heading(acc, mag):
        level = multiply(tilt_correction(q, acc), q)
        measured = euler.to_zyx(turn_about_down(heading_error(level, mag), level))
        angles = euler.to_zyx(q)
        motion = linear_acceleration(motion, rotate(q, acc), g, age, motion_window)
        u, factor, field = field_departure((p[8], p[9], p[10]), field, rotate(level, mag), age)
        if math.fabs(angles[1]) < p[14]:
            tilt = (acc_var + motion_time * motion) / (g * g * age)
            slope = dot(down_b(level), mag)
            square = max(dot(mag, mag) - slope * slope, 1e-12 * dot(mag, mag))
            slope2 = slope * slope / square
            heading = mag_var / age * (1.0 + slope2) * factor + slope2 * tilt
            c2 = math.cos(angles[1]) * math.cos(angles[1])
            r = (tilt / c2, tilt, heading + tilt * (1.0 - c2) / c2)
            residual = (
                euler.wrap(measured[0] - angles[0]),
                euler.wrap(measured[1] - angles[1]),
                euler.wrap(measured[2] - angles[2]),
            )
            cov, d = correct_angles(cov, angles, residual, r)
            nis, dof = d[6], 3.0
            q = normalize(multiply((1.0, 0.5 * d[0], 0.5 * d[1], 0.5 * d[2]), q))
        age = 0.0
    return q + (0.0, 0.0, 0.0) + (along,) + cov + (motion, age, 0.0) + field + (u, nis, dof)


@inline
def output(p: Any, s: Any) -> Any:
    """Attitude, its covariance, diagnostics."""
    q = (s[0], s[1], s[2], s[3])
    return q + symmetric3(s[8], s[9], s[10], s[14], s[15], s[19]) + (math.sqrt(s[29]), s[35], s[36], s[37])


@inline
def flags(p: Any, s: Any) -> int:
    """What has lowered the weight of this sample, and whether pitch is near ±90°."""
    down = down_b((s[0], s[1], s[2], s[3]))
    return flagged(p, s) | (_NEAR_SINGULAR if math.fabs(down[0]) > math.sin(p[14]) else 0)


@dataclass(frozen=True, kw_only=True)
class GyroEulerEKF(KalmanFilter):
    """Quaternion EKF measured by Euler angles, without bias: K06's reference; not for attitudes near pitch ±90°.

    Parameters
    ----------
    singular_pitch : float
        Pitch (rad) beyond which measurements are not used and samples are flagged. Raising it uses more of them,
        nearer to where they mean nothing.

    References
    ----------
    K06 section 4-5.
    """

    name = "gyro-euler-ekf"
    needs = ("gyr", "acc", "mag")
    kernel = Kernel(
        "gyro-euler-ekf",
        step,
        n_params=15,
        n_state=N_STATE,
        n_out=17,
        output=output,
        aligned=aligned,
        flagged=flags,
        covariance=4,
    )
    outputs = {  # noqa: RUF012  (a constant of the class)
        "covariance": slice(4, 13),
        "acceleration": slice(13, 14),
        "field_departure": slice(14, 15),
        "nis": slice(15, 16),
        "nis_dof": slice(16, 17),
    }
    singular = "pitch ±90°"

    singular_pitch: float = parameter(1.4, unit="rad", low=0.0, high=1.5708)

    def _parameters(self, frame: Frame) -> Sequence[float]:
        return (*self._noise(), self.singular_pitch)

    def _initial_state(self, quat: FloatArray, frame: Frame) -> Sequence[float]:
        return (0.0, 0.0, 0.0, *start(self._noise(), True), *(0.0,) * 9)
