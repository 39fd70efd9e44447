r"""Mahony's explicit complementary filter: proportional-integral feedback of direction errors.

The cross products between measured and expected directions of gravity and field are fed back into the rate:

.. math::

    e &= \hat a_b \times \hat v_b + \hat m_b \times \hat w_b \\
    \dot b &= -k_i\, e, \qquad \dot q = \tfrac12\, q \otimes (0,\; \omega - b + k_p\, e)

========= ======================== =====================================================
symbol    name                     meaning
========= ======================== =====================================================
â_b, m̂_b  acc, mag                 measured directions, body axes
v̂_b, ŵ_b  in kernels/              where up and the field should be, body axes
          direction_error.py
b         bx, by, bz               gyroscope bias, rad/s
========= ======================== =====================================================

Sources: R. Mahony, T. Hamel, J.-M. Pflimlin, IEEE Trans. Automatic Control 53(5), 2008,
doi:10.1109/TAC.2008.923738, (32); fusion tutorial of 2020 (M20), section 5.

Deviations from M20: the y-components of both its cross products are misprinted (a_z v_z for a_x v_z, and likewise for
the field), and it writes the direction of gravity where the accelerometer gives specific force. The
integral is kept as a bias, with the sign that makes it one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from northdown.estimators.base import Estimator, parameter
from northdown.frames import Frame
from northdown.kernels import strapdown
from northdown.kernels.direction_error import field_error, gravity_error, is_sample
from northdown.kernels.jit import inline
from northdown.kernels.quaternion import add
from northdown.kernels.runner import Kernel


@inline
def step(p: Any, s: Any, dt: float, gyr: Any, acc: Any, mag: Any) -> Any:
    """One sample: s = (w, x, y, z, bias x, y, z), p = (kp, ki, integrator)."""
    kp, ki, integrator = p
    w, x, y, z, bx, by, bz = s
    q = (w, x, y, z)
    e = (0.0, 0.0, 0.0)
    if is_sample(acc):
        e = gravity_error(q, acc)
    if is_sample(mag):
        e = add(e, field_error(q, mag))
    # ω − b⁺ + kp e with the new bias b⁺ = b − k e, without waiting for b⁺
    k = ki * dt
    rate = (gyr[0] - bx + (kp + k) * e[0], gyr[1] - by + (kp + k) * e[1], gyr[2] - bz + (kp + k) * e[2])
    bx -= k * e[0]
    by -= k * e[1]
    bz -= k * e[2]
    w, x, y, z = strapdown.step(integrator, q, rate, dt)
    return (w, x, y, z, bx, by, bz)


@dataclass(frozen=True, kw_only=True)
class Mahony(Estimator):
    """Mahony's complementary filter, with or without magnetometer.

    Parameters
    ----------
    kp : float
        Proportional gain, rad/s per unit of direction error. Raising it trusts accelerometer and magnetometer more:
        quicker recovery, more of their noise and of linear acceleration. 1/kp is the time constant in seconds.
    ki : float
        Integral gain, 1/s². Raising it learns the gyroscope bias faster, and takes lasting disturbances for
        bias; 0 keeps the bias at zero.
    integrator : {"first-order", "rk4", "closed-form"}
        How the rate is integrated over a step. ``"first-order"`` is M20's and that of the published
        implementations; the others are better where rate times step is large.

    References
    ----------
    R. Mahony, T. Hamel, J.-M. Pflimlin, IEEE Trans. Automatic Control 53(5), 2008; M20 section 5. The defaults are
    those that the authors of the BROAD data set found best for it (D. Laidig et al., Data 6(7):72, 2021).
    """

    name = "mahony"
    kernel = Kernel("mahony", step, n_params=3, n_state=7, n_out=7)
    outputs = {"gyr_bias": slice(4, 7)}  # noqa: RUF012  (a constant of the class)

    kp: float = parameter(0.74, unit="rad/s", low=0.0)
    ki: float = parameter(0.0012, unit="1/s²", low=0.0)
    integrator: Literal["first-order", "rk4", "closed-form"] = "first-order"

    def _parameters(self, frame: Frame) -> Sequence[float]:
        return (self.kp, self.ki, strapdown.code(self.integrator))
