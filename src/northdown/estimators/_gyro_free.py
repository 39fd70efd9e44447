r"""What the filters with the states angular rate and attitude share: parameters, prediction, start and output.

The array gives the angular acceleration at each sample (ω̇ of `_array`, with s = 0), which drives

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

Linear acceleration is not in the model, and P knows nothing of it. Taking it for noise of the measurement would be
of no use: without gravity, and with no more than six accelerometers' worth of information, there is only the
integral of ω̇, which drifts by degrees in a second. So attitude and rate follow the specific force as in K06, and
what that costs is told. A filter that decays errors at the rate b = P g² / R follows accelerations a of correlation
time τ (`motion_time`) with the share bτ / (1 + bτ) of their variance. With the mean square of a, the covariance that
is given is

.. math::

    P + v \begin{pmatrix} 1 & 0 & \kappa \tan D \\ 0 & 1 & 0 \\ \kappa \tan D & 0 & \tan^2 D \end{pmatrix}, \qquad
    v = \frac{b\tau}{1 + b\tau}\, \frac{\overline{a^2}}{3 g^2}

as a tilt about north turns the field's dip D into heading, at once (κ = 1) or later: κ is heading's share bτ / (1 +
bτ) over that of tilt, at most 1. Of the rate, it is the same in body axes, times (b / (1 + bτ))². An estimate that
follows the acceleration does not see its horizontal part; its norm does not lie. Therefore a² is thrice the mean
square of ‖f‖ − g, less what noise makes of it (with two standard deviations of that). An acceleration that stays
horizontal, a, shows as a²/2g only: then the covariance is still too small.

State tuple: quaternion 4, rate (half a sample ago) 3, P 21, angular acceleration 3, rate 3, whether these two come
from the last sample, Δ of the last step, ages of force and field, field's horizontal, down and age, flag, mean
square of ‖f‖ − g, NIS and its degrees of freedom.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from northdown._validation import FloatArray
from northdown.estimators._array import Reduction
from northdown.estimators._array_coupling import (
    N_ARRAY,
    coupling,
    force_products,
    subtract,
    turning,
    turning_slope,
)
from northdown.estimators._array_filter import GyroFreeFilter
from northdown.estimators.base import parameter
from northdown.frames import Frame
from northdown.kernels.direction_error import is_sample
from northdown.kernels.jit import inline
from northdown.kernels.kalman import symmetric3
from northdown.kernels.quaternion import add, cross, dot, multiply, normalize, scale
from northdown.kernels.rate_kalman import (
    change_rate,
    matrix_nb,
    products,
    times3,
    turn_attitude,
)
from northdown.kernels.so3 import exp

N_COMMON = 12 + N_ARRAY
N_STATE = 45
N_OUT = 22


@inline
def block(p: Any) -> Any:
    """The tuple of `_array_coupling`."""
    return p[12:81]


@inline
def own(p: Any) -> Any:
    """The parameters of one filter, after those that all have."""
    return p[81:]


@inline
def rate_at(p: Any, q: Any, w: Any, alpha: Any, force: Any, dt: float) -> Any:
    """Angular acceleration and rate at the time of q, when w is the rate dt/2 before."""
    a = block(p)
    g, _ = coupling(a, 0.0)
    rate = add(w, scale(0.5 * dt, turning(a, p[2], q, w, alpha, force, g)))
    return turning(a, p[2], q, rate, alpha, force, g), rate


@inline
def moving(p: Any, motion: float, rate: Any, force: Any, age: float) -> float:
    """Mean square of ‖f‖ − g after this sample."""
    f = subtract(force, products(force_products(block(p)), rate))
    departure = math.sqrt(dot(f, f)) - p[2]
    return motion + (departure * departure - motion) * min(1.0, age / p[11])  # type: ignore[no-any-return]


@inline
def acceleration(p: Any, motion: float, dt: float) -> float:
    """Mean square of linear acceleration, three components, from that of ‖f‖ − g at samples dt apart."""
    a = block(p)
    noise = 0.0
    if dt > 0.0:
        # the mean over the window has a relative standard deviation of √(Δ / window)
        noise = p[0] / dt * (a[63] + a[66] + a[68]) / 3.0 * (1.0 + 2.0 * math.sqrt(min(1.0, dt / p[11])))
    return 3.0 * max(0.0, motion - noise)


@inline
def followed(p: Any, s: Any) -> Any:
    """Variance of tilt about each horizontal axis by linear acceleration, its covariance with heading, heading's.

    Last, the square of the rate at which they change.
    """
    a = block(p)
    decay = 1.5 * (s[7] + s[13]) * p[2] * p[2] / (p[0] * (a[63] + a[66] + a[68]))
    part = decay * p[10] / (1.0 + decay * p[10])
    fast = decay / (1.0 + decay * p[10])
    north, down = p[7], p[8]
    if north != north:
        north, down = s[38], s[39]
    slant = down / north if north > 0.0 else 0.0
    tilt = part * acceleration(p, s[42], s[35]) / (3.0 * p[2] * p[2])
    turn = p[10] * s[18] / (p[1] * (1.0 + slant * slant))
    along = min(1.0, turn / ((1.0 + turn) * part)) if part > 0.0 else 1.0
    return tilt, along * slant * tilt, slant * slant * tilt, fast * fast


@inline
def predict(p: Any, s: Any, dt: float) -> Any:
    """Attitude, rate and covariance at the next sample, dt after the one of the state s."""
    q, w, cov = (s[0], s[1], s[2], s[3]), (s[4], s[5], s[6]), s[7:28]
    acceleration, rate, fresh, before = (s[28], s[29], s[30]), (s[31], s[32], s[33]), s[34], s[35]
    h = 0.5 * (before + dt)
    m = matrix_nb(q)
    g, left = coupling(block(p), 0.0)
    n = h * p[0]
    noise = (n * left[0], n * left[1], n * left[2], n * left[3], n * left[4], n * left[5])
    # of an acceleration that is only held nothing is known to depend on the present state
    u = h * fresh
    slope = turning_slope(block(p), rate, g)
    # f = −g down, and with it G f, changes by −g east δx + g north δy
    k = u * p[2]
    x, y = scale(-k, times3(g, m[1])), scale(k, times3(g, m[0]))
    cov = change_rate(
        cov,
        (x[0], y[0], 0.0, 1.0 - u * slope[0], -u * slope[1], -u * slope[2]),
        (x[1], y[1], 0.0, -u * slope[3], 1.0 - u * slope[4], -u * slope[5]),
        (x[2], y[2], 0.0, -u * slope[6], -u * slope[7], 1.0 - u * slope[8]),
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
def finished(p: Any, s: Any, q: Any, w: Any, cov: Any, sample: Any, dt: float) -> Any:
    """The state up to Δ: with the angular acceleration and the rate of this sample (α, f)."""
    if is_sample(sample[1]):
        acceleration, rate = rate_at(p, q, w, sample[0], sample[1], dt)
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
    """Attitude, rate, covariance of the attitude, sigma of the rate, diagnostics."""
    # of ½Δ ω̇, with the noise of this sample
    n = 0.25 * s[35] * p[0]
    _, noise = coupling(block(p), 0.0)
    tilt, x, z, square = followed(p, s)
    m = matrix_nb((s[0], s[1], s[2], s[3]))
    sigma = (
        math.sqrt(s[22] + n * noise[0] + square * seen(m, 0, tilt, x, z)),
        math.sqrt(s[25] + n * noise[3] + square * seen(m, 1, tilt, x, z)),
        math.sqrt(s[27] + n * noise[5] + square * seen(m, 2, tilt, x, z)),
    )
    covariance = symmetric3(s[7] + tilt, s[8], s[9] + x, s[13] + tilt, s[14], s[18] + z)
    return s[:4] + s[31:34] + covariance + sigma + (math.sqrt(acceleration(p, s[42], s[35])), s[43], s[44])


@inline
def seen(m: Any, i: int, tilt: float, x: float, z: float) -> float:
    """Variance about body axis i of what has the variances (tilt, tilt, z) and the covariance x of north and down."""
    n, e, d = m[0][i], m[1][i], m[2][i]
    return tilt * (n * n + e * e) + z * d * d + 2.0 * x * n * d  # type: ignore[no-any-return]


@inline
def flagged(p: Any, s: Any) -> int:
    """The flag of the last sample."""
    return int(s[41])


@dataclass(frozen=True, kw_only=True)
class GyroFreeKalman(GyroFreeFilter):
    """Parameters of the two filters of K06.

    Specific force counts as gravity throughout. Under linear acceleration attitude leans with it, which the
    covariance allows for; biases of the accelerometers it leaves out.

    Parameters
    ----------
    iterations : int
        Linearisations of the measurements at each sample: 1 is the extended Kalman filter, more the iterated one.
        Raising it helps while the attitude is far off, and costs time.
    motion_time : float
        Time (s) over which linear accelerations stay correlated. Raising it expects more error from the same
        acceleration. The estimate itself does not change. 0: K06's covariance, in which there is none.
    motion_window : float
        Time constant (s) of the mean square of linear acceleration. Raising it expects errors for longer after each.
    """

    outputs = {  # noqa: RUF012  (a constant of the class)
        "rate": slice(4, 7),
        "covariance": slice(7, 16),
        "rate_sigma": slice(16, 19),
        "acceleration": slice(19, 20),
        "nis": slice(20, 21),
        "nis_dof": slice(21, 22),
    }

    iterations: int = parameter(1, low=1, high=20)
    motion_time: float = parameter(0.3, unit="s", low=0.0)
    motion_window: float = parameter(1.0, unit="s", above=0.0)

    def _common(self, dip: float | None, window: float, made: Reduction, axes: str) -> list[float]:
        """The parameters that all of these kernels begin with."""
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
            self.motion_time,
            self.motion_window,
            *made.block(axes),
        ]

    def _initial_state(self, quat: FloatArray, frame: Frame) -> Sequence[float]:
        covariance = start_covariance(self._parameters(frame), True)
        return (0.0, 0.0, 0.0, *covariance, *(0.0,) * 17)
