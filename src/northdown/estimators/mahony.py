r"""Mahony's explicit complementary filter: proportional-integral feedback of direction errors.

The cross products between measured and expected directions of gravity and field are fed back into the rate:

.. math::

    e &= \hat a_b \times \hat v_b + \hat m_b \times \hat w_b \\
    \dot b &= -k_i\, e, \qquad \dot q = \tfrac12\, q \otimes (0,\; \omega - b + k_p\, e)

========= ============ =====================================================
symbol    name         meaning
========= ============ =====================================================
â_b, m̂_b  acc, mag     measured directions, body axes
v̂_b       up_b         where up should be: −(third row of mat_nb)
ŵ_b                    where the field should be, M20 5.2
b         bias         gyroscope bias, rad/s
========= ============ =====================================================

Sources: R. Mahony, T. Hamel, J.-M. Pflimlin, IEEE Trans. Automatic Control 53(5), 2008,
doi:10.1109/TAC.2008.923738, (32); fusion tutorial of 2020 (M20), section 5.

Deviations from M20: its y-components of both cross products are misprinted (a_z v_z for a_x v_z; likewise
for the field). It writes the gravity direction where the accelerometer gives specific force; the sign is taken
care of here. The field's reference has no dip to be known: its horizontal part is turned to north and its
vertical part kept, so the size of the vertical part cannot disturb the heading. The integral is subtracted as a bias.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from northdown.estimators.base import Estimator, parameter
from northdown.kernels import strapdown
from northdown.kernels.jit import inline
from northdown.kernels.quaternion import add, cross, down_b, scale, unit
from northdown.kernels.runner import Kernel


@inline
def field_error(q: Any, mag: Any) -> Any:
    """Cross product of the measured field direction with its expected one, body axes (M20 5.2).

    With h = mat_nb m̂ the expected field is (b, 0, h_z) in NED, b = √(h_x² + h_y²).
    """
    w, x, y, z = q
    m0, m1, m2 = unit(mag)
    r00, r01, r02 = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    r10, r11, r12 = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    r20, r21, r22 = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    hx = r00 * m0 + r01 * m1 + r02 * m2
    hy = r10 * m0 + r11 * m1 + r12 * m2
    hz = r20 * m0 + r21 * m1 + r22 * m2
    b = math.sqrt(hx * hx + hy * hy)
    return cross((m0, m1, m2), (r00 * b + r20 * hz, r01 * b + r21 * hz, r02 * b + r22 * hz))


@inline
def gravity_error(q: Any, acc: Any) -> Any:
    """Cross product of the measured direction of up with its expected one, body axes (M20 5.1, W section 5)."""
    return cross(unit(acc), scale(-1.0, down_b(q)))


@inline
def step(p: Any, s: Any, dt: float, gyr: Any, acc: Any, mag: Any) -> Any:
    """One sample: s = (w, x, y, z, bias x, y, z), p = (kp, ki, integrator code)."""
    kp, ki, integrator = p
    w, x, y, z, bx, by, bz = s
    q = (w, x, y, z)
    e = (0.0, 0.0, 0.0)
    if acc[0] + acc[1] + acc[2] == acc[0] + acc[1] + acc[2]:
        e = gravity_error(q, acc)
    if mag[0] + mag[1] + mag[2] == mag[0] + mag[1] + mag[2]:
        e = add(e, field_error(q, mag))
    k = ki * dt
    bx -= k * e[0]
    by -= k * e[1]
    bz -= k * e[2]
    rate = (gyr[0] - bx + kp * e[0], gyr[1] - by + kp * e[1], gyr[2] - bz + kp * e[2])
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
        Integral gain, 1/s² in the same terms. Raising it learns the gyroscope bias faster, and mistakes
        lasting disturbances for bias; 0 keeps the bias at zero.
    integrator : {"first-order", "rk4", "closed-form"}
        How the rate is integrated over a step. ``"first-order"`` is M20's and the published implementations'; the
        others are better where the rate times the step is large.

    References
    ----------
    R. Mahony, T. Hamel, J.-M. Pflimlin, IEEE Trans. Automatic Control 53(5), 2008; M20 section 5. The defaults are
    those tuned by the authors of the BROAD data set (D. Laidig et al., Data 6(7):72, 2021).
    """

    name = "mahony"
    kernel = Kernel("mahony", step, n_params=3, n_state=7, n_out=7)
    outputs = {"gyr_bias": slice(4, 7)}  # noqa: RUF012  (constant of the class)

    kp: float = parameter(0.74, unit="rad/s", low=0.0)
    ki: float = parameter(0.0012, unit="1/s²", low=0.0)
    integrator: Literal["first-order", "rk4", "closed-form"] = "first-order"

    def _parameters(self) -> Sequence[float]:
        return (self.kp, self.ki, float(strapdown.INTEGRATORS.index(self.integrator)))
