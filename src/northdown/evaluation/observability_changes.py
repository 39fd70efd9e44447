"""Changes of a state in terms that do not depend on how the state is written, and how they move along a motion.

Whatever the states are, a small change of them is also one of the quaternion's length, of the attitude as a rotation
δ about north, east and down, of bias and rate in these axes, and of the field.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from northdown._validation import FloatArray
from northdown.errors import InputError, expected
from northdown.evaluation.observability_equations import directions, euler_angles
from northdown.evaluation.observability_models import Model
from northdown.simulation import _quaternions as quaternions
from northdown.simulation.motion import Motion

_NODES: Final = 6
_MOST_PIECES: Final = 1000
# Bounds the memory.
_EVALUATIONS: Final = 100_000


class Changes:
    """From states to changes in north, east and down.

    Parameters
    ----------
    model : Model
        Whose states they are.
    quat : (4, N) array
        Attitudes w, x, y, z, body to NED.

    Attributes
    ----------
    mats : (N, 3, 3) array
        Body to NED.
    places : dict of str to slice
        Where each kind of change stands: length, attitude, gyr_bias, rate, field, dip; those that the model has.
    maps : (N, n, n) array
        Matrices from changes of the states to these.
    """

    def __init__(self, model: Model, quat: FloatArray) -> None:
        self.mats = np.ascontiguousarray(np.stack([np.stack(d) for d in directions(quat)]).transpose(2, 0, 1))
        n, count = len(model.state_names), quat.shape[1]
        self.maps = np.zeros((count, n, n))
        self.places: dict[str, slice] = {}
        first = self._attitude(model, quat)
        for name in model.unknown:
            size = 3 if name in ("gyr_bias", "rate") else (2 if name == "field" else 1)
            place = slice(first, first + size)
            self.places[name] = place
            self.maps[:, place, place] = self.mats if size == 3 else np.eye(size)
            first += size

    def _attitude(self, model: Model, quat: FloatArray) -> int:
        if model.state == "tangent":
            self.places["attitude"] = slice(0, 3)
            self.maps[:, :3, :3] = np.eye(3)
            return 3
        if model.state == "euler":
            self.places["attitude"] = slice(0, 3)
            self.maps[:, :3, :3] = self.mats @ _turns_of_angles(quat)
            return 3
        # δq = ½ (0, δ) ⊗ q, and a multiple of q
        self.places["length"], self.places["attitude"] = slice(0, 1), slice(1, 4)
        inverse = quaternions.conjugate(quat)
        for j, unit in enumerate(np.eye(4)):
            product = quaternions.multiply(unit[:, None], inverse)
            self.maps[:, 0, j] = product[0]
            self.maps[:, 1:4, j] = 2.0 * product[1:].T
        return 4


def _turns_of_angles(quat: FloatArray) -> FloatArray:
    """Matrices (N, 3, 3) from changes of roll, pitch, yaw to a rotation in body axes (K06 (2.8))."""
    roll, pitch, _ = euler_angles(quat)
    nothing, one = np.zeros_like(roll), np.ones_like(roll)
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    rows = [[one, nothing, -sp], [nothing, cr, cp * sr], [nothing, -sr, cp * cr]]
    return np.ascontiguousarray(np.stack([np.stack(row) for row in rows]).transpose(2, 0, 1))


def transitions(model: Model, changes: Changes, motion: Motion, time: FloatArray) -> FloatArray:
    """What changes at the first of given times have become at each of them, (N, n, n).

    Parameters
    ----------
    model : Model
        States and equations.
    changes : Changes
        Of the model at these times.
    motion : Motion
        What the body does.
    time : (N,) array
        Increasing, s.

    Notes
    -----
    A bias b, constant in the body, turns the attitude by δ(t) = δ(0) − ∫ R b dt; a change of the rate likewise with
    the other sign, as the angular acceleration is known. With 1/‖q‖ in q̇, a longer quaternion turns more slowly.
    """
    count, n = changes.maps.shape[:2]
    found = np.broadcast_to(np.eye(n), (count, n, n)).copy()
    attitude = changes.places["attitude"]
    back = changes.mats[0].T
    for name in ("gyr_bias", "rate"):
        if name in changes.places:
            place = changes.places[name]
            found[:, place, place] = changes.mats @ back
    mats, turns = _integrals(motion, time)
    if "rate" in changes.places:
        found[:, attitude, changes.places["rate"]] = mats @ back
    elif "gyr_bias" in changes.places:
        found[:, attitude, changes.places["gyr_bias"]] = -mats @ back
    if "length" in changes.places and model.variant in ("printed-rate", "printed"):
        found[:, attitude, changes.places["length"]] = -turns[:, :, None]
    return found


def _integrals(motion: Motion, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """∫ R dt (N, 3, 3) and ∫ R ω dt (N, 3) from the first time on, by Gauss's rule between neighbouring times."""
    step = np.diff(time)
    # as many pieces as radians, by the fastest of the known rates: the rule's error is then some 1e-13
    fastest = float(np.linalg.norm(motion.at(time).rate, axis=1).max())
    pieces = max(1, int(np.ceil(fastest * float(step.max(initial=0.0)))))
    if pieces > _MOST_PIECES:
        got = f"{float(step.max()):g} s between two, in which it turns by some {pieces} rad"
        raise InputError(expected("times close enough to follow the motion", got, do="give more times"))
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    places = ((np.arange(pieces)[:, None] + 0.5 * (1.0 + nodes)) / pieces).ravel()
    shares = np.tile(0.5 * weights / pieces, pieces)
    moved, swept = np.zeros((len(time), 3, 3)), np.zeros((len(time), 3))
    at_once = max(1, _EVALUATIONS // len(places))
    for part in (slice(k, min(k + at_once, len(step))) for k in range(0, len(step), at_once)):
        state = motion.at((time[:-1][part, None] + step[part, None] * places).ravel())
        mats = np.stack([np.stack(d) for d in directions(np.ascontiguousarray(state.quat.T))]).transpose(2, 0, 1)
        turned = np.einsum("nij,nj->ni", mats, state.rate)
        share = step[part, None] * shares
        moved[1:][part] = np.einsum("nk,nkij->nij", share, mats.reshape(*share.shape, 3, 3))
        swept[1:][part] = np.einsum("nk,nki->ni", share, turned.reshape(*share.shape, 3))
    return np.cumsum(moved, axis=0), np.cumsum(swept, axis=0)
