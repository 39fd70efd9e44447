r"""How the K channels of an accelerometer array become six numbers a sample, and with which noise.

With y = J (ω̇, f) + P p(ω) + n, p the products of rates, and white noise n of equal size in all channels, the least
squares solution is linear in y:

.. math::

    \begin{pmatrix} \alpha_m \\ f_m \end{pmatrix} = J^+ y, \qquad
    \alpha_m = \dot\omega + L_\alpha p(\omega) + n_\alpha, \quad f_m = f + L_f\, p(\omega) + n_f + a

with C = E[n nᵀ] = J⁺ J⁺ᵀ, f what the model says of the specific force, −g down, and linear acceleration a: left out
(s = 0), or taken for noise of variance s in each component. A filter's process noise n_α and its measurement noise
n_f come from the same channels. Exact treatment of their correlation: what the residual tells of n_α is taken off,

.. math::

    \dot\omega = \alpha_m - L_\alpha p(\omega) - G\, (f_m - L_f\, p(\omega) - f) - \tilde n, \qquad
    G = C_{\alpha f} (C_{ff} + s)^{-1} = C_{\alpha f} V (\Lambda + s)^{-1} V^T

with C_ff = V Λ Vᵀ, and ñ is not correlated with n_f + a any more. Where gravity is distrusted, s large, nothing is
taken off. (With s = 0 and all three components of f, α_m − G f_m is (J₁ᵀJ₁)⁻¹J₁ᵀy, J₁ being the columns of J that
belong to ω̇.)
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
        J⁺: gives (α_m, f_m) from the channels, rad/s² and m/s².
    products : (6, 6) array
        L: what of (α_m, f_m) comes from ωx², ωy², ωz², ωxωy, ωxωz, ωyωz.
    noise : (6, 6) array
        C: covariance of the noise of (α_m, f_m) for channels of variance 1.
    extra : (n, K) array
        Gives further combinations, of filters that take them; see `redundancy`.
    """

    matrix: FloatArray
    products: FloatArray
    noise: FloatArray
    extra: FloatArray

    def block(self, axes: str = "xyz") -> list[float]:
        """What kernels take, `_array_coupling`, when the components `axes` of f are measurements."""
        used = ["xyz".index(axis) for axis in axes]
        values, vectors = np.ones(3), np.zeros((3, 3))
        there = np.ix_(used, range(len(used)))
        values[: len(used)], vectors[there] = np.linalg.eigh(self.noise[3:, 3:][np.ix_(used, used)])
        upper = np.triu_indices(3)
        return [
            *self.products.ravel(),
            *self.noise[:3, :3][upper],
            *(self.noise[:3, 3:] @ vectors).ravel(),
            *vectors.ravel(),
            *values,
            *self.noise[3:, 3:][upper],
        ]


def reduce_array(array: AccelerometerArray) -> Reduction:
    """The reduction of an array.

    Raises
    ------
    InputError
        When the array has fewer than six accelerometers, or cannot tell ω̇ and f apart.
    """
    matrix = solution(array)
    return Reduction(matrix, matrix @ array.products, matrix @ matrix.T, np.zeros((0, len(array))))


def channels(array: AccelerometerArray | None, samples: FloatArray, name: str) -> FloatArray:
    """Check that samples (…, K) are those of the array."""
    count = 0 if array is None else len(array)
    if samples.shape[-1] != count:
        got = f"{samples.shape[-1]}"
        raise InputError(
            expected(f"{count} channels of the array for {name}", got, do="give the array they belong to")
        )
    return samples


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
