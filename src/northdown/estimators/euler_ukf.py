r"""Unscented Kalman filter on Euler angles, with the quaternion for the time update.

State x = (roll, pitch, yaw); augmented with the gyroscope's noise and the measurement's, L = 2n + m with n = 3 and
m = 6 (3 without a field sample). Sigma points x̂ and x̂ ± √(L + λ) times the columns of the Cholesky factor,

.. math::

    \lambda = \alpha^2 (L + \kappa) - L, \qquad w_0^m = \frac{\lambda}{L + \lambda}, \qquad
    w_0^c = w_0^m + 1 - \alpha^2 + \beta, \qquad w_i = \frac{1}{2 (L + \lambda)}

Time update: each sigma point's angles become a quaternion, turned by exp((ω − w) Δt) with its own noise w, and
angles again. Measurement: gravity and field, normalised, in the body frame, R_nbᵀ (0, 0, −1) and R_nbᵀ (cos D, 0,
sin D), from sigma points drawn anew from the predicted covariance. Where no field sample arrives the gravity part
alone is used.

Means and differences of angles are circular: taken about the central point, each difference wrapped to ±π.

Sigma points that differ from the centre only in noise that does not enter a function give the centre's value: they
are not computed but counted in its weight, and the measurement noise, which is additive, adds R to P_zz exactly. So
13 propagations and 7 measurements stand for all 25 points, without approximation.

Near pitch ±90° roll and yaw are no longer separate: a small turn changes both by large and opposite amounts, the
sigma points spread over the circle and their mean and covariance lose their meaning. Samples beyond
`singular_pitch` carry the flag `NEAR_SINGULAR`, and results there and until the filter has settled again are not to
be trusted. Choose `axes` so that the nose does not point up in use, or take `mekf`.

``axes="rfu"``: the nose is the body's y axis (right-forward-up; J14's pitch about x, roll about y, heading). It
amounts to the same filter on axes (y, x, −z), and moves the singular attitudes accordingly.

Source: R.-C. Jia, Optics and Precision Engineering 22(12), 2014, doi:10.3788/OPE.20142212.3280 (J14), section 3.
Misprints corrected: λ = α²(L + κ) − L; the term 1 − α² + β belongs to w₀ᶜ only; (34) is P − K P_zz Kᵀ; (21) T32 −
T23. Added: linear acceleration and magnetic disturbance raise the measurement noise as in `mekf`; the dip D is
learned. J14's state has no gyroscope bias, so a constant bias leaves a constant error of attitude.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from northdown._validation import FloatArray
from northdown.estimators._kalman import KalmanFilter, weighting_flags
from northdown.estimators.base import parameter
from northdown.frames import Frame
from northdown.kernels import euler
from northdown.kernels.direction_error import is_sample
from northdown.kernels.jit import inline
from northdown.kernels.kalman import symmetric3
from northdown.kernels.quaternion import dot, multiply, rotate, unit
from northdown.kernels.runner import Kernel
from northdown.kernels.so3 import exp
from northdown.kernels.weighting import field_departure, field_direction, linear_acceleration
from northdown.orientation import Flag

_NEAR_SINGULAR = int(Flag.NEAR_SINGULAR)
_HALF = math.sqrt(0.5)
_FLOOR = 1e-18  # rad²: keeps a pivot lost to rounding positive


@inline
def remount(rfu: float, v: Any) -> Any:
    """Vector in forward-right-down axes of a right-forward-up body, or as it is."""
    return (v[1], v[0], -v[2]) if rfu != 0.0 else v


@inline
def remount_quaternion(rfu: float, q: Any) -> Any:
    """Attitude of the forward-right-down axes, or back (it is its own inverse but for the sign)."""
    return multiply(q, (0.0, _HALF, _HALF, 0.0)) if rfu != 0.0 else q


@inline
def cholesky3(p: Any, scale: float) -> Any:
    """Columns of √scale times the lower Cholesky factor of a 3 × 3 covariance given by its upper triangle."""
    k = math.sqrt(scale)
    l00 = math.sqrt(max(p[0], _FLOOR))
    l10, l20 = p[1] / l00, p[2] / l00
    l11 = math.sqrt(max(p[3] - l10 * l10, _FLOOR))
    l21 = (p[4] - l20 * l10) / l11
    l22 = math.sqrt(max(p[5] - l20 * l20 - l21 * l21, _FLOOR))
    return (k * l00, k * l10, k * l20), (0.0, k * l11, k * l21), (0.0, 0.0, k * l22)


@inline
def propagate(angles: Any, rate: Any, dt: float) -> Any:
    """Angles after a step, by way of the quaternion (J14 (20)–(23))."""
    return euler.to_zyx(multiply(euler.from_zyx(angles), exp((rate[0] * dt, rate[1] * dt, rate[2] * dt))))


@inline
def wrapped(a: Any, b: Any) -> Any:
    """Differences a − b of angles, each between −π and π."""
    return (euler.wrap(a[0] - b[0]), euler.wrap(a[1] - b[1]), euler.wrap(a[2] - b[2]))


@inline
def predict(
    x: Any, p: Any, rate: Any, noise: float, dt: float, scale: float, w0m: float, w0c: float, w: float
) -> Any:
    """Time update (24)–(25): mean and covariance (upper triangle) of the angles; noise is the rate's sigma."""
    c0, c1, c2 = cholesky3(p, scale)
    g = math.sqrt(scale) * noise
    centre = propagate(x, rate, dt)
    d = np.empty((12, 3))
    for i in range(12):
        sign = 1.0 if i % 2 == 0 else -1.0
        k = i // 2
        if k < 3:
            c = c0 if k == 0 else (c1 if k == 1 else c2)
            y = propagate((x[0] + sign * c[0], x[1] + sign * c[1], x[2] + sign * c[2]), rate, dt)
        else:
            s0 = sign * g if k == 3 else 0.0
            s1 = sign * g if k == 4 else 0.0
            s2 = sign * g if k == 5 else 0.0
            y = propagate(x, (rate[0] - s0, rate[1] - s1, rate[2] - s2), dt)
        e = wrapped(y, centre)
        d[i, 0], d[i, 1], d[i, 2] = e[0], e[1], e[2]
    m0, m1, m2 = 0.0, 0.0, 0.0
    for i in range(12):
        m0 += w * d[i, 0]
        m1 += w * d[i, 1]
        m2 += w * d[i, 2]
    # the centre's own difference from the mean is −m, with its weight and those of the points counted in it
    wc = 1.0 - 12.0 * w + (w0c - w0m)
    p00, p01, p02, p11, p12, p22 = wc * m0 * m0, wc * m0 * m1, wc * m0 * m2, wc * m1 * m1, wc * m1 * m2, wc * m2 * m2
    for i in range(12):
        e0, e1, e2 = d[i, 0] - m0, d[i, 1] - m1, d[i, 2] - m2
        p00 += w * e0 * e0
        p01 += w * e0 * e1
        p02 += w * e0 * e2
        p11 += w * e1 * e1
        p12 += w * e1 * e2
        p22 += w * e2 * e2
    mean = (euler.wrap(centre[0] + m0), euler.wrap(centre[1] + m1), euler.wrap(centre[2] + m2))
    return mean, (p00, p01, p02, p11, p12, p22)


@inline
def predicted_measurement(angles: Any, north: float, down: float, z: Any, i: int) -> None:
    """Write up and field in body axes, six numbers, to row i of z."""
    sr, cr = math.sin(angles[0]), math.cos(angles[0])
    sp, cp = math.sin(angles[1]), math.cos(angles[1])
    sy, cy = math.sin(angles[2]), math.cos(angles[2])
    d0, d1, d2 = -sp, sr * cp, cr * cp
    z[i, 0], z[i, 1], z[i, 2] = -d0, -d1, -d2
    z[i, 3] = north * cp * cy + down * d0
    z[i, 4] = north * (sr * sp * cy - cr * sy) + down * d1
    z[i, 5] = north * (cr * sp * cy + sr * sy) + down * d2


@inline
def correct(
    x: Any, p: Any, z: Any, m: int, r: Any, north: float, down: float, scale: float, w0: float, w: float
) -> Any:
    """Measurement update (26)–(34) with the first m of the six measurements z of variances r (two numbers).

    w0 is the extra weight of the centre in covariances, 1 − α² + β. Returns angles, P, and the normalised innovation
    squared.
    """
    c0, c1, c2 = cholesky3(p, scale)
    h = np.empty((7, 6))
    predicted_measurement(x, north, down, h, 6)
    for i in range(6):
        sign = 1.0 if i % 2 == 0 else -1.0
        c = c0 if i < 2 else (c1 if i < 4 else c2)
        predicted_measurement((x[0] + sign * c[0], x[1] + sign * c[1], x[2] + sign * c[2]), north, down, h, i)
    mean = np.empty(6)
    for j in range(m):
        total = 0.0
        for i in range(6):
            total += h[i, j] - h[6, j]
        mean[j] = h[6, j] + w * total
    wc = 1.0 - 6.0 * w + w0
    s = np.empty((6, 6))
    for j in range(m):
        for k in range(j + 1):
            total = wc * (h[6, j] - mean[j]) * (h[6, k] - mean[k])
            for i in range(6):
                total += w * (h[i, j] - mean[j]) * (h[i, k] - mean[k])
            s[j, k] = total
        s[j, j] += r[0] if j < 3 else r[1]
    # cross covariance: sigma points of x are x ± c, so its rows are w Σ c (h₊ − h₋)
    cross = np.empty((3, 6))
    for j in range(m):
        a, b, c = h[0, j] - h[1, j], h[2, j] - h[3, j], h[4, j] - h[5, j]
        cross[0, j] = w * (c0[0] * a)
        cross[1, j] = w * (c0[1] * a + c1[1] * b)
        cross[2, j] = w * (c0[2] * a + c1[2] * b + c2[2] * c)
    # in place: S = G Gᵀ; then rows of T = cross G⁻ᵀ, so that K P_zz Kᵀ = T Tᵀ and K y = T G⁻¹ y
    y = np.empty(6)
    for j in range(m):
        total = s[j, j]
        for k in range(j):
            total -= s[j, k] * s[j, k]
        pivot = math.sqrt(total)
        for i in range(j + 1, m):
            total = s[i, j]
            for k in range(j):
                total -= s[i, k] * s[j, k]
            s[i, j] = total / pivot
        s[j, j] = pivot
        total = z[j] - mean[j]
        for k in range(j):
            total -= s[j, k] * y[k]
        y[j] = total / pivot
        for row in range(3):
            total = cross[row, j]
            for k in range(j):
                total -= s[j, k] * cross[row, k]
            cross[row, j] = total / pivot
    x0, x1, x2 = x
    p00, p01, p02, p11, p12, p22 = p
    nis = 0.0
    for j in range(m):
        nis += y[j] * y[j]
        t0, t1, t2 = cross[0, j], cross[1, j], cross[2, j]
        x0 += t0 * y[j]
        x1 += t1 * y[j]
        x2 += t2 * y[j]
        p00 -= t0 * t0
        p01 -= t0 * t1
        p02 -= t0 * t2
        p11 -= t1 * t1
        p12 -= t1 * t2
        p22 -= t2 * t2
    return (x0, x1, x2), (p00, p01, p02, p11, p12, p22), nis


@inline
def step(p: Any, s: Any, dt: float, gyr: Any, acc: Any, mag: Any) -> Any:
    """One sample; s = (q, angles, P, motion, ages of acc and mag, field's horizontal, down and age, u, NIS, dof)."""
    gyr_var, scale_var, acc_var, motion_time, motion_window, mag_var, g = p[:7]
    alpha2, beta, kappa, rfu = p[12], p[13], p[14], p[15]
    x, cov = (s[4], s[5], s[6]), s[7:13]
    motion, age_acc, age_mag = s[13], s[14] + dt, s[15] + dt
    field = (s[16], s[17], s[18])
    u, nis = 0.0, 0.0

    rate, force, direction = remount(rfu, gyr), remount(rfu, acc), remount(rfu, mag)
    has_acc = is_sample(force) and age_acc > 0.0
    has_mag = dot(direction, direction) > 0.0 and age_mag > 0.0
    m = 6 if has_mag else 3
    dof = (3.0 if has_acc else 0.0) + (2.0 if has_mag else 0.0)
    scale = alpha2 * (6 + m + kappa)
    w, w0 = 0.5 / scale, 1.0 - alpha2 + beta
    if dt > 0.0:
        noise = math.sqrt((gyr_var + scale_var * dot(rate, rate)) / dt)
        x, cov = predict(x, cov, rate, noise, dt, scale, 0.0, w0, w)
    if has_acc or has_mag:
        q = euler.from_zyx(x)
        z = np.zeros(6)
        r_acc, r_mag = 1e12, 1e12
        if has_acc:
            motion = linear_acceleration(motion, rotate(q, force), g, age_acc, motion_window)
            r_acc = (acc_var + motion_time * motion) * (1.0 / (g * g * age_acc))
            z[0], z[1], z[2] = force[0] / g, force[1] / g, force[2] / g
            age_acc = 0.0
        if has_mag:
            u, factor, field = field_departure((p[7], p[8], p[9]), field, rotate(q, direction), age_mag)
            r_mag = mag_var / age_mag * factor
            a = unit(direction)
            z[3], z[4], z[5] = a[0], a[1], a[2]
            age_mag = 0.0
        north, down = p[16], p[17]
        if north != north and field[2] > 0.0:
            north, down = field_direction(field)
        x, cov, nis = correct(x, cov, z, m, (r_acc, r_mag), north, down, scale, w0, w)
    q = remount_quaternion(rfu, euler.from_zyx(x))
    return q + x + cov + (motion, age_acc, age_mag) + field + (u, nis, dof)


@inline
def start_covariance(p: Any, heading_known: bool) -> Any:
    """P for fresh angles; an unknown heading is uniform over the circle."""
    heading = p[11] if heading_known else math.pi * math.pi / 3.0
    return (p[10], 0.0, 0.0, p[10], 0.0, heading)


@inline
def aligned(p: Any, s: Any, q: Any, heading_known: bool) -> Any:
    """State for an attitude found from the sensors."""
    return q + euler.to_zyx(remount_quaternion(p[15], q)) + start_covariance(p, heading_known) + s[13:]


@inline
def output(p: Any, s: Any) -> Any:
    """Attitude, covariance of its rotation vector in navigation axes, diagnostics.

    δ = J (dφ, dθ, dψ) with the columns of J (cos ψ cos θ, sin ψ cos θ, −sin θ), (−sin ψ, cos ψ, 0), (0, 0, 1).
    """
    sp, cp = math.sin(s[5]), math.cos(s[5])
    sy, cy = math.sin(s[6]), math.cos(s[6])
    a0, a1, b0, b1 = cy * cp, sy * cp, -sy, cy
    p00, p01, p02, p11, p12, p22 = s[7], s[8], s[9], s[10], s[11], s[12]
    u0, u1 = a0 * p00 + b0 * p01, a1 * p00 + b1 * p01
    v0, v1 = a0 * p01 + b0 * p11, a1 * p01 + b1 * p11
    w0, w1, w2 = a0 * p02 + b0 * p12, a1 * p02 + b1 * p12, p22 - sp * p02
    z0 = p02 - sp * p00
    c00, c01, c11 = u0 * a0 + v0 * b0, u0 * a1 + v0 * b1, u1 * a1 + v1 * b1
    c02, c12 = w0 - sp * u0, w1 - sp * u1
    return s[:4] + symmetric3(c00, c01, c02, c11, c12, w2 - sp * z0) + (math.sqrt(s[13]), s[19], s[20], s[21])


@inline
def flagged(p: Any, s: Any) -> int:
    """What has lowered the weight of this sample, and whether pitch is near ±90°."""
    flags = weighting_flags(p[2], p[3], s[13], s[14], s[19])
    if math.fabs(s[5]) > p[18]:
        flags |= _NEAR_SINGULAR
    return flags


@dataclass(frozen=True, kw_only=True)
class EulerUKF(KalmanFilter):
    """Unscented Kalman filter on Euler angles (three states, no bias); not for attitudes near pitch ±90°.

    Parameters
    ----------
    dip : float or None
        Angle of the field below the horizontal, rad. None: the mean of the past over
        `field_window`.
        Raising it tips the result about the east axis.
    alpha : float
        Spread of the sigma points. Raising it samples the model further from the mean.
    beta : float
        Weight of prior knowledge of the distribution; 2 suits a Gaussian. Raising it enlarges covariances.
    kappa : float
        Further spread. Raising it spreads the sigma points by √(1 + κ/L).
    axes : {"frd", "rfu"}
        Axes of the body: forward-right-down (pitch about y), or J14's right-forward-up (pitch about x).
    singular_pitch : float
        Pitch (rad) beyond which samples are flagged. Raising it flags fewer.

    References
    ----------
    R.-C. Jia, Optics and Precision Engineering 22(12), 2014, section 3.
    """

    name = "euler-ukf"
    kernel = Kernel(
        "euler-ukf",
        step,
        n_params=19,
        n_state=22,
        n_out=17,
        output=output,
        aligned=aligned,
        flagged=flagged,
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

    dip: float | None = parameter(None, unit="rad", low=-1.56, high=1.56)
    alpha: float = parameter(0.3, above=0.0)
    beta: float = parameter(2.0, low=0.0)
    kappa: float = parameter(0.0, low=0.0)
    axes: Literal["frd", "rfu"] = "frd"
    singular_pitch: float = parameter(1.4, unit="rad", low=0.0, high=1.5708)

    def _parameters(self, frame: Frame) -> Sequence[float]:
        n = self._noise()
        return (
            n.gyr,
            n.scale,
            n.acc,
            n.motion_time,
            n.motion_window,
            n.mag,
            n.gravity,
            n.norm_gate,
            n.dip_gate,
            n.field_window,
            n.tilt,
            n.heading,
            self.alpha**2,
            self.beta,
            self.kappa,
            float(self.axes == "rfu"),
            *((math.nan, math.nan) if self.dip is None else (math.cos(self.dip), math.sin(self.dip))),
            self.singular_pitch,
        )

    def _initial_state(self, quat: FloatArray, frame: Frame) -> Sequence[float]:
        p = self._parameters(frame)
        angles = euler.to_zyx(remount_quaternion(p[15], tuple(quat)))
        return (*angles, *start_covariance(p, True), *(0.0,) * 9)
