"""How far the field is from its reference, and how the reference follows it."""

from __future__ import annotations

from typing import Any, Final

from northdown.estimators._calibrating_layout import FIELD, MEAN_DEPARTURE, NEW_FIELD, STILL
from northdown.kernels.jit import inline
from northdown.kernels.weighting import REJECTED, departure

FIELD_LEARNT: Final = 1.0
"""Time (s) during which the field's reference is averaged without judging."""


@inline
def judge_field(p: Any, s: Any, h: float, z: float, age: float) -> float:
    """Departure u of an epoch's field (horizontal, down) from its reference, which then follows, as u's mean does."""
    s[FIELD + 2] += age
    learnt = s[FIELD + 2]
    u, gain = 0.0, min(1.0, age / learnt)
    if learnt > FIELD_LEARNT + 0.5 * age:  # between two epochs, so that rounding does not decide
        u = min(60.0, departure(p.norm_gate, p.dip_gate, s[FIELD], s[FIELD + 1], h, z))
        gain = min(1.0, age / min(learnt, p.field_window)) / (1.0 + u)
        if u > REJECTED and _is_new_field(p, s, h, z, age):
            s[FIELD], s[FIELD + 1], s[FIELD + 2] = s[NEW_FIELD], s[NEW_FIELD + 1], s[NEW_FIELD + 2]
            u = s[MEAN_DEPARTURE] = 0.0
        elif u <= REJECTED:
            s[NEW_FIELD + 2] = 0.0
    s[FIELD] += gain * (h - s[FIELD])
    s[FIELD + 1] += gain * (z - s[FIELD + 1])
    s[MEAN_DEPARTURE] = follow(p, s[MEAN_DEPARTURE], u, age)
    return u


@inline
def follow(p: Any, mean: float, u: float, age: float) -> float:
    """Mean departure over the last `gate_window` after one of u; 0 where there is no such window."""
    if p.gate_window > 0.0:
        mean += min(1.0, age / p.gate_window) * (u - mean)
    return mean


@inline
def _is_new_field(p: Any, s: Any, h: float, z: float, age: float) -> bool:
    """Whether a field unlike the reference has been steady for so long, in motion, that it must be that of the place.

    Motion is asked for because a magnet beside a body at rest is steady too.
    """
    if s[STILL] > 0.0:
        return False
    steady = s[NEW_FIELD + 2]
    if steady > 0.0 and departure(p.norm_gate, p.dip_gate, s[NEW_FIELD], s[NEW_FIELD + 1], h, z) < REJECTED:
        s[NEW_FIELD + 2] = steady + age
        gain = age / (steady + age)
        s[NEW_FIELD] += gain * (h - s[NEW_FIELD])
        s[NEW_FIELD + 1] += gain * (z - s[NEW_FIELD + 1])
    else:
        s[NEW_FIELD], s[NEW_FIELD + 1], s[NEW_FIELD + 2] = h, z, age
    return bool(s[NEW_FIELD + 2] > p.field_new)
