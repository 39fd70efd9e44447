r"""How the K channels of an accelerometer array become six numbers a sample, and with which noise.

With y = J (ω̇, f) + P p(ω) + n, p the products of rates, and white noise n of equal size in all channels, the least
squares solution is linear in y. Two forms are used, J₁ and J₂ being the columns of J that belong to ω̇ and f:

.. math::  f_m = (J^+ y)_{4:6}, \qquad  \alpha_m = (J^+ y)_{1:3} - G f_m, \qquad
           G = E[n_\alpha n_f^T]\, E[n_f n_f^T]^{-1}

so that

.. math::  \dot\omega = \alpha_m - L_\alpha p(\omega) + G f - \tilde n, \qquad f_m = f + L_f p(\omega) + n_f

where f is what the model says of the specific force, −g down. Noises ñ and n_f are uncorrelated: the filter's process
noise and its measurement noise come from the same channels, and this is the exact treatment of their correlation. (If
all three components of f are used, α_m is (J₁ᵀJ₁)⁻¹J₁ᵀy and G the same of J₂.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from northdown._validation import FloatArray
from northdown.arrays import AccelerometerArray, solution
from northdown.errors import InputError, expected

# Of what a combination sees of products of rates to the most that an accelerometer sees of one.
_SINGULAR = 1e-6


@dataclass(frozen=True, eq=False)
class Reduction:
    """The six numbers of an array's sample.

    Parameters
    ----------
    matrix : (6, K) array
        Gives (α_m, f_m) from the channels: rad/s², m/s².
    products : (6, 6) array
        L: what of (α_m, f_m) comes from ωx², ωy², ωz², ωxωy, ωxωz, ωyωz.
    coupling : (3, 3) array
        G, rad/s² for m/s².
    rate_noise : (3, 3) array
        Covariance of ñ for channels of variance 1.
    force_noise : (3, 3) array
        Covariance of n_f for channels of variance 1.
    extra : (n, K) array
        Gives further combinations, of filters that take them; see `redundancy`.
    """

    matrix: FloatArray
    products: FloatArray
    coupling: FloatArray
    rate_noise: FloatArray
    force_noise: FloatArray
    extra: FloatArray


def reduce_array(array: AccelerometerArray, axes: str = "xyz") -> Reduction:
    """The reduction of an array, when the components `axes` of f are measurements of the filter.

    Raises
    ------
    InputError
        When the array has fewer than six accelerometers, or cannot tell ω̇ and f apart.
    """
    matrix = solution(array)
    noise = matrix @ matrix.T
    coupling = np.zeros((3, 3))
    used = [3 + "xyz".index(axis) for axis in axes]
    if used:
        coupling[:, [k - 3 for k in used]] = np.linalg.solve(noise[np.ix_(used, used)], noise[:3, used].T).T
    matrix = np.vstack([matrix[:3] - coupling @ matrix[3:], matrix[3:]])
    noise = matrix @ matrix.T
    none = np.zeros((0, len(array)))
    return Reduction(matrix, matrix @ array.products, coupling, noise[:3, :3], noise[3:, 3:], none)


def channels(array: AccelerometerArray | None, samples: FloatArray, name: str) -> FloatArray:
    """Check that samples (…, K) are those of the array."""
    count = 0 if array is None else len(array)
    if samples.shape[-1] != count:
        got = f"{samples.shape[-1]}"
        raise InputError(
            expected(f"{count} channels of the array for {name}", got, do="give the array they belong to")
        )
    return samples


def selected_whitening(noise: FloatArray, axes: str) -> FloatArray:
    """A (3, 3) with A C Aᵀ = 1 for the components `axes` of a covariance C; its rows of the others are zero."""
    used = np.ix_(*[["xyz".index(axis) for axis in axes]] * 2)
    result = np.zeros((3, 3))
    result[used] = np.linalg.inv(np.linalg.cholesky(noise[used]))
    return result


def redundancy(array: AccelerometerArray) -> tuple[FloatArray, FloatArray]:
    """What an array of more than six accelerometers tells of its rate beside the six numbers.

    Combinations in the null space of Jᵀ see neither angular acceleration nor specific force, but products of rates
    alone.

    Returns
    -------
    matrix : (6, K) array
        Combinations whose noise is white, of the size of one channel's and uncorrelated with that of the six numbers.
        Rows of zeros where fewer than six see anything.
    products : (6, 6) array
        What they see of ωx², ωy², ωz², ωxωy, ωxωz, ωyωz.
    """
    left, _, _ = np.linalg.svd(array.matrix)
    null = left[:, 6:].T
    # in this metric products of rates are the matrix ω ωᵀ, and the combinations the same in all axes
    metric = np.sqrt([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
    turn, seen, by = np.linalg.svd(null @ array.products / metric, full_matrices=False)
    size = float(np.abs(array.products).max())
    used = seen > _SINGULAR * size if size > 0.0 else np.zeros(len(seen), bool)
    matrix, products = np.zeros((6, len(array))), np.zeros((6, 6))
    matrix[: used.sum()] = turn[:, used].T @ null
    products[: used.sum()] = seen[used, None] * by[used] * metric
    return matrix, products
