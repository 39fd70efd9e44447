"""Rotation over a stretch of gyroscope samples, and how it depends on the gyroscope's calibration.

With the rate ω = M r (r the raw rate without bias) and R(t) the rotation from the body at time t to the body at the
start, Ṙ = R [ω×]. A change δM turns the end of the stretch, in axes of the start, by the small rotation vector
∫ R(t) δM r(t) dt, so that

    K[a, i, j] = ∫ R(t)[a, i] r_j(t) dt

is all that first derivatives with respect to M need: the vector is Σ_ij K[·, i, j] δM_ij.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import numpy.typing as npt

from northdown.kernels.jit import compiled, inline
from northdown.kernels.quaternion import Quaternion, Vector, multiply, normalize
from northdown.kernels.so3 import exp

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


@inline
def columns(q: Quaternion) -> tuple[Vector, Vector, Vector]:
    """Columns of the rotation matrix of a unit quaternion."""
    w, x, y, z = q
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        (2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


def _turns(
    rate: Array, dt: Array, bias: Array, mat: Array, starts: Indices, stops: Indices, r: Array, k: Array
) -> None:
    """Integrate each stretch [start, stop) of the samples; `r` (T, 3, 3) and `k` (T, 3, 3, 3) are written."""
    for turn in range(len(starts)):
        q = (1.0, 0.0, 0.0, 0.0)
        for a in range(3):
            for i in range(3):
                for j in range(3):
                    k[turn, a, i, j] = 0.0
        for n in range(starts[turn], stops[turn]):
            v = (
                (rate[n, 0] - bias[turn, 0]) * dt[n],
                (rate[n, 1] - bias[turn, 1]) * dt[n],
                (rate[n, 2] - bias[turn, 2]) * dt[n],
            )
            w = (
                mat[0, 0] * v[0] + mat[0, 1] * v[1] + mat[0, 2] * v[2],
                mat[1, 0] * v[0] + mat[1, 1] * v[1] + mat[1, 2] * v[2],
                mat[2, 0] * v[0] + mat[2, 1] * v[1] + mat[2, 2] * v[2],
            )
            # the attitude in the middle of the step makes the sum second-order accurate
            c = columns(multiply(q, exp((0.5 * w[0], 0.5 * w[1], 0.5 * w[2]))))
            for a in range(3):
                for i in range(3):
                    for j in range(3):
                        k[turn, a, i, j] += c[i][a] * v[j]
            q = normalize(multiply(q, exp(w)))
        c = columns(q)
        for a in range(3):
            for i in range(3):
                r[turn, a, i] = c[i][a]


@cache
def turns() -> Callable[..., None]:
    """Compiled ``turns(rate, dt, bias, mat, starts, stops, r, k)``.

    `rate` (N, 3) and `dt` (N,) are all samples, `bias` (T, 3) that of each stretch, `mat` (3, 3) is M, `starts` and
    `stops` (T,) delimit the stretches.
    """
    signature = "(f8[:,::1], f8[::1], f8[:,::1], f8[:,::1], i8[::1], i8[::1], f8[:,:,::1], f8[:,:,:,::1])"
    return compiled(_turns, "gravity-turns", signature)
