"""How far a sample can be trusted: linear acceleration and magnetic disturbance as measurement noise."""

from __future__ import annotations

import math
from typing import Any

from northdown.kernels.jit import inline
from northdown.kernels.quaternion import Vector

LEARN = 1.0
"""Time (s) during which the field's reference is averaged without judging; judgement then comes in over as long."""

REJECTED = 4.6
"""Departure u from which a magnetometer sample keeps less than 1 % of its weight."""


@inline
def linear_acceleration(mean_square: float, force_n: Vector, g: float, dt: float, window: float) -> float:
    """Mean square (m²/s⁴) of linear acceleration after this sample: of f_n + g down, over about `window` seconds."""
    up = force_n[2] + g
    square = force_n[0] * force_n[0] + force_n[1] * force_n[1] + up * up
    return mean_square + (square - mean_square) * min(1.0, dt / window)


@inline
def field_departure(gates: Any, reference: Any, field_n: Vector, dt: float) -> Any:
    """Departure u of the field from its reference, and the reference (norm, dip, age) after this sample.

    u = (Δnorm / norm / gate₁)² + (Δdip / gate₂)², at most 60, and nothing in the first second. The reference is the
    mean of all samples so far, each with weight e⁻ᵘ, forgotten with the time constant `window`.
    """
    norm_gate, dip_gate, window = gates
    norm, dip, age = reference
    square = field_n[0] * field_n[0] + field_n[1] * field_n[1]
    n = math.sqrt(square + field_n[2] * field_n[2])
    a = math.atan2(field_n[2], math.sqrt(square))
    age += dt
    if norm == 0.0:
        return 0.0, (n, a, age)
    e, c = (n / norm - 1.0) / norm_gate, (a - dip) / dip_gate
    u = min(60.0, e * e + c * c) * min(1.0, max(0.0, age / LEARN - 1.0))
    k = math.exp(-u) * dt / min(age, window + dt)
    return u, (norm + k * (n - norm), dip + k * (a - dip), age)
