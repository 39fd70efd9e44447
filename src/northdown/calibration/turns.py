"""Scale and alignment of a gyroscope from turns between rests.

Before and after a turn the accelerometer shows where up is. The gyroscope, integrated over the turn, says where it
should be afterwards: u₁ = Rᵀu₀ with Ṙ = R [M(r − b)×]. Matching the two over many turns fixes the nine elements of M
(scale, cross-axis sensitivity, alignment to the accelerometer), except for turns about the vertical, which move
nothing: the axes must change.

M is found by Gauss–Newton. A change δM turns the predicted direction by Rᵀ(u₀ × ∫R δM (r − b) dt), which
`northdown.kernels.turn` integrates. The noise of a residual is that of both rests' directions, and of the
gyroscope and its bias over the turn. Turns that share a rest share its noise, so residuals are whitened together.

Sources: W. T. Fong, S. K. Ong, A. Y. C. Nee, Meas. Sci. Technol. 19, 2008, 085202 (gyroscope matched to
accelerometer); D. Tedaldi, A. Pretto, E. Menegatti, ICRA 2014 (procedure of turns between rests).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from northdown._validation import BoolArray, FloatArray
from northdown.calibration._inputs import axis_words
from northdown.calibration._known_noise import ignored, known_noise
from northdown.calibration._solve import Model, Solution
from northdown.calibration._turn_data import Turns, gather_turns
from northdown.calibration.rest import Rest
from northdown.errors import expected
from northdown.recording import Recording

# Turns whose noises are treated together; between such parts the shared rest's noise counts twice.
_TOGETHER: Final = 60
# Largest root mean square error after the fit (rad) that still is a fit.
_WORST: Final = math.radians(5.0)
_FULL: Final = tuple(range(9))
_SCALE: Final = (0, 4, 8)
# Cross-axis sensitivity (1-σ) that a sensor may have which only scale is corrected for.
_USUAL_CROSS: Final = 0.01
_HOW: Final = (
    "between rests of 2 s or more, turn the sensor by 90° or more about each of its axes in both senses, with the "
    "axis held level"
)


@dataclass(frozen=True, eq=False)
class TurnFit:
    """Scale and alignment found from turns; errors in rad."""

    model: str
    matrix: FloatArray
    sigma: FloatArray
    before: float
    after: float
    turns: int
    used: float
    condition: float
    notes: tuple[str, ...]


def fit_turns(rested: Sequence[tuple[Recording, tuple[Rest, ...]]], *, tolerance: float) -> TurnFit | str:
    """Fit scale and alignment to the turns between rests, or say why that is not possible.

    Parameters
    ----------
    rested : sequence of (Recording, tuple of Rest)
        Recordings with their rests.
    tolerance : float
        Largest 1-σ of the matrix's elements that is accepted.
    """
    turns = gather_turns(rested)
    if turns is None or len(turns) < 3:
        return expected("three turns between rests, or more", f"{0 if turns is None else len(turns)}", do=_HOW)
    reason = ""
    for name, free, usual in ((", scale and alignment", _FULL, 0.0), (" and scale", _SCALE, _USUAL_CROSS)):
        if 2 * len(turns) < len(free) + 3:
            reason = expected("more turns between rests", f"{len(turns)}", do=_HOW)
            continue
        solution, kept = _fit(turns, free)
        before, after = _errors(turns.part(kept), np.eye(3)), _errors(turns.part(kept), _matrix(free, solution.x))
        if not after < _WORST:
            got = f"turns that differ by {math.degrees(after):.1f}°"
            return expected("a gyroscope that turns as the accelerometer does", got, do="check its unit and axes")
        if usual and np.isfinite(solution.covariance).all():
            every, _, _ = _whitened(turns.part(kept), _matrix(free, solution.x))
            rest = [k for k in _FULL if k not in free]
            extra = ignored(every[:, list(free)], every[:, rest], np.ones(len(every)), usual)
            solution = replace(solution, covariance=solution.covariance + extra)
        worst = float(solution.sigma.max())
        if worst <= tolerance:
            notes = _notes(turns, kept, solution, reason)
            sigma = np.zeros(9)
            sigma[list(free)] = solution.sigma
            return TurnFit(
                name,
                _matrix(free, solution.x),
                sigma.reshape(3, 3),
                before,
                after,
                len(turns),
                float(kept.mean()),
                solution.condition,
                notes,
            )
        reason = _why_not(solution, free)
    return reason


def _why_not(solution: Solution, free: tuple[int, ...]) -> str:
    if np.isfinite(solution.covariance).all():
        # input axes of the gyroscope, by how uncertain their column of M is
        variance = np.zeros(9)
        variance[list(free)] = solution.sigma**2
        direction = np.zeros(3)
        direction[int(np.argmax(variance.reshape(3, 3).sum(axis=0)))] = 1.0
        got = f"turns that leave axis {axis_words(direction)} uncertain to {100.0 * solution.sigma.max():.1f} % (1-σ)"
    else:
        got = "turns that leave axes undetermined"
    return expected("turns about all axes", got, do=_HOW)


def _notes(turns: Turns, kept: BoolArray, solution: Solution, reason: str) -> tuple[str, ...]:
    notes = [f"{len(turns)} turns"]
    if turns.skipped:
        notes.append(f"{turns.skipped} turns were passed over: clipped, too long, or with missing samples")
    if reason:
        notes.append("only scale was found: the turns do not fix the alignment; turn about more axes")
    if not kept.all():
        notes.append(f"{int((~kept).sum())} turns were left out, as they contradict the others")
    if solution.scale > 1.0:
        notes.append(
            f"the turns differ {solution.scale:.1f} times more than the noise explains (is the accelerometer "
            "calibrated?); the σ were enlarged"
        )
    return tuple(notes)


def _matrix(free: tuple[int, ...], x: FloatArray) -> FloatArray:
    mat = np.eye(3).ravel()
    mat[list(free)] = x
    return mat.reshape(3, 3)


def _fit(turns: Turns, free: tuple[int, ...]) -> tuple[Solution, BoolArray]:
    """Fit, leaving out the few turns that contradict the others."""
    kept: BoolArray = np.ones(len(turns), dtype=np.bool_)
    most_out = int(0.2 * len(turns))
    x = np.eye(3).ravel()[list(free)]
    while True:
        part = turns.part(kept)
        solution = known_noise(_model(part, free), x, may_leave_out=False)
        if solution.scale == 1.0 or int((~kept).sum()) >= most_out or 2 * int(kept.sum()) < len(free) + 5:
            return solution, kept
        residual, sigma = _residual(part, _matrix(free, solution.x))
        size = np.linalg.norm(residual, axis=1) / sigma
        worst = int(np.argmax(size))
        if size[worst] <= 5.0 * max(1.0, float(np.median(size))):
            return solution, kept
        kept = kept.copy()
        kept[np.flatnonzero(kept)[worst]] = False


def _residual(turns: Turns, mat: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Difference (T, 3) of predicted and measured directions, and its σ (T,) for each axis."""
    rotation, _ = turns.integrate(mat)
    predicted = np.einsum("tji,tj->ti", rotation, turns.before)
    variance = turns.own_variance + turns.rest_variance[turns.rest].sum(axis=1)
    sigma: FloatArray = np.sqrt(variance)
    return predicted - turns.after, sigma


def turn_errors(rested: Sequence[tuple[Recording, tuple[Rest, ...]]], mat: FloatArray) -> FloatArray:
    """Angle (T,) in rad between predicted and measured direction of gravity after each turn, for one matrix."""
    turns = gather_turns(rested)
    if turns is None:
        return np.empty(0)
    size: FloatArray = np.linalg.norm(_residual(turns, mat)[0], axis=1)
    return size


def _errors(turns: Turns, mat: FloatArray) -> float:
    """Root mean square angle (rad) between predicted and measured directions."""
    residual, _ = _residual(turns, mat)
    return float(np.sqrt((residual**2).sum(axis=1).mean()))


def _model(turns: Turns, free: tuple[int, ...]) -> Model:
    # the noise hardly depends on M: its correlation is taken as at the start
    lowers = _lowers(turns, np.eye(3))

    def model(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        jacobian, residual, _ = _whitened(turns, _matrix(free, x), lowers)
        return residual, jacobian[:, list(free)]

    return model


def _tangents(direction: FloatArray) -> FloatArray:
    """Two unit vectors (T, 2, 3) perpendicular to each direction (T, 3)."""
    helper = np.eye(3)[np.argmin(np.abs(direction), axis=1)]
    first = np.cross(direction, helper)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(direction, first)], axis=1)


def _lowers(turns: Turns, mat: FloatArray) -> list[tuple[slice, FloatArray]]:
    """Cholesky factors of the covariance of residuals, for parts of the turns."""
    rotation, _ = turns.integrate(mat)
    at_start, at_end = _tangents(turns.before), _tangents(turns.after)
    # noise of the direction before, as seen after the turn
    carried = np.einsum("tai,tji,tbj->tab", at_end, rotation, at_start)
    lowers = []
    for first in range(0, len(turns), _TOGETHER):
        chosen = slice(first, min(first + _TOGETHER, len(turns)))
        rest, n = turns.rest[chosen], chosen.stop - chosen.start
        covariance = np.kron(np.diag(turns.own_variance[chosen]), np.eye(2))
        for i in range(n):
            here = slice(2 * i, 2 * i + 2)
            covariance[here, here] += turns.rest_variance[rest[i, 1]] * np.eye(2)
            covariance[here, here] += turns.rest_variance[rest[i, 0]] * carried[first + i] @ carried[first + i].T
            if i + 1 < n and rest[i, 1] == rest[i + 1, 0]:
                following = slice(2 * i + 2, 2 * i + 4)
                # −e in the one residual and carried·e in the next; the tangents after i and before i + 1 agree
                block = -turns.rest_variance[rest[i, 1]] * carried[first + i + 1]
                covariance[following, here] += block
                covariance[here, following] += block.T
        lowers.append((chosen, np.linalg.cholesky(covariance)))
    return lowers


def _whitened(
    turns: Turns, mat: FloatArray, lowers: list[tuple[slice, FloatArray]] | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Whitened derivatives (2T, 9) and residuals (2T,), and the rotations."""
    rotation, derivative = turns.integrate(mat)
    at_end = _tangents(turns.after)
    predicted = np.einsum("tji,tj->ti", rotation, turns.before)
    residual = np.einsum("tai,ti->ta", at_end, predicted - turns.after)
    # Rᵀ(u × φ) = −(Rᵀφ) × (Rᵀu), for each element of M
    turned = np.einsum("tai,tajk->tijk", rotation, derivative).reshape(len(turns), 3, 9)
    moved = np.cross(predicted[:, :, None], turned, axis=1)
    jacobian = np.einsum("tai,tip->tap", at_end, moved)
    white_j, white_r = np.empty((2 * len(turns), 9)), np.empty(2 * len(turns))
    for chosen, lower in lowers or _lowers(turns, mat):
        rows = slice(2 * chosen.start, 2 * chosen.stop)
        white_j[rows] = np.linalg.solve(lower, jacobian[chosen].reshape(-1, 9))
        white_r[rows] = np.linalg.solve(lower, residual[chosen].ravel())
    return white_j, white_r, rotation
