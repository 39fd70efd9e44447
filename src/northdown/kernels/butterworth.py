r"""Second-order Butterworth low-pass filter for steps of any length.

With the time constant τ the filter has the natural frequency ω = √2/τ, and its analogue form is

.. math::  \dot y = v, \qquad \dot v = \omega^2 (u - y) - \sqrt2\, \omega\, v

The bilinear transform is the trapezoidal rule on this, at a frequency bent so that the digital filter has its −3 dB
point at ω. With C = tan(ω Δt / 2) and V = v C / ω the step is

.. math::

    y^+ = y + s, \qquad V^+ = s - V, \qquad
    s = \frac{2 V + C^2 (u^- - y + u - y)}{1 + \sqrt2\, C + C^2}

For a constant step these are the samples of the direct form with the usual coefficients b and a. Unlike the
direct form, value y, slope V and last input u⁻ keep their meaning when the step changes: V is then to be
scaled by the ratio of the steps.

In its first τ seconds the filter gives the mean of what it has seen so far, and goes on from there at rest.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

from northdown.kernels.jit import inline

Gains: TypeAlias = tuple[float, float, float]
"""(step in s, C² / D, 2 / D) with D = 1 + √2 C + C²."""

# A step longer than 2.1 τ counts as that long: the tangent must stay below its pole.
_LONGEST = 1.5
# Relative change of the step below which the gains are kept. Times in seconds are rounded, and a tangent costs 20 ns.
SAME_STEP = 1e-6


@inline
def gains(old: Gains, dt: float, half_omega: float) -> tuple[Gains, float]:
    """Gains for a step (s), half_omega = ω/2, and the ratio of this step to the last; the old ones if it is the same.

    The step that the gains were made for is thus one that does not tremble with the rounding of times.
    """
    if math.fabs(dt - old[0]) <= SAME_STEP * dt:
        return old, 1.0
    c = math.tan(min(half_omega * dt, _LONGEST))
    k = 1.0 / (1.0 + c * (math.sqrt(2.0) + c))
    ratio = dt / old[0] if old[0] > 0.0 else 1.0
    return (dt, c * c * k, 2.0 * k), ratio


@inline
def channel(how: Any, f: Any, u: float) -> Any:
    """One channel's f = (y, V, u⁻) after the input u.

    how = (averaging, ratio of steps, C²/D, 2/D); while averaging, the third entry is one over the number of
    samples, this one included.
    """
    averaging, ratio, alpha, beta = how
    y, v, last = f
    if averaging:
        y += alpha * (u - y)
        return (y, 0.0, y)
    v *= ratio
    s = beta * v + alpha * ((last - y) + (u - y))
    return (y + s, s - v, u)


@inline
def vector(how: Any, f: Any, u: Any) -> Any:
    """Three channels, one after the other in f, and their three inputs."""
    return channel(how, f[0:3], u[0]) + channel(how, f[3:6], u[1]) + channel(how, f[6:9], u[2])
