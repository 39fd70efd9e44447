"""Smoothing of inertial navigation: what the samples after a time say about the errors at that time.

Modified Bryson–Frazier form of the Rauch–Tung–Striebel smoother, which needs no inverse: an adjoint a and its
information matrix Λ run backward through the trace of `northdown.kernels.navigation`,

    update, H = e_hᵀ:   a ← a + e_h (y/s − Kᵀ a),    Λ ← (I − K H)ᵀ Λ (I − K H) + Hᵀ H / s
    step:               a ← Fᵀ a,                    Λ ← Fᵀ Λ F
    result:             x + P a,                     P − P Λ P

with x and P of the forward filter after its updates. Source: G. J. Bierman, Factorization Methods for Discrete
Sequential Estimation, Academic Press 1977, chapter X (a is −λ there).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from northdown.kernels.jit import compiled, inline
from northdown.kernels.navigation import (
    COVARIANCE,
    GYR_BIAS,
    N_ERROR,
    N_NOMINAL,
    N_UPDATE,
    STEP,
    UPDATES,
    VELOCITY,
    correct,
    load,
    store,
    symmetrize,
)
from northdown.kernels.quaternion import Vector, cross, dot

Array = npt.NDArray[np.float64]


@inline
def transition_back(x: Any, dt: float, f: Vector, mat: Any) -> Any:
    """Fᵀ x, with F as in `northdown.kernels.navigation.transition`."""
    h = 0.5 * dt * dt
    u = (h * x[0] + dt * x[3], h * x[1] + dt * x[4], h * x[2] + dt * x[5])
    tilt = cross(f, u)
    t = (x[6], x[7], x[8])
    return (
        x[0],
        x[1],
        x[2],
        x[3] + dt * x[0],
        x[4] + dt * x[1],
        x[5] + dt * x[2],
        x[6] + tilt[0],
        x[7] + tilt[1],
        x[8] + tilt[2],
        x[9] - dot(mat[0], u),
        x[10] - dot(mat[1], u),
        x[11] - dot(mat[2], u),
        x[12] - dt * dot(mat[0], t),
        x[13] - dt * dot(mat[1], t),
        x[14] - dt * dot(mat[2], t),
    )


@inline
def _undo_update(a: Array, info: Array, place: int, row: Array, u: Array) -> None:
    """Take the adjoint back through one scalar update."""
    for i in range(N_ERROR):
        total = 0.0
        for j in range(N_ERROR):
            total += info[i, j] * row[2 + j]
        u[i] = total
    gain_a = 0.0
    gain_u = 0.0
    for i in range(N_ERROR):
        gain_a += row[2 + i] * a[i]
        gain_u += row[2 + i] * u[i]
    a[place] += row[0] - gain_a
    for i in range(N_ERROR):
        info[place, i] -= u[i]
        info[i, place] -= u[i]
    info[place, place] += gain_u + row[1]


@inline
def _smooth(row: Array, a: Array, info: Array, out: Array, cov: Array, w: Array, d: Array) -> None:
    """Smoothed state at one sample, and the 3 × 3 covariances of position, velocity and attitude."""
    p = row[COVARIANCE:].reshape((N_ERROR, N_ERROR))
    for i in range(N_ERROR):
        d[i] = 0.0
        for j in range(N_ERROR):
            d[i] += p[i, j] * a[j]
    for i in range(N_NOMINAL):
        out[i] = row[i]
    correct(out, d)
    for i in range(9):
        for j in range(N_ERROR):
            w[i, j] = 0.0
        for k in range(N_ERROR):
            x = p[i, k]
            for j in range(N_ERROR):
                w[i, j] += x * info[k, j]
    for block in range(3):
        for i in range(3):
            for j in range(3):
                total = 0.0
                for k in range(N_ERROR):
                    total += w[3 * block + i, k] * p[3 * block + j, k]
                cov[9 * block + 3 * i + j] = p[3 * block + i, 3 * block + j] - total


def _backward(trace: Array, adjoint: Array, info: Array, out: Array, cov: Array) -> None:
    u = np.zeros(N_ERROR)
    d = np.zeros(N_ERROR)
    w = np.zeros((9, N_ERROR))
    for back in range(len(trace)):
        n = len(trace) - 1 - back
        row = trace[n]
        _smooth(row, adjoint, info, out[n], cov[n], w, d)
        for i in range(5, -1, -1):
            update = row[UPDATES + i * N_UPDATE : UPDATES + (i + 1) * N_UPDATE]
            if update[1] > 0.0:
                _undo_update(adjoint, info, VELOCITY + i if i < 3 else GYR_BIAS + i - 3, update, u)
        dt = row[STEP]
        if dt > 0.0:
            r = row[STEP + 1 : UPDATES]
            f = (r[0], r[1], r[2])
            mat = ((r[3], r[4], r[5]), (r[6], r[7], r[8]), (r[9], r[10], r[11]))
            store(adjoint, transition_back(load(adjoint), dt, f, mat))
            for j in range(N_ERROR):
                store(info[:, j], transition_back(load(info[:, j]), dt, f, mat))
            for i in range(N_ERROR):
                store(info[i], transition_back(load(info[i]), dt, f, mat))
            symmetrize(info)


@cache
def backward() -> Callable[..., None]:
    """Compiled ``backward(trace, adjoint, info, out, cov)``.

    Goes backward over the n rows of `trace` from `adjoint` (15,) and `info` (15, 15), zero at the end of a recording,
    which it changes; writes the smoothed nominal states `out` (n, 16) and the covariances of position, velocity and
    attitude `cov` (n, 27).
    """
    return compiled(_backward, "navigation-backward", "(f8[:,::1], f8[::1], f8[:,::1], f8[:,::1], f8[:,::1])")
