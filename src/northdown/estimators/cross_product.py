r"""Six-axis fusion by a cross product: the gyroscope steered by the accelerometer.

.. math::  e = \hat a_b \times \hat g_b, \qquad \dot q = \tfrac12\, q \otimes (0,\; \omega + k_p\, e)

The direction of gravity is turned into the body, crossed with the normalised accelerometer, and the product added to
the rate. Heading is not corrected: it drifts with the gyroscope's bias about the vertical.

Source: W.-H. Wang, note on quaternions (W), section 5. It is Mahony's filter without magnetometer and
integral. W leaves the weight of the error open ("fuse e into the rate"); here it is `kp`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from northdown.estimators.base import Estimator, parameter
from northdown.frames import Frame
from northdown.kernels import strapdown
from northdown.kernels.direction_error import gravity_error, is_sample
from northdown.kernels.jit import inline
from northdown.kernels.quaternion import add, scale
from northdown.kernels.runner import Kernel


@inline
def step(p: Any, s: Any, dt: float, gyr: Any, acc: Any, mag: Any) -> Any:
    """One sample: s = (w, x, y, z), p = (kp, integrator)."""
    kp, integrator = p
    rate = gyr
    if is_sample(acc):
        rate = add(gyr, scale(kp, gravity_error(s, acc)))
    return strapdown.step(integrator, s, rate, dt)


@dataclass(frozen=True, kw_only=True)
class CrossProduct(Estimator):
    """Cross-product fusion of gyroscope and accelerometer; the magnetometer serves only for the start.

    Parameters
    ----------
    kp : float
        Gain, rad/s per unit of direction error. Raising it trusts the accelerometer more: quicker levelling, more
        of its noise and of linear acceleration. 1/kp is the time constant in seconds.
    integrator : {"first-order", "rk4", "closed-form"}
        How the rate is integrated over a step. ``"first-order"`` is W's (section 4).

    References
    ----------
    W.-H. Wang, note on direction cosine matrices and quaternions, section 5.
    """

    name = "cross-product"
    uses = ("gyr", "acc")
    kernel = Kernel("cross-product", step, n_params=2, n_state=4, n_out=4)

    kp: float = parameter(0.74, unit="rad/s", low=0.0)
    integrator: Literal["first-order", "rk4", "closed-form"] = "first-order"

    def _parameters(self, frame: Frame) -> Sequence[float]:
        return (self.kp, strapdown.code(self.integrator))
