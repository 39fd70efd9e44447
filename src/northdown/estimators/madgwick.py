r"""Madgwick's gradient-descent filter, for comparison.

Each step moves against the gradient of the misfit between measured and expected directions of gravity and
field, always with the same speed β:

.. math::  \dot q = \tfrac12\, q \otimes (0, \omega) - \beta\, \frac{\nabla f}{\lVert \nabla f \rVert}

Only the part of the gradient tangent to the unit sphere turns the attitude. For f = ½ Σ ‖R_bn r_n − r_b‖² that part
is −2 q ⊗ (0, e) with e the sum of the cross products â_b × v̂_b + m̂_b × ŵ_b that Mahony's filter
feeds back. So the filter is Mahony's with the error's direction only, at a fixed gain:

.. math::  \dot q = \tfrac12\, q \otimes (0,\; \omega + 2\beta\, e / \lVert e \rVert)

Source: S. Madgwick, A. Harrison, R. Vaidyanathan, IEEE ICORR 2011, doi:10.1109/ICORR.2011.5975346, (12)–(34).

Deviations: the paper's Jacobian also has a part along q, which turns nothing but takes part in the normalisation; it
makes the gain depend on how the sensor is mounted, and is left out. The bias drift compensation (47) is not built:
use Mahony. Since the speed is β whatever the size of the error, the result trembles by 2 β Δt about the optimum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from northdown.estimators.base import Estimator, parameter
from northdown.frames import Frame
from northdown.kernels.direction_error import field_error, gravity_error, is_sample
from northdown.kernels.jit import inline
from northdown.kernels.quaternion import add, normalize, scale, unit
from northdown.kernels.runner import Kernel
from northdown.kernels.strapdown import first_order


@inline
def step(p: Any, s: Any, dt: float, gyr: Any, acc: Any, mag: Any) -> Any:
    """One sample: s = (w, x, y, z), p = (beta,)."""
    e = (0.0, 0.0, 0.0)
    if is_sample(acc):
        e = gravity_error(s, acc)
    if is_sample(mag):
        e = add(e, field_error(s, mag))
    return normalize(first_order(s, add(gyr, scale(2.0 * p[0], unit(e))), dt))


@dataclass(frozen=True, kw_only=True)
class Madgwick(Estimator):
    """Madgwick's gradient-descent filter, with or without magnetometer.

    Parameters
    ----------
    beta : float
        Half the speed of correction, rad/s: a gyroscope error of up to twice this is made good. Raising it recovers
        faster, and follows the noise of accelerometer and magnetometer more.

    References
    ----------
    S. Madgwick, A. Harrison, R. Vaidyanathan, IEEE ICORR 2011. The default is the one that the authors of the
    BROAD data set found best for it (D. Laidig et al., Data 6(7):72, 2021).
    """

    name = "madgwick"
    kernel = Kernel("madgwick", step, n_params=1, n_state=4, n_out=4)

    beta: float = parameter(0.12, unit="rad/s", low=0.0)

    def _parameters(self, frame: Frame) -> Sequence[float]:
        return (self.beta,)
