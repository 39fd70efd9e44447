r"""TRIAD: attitude from two directions, one of which is trusted fully.

With the trusted direction r₁ and the other r₂, in body (b) and navigation (n) axes,

.. math::

    t_1 = \hat r_1, \quad t_2 = \widehat{r_1 \times r_2}, \quad t_3 = t_1 \times t_2, \qquad
    R_{nb} = \sum_i t_{i,n}\, t_{i,b}^{\mathsf T}

With gravity trusted, the field's dip plays no part and the result is the tilt compass's. With the field trusted, its
dip must be known, and the error of the accelerometer goes into the rotation about the field instead of into tilt.

Source: H. D. Black, AIAA Journal 2(7), 1964, doi:10.2514/3.2555; K06 (3.9)–(3.15).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from northdown.estimators.base import Estimator, parameter
from northdown.frames import Frame
from northdown.kernels.jit import inline
from northdown.kernels.runner import Kernel
from northdown.kernels.wahba import has_heading, triad


@inline
def step(p: Any, s: Any, dt: float, gyr: Any, acc: Any, mag: Any) -> Any:
    """One sample: s = (w, x, y, z), p = (field trusted, north and down part of the field's direction)."""
    if not has_heading(acc, mag):
        return s
    up = (0.0, 0.0, -1.0)
    field = (p[1], 0.0, p[2])
    if p[0] != 0.0:
        return triad(mag, acc, field, up)
    return triad(acc, mag, up, field)


@dataclass(frozen=True, kw_only=True)
class Triad(Estimator):
    """TRIAD from accelerometer and magnetometer, no memory; holds its value while either is missing.

    Parameters
    ----------
    trusted : {"gravity", "field"}
        The direction that is met exactly. ``"field"`` suits a body that accelerates in an undisturbed field.
    dip : float
        Angle of the field below the horizontal, rad, −π/2 to π/2. Matters only when the field is trusted; raising it
        pitches the result about the east axis.

    References
    ----------
    H. D. Black, AIAA Journal 2(7), 1964.
    """

    name = "triad"
    needs = ("acc", "mag")
    uses = ("acc", "mag")
    kernel = Kernel("triad", step, n_params=3, n_state=4, n_out=4, memoryless=True)

    trusted: Literal["gravity", "field"] = "gravity"
    dip: float = parameter(1.1, unit="rad", low=-1.56, high=1.56)

    def _parameters(self, frame: Frame) -> Sequence[float]:
        return (float(self.trusted == "field"), math.cos(self.dip), math.sin(self.dip))
