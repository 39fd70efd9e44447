"""Where the numbers of VQF's parameters and state stand in their tuples."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from northdown._validation import FloatArray
from northdown.estimators._vqf_bias import rows_ned
from northdown.kernels.quaternion import rotate_inverse

# Parameters: half the natural frequency of a low-pass and when its first mean is full, for specific force, rest and
# field; time constants; switches; variances of the bias; squares of the thresholds of rest and of turning.
(
    ACC_OMEGA,
    ACC_FULL,
    REST_OMEGA,
    REST_FULL,
    MAG_OMEGA,
    MAG_FULL,
    TAU_MAG,
    TAU_REFERENCE,
    MOTION_BIAS,
    REST_BIAS,
    REJECTION,
    BIAS_START,
    BIAS_WALK,
    BIAS_CLIP,
    BIAS_MOTION,
    BIAS_VERTICAL,
    BIAS_REST,
    REST_TIME,
    REST_RATE,
    REST_FORCE,
    NORM,
    DIP,
    NEW_TIME,
    FIRST_TIME,
    NEW_RATE,
    UNDISTURBED,
    LONGEST,
    SLOWER,
) = range(28)
N_PARAMS: Final = 28

# Where the parts of the state begin, after the attitude.
BIAS: Final = 4
COVARIANCE: Final = 7
"""The upper triangle."""
FREE: Final = 13
LEVEL: Final = 17
TURN: Final = 21
GYR: Final = 23
"""count, age, gains (3), low-pass of the rate (9)."""
ACC: Final = 37
"""count, age, since, gains of specific force and rotation (3), of rest (3); low-passes: specific force in the free
frame (9), the rotation matrix (27), the bias' north and east (6), specific force in the body frame (9); time at rest,
whether at rest."""
MAG: Final = 99
"""count, age, since, gains of norm and dip (3), of heading, of the reference, least gain of heading; low-pass of norm
and dip (6); reference (2), candidate (2), candidate's age, time undisturbed, time rejected, whether disturbed."""
N_STATE: Final = 122

_GRAVITY = 9.80665


def steady_state(quat: FloatArray, bias_variance: float, rejected: float) -> FloatArray:
    """State for a known attitude (4,), body → NED: filters as after a long rest, no field seen yet.

    `rejected` is the time (s) for which the field counts as left out so far.
    """
    state = np.zeros(N_STATE)
    q = (quat[0], quat[1], quat[2], quat[3])
    state[:4] = state[FREE:LEVEL] = q
    state[LEVEL] = state[TURN] = 1.0
    state[COVARIANCE + np.array([0, 3, 5])] = bias_variance
    acc = state[ACC:MAG]
    acc[:2] = 1.0, math.inf
    up = np.array([0.0, 0.0, -_GRAVITY])
    low_passed = {9: up, 18: np.ravel(rows_ned(q)), 51: np.array(rotate_inverse(q, tuple(up)))}
    for first, values in low_passed.items():
        ends = first + 3 * len(values)
        acc[first:ends:3] = acc[first + 2 : ends : 3] = values
    state[-2:] = rejected, 1.0
    return state
