"""Steps of quaternion kinematics, q̇ = ½ q ⊗ (0, ω), with the rate held constant over a step.

========== =============================================== =======================================
code       name                                            source
========== =============================================== =======================================
0          first-order, then normalised                    M20 5.4, W section 4
1          first-order of q̇ = (1/2‖q‖) q ⊗ (0, ω)          K06 (2.16); not renormalised
2          fourth-order Runge–Kutta, then normalised       textbook
3          closed form, q ⊗ exp(ω Δt)                      exact for constant ω
========== =============================================== =======================================

M20: fusion tutorial of 2020; W: Wang, note on quaternions; K06: Kao, thesis, NCTU 2006.
"""

from __future__ import annotations

import math
from typing import Final

from northdown.kernels.jit import inline
from northdown.kernels.quaternion import Quaternion, Vector, multiply, normalize
from northdown.kernels.so3 import exp

FIRST_ORDER = 0.0
NORMALIZED_RATE = 1.0
RK4 = 2.0
CLOSED_FORM = 3.0

INTEGRATORS: Final = ("first-order", "normalized-rate", "rk4", "closed-form")
"""Names of the integrators; the position is the code."""


def code(integrator: str) -> float:
    """Code of an integrator's name, as kernels take it."""
    return float(INTEGRATORS.index(integrator))


@inline
def first_order(q: Quaternion, w: Vector, dt: float) -> Quaternion:
    """Euler step q + Δt ½ q ⊗ (0, ω), without normalisation."""
    h = 0.5 * dt
    return (
        q[0] - h * (q[1] * w[0] + q[2] * w[1] + q[3] * w[2]),
        q[1] + h * (q[0] * w[0] + q[2] * w[2] - q[3] * w[1]),
        q[2] + h * (q[0] * w[1] - q[1] * w[2] + q[3] * w[0]),
        q[3] + h * (q[0] * w[2] + q[1] * w[1] - q[2] * w[0]),
    )


@inline
def normalized_rate(q: Quaternion, w: Vector, dt: float) -> Quaternion:
    """Euler step of K06 (2.16): the rate matrix divided by 2‖q‖.

    The norm grows by Δt²ω²/(8‖q‖²)·‖q‖ a step instead of being restored, and the division keeps that growth
    from feeding on itself.
    """
    norm = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return first_order(q, w, dt / norm)


@inline
def rk4(q: Quaternion, w: Vector, dt: float) -> Quaternion:
    """Fourth-order Runge–Kutta step for constant ω, without normalisation.

    With constant ω the four stages sum to the exponential's series to fourth order in ½ω Δt, which is what is
    evaluated: q ⊗ (1 − s/2 + s²/24, (1 − s/6) ½ω Δt), s = ‖½ω Δt‖².
    """
    h = 0.5 * dt
    s = h * h * (w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    k = h * (1.0 - s * (1.0 / 6.0))
    return multiply(q, (1.0 - s * (0.5 - s * (1.0 / 24.0)), k * w[0], k * w[1], k * w[2]))


@inline
def closed_form(q: Quaternion, w: Vector, dt: float) -> Quaternion:
    """Exact step for constant ω: q ⊗ exp(ω Δt)."""
    return multiply(q, exp((w[0] * dt, w[1] * dt, w[2] * dt)))


@inline
def step(integrator: float, q: Quaternion, w: Vector, dt: float) -> Quaternion:
    """Step with the integrator of that code, normalised except for K06's form."""
    if integrator == FIRST_ORDER:
        return normalize(first_order(q, w, dt))
    if integrator == CLOSED_FORM:
        return normalize(closed_form(q, w, dt))
    if integrator == RK4:
        return normalize(rk4(q, w, dt))
    return normalized_rate(q, w, dt)
