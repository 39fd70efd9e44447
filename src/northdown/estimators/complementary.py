r"""Linear complementary filter: the gyroscope's short-term attitude blended with the measured one.

.. math::  \alpha \leftarrow (1 - k)(\alpha + \omega\, \Delta t) + k\, \alpha_{\text{measured}}

The gain comes from a time constant, k = 1 − exp(−Δt/τ) with Δt the time since that sensor's last sample, so that
the result does not depend on the sampling rate and slower or missing samples are weighted rightly. M20's k = 0.1 at
a rate f is τ = −1/(f ln 0.9).

``blend="rotation"`` (default) blends on the rotations: the predicted attitude is turned by a fraction k of the
shortest arc to level, then by a fraction k of the heading error. It has no singular attitude and does not depend on
the mounting.
``blend="euler"`` is M20's literal form: each of roll, pitch and yaw by itself, predicted by the naive sum and
blended through the shorter arc; it fails where the naive sum does, and near pitch ±90°.

Adaptive gain: the accelerometer's k is multiplied by

.. math::  f(e) = \min(1, \max(0, (e_2 - e)/(e_2 - e_1))), \qquad e = \bigl|\lVert a \rVert - g\bigr| / g

(R. G. Valenti, I. Dryanovski, J. Xiao, Sensors 15(8), 2015, doi:10.3390/s150819302, (60)–(61)).

Fuzzy gain: a zero-order Sugeno system. Inputs: e above, *small* below e₁, *large* above e₂, *medium* halfway between,
with triangular memberships; and ‖ω‖, *slow* below 0.5 rad/s, *fast* above 4 rad/s. Output, the weight of the
membership-weighted mean of its rules:

============ ====== ======
e \\ ‖ω‖     slow   fast
============ ====== ======
small        1      0.7
medium       0.4    0.2
large        0      0
============ ====== ======

Source: fusion tutorial of 2020 (M20), section 4, which names the adaptive and the fuzzy form without giving them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from northdown._validation import check_number
from northdown.estimators.base import Estimator, parameter
from northdown.frames import Frame, quat_from_ned
from northdown.kernels import euler
from northdown.kernels.jit import inline
from northdown.kernels.quaternion import dot, down_b, multiply, normalize
from northdown.kernels.runner import Kernel
from northdown.kernels.so3 import exp, log
from northdown.kernels.strapdown import closed_form
from northdown.kernels.wahba import has_heading, heading_error, tilt_correction, turn_about_down

_GRAVITY = 9.80665
_SLOW, _FAST = 0.5, 4.0
_FIXED, _ADAPTIVE, _FUZZY = 0.0, 1.0, 2.0
_GAINS = ("fixed", "adaptive", "fuzzy")


@inline
def gain_factor(gain: float, low: float, high: float, acc: Any, gyr: Any) -> float:
    """Factor between 0 and 1 by which the accelerometer's gain is reduced."""
    if gain == _FIXED:
        return 1.0
    e = math.fabs(math.sqrt(dot(acc, acc)) / _GRAVITY - 1.0)
    u = min(1.0, max(0.0, (e - low) / (high - low)))
    if gain == _ADAPTIVE:
        return 1.0 - u
    small, medium = max(0.0, 1.0 - 2.0 * u), 1.0 - math.fabs(2.0 * u - 1.0)
    fast = min(1.0, max(0.0, (math.sqrt(dot(gyr, gyr)) - _SLOW) / (_FAST - _SLOW)))
    slow = 1.0 - fast
    return small * (slow + 0.7 * fast) + medium * (0.4 * slow + 0.2 * fast)


@inline
def blend_rotations(q: Any, k_acc: float, k_mag: float, acc: Any, mag: Any) -> Any:
    """Turn q by fractions of the tilt and of the heading error; heading is read with the measured tilt."""
    level = q
    if k_acc > 0.0:
        arc = tilt_correction(q, acc)
        level = multiply(arc, q)
        v = log(arc)
        q = multiply(exp((k_acc * v[0], k_acc * v[1], k_acc * v[2])), q)
    if k_mag > 0.0:
        q = turn_about_down(k_mag * heading_error(level, mag), q)
    return normalize(q)


@inline
def blend_angles(turn: Any, q: Any, gyr: Any, dt: float, k_acc: float, k_mag: float, acc: Any, mag: Any) -> Any:
    """M20's formula on roll, pitch and yaw in the frame of the result."""
    roll, pitch, yaw = euler.to_zyx(multiply(turn, q))
    roll, pitch, yaw = roll + gyr[0] * dt, pitch + gyr[1] * dt, yaw + gyr[2] * dt
    back = (turn[0], -turn[1], -turn[2], -turn[3])
    level = multiply(back, euler.from_zyx((roll, pitch, yaw)))
    if k_acc > 0.0:
        level = multiply(tilt_correction(level, acc), level)
        measured = euler.to_zyx(multiply(turn, level))
        roll += k_acc * euler.wrap(measured[0] - roll)
        pitch += k_acc * euler.wrap(measured[1] - pitch)
    if k_mag > 0.0:
        measured = euler.to_zyx(multiply(turn, turn_about_down(heading_error(level, mag), level)))
        yaw += k_mag * euler.wrap(measured[2] - yaw)
    return normalize(multiply(back, euler.from_zyx((roll, pitch, yaw))))


@inline
def step(p: Any, s: Any, dt: float, gyr: Any, acc: Any, mag: Any) -> Any:
    """One sample: s = (w, x, y, z, time since acc, time since mag)."""
    tau_acc, tau_mag, gain, low, high, by_angle, t0, t1, t2, t3 = p
    w, x, y, z, age_acc, age_mag = s
    q = (w, x, y, z)
    age_acc += dt
    age_mag += dt
    predicted = q if by_angle != 0.0 else normalize(closed_form(q, gyr, dt))
    k_acc = 0.0
    k_mag = 0.0
    if dot(acc, acc) > 0.0:
        k_acc = (1.0 - math.exp(-age_acc / tau_acc)) * gain_factor(gain, low, high, acc, gyr)
        age_acc = 0.0
    if has_heading(down_b(predicted), mag):
        k_mag = 1.0 - math.exp(-age_mag / tau_mag)
        age_mag = 0.0
    if by_angle != 0.0:
        q = blend_angles((t0, t1, t2, t3), q, gyr, dt, k_acc, k_mag, acc, mag)
    else:
        q = blend_rotations(predicted, k_acc, k_mag, acc, mag)
    return (q[0], q[1], q[2], q[3], age_acc, age_mag)


@dataclass(frozen=True, kw_only=True)
class Complementary(Estimator):
    """Linear complementary filter with fixed, adaptive or fuzzy gain.

    Parameters
    ----------
    tau_acc : float
        Time constant (s) with which tilt follows the accelerometer. Raising it trusts the gyroscope for longer:
        less noise and less error from linear acceleration, more drift.
    tau_mag : float
        Time constant (s) with which heading follows the magnetometer. Raising it rides out magnetic
        disturbances for longer, and lets the gyroscope's bias turn the heading further away.
    gain : {"fixed", "adaptive", "fuzzy"}
        Whether the accelerometer's weight falls when its norm departs from gravity, linearly or by fuzzy
        rules that also look at the rate.
    low, high : float
        Departure of the accelerometer's norm from gravity, as a fraction of it, up to which the
        weight is full and from which it is zero. Raising them accepts more linear acceleration. Without effect for
        the fixed gain.
    blend : {"rotation", "euler"}
        Blend rotations, or each Euler angle by itself as M20 does.

    References
    ----------
    M20 section 4; R. G. Valenti, I. Dryanovski, J. Xiao, Sensors 15(8), 2015, (60)–(61).
    """

    name = "complementary"
    kernel = Kernel("complementary", step, n_params=10, n_state=6, n_out=4)

    tau_acc: float = parameter(3.0, unit="s", above=0.0)
    tau_mag: float = parameter(10.0, unit="s", above=0.0)
    gain: Literal["fixed", "adaptive", "fuzzy"] = "fixed"
    low: float = parameter(0.1, low=0.0)
    high: float = parameter(0.2, above=0.0)
    blend: Literal["rotation", "euler"] = "rotation"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_number("high", self.high, above=self.low)

    def _parameters(self, frame: Frame) -> Sequence[float]:
        gain, by_angle = float(_GAINS.index(self.gain)), float(self.blend == "euler")
        return (self.tau_acc, self.tau_mag, gain, self.low, self.high, by_angle, *quat_from_ned(frame))
