r"""The way back of the calibrating filter's smoother: Modified Bryson–Frazier.

It needs no inverse of a covariance: an adjoint λ and its matrix Λ, zero after the last epoch, take each scalar
measurement (row H, gain K, innovation y of variance S), last one first,

.. math::

    \lambda \leftarrow \lambda - H^T (K^T \lambda + y / S), \qquad
    \Lambda \leftarrow (I - K H)^T \Lambda (I - K H) + H^T H / S

and each propagation λ ← Fᵀ λ, Λ ← Fᵀ Λ F. The smoothed error after an epoch's measurements is −P λ, of covariance
P − P Λ P, both with the filter's P of that moment.

Source: G. J. Bierman, "Fixed interval smoothing with discrete measurements", Int. J. Control 18(1), 1973,
doi:10.1080/00207177308932487.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, Final

import numba
import numpy as np
import numpy.typing as npt

from northdown.estimators._calibrating_forth import (
    CORRECTION,
    FRESH,
    KEPT_COV,
    KEPT_GAINS,
    MEAN,
    MEASURED,
    MOVE,
    SEEN,
)
from northdown.estimators._calibrating_layout import (
    BIAS,
    DELAY,
    FORCE,
    MATRIX,
    OFFSET,
    RAW,
    REST_TURN,
    SCALED,
    TAKEN,
    TIME,
    TURN,
    VELOCITY,
    N,
)
from northdown.kernels.jit import compiled, inline
from northdown.kernels.quaternion import rotate
from northdown.kernels.rows import WIDTH, add_row, add_three_rows, weigh_rows
from northdown.kernels.so3 import exp

Array = npt.NDArray[np.float64]

# What the way back works on: λ, Λ and a few rows.
_ADJOINT: Final = 0
_MATRIX: Final = WIDTH
_ROW: Final = _MATRIX + N * WIDTH
_F: Final = _ROW + WIDTH  # rows of attitude of F − I
_N_WORK: Final = _F + 3 * WIDTH


def _back(records: Array, smoothed: Array) -> None:
    """Smooth; `smoothed` (epochs, 18) gets the error of attitude and bias, covariance of attitude, bias sigma."""
    w = np.zeros(_N_WORK)
    for k in range(len(records) - 1, -1, -1):
        row = records[k]
        _write_smoothed(w, row, smoothed[k])
        for a in range(2, -1, -1):
            if row[MEASURED + 2 * (4 + a)] > 0.0:
                _untake(w, row, 4 + a, ((BIAS + a, 1.0), (OFFSET + a, 1.0), (0, 0.0), (0, 0.0)), 2)
        if row[MEASURED + 6] > 0.0:
            h = ((0, row[MEASURED + 14]), (1, row[MEASURED + 15]), (2, -1.0), (DELAY, row[MEASURED + 16]))
            _untake(w, row, 3, h, 4)
        for a in range(2, -1, -1):
            if row[MEASURED + 2 * a] > 0.0:
                _untake(w, row, a, ((VELOCITY + a, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)), 1)
        if row[FRESH] > 0.0:
            for j in range(_ROW):
                w[j] = 0.0
        else:
            _unmove(w, row)


@inline
def _write_smoothed(w: Array, row: Array, to: Array) -> None:
    """−P λ, and the needed part of P − P Λ P."""
    for i in range(6):
        p = KEPT_COV + i * N
        to[i] = _smoothed(w, row, i)
        weigh_rows(w, _ROW, row, p, N, _MATRIX)
        for k in range(3):
            other = KEPT_COV + (k if i < 3 else i) * N
            value = row[p + (k if i < 3 else i)]
            for j in range(N):
                value -= w[_ROW + j] * row[other + j]
            if i < 3:
                to[6 + 3 * i + k] = value
            else:
                to[15 + i - 3] = math.sqrt(max(value, 0.0))
                break


@inline
def _smoothed(w: Array, row: Array, i: int) -> float:
    """Smoothed error of attitude or bias after an epoch: m − P λ."""
    error: float = row[MEAN + i]
    for j in range(N):
        error -= row[KEPT_COV + i * N + j] * w[_ADJOINT + j]
    return error


@inline
def _untake(w: Array, row: Array, k: int, h: Any, n: int) -> None:
    """Take a scalar measurement back: `h` are its (state, derivative) pairs, of which n count."""
    along, square = 0.0, row[MEASURED + 2 * k]
    gain = KEPT_GAINS + k * N
    weigh_rows(w, _ROW, row, gain, N, _MATRIX)
    for j in range(N):
        along += row[gain + j] * w[_ADJOINT + j]
        square += row[gain + j] * w[_ROW + j]
    for a in range(n):
        at, slope = h[a]
        w[_ADJOINT + at] -= slope * (along + row[MEASURED + 2 * k + 1])
        add_row(w, _MATRIX + at * WIDTH, -slope, _ROW)
    for a in range(n):
        at, slope = h[a]
        for j in range(N):
            w[_MATRIX + j * WIDTH + at] -= slope * w[_ROW + j]
    for a in range(n):
        for b in range(n):
            w[_MATRIX + h[a][0] * WIDTH + h[b][0]] += square * h[a][1] * h[b][1]


@inline
def _write_transition(w: Array, row: Array) -> Any:
    """Rows of attitude of F − I to `_F`; returns Σ R a dt, of which those of velocity are made."""
    turn, scaled, rest = MOVE + TURN - TIME, MOVE + SCALED - TIME, MOVE + REST_TURN - TIME
    for a in range(3):
        for j in range(3):
            w[_F + a * WIDTH + BIAS + j] = -row[turn + 3 * a + j]
            w[_F + a * WIDTH + OFFSET + j] = -row[rest + 3 * a + j]
            for k in range(3):
                w[_F + a * WIDTH + MATRIX + 3 * k + j] = -row[scaled + 9 * k + 3 * a + j]
    force = MOVE + FORCE - TIME
    return row[force], row[force + 1], row[force + 2]


@inline
def _unmove(w: Array, row: Array) -> None:
    """λ ← Fᵀ λ, Λ ← Fᵀ Λ F."""
    fx, fy, fz = _write_transition(w, row)
    # columns of Λ, and λ, row by row
    for i in range(-1, N):
        y = _MATRIX + i * WIDTH  # the row before the first is λ
        v0, v1, v2 = w[y + VELOCITY], w[y + VELOCITY + 1], w[y + VELOCITY + 2]
        add_three_rows(w, y, (w[y], w[y + 1], w[y + 2]), _F)
        w[y] += fy * v2 - fz * v1
        w[y + 1] += fz * v0 - fx * v2
    # rows
    for j in range(BIAS, DELAY):
        if j < VELOCITY or j >= MATRIX:
            factors = (w[_F + j], w[_F + WIDTH + j], w[_F + 2 * WIDTH + j])
            add_three_rows(w, _MATRIX + j * WIDTH, factors, _MATRIX)
    v = _MATRIX + VELOCITY * WIDTH
    add_row(w, _MATRIX, fy, v + 2 * WIDTH)
    add_row(w, _MATRIX, -fz, v + WIDTH)
    add_row(w, _MATRIX + WIDTH, fz, v)
    add_row(w, _MATRIX + WIDTH, -fx, v + 2 * WIDTH)


def _residuals(records: Array, seen: Array) -> None:
    """What the way back sees of the headings, without any covariance.

    To `seen` (epochs, 3): what the heading misses the smoothed trajectory by, and the horizontal and the down part of
    the field by the smoothed attitude; NaN where there is no heading.
    """
    w = np.zeros(_N_WORK)
    for k in range(len(records) - 1, -1, -1):
        row = records[k]
        _write_field(w, row, seen[k])
        for a in range(2, -1, -1):
            if row[MEASURED + 8 + 2 * a] > 0.0:
                change = _missed(w, row, 4 + a)
                w[BIAS + a] -= change
                w[OFFSET + a] -= change
        if row[MEASURED + 6] > 0.0:
            change = _missed(w, row, 3)
            seen[k, 0] = row[MEASURED + RAW - TAKEN + 6] * change
            w[0] -= row[MEASURED + 14] * change
            w[1] -= row[MEASURED + 15] * change
            w[2] += change
            w[DELAY] -= row[MEASURED + 16] * change
        for a in range(2, -1, -1):
            if row[MEASURED + 2 * a] > 0.0:
                w[VELOCITY + a] -= _missed(w, row, a)
        if row[FRESH] > 0.0:
            for j in range(WIDTH):
                w[j] = 0.0
        else:
            fx, fy, fz = _write_transition(w, row)
            add_three_rows(w, _ADJOINT, (w[0], w[1], w[2]), _F)
            w[0] += fy * w[VELOCITY + 2] - fz * w[VELOCITY + 1]
            w[1] += fz * w[VELOCITY] - fx * w[VELOCITY + 2]


@inline
def _write_field(w: Array, row: Array, to: Array) -> None:
    """The mean field of an epoch by its smoothed attitude."""
    for j in range(3):
        to[j] = math.nan
    if not row[MEASURED + 6] > 0.0:
        return
    error = (_smoothed(w, row, 0), _smoothed(w, row, 1), _smoothed(w, row, 2))
    turn = (error[0] + row[CORRECTION], error[1] + row[CORRECTION + 1], error[2] + row[CORRECTION + 2])
    k = 1.0 / row[SEEN + 3]
    x, y, z = rotate(exp(turn), (row[SEEN] * k, row[SEEN + 1] * k, row[SEEN + 2] * k))
    to[1] = math.sqrt(x * x + y * y)
    to[2] = z


@inline
def _missed(w: Array, row: Array, k: int) -> float:
    """K·λ + y/S of a scalar measurement."""
    along: float = row[MEASURED + 2 * k + 1]
    for j in range(N):
        along += row[KEPT_GAINS + k * N + j] * w[_ADJOINT + j]
    return along


_ARRAY: Any = numba.float64[:, ::1]


@cache
def back() -> Callable[..., None]:
    """Compiled ``back(records, smoothed)``."""
    return compiled(_back, "calibrating-back", (_ARRAY, _ARRAY))


@cache
def residuals() -> Callable[..., None]:
    """Compiled ``residuals(records, seen)``."""
    return compiled(_residuals, "calibrating-residuals", (_ARRAY, _ARRAY))
