r"""Error-state Kalman filter of attitude, rate and biases on an accelerometer array and a magnetometer.

Twelve error states: rotation vector δ in navigation axes, R = exp(δ) R̂; angular rate ω; biases of angular
acceleration and of specific force, which are J⁺ b, all that six numbers a sample show of the biases b of K
accelerometers. The prediction is that of `_gyro_free`, with the biases as random walks.

Specific force is measured in the axes in which its noise is diagonal, C_ff = V Λ Vᵀ. Linear acceleration is noise:

.. math::  R_f = \bigl(\sigma^2 (C_{ff} + s), \qquad s\,\sigma^2 = \tau_m\, \overline{a^2}\bigr) / \Delta t

with the mean square of :math:`f_n - (0, 0, -g)` over `motion_window`, less the channels' noise. What the noise of f
tells of that of ω̇ follows it, :math:`G = C_{\alpha f} V (\Lambda + s)^{-1} V^T` (see `_array`).

More than six accelerometers measure the rate without gravity: in the null space of Jᵀ the channels hold neither ω̇ nor
f, but

.. math::  e = B\, p(\omega) + n_e, \qquad
           p = (\omega_x^2, \omega_y^2, \omega_z^2, \omega_x\omega_y, \omega_x\omega_z, \omega_y\omega_z)

at most six numbers. So rates stay known while gravity is distrusted. Row i is the quadratic form ωᵀ M ω, and near
ω = 0 its slope vanishes; therefore to the expectation tr(M P) is added, to the noise 2 tr(M P M P) (second-order
filter). Biases of these combinations are no states: they count as noise that stays correlated for `bias_time`.

Limits: products of rates do not tell ω from −ω, and an error of many degrees is outside of what any linearised filter
says of itself. Where gravity is distrusted so much that attitude is lost to 10° or more, the covariance is too small.

Magnetometer: the direction of the field against the mean of the past, weighted by its departure, as in
`quaternion_ekf`; with it tilt is known about one axis even without gravity.

Sources: C.-F. Kao, M.S. thesis, National Chiao Tung University, 2006, chapters 2.5 and 3; for redundant
accelerometers K. Parsa, J. Angeles, A. K. Misra, Archive of Applied Mechanics 74, 2004; for the second-order filter
A. Gelb (ed.), Applied Optimal Estimation, 1974, 6.1. Biases as J⁺ b, the correlation G and the weighting are this
project's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from northdown._validation import FloatArray
from northdown.estimators._array import Reduction, redundancy
from northdown.estimators._array_coupling import (
    acceleration_flag,
    coupling,
    force_products,
    force_residual,
    looseness,
    subtract,
    turning,
)
from northdown.estimators._array_filter import GyroFreeFilter
from northdown.estimators._array_mekf import (
    correct_extra,
    correct_field,
    correct_force,
    predict,
)
from northdown.estimators.base import parameter
from northdown.frames import Frame
from northdown.kernels.block_kalman import flat, full, product, raised, times, transposed
from northdown.kernels.direction_error import is_sample
from northdown.kernels.jit import inline
from northdown.kernels.quaternion import add, dot, multiply, normalize, rotate, scale, unit
from northdown.kernels.rate_kalman import products
from northdown.kernels.runner import Kernel
from northdown.kernels.so3 import exp
from northdown.kernels.weighting import REJECTED, field_departure, field_direction, linear_acceleration
from northdown.orientation import Flag

_MAG_REJECTED = int(Flag.MAG_REJECTED)


@inline
def step(p: Any, s: Any, dt: float, gyr: Any, acc: Any, mag: Any, extra: Any) -> Any:
    """One sample; gyr and acc are α_m and f_m of the array, extra its redundant combinations.

    s = (q 4, ω 3, biases 6, P 78, ω̇ 3, rate 3, whether these two are of the last sample, Δ, s, motion, ages of force
    and field, field's horizontal, down and age, u, NIS, dof).
    """
    motion, age_acc, age_mag, field, u = s[100], s[101] + dt, s[102] + dt, (s[103], s[104], s[105]), 0.0
    biases = ((s[7], s[8], s[9]), (s[10], s[11], s[12]))
    loose = s[99]
    q, w, cov = predict(p, s, dt)
    zero = (0.0, 0.0, 0.0)
    d, dof = (zero, zero, zero, zero, 0.0), 0.0

    if dot(mag, mag) > 0.0 and age_mag > 0.0:
        h = rotate(q, mag)
        u, factor, field = field_departure((p[5], p[6], p[7]), field, h, age_mag)
        north, down = p[11], p[12]
        if north != north:
            north, down = field_direction(field)
        h = unit(h)
        y = (h[0] - north, h[1], h[2] - down)
        cov, d = correct_field(cov, d, y, north, down, p[4] / age_mag * factor)
        age_mag, dof = 0.0, 2.0

    has_acc = is_sample(acc)
    shift = zero
    if has_acc and age_acc > 0.0:
        g, _ = coupling(p[13:82], loose)
        first = turning(p[13:82], p[3], q, w, subtract(gyr, biases[0]), subtract(acc, biases[1]), g)
        shift = scale(0.5 * dt, first)
        rate = add(w, shift)
        per = p[0] / age_acc
        if is_sample((extra[0], extra[1], extra[2])):
            cov, d, more = correct_extra(p, cov, d, rate, extra, p[10] / age_acc)
            dof += more
        y = force_residual(p[13:82], p[3], q, rate, subtract(acc, biases[1]))
        f_n = rotate(q, subtract(acc, add(biases[1], products(force_products(p[13:82]), rate))))
        motion = linear_acceleration(motion, f_n, p[3], age_acc, p[9])
        loose = looseness(p[13:82], p[0], p[8], motion, per)
        cov, d = correct_force(p, cov, d, q, rate, y, loose, per)
        age_acc = 0.0
        dof += 3.0

    q = normalize(multiply(exp(d[0]), q))
    w = add(w, d[1])
    biases = (add(biases[0], d[2]), add(biases[1], d[3]))
    acceleration, rate, fresh = (s[91], s[92], s[93]), zero, 0.0
    if has_acc:
        g, _ = coupling(p[13:82], loose)
        first = turning(p[13:82], p[3], q, w, subtract(gyr, biases[0]), subtract(acc, biases[1]), g)
        rate = add(w, scale(0.5 * dt, first))
        acceleration, fresh = (
            turning(p[13:82], p[3], q, rate, subtract(gyr, biases[0]), subtract(acc, biases[1]), g),
            1.0,
        )
    else:
        rate = add(w, scale(0.5 * dt, acceleration))
    head = q + w + biases[0] + biases[1] + flat(cov) + acceleration + rate
    return head + (fresh, dt, loose, motion, age_acc, age_mag) + field + (u, d[4], dof)


@inline
def start_covariance(p: Any, heading_known: bool) -> Any:
    """P, flat, for a fresh attitude; an unknown heading is uniform over the circle."""
    tilt, heading, rate, bias = p[118], p[119], p[120], p[2]
    if not heading_known:
        heading = math.pi * math.pi / 3.0
    z = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    none = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    cross = times(bias, product(p[55:64], transposed(p[64:73])))
    return flat(
        (
            (tilt, 0.0, 0.0, tilt, 0.0, heading),
            z,
            z,
            z,
            (rate, 0.0, 0.0, rate, 0.0, rate),
            z,
            z,
            raised(none, bias, p[49:55]),
            cross,
            raised(none, bias, p[76:82]),
        )
    )


@inline
def aligned(p: Any, s: Any, q: Any, heading_known: bool) -> Any:
    """State for an attitude found from the sensors."""
    return q + s[4:13] + start_covariance(p, heading_known) + s[91:]


@inline
def output(p: Any, s: Any) -> Any:
    """Attitude, rate, covariance of the attitude, sigma of the rate, diagnostics."""
    _, noise = coupling(p[13:82], s[99])
    n = 0.25 * s[98] * p[0]
    sigma = (math.sqrt(s[46] + n * noise[0]), math.sqrt(s[49] + n * noise[3]), math.sqrt(s[51] + n * noise[5]))
    return s[:4] + s[94:97] + full(s[13:19]) + sigma + (math.sqrt(s[100]), s[106], s[107], s[108])


@inline
def flagged(p: Any, s: Any) -> int:
    """Whether linear acceleration or a disturbed field has lowered the weight of this sample."""
    flags = acceleration_flag(p[13:82], s[99], s[101])
    return flags | _MAG_REJECTED if s[106] > REJECTED else flags


@dataclass(frozen=True, kw_only=True)
class GyroFreeMEKF(GyroFreeFilter):
    """Error-state Kalman filter without gyroscope: biases, linear acceleration, redundant accelerometers.

    Parameters
    ----------
    motion_time : float
        Time (s) over which linear accelerations stay correlated. Raising it distrusts gravity more whenever the body
        has been accelerating, and leans on the angular acceleration, with its biases. 0: all specific force is
        gravity.
    motion_window : float
        Time constant (s) of the mean square of linear acceleration. Raising it distrusts for longer after each
        acceleration.
    acc_bias_walk : float
        Random walk of each accelerometer's bias, m/s³/√Hz. Raising it lets the biases change faster.
    start_bias : float
        Standard deviation of each accelerometer's bias at the start, m/s²; the default is that of calibrated ones.
        Raising it learns the biases faster at first, and trusts the redundant accelerometers less.
    bias_time : float
        Time (s) for which the bias of a redundant combination counts as noise that does not change. Raising it trusts
        redundant accelerometers less.
    dip : float or None
        Angle of the field below the horizontal, rad. None: the mean of the past over `field_window`. Raising it tips
        the result about the east axis.
    norm_gate : float
        Relative departure of the field's norm that lowers the magnetometer's weight to 1/e. Raising it accepts more
        disturbance.
    dip_gate : float
        Departure of the field's dip, rad, that does the same. Raising it accepts more disturbance.
    field_window : float
        Time constant (s) with which the reference of norm and dip follows the field. Raising it adapts more slowly to
        a new place.

    Notes
    -----
    ``acceleration`` of the diagnostics holds noise and tilt errors too. Where linear acceleration leaves the specific
    force less than a tenth of its weight at rest, its samples carry `Flag.ACC_REJECTED`. ``field_departure`` is u:
    above 4.6 samples of the magnetometer have less than 1 % of their weight, `Flag.MAG_REJECTED`. Where `bias_time`
    counts a bias as noise the mean of ``nis`` is somewhat below ``nis_dof``.
    """

    name = "gyro-free-mekf"
    kernel = Kernel(
        "gyro-free-mekf",
        step,
        n_params=121,
        n_state=109,
        n_out=23,
        output=output,
        aligned=aligned,
        flagged=flagged,
        covariance=7,
        n_extra=6,
    )
    outputs = {  # noqa: RUF012  (a constant of the class)
        "rate": slice(4, 7),
        "covariance": slice(7, 16),
        "rate_sigma": slice(16, 19),
        "acceleration": slice(19, 20),
        "field_departure": slice(20, 21),
        "nis": slice(21, 22),
        "nis_dof": slice(22, 23),
    }

    motion_time: float = parameter(0.03, unit="s", low=0.0)
    motion_window: float = parameter(1.0, unit="s", above=0.0)
    acc_bias_walk: float = parameter(1e-5, unit="m/s³/√Hz", low=0.0)
    start_bias: float = parameter(0.005, unit="m/s²", low=0.0)
    bias_time: float = parameter(1.0, unit="s", low=0.0)
    dip: float | None = parameter(None, unit="rad", low=-1.56, high=1.56)
    norm_gate: float = parameter(0.05, above=0.0)
    dip_gate: float = parameter(0.05, unit="rad", above=0.0)
    field_window: float = parameter(100.0, unit="s", above=0.0)

    def _parameters(self, frame: Frame) -> Sequence[float]:
        made = self.reduction()
        _, seen = redundancy(self._geometry())
        return (
            self.acc_noise**2,
            self.acc_bias_walk**2,
            self.start_bias**2,
            self.gravity,
            (self.mag_noise / self.field) ** 2,
            *(self.norm_gate, self.dip_gate, self.field_window),
            *(self.motion_time, self.motion_window),
            self.acc_noise**2 + self.start_bias**2 * self.bias_time,
            *((math.nan, math.nan) if self.dip is None else (math.cos(self.dip), math.sin(self.dip))),
            *made.block(),
            *seen.ravel(),
            *(self.start_tilt**2, self.start_heading**2, self.start_rate**2),
        )

    def _initial_state(self, quat: FloatArray, frame: Frame) -> Sequence[float]:
        covariance = start_covariance(self._parameters(frame), True)
        return (*(0.0,) * 9, *covariance, *(0.0,) * 18)

    def reduction(self) -> Reduction:
        """The numbers that the filter makes of a sample of its array, redundant combinations among them."""
        return replace(super().reduction(), extra=redundancy(self._geometry())[0])
