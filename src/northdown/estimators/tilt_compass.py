r"""Attitude from one accelerometer and one magnetometer sample: tilt and tilt-compensated heading.

In NED, with specific force f_b at rest pointing up,

.. math::

    \phi = \operatorname{atan2}(-f_y, -f_z), \quad \theta = \operatorname{atan2}(f_x, \sqrt{f_y^2 + f_z^2}), \quad
    \psi = -\operatorname{atan2}(m_y \cos\phi - m_z \sin\phi,\;
           m_x \cos\theta + m_y \sin\theta \sin\phi + m_z \sin\theta \cos\phi)

Computed without angles: the shortest arc that levels the body, then the turn about the vertical that brings the
horizontal field to north. The result is the same, without singularity, and stays defined with one of the two sensors
missing: the other's part is held.

Sources: fusion tutorial of 2020 (M20), 3.1; J14 (3)–(6); K06 (3.9)–(3.15).
Deviations: M20 swaps roll and pitch in 3.1.1 and has sin ψ for sin φ in its heading; J14's roll has √(f_y + f_z) for
f_z and its Mag_x lacks m_y. M20 and K06 write the direction of gravity for the accelerometer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from northdown.estimators.base import Estimator
from northdown.frames import Frame
from northdown.kernels.jit import inline
from northdown.kernels.quaternion import dot, down_b, multiply, normalize
from northdown.kernels.runner import Kernel
from northdown.kernels.wahba import has_heading, heading_error, tilt_correction, turn_about_down


@inline
def step(p: Any, s: Any, dt: float, gyr: Any, acc: Any, mag: Any) -> Any:
    """One sample: s = (w, x, y, z); no parameters, dt and gyr are not used."""
    q = s
    if dot(acc, acc) > 0.0:
        q = multiply(tilt_correction(q, acc), q)
    if has_heading(down_b(q), mag):
        q = turn_about_down(heading_error(q, mag), q)
    return normalize(q)


@dataclass(frozen=True, kw_only=True)
class TiltCompass(Estimator):
    """Tilt from the accelerometer, heading from the magnetometer, no memory.

    Right at rest; wrong by the angle between specific force and the vertical when the body accelerates. Between
    samples the last value is held. Needs no gyroscope.

    References
    ----------
    M20 section 3.1, J14 (3)–(6).
    """

    name = "tilt-compass"
    needs = ("acc",)
    uses = ("acc", "mag")
    kernel = Kernel("tilt-compass", step, n_params=0, n_state=4, n_out=4, memoryless=True)

    def _parameters(self, frame: Frame) -> Sequence[float]:
        return ()
