"""How far a sample can be trusted: linear acceleration and magnetic disturbance as measurement noise."""

from __future__ import annotations

import math
from typing import Any

from northdown.kernels.jit import inline
from northdown.kernels.quaternion import Vector

LEARN = 1.0
"""Time (s) during which the field's reference is averaged without judging; judgement then comes in over as long."""

ACCELERATING = 9.0
"""Noise of linear acceleration, in units of the accelerometer's own variance, that leaves a tenth of its weight."""

REJECTED = 4.6
"""Departure u from which a magnetometer sample keeps less than 1 % of its weight."""


@inline
def linear_acceleration(mean_square: float, force_n: Vector, g: float, dt: float, window: float) -> float:
    """Mean square (m²/s⁴) of linear acceleration after this sample: of f_n + g down, over about `window` seconds."""
    up = force_n[2] + g
    square = force_n[0] * force_n[0] + force_n[1] * force_n[1] + up * up
    return mean_square + (square - mean_square) * min(1.0, dt / window)


@inline
def departure(norm_gate: float, dip_gate: float, horizontal: float, down: float, h: float, z: float) -> float:
    """Departure u of the field (h, z) from its reference (horizontal, down).

    Of the difference, relative to the reference's size, the part along the reference is the departure of the norm,
    the part across it that of the dip: u = (along / gate₁)² + (across / gate₂)².
    """
    k = 1.0 / (horizontal * horizontal + down * down)
    e = (k * (h * horizontal + z * down) - 1.0) * (1.0 / norm_gate)
    c = k * (z * horizontal - h * down) * (1.0 / dip_gate)
    return e * e + c * c


@inline
def field_departure(gates: Any, reference: Any, field_n: Vector, dt: float) -> Any:
    """Departure u of the field from its reference, eᵘ, and the reference (horizontal, down, age) after this sample.

    A heading's variance grows by eᵘ.

    u is that of `departure`, at most 60, and nothing in the first second. The reference is the mean of all samples so
    far, each with weight e⁻ᵘ, forgotten with the time constant `window`.
    """
    norm_gate, dip_gate, window = gates
    horizontal, down, age = reference
    h, z = math.sqrt(field_n[0] * field_n[0] + field_n[1] * field_n[1]), field_n[2]
    age += dt
    square = horizontal * horizontal + down * down
    if square == 0.0:
        return 0.0, 1.0, (h, z, age)
    u = min(60.0, departure(norm_gate, dip_gate, horizontal, down, h, z)) * min(1.0, max(0.0, age / LEARN - 1.0))
    factor = math.exp(u)
    k = dt / (factor * min(age, window + dt))
    return u, factor, (horizontal + k * (h - horizontal), down + k * (z - down), age)


@inline
def field_direction(reference: Any) -> Any:
    """North and down part of the reference's direction: cosine and sine of its dip."""
    k = 1.0 / math.sqrt(reference[0] * reference[0] + reference[1] * reference[1])
    return k * reference[0], k * reference[1]
