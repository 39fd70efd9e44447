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

from northdown.estimators._calibrating_forth import FRESH, KEPT_COV, KEPT_GAINS, MEASURED, MOVE
from northdown.estimators._calibrating_layout import (
    BIAS,
    DELAY,
    FORCE,
    MATRIX,
    OFFSET,
    REST_TURN,
    TURN,
    VELOCITY,
    N,
)
from northdown.kernels.jit import compiled, inline
from northdown.kernels.rows import WIDTH, add_row

Array = npt.NDArray[np.float64]

# What the way back works on: λ, Λ and a few rows.
_ADJOINT: Final = 0
_MATRIX: Final = WIDTH
_ROW: Final = _MATRIX + N * WIDTH
_GAIN: Final = _ROW + WIDTH
_F: Final = _GAIN + WIDTH  # rows of attitude of F − I
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
        error = 0.0
        for j in range(WIDTH):
            w[_ROW + j] = 0.0
        for j in range(N):
            error -= row[p + j] * w[_ADJOINT + j]
            add_row(w, _ROW, row[p + j], _MATRIX + j * WIDTH)
        to[i] = error
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
def _untake(w: Array, row: Array, k: int, h: Any, n: int) -> None:
    """Take a scalar measurement back: `h` are its (state, derivative) pairs, of which n count."""
    along, square = 0.0, row[MEASURED + 2 * k]
    for j in range(WIDTH):
        w[_ROW + j] = 0.0
    for j in range(N):
        gain = row[KEPT_GAINS + k * N + j]
        w[_GAIN + j] = gain
        along += gain * w[_ADJOINT + j]
        add_row(w, _ROW, gain, _MATRIX + j * WIDTH)
    for j in range(N):
        square += w[_GAIN + j] * w[_ROW + j]
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
def _unmove(w: Array, row: Array) -> None:
    """λ ← Fᵀ λ, Λ ← Fᵀ Λ F."""
    fx, fy, fz = (row[MOVE + FORCE - TURN], row[MOVE + FORCE - TURN + 1], row[MOVE + FORCE - TURN + 2])
    for a in range(3):
        for j in range(3):
            w[_F + a * WIDTH + BIAS + j] = -row[MOVE + 3 * a + j]
            w[_F + a * WIDTH + OFFSET + j] = -row[MOVE + REST_TURN - TURN + 3 * a + j]
            for k in range(3):
                w[_F + a * WIDTH + MATRIX + 3 * k + j] = -row[MOVE + 9 + 9 * k + 3 * a + j]
    # columns of Λ, and λ, row by row
    for i in range(-1, N):
        y = _MATRIX + i * WIDTH  # the row before the first is λ
        x0, x1, x2 = w[y], w[y + 1], w[y + 2]
        v0, v1, v2 = w[y + VELOCITY], w[y + VELOCITY + 1], w[y + VELOCITY + 2]
        add_row(w, y, x0, _F)
        add_row(w, y, x1, _F + WIDTH)
        add_row(w, y, x2, _F + 2 * WIDTH)
        w[y] += fy * v2 - fz * v1
        w[y + 1] += fz * v0 - fx * v2
    # rows
    for j in range(BIAS, DELAY):
        for a in range(3):
            if j < VELOCITY or j >= MATRIX:
                add_row(w, _MATRIX + j * WIDTH, w[_F + a * WIDTH + j], _MATRIX + a * WIDTH)
    v = _MATRIX + VELOCITY * WIDTH
    add_row(w, _MATRIX, fy, v + 2 * WIDTH)
    add_row(w, _MATRIX, -fz, v + WIDTH)
    add_row(w, _MATRIX + WIDTH, fz, v)
    add_row(w, _MATRIX + WIDTH, -fx, v + 2 * WIDTH)


_VECTOR: Any = numba.float64[::1]
_ARRAY: Any = numba.float64[:, ::1]


@cache
def back() -> Callable[..., None]:
    """Compiled ``back(records, smoothed)``."""
    return compiled(_back, "calibrating-back", (_ARRAY, _ARRAY))
