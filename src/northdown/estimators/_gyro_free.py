r"""What the filters with the states angular rate and attitude share: parameters, prediction, start and output.

The array gives the angular acceleration at each sample, ω̇ = α_m − L_α p(ω) + G f(q) (see `_array`), which drives

.. math::

    \omega_{k+1/2} = \omega_{k-1/2} + \tfrac12(\Delta_k + \Delta_{k+1})\, \dot\omega_k, \qquad
    q_{k+1} = q_k \otimes \exp(\Delta_{k+1}\, \omega_{k+1/2})

The rate of the state is that half a sample before the attitude's time, so that both integrations are of second order.
A forward Euler step (K06 (3.25)) makes the same numbers, but calls the rate of half a sample later the present one.
The result's rate is ω_{k−1/2} + ½Δ_k ω̇_k. Products of rates are taken at that rate, and the shift by ½Δ ω̇ is not
differentiated.

Error states are the rotation vector δ in navigation axes, R = exp(δ) R̂, and the error of ω: six, as many as there are
degrees of freedom. K06's seventh, along q, tells nothing: q has unit norm.

Where a sample of the array is missing the angular acceleration of the last one is held.

State tuple: quaternion 4, rate (half a sample ago) 3, P 21, angular acceleration 3, rate 3, whether these two come
from the last sample, Δ of the last step, ages of force and field, field's horizontal, down and age, flag.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from northdown._validation import FloatArray
from northdown.estimators._array import Reduction
from northdown.estimators._array_filter import GyroFreeFilter
from northdown.estimators.base import parameter
from northdown.frames import Frame
from northdown.kernels.jit import inline
from northdown.kernels.kalman import symmetric3
from northdown.kernels.quaternion import add, cross, dot, down_b, multiply, normalize, scale
from northdown.kernels.rate_kalman import (
    change_rate,
    matrix_nb,
    products,
    products_slope,
    times3,
    turn_attitude,
)
from northdown.kernels.so3 import exp

N_COMMON = 61
N_STATE = 42
N_OUT = 19


@inline
def force_products(p: Any) -> Any:
    """L_f, 18 entries by rows."""
    return p[43:61]


@inline
def own(p: Any) -> Any:
    """The parameters of one filter, after those that all have."""
    return p[61:]


@inline
def rate_at(p: Any, q: Any, w: Any, alpha: Any, dt: float) -> Any:
    """Angular acceleration and rate at the time of q, when w is the rate dt/2 before."""
    l = p[10:28]
    free = add(alpha, scale(-p[2], times3(p[28:37], down_b(q))))
    rate = add(w, scale(0.5 * dt, add(free, scale(-1.0, products(l, w)))))
    return add(free, scale(-1.0, products(l, rate))), rate


@inline
def predict(p: Any, s: Any, dt: float) -> Any:
    """Attitude, rate and covariance at the next sample, dt after the one of the state s."""
    q, w, cov = (s[0], s[1], s[2], s[3]), (s[4], s[5], s[6]), s[7:28]
    acceleration, rate, fresh, before = (s[28], s[29], s[30]), (s[31], s[32], s[33]), s[34], s[35]
    h = 0.5 * (before + dt)
    m = matrix_nb(q)
    n = h * p[0]
    noise = (n * p[37], n * p[38], n * p[39], n * p[40], n * p[41], n * p[42])
    # of an acceleration that is only held nothing is known to depend on the present state
    u = h * fresh
    slope = products_slope(p[10:28], rate)
    # f = −g down, and with it G f, changes by −g east δx + g north δy
    k = u * p[2]
    x, y = scale(-k, times3(p[28:37], m[1])), scale(k, times3(p[28:37], m[0]))
    cov = change_rate(
        cov,
        (x[0], y[0], 0.0, 1.0 - u * slope[0][0], -u * slope[0][1], -u * slope[0][2]),
        (x[1], y[1], 0.0, -u * slope[1][0], 1.0 - u * slope[1][1], -u * slope[1][2]),
        (x[2], y[2], 0.0, -u * slope[2][0], -u * slope[2][1], 1.0 - u * slope[2][2]),
        noise,
    )
    w = add(w, scale(h, acceleration))
    return normalize(multiply(q, exp(scale(dt, w)))), w, turn_attitude(cov, m, dt)


@inline
def learn_field(p: Any, field: Any, force: Any, mag: Any, dt: float) -> Any:
    """Mean of the field's (horizontal, down) part about the specific force, and the age of that mean."""
    k = 1.0 / math.sqrt(dot(force, force) * dot(mag, mag))
    level = cross(force, mag)
    horizontal, down = k * math.sqrt(dot(level, level)), -k * dot(force, mag)
    age = field[2] + dt
    k = dt / min(age, p[9] + dt)
    return (field[0] + k * (horizontal - field[0]), field[1] + k * (down - field[1]), age)


@inline
def corrected(q: Any, w: Any, d: Any) -> Any:
    """Attitude and rate after the correction d."""
    q = normalize(multiply(exp((d[0], d[1], d[2])), q))
    return q, (w[0] + d[3], w[1] + d[4], w[2] + d[5])


@inline
def finished(p: Any, s: Any, q: Any, w: Any, cov: Any, alpha: Any, has_acc: bool, dt: float) -> Any:
    """The state up to Δ: with the angular acceleration and the rate of this sample."""
    if has_acc:
        acceleration, rate = rate_at(p, q, w, alpha, dt)
        fresh = 1.0
    else:
        acceleration = (s[28], s[29], s[30])
        rate = add(w, scale(0.5 * dt, acceleration))
        fresh = 0.0
    return q + w + cov + acceleration + rate + (fresh, dt)


@inline
def start_covariance(p: Any, heading_known: bool) -> Any:
    """Upper triangle of P for a fresh attitude; an unknown heading is uniform over the circle."""
    tilt, heading, rate = p[4], p[5], p[6]
    if not heading_known:
        heading = math.pi * math.pi / 3.0
    zero3 = (0.0, 0.0, 0.0)
    rows = (tilt, 0.0, 0.0) + zero3 + (tilt, 0.0) + zero3 + (heading,) + zero3
    return rows + (rate, 0.0, 0.0, rate, 0.0, rate)


@inline
def aligned(p: Any, s: Any, q: Any, heading_known: bool) -> Any:
    """State for an attitude found from the sensors."""
    return q + s[4:7] + start_covariance(p, heading_known) + s[28:]


@inline
def output(p: Any, s: Any) -> Any:
    """Attitude, rate, covariance of the attitude, sigma of the rate."""
    # of ½Δ ω̇, with the noise of this sample
    n = 0.25 * s[35] * p[0]
    sigma = (math.sqrt(s[22] + n * p[37]), math.sqrt(s[25] + n * p[40]), math.sqrt(s[27] + n * p[42]))
    return s[:4] + s[31:34] + symmetric3(s[7], s[8], s[9], s[13], s[14], s[18]) + sigma


@inline
def flagged(p: Any, s: Any) -> int:
    """The flag of the last sample."""
    return int(s[41])


@dataclass(frozen=True, kw_only=True)
class GyroFreeKalman(GyroFreeFilter):
    """Parameters of the two filters of K06.

    Parameters
    ----------
    iterations : int
        Linearisations of the measurements at each sample: 1 is the extended Kalman filter, more the iterated one.
        Raising it helps while the attitude is far off, and costs time.
    """

    outputs = {  # noqa: RUF012  (a constant of the class)
        "rate": slice(4, 7),
        "covariance": slice(7, 16),
        "rate_sigma": slice(16, 19),
    }

    iterations: int = parameter(1, low=1, high=20)

    def _common(self, dip: float | None, window: float, made: Reduction) -> list[float]:
        """The parameters that all of these kernels begin with."""
        upper = np.triu_indices(3)
        return [
            self.acc_noise**2,
            (self.mag_noise / self.field) ** 2,
            self.gravity,
            float(self.iterations),
            self.start_tilt**2,
            self.start_heading**2,
            self.start_rate**2,
            math.nan if dip is None else math.cos(dip),
            math.nan if dip is None else math.sin(dip),
            window,
            *made.products[:3].ravel(),
            *made.coupling.ravel(),
            *made.rate_noise[upper],
            *made.products[3:].ravel(),
        ]

    def _initial_state(self, quat: FloatArray, frame: Frame) -> Sequence[float]:
        covariance = start_covariance(self._parameters(frame), True)
        return (0.0, 0.0, 0.0, *covariance, *(0.0,) * 14)
