r"""Attitude and rate without a gyroscope: accelerometer array and magnetometer, measured as Euler angles.

States are the angular rate, driven by the array's angular acceleration, and the attitude (`_gyro_free` has the
prediction). Measured are the Euler angles that specific force and field give, in K06 as

.. math::

    z = (-\tan\psi,\; -\sin\theta,\; \tan\varphi), \qquad \sin\theta = f_x / g, \quad
    \tan\varphi = f_y / f_z, \quad \tan\psi = -V_2 / V_1, \quad V = R_y(\theta)\, R_x(\varphi)\, m_b

The field need not be known. The noise of the three is that of f and m, propagated in full at the prediction:

.. math::

    n_1 = \cos\theta\, n_\varphi = (\sin\varphi\, n_{f_z} - \cos\varphi\, n_{f_y}) / g, \quad
    n_\theta = n_{f_x} / (g \cos\theta), \quad
    n_\psi = \tan\theta\, n_1 + \frac{V_3}{V_h} (\cos\psi\, n_1 - \sin\psi\, n_\theta) + \frac{n_m}{V_h}

The combinations :math:`\cos\theta\,\varphi`, :math:`\theta - k \cos\theta\,\varphi` and
:math:`\psi - \tan\theta\, n_1 - …` have uncorrelated noise and are taken one after the other.

Pitch ±90° is singular. What linearisation leaves out grows towards it and is added to the noise: :math:`\tfrac12
(\tan\theta\, v_\theta)^2` to that of θ, the variance of n_θ being v_θ, and :math:`(v_1 + P_{11})(v_\theta + P_{22}) /
\cos^2\theta` to that of cos θ φ and, times :math:`(V_3/V_h)^2`, of ψ. From `singular_pitch` on, measured or
estimated, pitch is not measured any more, so that the covariance about that axis grows as the rate's uncertainty
tells, and the samples carry the flag `NEAR_SINGULAR`.

Source: C.-F. Kao, M.S. thesis, National Chiao Tung University, 2006 (K06), (3.1) to (3.18), (3.22), (3.24) to (3.28).

Deviations. The residual is the rotation vector from the estimate to the attitude of the measured angles, unless
``residual="tangent"``. To first order both are the same measurement, as the noise is propagated accordingly; but
tangents do not know an attitude from the one with heading turned by 180°, and fail near roll and heading ±90° too.
With them samples near either are left out altogether. What is said in `gyro_free_direct` about (3.6), (3.7) and
(3.25), about correlated noise, linear acceleration and the number of states holds here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from northdown.estimators._array_coupling import force_products
from northdown.estimators._gyro_free import (
    N_COMMON,
    N_OUT,
    N_STATE,
    GyroFreeKalman,
    aligned,
    block,
    corrected,
    finished,
    flagged,
    moving,
    output,
    own,
    predict,
    rate_at,
)
from northdown.estimators.base import parameter
from northdown.frames import Frame
from northdown.kernels.direction_error import is_sample
from northdown.kernels.euler import from_zyx, to_zyx
from northdown.kernels.jit import inline
from northdown.kernels.kalman import NO_CORRECTION
from northdown.kernels.quaternion import add, conjugate, dot, down_b, multiply, rotate, scale
from northdown.kernels.rate_kalman import correct_attitude_row, correct_row, from_prior, products, products_slope
from northdown.kernels.runner import Kernel
from northdown.kernels.so3 import log
from northdown.kernels.wahba import has_heading
from northdown.orientation import Flag

_NEAR_SINGULAR = float(Flag.NEAR_SINGULAR)


@inline
def levelled(force: Any, mag: Any, g: float) -> Any:
    """Roll and sine of pitch by specific force, and the field turned back by both, V."""
    sin_pitch = min(1.0, max(-1.0, force[0] / g))
    cos_pitch = math.sqrt(1.0 - sin_pitch * sin_pitch)
    roll = math.atan2(-force[1], -force[2])
    s, c = math.sin(roll), math.cos(roll)
    low = s * mag[1] + c * mag[2]
    return (
        roll,
        sin_pitch,
        (cos_pitch * mag[0] + sin_pitch * low, c * mag[1] - s * mag[2], cos_pitch * low - sin_pitch * mag[0]),
    )


@inline
def is_singular(limit: float, tangent: float, angles: Any, force: Any, g: float) -> bool:
    """Whether pitch, estimated or measured, is beyond the limit; of tangents also roll and yaw, either side."""
    if abs(angles[1]) > limit or abs(force[0]) > g * math.sin(limit):
        return True
    least = math.cos(limit)
    return tangent != 0.0 and (abs(math.cos(angles[0])) < least or abs(math.cos(angles[2])) < least)


@inline
def tilt_variances(cov: Any, yaw: float) -> Any:
    """Variance of the error about the horizontal axis that points ahead, and of that to its right."""
    s, c = math.sin(yaw), math.cos(yaw)
    xx, xy, yy = cov[0], cov[1], cov[6]
    return c * c * xx + 2.0 * s * c * xy + s * s * yy, s * s * xx - 2.0 * s * c * xy + c * c * yy


@inline
def noise_of(p: Any, prior: Any, age: float) -> Any:
    """Variances of cos θ φ and of θ, the latter less k times the former, and k, at the predicted angles."""
    c_xx, c_xy, c_xz, c_yy, c_yz, c_zz = block(p)[63:69]
    sr, cr, cp = math.sin(prior[0]), math.cos(prior[0]), max(1e-3, math.cos(prior[1]))
    t = p[0] / (p[2] * p[2] * age)
    v_1 = t * (cr * cr * c_yy - 2.0 * sr * cr * c_yz + sr * sr * c_zz)
    k = t * (sr * c_xz - cr * c_xy) / (cp * v_1)
    v_2 = t * c_xx / (cp * cp)
    bend = v_2 * math.sin(prior[1]) / cp
    return v_1, v_2 - k * k * v_1 + 0.5 * bend * bend, k


@inline
def tangents(measured: Any, prior: Any, angles: Any, point: Any) -> Any:
    """Residuals of cos θ φ, θ and ψ by tangents and sine, in units of angle at the prediction, and their rows."""
    c, cp, k = math.cos(prior[0]), math.cos(prior[1]), math.cos(angles[0])
    e_1 = cp * c * c * (math.tan(measured[0]) - math.tan(angles[0]))
    sy, cy = math.sin(angles[2]), math.cos(angles[2])
    h_1 = scale(c * c * cp / (k * k * math.cos(angles[1])), (cy, sy, 0.0))
    e_2 = (math.sin(measured[1]) - math.sin(angles[1])) / cp
    h_2 = scale(math.cos(angles[1]) / cp, (-sy, cy, 0.0))
    c, k, t = math.cos(prior[2]), math.cos(angles[2]), math.tan(angles[1])
    e_3 = c * c * (math.tan(measured[2]) - math.tan(angles[2]))
    h_3 = scale(c * c / (k * k), (t * cy, t * sy, 1.0))
    return e_1, e_2, e_3, from_prior(h_1, point), from_prior(h_2, point), from_prior(h_3, point)


@inline
def rotation(measured: Any, prior: Any, q: Any, point: Any) -> Any:
    """Residuals and rows of the rotation vector from q to the measured attitude: ahead, to the right, down."""
    turn = add(log(multiply(from_zyx(measured), conjugate(q))), scale(-1.0, point))
    s, c = math.sin(prior[2]), math.cos(prior[2])
    h_1, h_2, h_3 = (c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)
    return dot(h_1, turn), dot(h_2, turn), turn[2], h_1, h_2, h_3


@inline
def rate_row(a: Any, slope: Any) -> Any:
    """The combination a of the rows of L_f p'."""
    return add(scale(a[0], slope[0]), add(scale(a[1], slope[1]), scale(a[2], slope[2])))


@inline
def correct(p: Any, q: Any, w: Any, cov: Any, shift: Any, acc: Any, mag: Any, ages: Any, use: Any) -> Any:
    """Iterated update; `use` says whether pitch, and whether yaw is measured. Returns (P, correction)."""
    g, tangent, leak = p[2], own(p)[0], force_products(block(p))
    use_pitch, use_yaw = use
    prior = to_zyx(q)
    v_1, v_2, k = noise_of(p, prior, ages[0])
    cp = max(1e-3, math.cos(prior[1]))
    ratio, v_3 = 0.0, 1.0
    if use_yaw:
        h = rotate(q, mag)
        square = h[0] * h[0] + h[1] * h[1]
        ratio = h[2] / math.sqrt(square)
        v_3 = p[1] * (square + h[2] * h[2]) / (square * ages[1])
    # a roll that is off turns an error of pitch into the other two; at ±90° that error is a root of the noise
    p_11, p_22 = tilt_variances(cov, prior[2])
    spread = v_2 if use_pitch else v_2 + 2.0 * math.sqrt(v_2) * cp
    mixed = (v_1 + p_11) * (spread + p_22) / (cp * cp)
    v_1 += mixed
    v_3 += ratio * ratio * mixed
    # what frees yaw from the specific force's noise: its combination with the other two
    b = ratio * math.sin(prior[2])
    a = -ratio * math.cos(prior[2])
    if tangent != 0.0:
        a -= math.tan(prior[1])
    by_roll = scale(1.0 / g, (0.0, -math.cos(prior[0]), math.sin(prior[0])))
    before, d = cov, NO_CORRECTION
    for _ in range(int(p[3])):
        at, d, cov = d, NO_CORRECTION, before
        point, point_w = (at[0], at[1], at[2]), (at[3], at[4], at[5])
        q_at, w_at = corrected(q, w, at)
        rate = add(w_at, shift)
        slope = products_slope(leak, rate)
        roll, sin_pitch, v = levelled(add(acc, scale(-1.0, products(leak, rate))), mag, g)
        yaw = math.atan2(-v[1], v[0]) if use_yaw else prior[2]
        measured = (roll, math.asin(sin_pitch), yaw)
        if tangent != 0.0:
            e_1, e_2, e_3, h_1, h_2, h_3 = tangents(measured, prior, to_zyx(q_at), point)
        else:
            e_1, e_2, e_3, h_1, h_2, h_3 = rotation(measured, prior, q, point)
        f_1, f_2 = rate_row(by_roll, slope), rate_row((1.0 / (g * cp), 0.0, 0.0), slope)
        cov, d = correct_row(cov, d, h_1 + f_1, e_1 + dot(h_1, point) + dot(f_1, point_w), v_1)
        if use_yaw:
            e_3 += a * e_1 + b * e_2
            h_3 = add(h_3, add(scale(a, h_1), scale(b, h_2)))
            cov, d = correct_attitude_row(cov, d, h_3, e_3 + dot(h_3, point), v_3)
        if use_pitch:
            e_2, h_2, f_2 = e_2 - k * e_1, add(h_2, scale(-k, h_1)), add(f_2, scale(-k, f_1))
            cov, d = correct_row(cov, d, h_2 + f_2, e_2 + dot(h_2, point) + dot(f_2, point_w), v_2)
    return cov, d


@inline
def step(p: Any, s: Any, dt: float, gyr: Any, acc: Any, mag: Any) -> Any:
    """One sample; gyr and acc are α_m and f_m of the array."""
    age_acc, age_mag, flag = s[36] + dt, s[37] + dt, 0.0
    motion, field, d, dof = s[42], (s[38], s[39], s[40]), NO_CORRECTION, 0.0

    q, w, cov = predict(p, s, dt)

    if is_sample(acc) and age_acc > 0.0 and dot(acc, acc) > 0.0:
        _, rate = rate_at(p, q, w, gyr, acc, dt)
        motion = moving(p, motion, rate, acc, age_acc)
        force = add(acc, scale(-1.0, products(force_products(block(p)), rate)))
        near = is_singular(own(p)[1], own(p)[0], to_zyx(q), force, p[2])
        use_yaw = age_mag > 0.0 and has_heading(down_b(q), mag) and has_heading(force, mag)
        if near:
            flag = _NEAR_SINGULAR
        if not near or (use_yaw and own(p)[0] == 0.0):
            shift = add(rate, scale(-1.0, w))
            cov, d = correct(p, q, w, cov, shift, acc, mag, (age_acc, age_mag), (not near, use_yaw))
            q, w = corrected(q, w, d)
            age_acc, dof = 0.0, 1.0
            if not near:
                dof += 1.0
            if use_yaw:
                h = rotate(q, mag)
                field = (math.sqrt(h[0] * h[0] + h[1] * h[1]), h[2], age_mag)
                age_mag = 0.0
                dof += 1.0
    state = finished(p, s, q, w, cov, (gyr, acc), dt)
    return state + (age_acc, age_mag) + field + (flag, motion, d[6], dof)


@dataclass(frozen=True, kw_only=True)
class GyroFreeIndirect(GyroFreeKalman):
    """Kalman filter of attitude and rate on the Euler angles that an accelerometer array and the field give.

    Parameters
    ----------
    residual : {"rotation", "tangent"}
        Compare the attitude of the measured angles with the estimate, or as K06 (−tan ψ, −sin θ, tan φ) with its own.
    singular_pitch : float
        Pitch, estimated or measured, from which samples are flagged and not used, rad. Raising it takes more samples
        whose angles are unsure.

    References
    ----------
    C.-F. Kao, M.S. thesis, National Chiao Tung University, 2006, (3.9) to (3.18), (3.22), (3.25) to (3.28).
    """

    name = "gyro-free-indirect"
    needs: ClassVar[tuple[str, ...]] = ("array", "mag")
    singular = "pitch ±90°"
    kernel = Kernel(
        "gyro-free-indirect",
        step,
        n_params=N_COMMON + 2,
        n_state=N_STATE,
        n_out=N_OUT,
        output=output,
        aligned=aligned,
        flagged=flagged,
        covariance=7,
    )

    residual: Literal["rotation", "tangent"] = "rotation"
    singular_pitch: float = parameter(1.4, unit="rad", low=0.0, high=1.5708)

    def _parameters(self, frame: Frame) -> Sequence[float]:
        return (
            *self._common(None, 1.0, self.reduction(), "xyz"),
            float(self.residual == "tangent"),
            self.singular_pitch,
        )
