r"""Acceleration that lasts, as of vehicles: how the calibrating filter sees it, and what it then leaves undone.

That velocity is zero on average levels the attitude, and tilts it where a body does travel. Two things tell:

- the velocity's innovation, which grows far beyond its variance: its mean square over `SURPRISE_WINDOW`, in units of
  that variance, exceeds `SURPRISING`, which no motion on the spot has done;
- specific force, averaged in navigation axes over `FORCE_WINDOW`, whose norm exceeds what is usual here by
  `acc_gate` and the change of force from epoch to epoch: horizontal acceleration a makes it √(g² + a²).

The first alone is not enough for long, as a wrong attitude has the same effect; but that leaves the norm alone, or
lowers it. So the first, in calm motion, begins a hold of `HOLD_UNSEEN`, and the second keeps it up; both together
begin one in lively motion too.

For acceleration the norm must be larger by at least `SHARE` of what horizontal force would then add to it. Where it
is by less than `FAR_LESS` of that, and force shows a tilt above `LOST_TILT`, the attitude is wrong (a glitch of the
gyroscope, a wrong start): it gets the variance of that tilt on all axes, and the bias as much as would have brought
it about in `LOST_WITHIN`. So it does after a hold for which no reason was seen.

In a hold, velocity becomes unknown in every epoch, so that nothing is learnt of tilt and the filter coasts on its
gyroscope; and for `TRAVEL_WINDOW` after it, velocity may change as that of a vehicle.

What is usual is a mean over `NORM_WINDOW` outside holds, of a badly calibrated accelerometer too. Should the norm
stay too large for `LONGEST_HOLD`, it is taken for the usual one. Rest is believed only where velocity agrees, as
smooth acceleration looks like rest to the scatter of the sensors.
"""

from __future__ import annotations

import math
from typing import Any, Final

from northdown.estimators._calibrating_layout import (
    COV,
    FORCE,
    FORCE_CHANGE,
    HELD,
    HOLD,
    LAST_FORCE,
    LOW_FORCE,
    MISSED,
    NORM,
    PATIENCE,
    SPEED,
    SURPRISE,
    TIME_ACC,
    TRAVEL,
    VELOCITY,
)
from northdown.kernels.jit import inline
from northdown.kernels.rows import WIDTH

SURPRISING: Final = 5.0
"""Mean square of the velocity's innovation, in units of its variance, that acceleration must have brought about."""
SURPRISE_WINDOW: Final = 2.0
"""Time constant (s) of that mean."""
FORCE_WINDOW: Final = 1.5
"""Time constant (s) of the mean specific force."""
NORM_WINDOW: Final = 60.0
"""Time constant (s) with which the usual norm follows."""
LEARNT: Final = 5.0
"""Time (s) from the start during which nothing is judged, and in which the usual norm follows at rest."""
HOLD_SEEN: Final = 3.0
"""Time (s) for which a hold goes on after the norm was last too large."""
HOLD_UNSEEN: Final = 5.0
"""Time (s) of a hold for which the norm gives no reason."""
BETWEEN_UNSEEN: Final = 30.0
"""Time (s) that must lie between two of those, in which a wrong attitude is put right."""
LIVELY: Final = 1.0
"""By how much of the change of force from epoch to epoch motion to and fro may raise the norm."""
SHARE: Final = 0.5
"""Part of the excess that horizontal force would give the norm that must be seen: tilt gives none."""
FAR_LESS: Final = 0.1
"""Part below which it must be tilt."""
LOST_TILT: Final = 0.15
"""Tilt (rad) that horizontal force must show for the attitude to be wrong, and not the accelerometer; beside twice
what motion to and fro may raise the norm by."""
LOST_WITHIN: Final = 10.0
"""Time (s) in which a wrong bias would have brought about a wrong attitude."""
CALM: Final = 0.3
"""Change (m/s²) of force from epoch to epoch above which velocity alone is no reason for a hold."""
LONGEST_HOLD: Final = 180.0
"""Time (s) of holds, less that between them, after which the norm of the moment is taken for the usual one."""
UNKNOWN_SPEED: Final = 1e4
"""Variance (m/s)² that velocity gets in every epoch of a hold."""
TRAVEL_WINDOW: Final = 60.0
"""Time constant (s) with which a vehicle is forgotten."""
EXPECTED: Final = 0.8
"""Part by which `SURPRISING` is less for a vehicle, as its velocity follows more readily."""
TRAVEL_NOISE: Final = 0.09
"""Spectral density of a vehicle's acceleration beside holds, (m/s²)²/Hz."""
REST_SPEED_GATE: Final = 10.0
"""Sigmas by which velocity may miss that of rest."""
REST_FORCE: Final = 0.3
"""Acceleration (m/s²) with which a body in a hold may be at rest."""


@inline
def watch_acceleration(p: Any, s: Any, time: float, variance: float, still: bool) -> None:
    """Begin, keep up or end a hold, from an epoch's force and velocity, measured with a variance."""
    learnt = s[NORM + 1]
    gain = min(1.0, time / min(FORCE_WINDOW, learnt + time))
    square = changes = 0.0
    for a in range(3):
        force = s[FORCE + a] / s[TIME_ACC]
        change = force - s[LAST_FORCE + a]
        s[LAST_FORCE + a] = force
        s[LOW_FORCE + a] += gain * (force - s[LOW_FORCE + a])
        changes += change * change
        square += s[LOW_FORCE + a] * s[LOW_FORCE + a]
    s[FORCE_CHANGE] += gain * (changes - s[FORCE_CHANGE]) if learnt > 0.0 else 0.0
    more = math.sqrt(square) - s[NORM]
    if s[HOLD] == 0.0 or s[HELD] > LONGEST_HOLD:
        window = LEARNT if still or s[HELD] > LONGEST_HOLD else NORM_WINDOW
        s[NORM] += min(1.0, time / min(window, learnt + time)) * more
    s[HELD] = max(0.0, s[HELD] - time) if s[HOLD] == 0.0 else s[HELD] + time
    s[NORM + 1] = learnt + time
    s[TRAVEL] *= 1.0 - min(1.0, time / TRAVEL_WINDOW)
    s[PATIENCE] = max(0.0, s[PATIENCE] - time)
    if still:
        s[TRAVEL] = s[HOLD] = s[SURPRISE] = s[HELD] = 0.0
        return
    lively = LIVELY * math.sqrt(s[FORCE_CHANGE])
    across = s[LOW_FORCE] * s[LOW_FORCE] + s[LOW_FORCE + 1] * s[LOW_FORCE + 1]
    excess = math.sqrt(s[NORM] * s[NORM] + across) - s[NORM]
    tilted = across > (LOST_TILT * s[NORM] + 2.0 * lively) ** 2 and learnt > LEARNT
    if tilted and excess > p.acc_gate + lively and more < FAR_LESS * excess:
        _lose(s, across)
        return
    implied = SHARE * excess
    if s[HOLD] > 0.0:
        s[HOLD] -= time
        if more > max(0.5 * p.acc_gate + lively, implied):
            s[HOLD] = max(s[HOLD], HOLD_SEEN)
            s[TRAVEL] = 1.0
            s[PATIENCE] = 0.0
        if s[HOLD] <= 0.0:
            s[HOLD] = s[SURPRISE] = 0.0
            if s[PATIENCE] > 0.0:
                _lose(s, across)
        return
    now = _speed_in_sigmas(s, variance)
    s[SURPRISE] += min(1.0, time / SURPRISE_WINDOW) * (now - s[SURPRISE])
    if not learnt > LEARNT:
        return
    surprising = s[SURPRISE] > SURPRISING * (1.0 - EXPECTED * s[TRAVEL])
    if surprising and more > max(p.acc_gate + lively, implied):
        s[TRAVEL] = 1.0
        s[HOLD] = HOLD_SEEN
    elif surprising and s[PATIENCE] == 0.0 and more > implied - p.acc_gate and s[FORCE_CHANGE] < CALM * CALM:
        s[HOLD] = HOLD_UNSEEN
        s[PATIENCE] = BETWEEN_UNSEEN
    elif surprising and tilted:
        _lose(s, across)


@inline
def _lose(s: Any, across: float) -> None:
    """Take the attitude for wrong by the tilt that horizontal force shows; the body does not travel then."""
    s[MISSED] = across / (s[NORM] * s[NORM])
    s[HOLD] = s[TRAVEL] = s[SURPRISE] = 0.0
    # so that it takes some time to judge again
    s[LOW_FORCE], s[LOW_FORCE + 1], s[LOW_FORCE + 2] = 0.0, 0.0, -s[NORM]


@inline
def coasted(s: Any, time: float) -> float:
    """What the variance of velocity grows by in an epoch, for a body that travels."""
    more: float = TRAVEL_NOISE * s[TRAVEL] * time
    return more + UNKNOWN_SPEED if s[HOLD] > 0.0 else more


@inline
def speed_is_of_rest(p: Any, s: Any) -> bool:
    """Whether velocity, or in a hold acceleration, agrees with a body at rest."""
    if s[HOLD] > 0.0:
        up = s[LOW_FORCE + 2] + p.gravity
        square = s[LOW_FORCE] * s[LOW_FORCE] + s[LOW_FORCE + 1] * s[LOW_FORCE + 1] + up * up
        return bool(square < REST_FORCE * REST_FORCE)
    if not s[TIME_ACC] > 0.0:
        return True
    return bool(_speed_in_sigmas(s, p.rest_speed / s[TIME_ACC]) < REST_SPEED_GATE * REST_SPEED_GATE)


@inline
def _speed_in_sigmas(s: Any, variance: float) -> float:
    """Mean square of the velocity, axis by axis in units of the variance that it has when measured."""
    total = 0.0
    for a in range(3):
        v = s[SPEED + a]
        total += v * v / (s[COV + (VELOCITY + a) * (WIDTH + 1)] + variance)
    return total / 3.0
