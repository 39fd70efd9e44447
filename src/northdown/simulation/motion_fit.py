"""The smooth spline closest to given attitudes, or through them, by Newton's method.

Turning each control attitude c_j by a small δ_j in NED turns the spline's attitude R(t) by

    E = Σ_j (B_j − B_{j+1}) δ_j,   B_j = P_{j−1} J(λ_j d_j) λ_j J⁻¹(d_j) c_{j−1}ᵀ,

with P_j the product of the spline's factors up to j, B = 1 for the first of them and 0 after the last, and J the left
Jacobian of the exponential map.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from northdown._validation import FloatArray
from northdown.errors import InputError, expected
from northdown.simulation import _quaternions as quaternions
from northdown.simulation.motion_spline import DEGREE, SplineTurning, basis, find_intervals

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix

# rad; a few times the rounding of the products that make one attitude
_CONVERGED = 1e-13
_ROUNDS = 40
# rad; longer steps than this leave the region where the linear problem says much
_LONGEST = 1.0


def fit_turning(time: FloatArray, quat: FloatArray, knots: FloatArray) -> SplineTurning:
    """Fit a cumulative B-spline of degree five to attitudes.

    Parameters
    ----------
    time : (N,) array
        Increasing, s, within the domain of the spline.
    quat : (4, N) array
        Attitudes w, x, y, z.
    knots : array
        Of the spline, its ends repeated six times. With N + 6 of them it passes through all attitudes, with fewer it
        is the least squares fit.

    Raises
    ------
    InputError
        When the search does not settle, as for neighbouring attitudes about half a turn apart.
    """
    # each control attitude acts most around the mean of its inner knots (Greville's abscissa)
    centres = np.convolve(knots[1:-1], np.full(DEGREE, 1.0 / DEGREE), mode="valid")
    controls = quat[:, np.searchsorted(0.5 * (time[1:] + time[:-1]), centres)]
    change = np.inf
    for _ in range(_ROUNDS):
        spline = _through(knots, controls)
        error = quaternions.log(quaternions.multiply(quat, quaternions.conjugate(spline.quat(time))))
        step = _newton_step(spline, time, error)
        before, change = change, float(np.abs(step).max())
        controls = quaternions.multiply(quaternions.exp(step * min(1.0, _LONGEST / max(change, 1e-300))), controls)
        if change < _CONVERGED or (change < 1e-10 and change > 0.1 * before):
            return _through(knots, controls)
    raise InputError(
        expected(
            "attitudes that a smooth curve can follow",
            f"turns of up to {_largest_turn(quat):.0f}° from one to the next",
            do="give more attitudes between them",
        )
    )


def _newton_step(spline: SplineTurning, time: FloatArray, error: FloatArray) -> FloatArray:
    """Turns δ (3, n) of the control attitudes that make the errors (3, N) smallest, to first order."""
    from scipy.sparse.linalg import spsolve

    matrix = _sensitivity(spline, time)
    right = np.ascontiguousarray(error.T).ravel()
    if matrix.shape[0] != matrix.shape[1]:
        matrix, right = (matrix.T @ matrix).tocsc(), matrix.T @ right
    solution: FloatArray = np.asarray(spsolve(matrix, right)).reshape(-1, 3)
    return np.ascontiguousarray(solution.T)


def _sensitivity(spline: SplineTurning, time: FloatArray) -> csc_matrix:
    """Matrix (3N, 3n) from turns of the control attitudes to turns of the spline at given times."""
    from scipy.sparse import csc_matrix

    p, n = spline.degree, len(time)
    i = find_intervals(spline.knots, p, time)
    blend = np.cumsum(basis(spline.knots, p, time, i)[:0:-1], axis=0)[::-1]
    control_mats = _matrices(spline.controls)
    product = spline.controls[:, i - p]
    before: FloatArray = np.broadcast_to(np.eye(3), (n, 3, 3))
    row = 3 * np.arange(n)[:, None, None] + np.arange(3)[None, :, None]
    rows, columns, values = [], [], []
    for k in range(p + 1):
        after = np.zeros((n, 3, 3))
        if k < p:
            d = spline.increments[:, i - p + k]
            turned = _jacobian(blend[k] * d) @ _inverse_jacobian(d)
            after = _matrices(product) @ (blend[k][:, None, None] * turned)
            after = after @ control_mats[i - p + k].transpose(0, 2, 1)
            product = quaternions.multiply(product, quaternions.exp(blend[k] * d))
        column = 3 * (i - p + k)[:, None, None] + np.arange(3)[None, None, :]
        rows.append(np.broadcast_to(row, (n, 3, 3)).ravel())
        columns.append(np.broadcast_to(column, (n, 3, 3)).ravel())
        values.append((before - after).ravel())
        before = after
    shape = 3 * n, 3 * spline.controls.shape[1]
    return csc_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape)


def _through(knots: FloatArray, controls: FloatArray) -> SplineTurning:
    steps = quaternions.log(quaternions.multiply(quaternions.conjugate(controls[:, :-1]), controls[:, 1:]))
    return SplineTurning(knots, controls[:, :1], steps, rests=False)


def _matrices(q: FloatArray) -> FloatArray:
    """Rotation matrices (N, 3, 3)."""
    columns = [quaternions.rotate(q, np.repeat(axis[:, None], q.shape[1], axis=1)) for axis in np.eye(3)]
    return np.ascontiguousarray(np.stack(columns, axis=1).transpose(2, 0, 1))


def _skew(v: FloatArray) -> FloatArray:
    nothing = np.zeros_like(v[0])
    rows = [[nothing, -v[2], v[1]], [v[2], nothing, -v[0]], [-v[1], v[0], nothing]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _jacobian(v: FloatArray) -> FloatArray:
    """J with exp(v + δ) = exp(J δ) exp(v) to first order, (N, 3, 3)."""
    angle = np.sqrt((v * v).sum(axis=0))
    small = angle < 1e-4
    a = np.where(small, 1.0, angle)
    first = np.where(small, 0.5, (1.0 - np.cos(a)) / a**2)
    second = np.where(small, 1.0 / 6.0, (a - np.sin(a)) / a**3)
    skew = _skew(v)
    matrix: FloatArray = np.eye(3) + first[:, None, None] * skew + second[:, None, None] * (skew @ skew)
    return matrix


def _inverse_jacobian(v: FloatArray) -> FloatArray:
    """Inverse of `_jacobian`, for turns of less than 2π."""
    angle = np.sqrt((v * v).sum(axis=0))
    small = angle < 1e-4
    a = np.where(small, 1.0, angle)
    second = np.where(small, 1.0 / 12.0, 1.0 / a**2 - np.cos(0.5 * a) / (2.0 * a * np.sin(0.5 * a)))
    skew = _skew(v)
    matrix: FloatArray = np.eye(3) - 0.5 * skew + second[:, None, None] * (skew @ skew)
    return matrix


def _largest_turn(quat: FloatArray) -> float:
    steps = quaternions.log(quaternions.multiply(quaternions.conjugate(quat[:, :-1]), quat[:, 1:]))
    return float(np.rad2deg(np.sqrt((steps * steps).sum(axis=0)).max(initial=0.0)))
