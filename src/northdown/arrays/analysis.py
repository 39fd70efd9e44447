r"""`analyse`: what an array measures, how well, and what its geometry makes of errors.

With x = (ω̇, f), the products w of rates, and noise of standard deviation s_k in accelerometer k,

.. math::  y = J x + P w + n,\quad  \hat x = J^+ (y - P w),\quad  J^+ = (J^T W J)^{-1} J^T W,\quad  W = diag(s_k^{-2})

============================== =============================== ===================================================
what                           name                            unit
============================== =============================== ===================================================
J⁺                             ``inverse``                     rad/m for the rows of ω̇, none for those of f
√diag(J⁺ W⁻¹ J⁺ᵀ)              ``angular_noise``,              rad/s² or m/s² for each m/s² of an accelerometer,
                               ``force_noise``                 or both divided by √Hz
J⁺ P                           ``leakage``                     rad/s² or m/s² for each (rad/s)² left uncorrected
N P, N Jᵀ⊥ = 0                 ``measured_products``           combinations of w that the redundancy shows
============================== =============================== ===================================================

Source: K06 (C.-F. Kao, M.S. thesis, National Chiao Tung University, 2006), (2.20) to (2.24), for J and P with an
inverse; the least squares form, its weights and what follows from it are standard.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray, as_float_array
from northdown.arrays.geometry import AccelerometerArray
from northdown.arrays.rank import ScaledMatrix, check_measures_all, scaled_matrix
from northdown.arrays.words import combination, echelon, listed
from northdown.errors import InputError, expected

# Of P's largest entry: below this a product counts as not measured, and a leakage as none.
_ZERO: Final = 1e-7
_OUTPUTS: Final = ("ω̇x", "ω̇y", "ω̇z", "fx", "fy", "fz")


@dataclass(frozen=True, eq=False)
class ArrayAnalysis:
    """What an array of accelerometers can measure.

    Attributes
    ----------
    array : AccelerometerArray
        The array.
    noise : (K,) array
        Noise of each accelerometer relative to a unit that is the same for all.
    inverse : (6, K) array
        Weighted least squares inverse of J: rows of angular acceleration (rad/m), then of specific force at the
        body's origin.
    length : float
        Root mean square distance of the accelerometers from their mean position, m: the scale of `condition`.
    condition : float
        Ratio of the largest to the smallest singular value of J, taken about the mean position, its angular part
        divided by `length`. It depends neither on the unit nor on the origin; 1 is best.
    """

    array: AccelerometerArray
    noise: FloatArray
    inverse: FloatArray
    length: float
    condition: float

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance (6, 6) of angular acceleration and specific force for a noise of one unit."""
        each: FloatArray = self.inverse * self.noise
        return each @ each.T

    @property
    def angular_noise(self) -> FloatArray:
        """Noise (3,) of angular acceleration about x, y, z for each unit of an accelerometer's noise, 1/m."""
        return np.sqrt(np.diag(self.covariance)[:3])

    @property
    def force_noise(self) -> FloatArray:
        """Noise (3,) of specific force along x, y, z at the body's origin for each unit of an accelerometer's."""
        return np.sqrt(np.diag(self.covariance)[3:])

    @property
    def angular_dilution(self) -> float:
        """Root of the sum of squares of `angular_noise`, 1/m; does not depend on the axes."""
        return float(np.sqrt(np.trace(self.covariance[:3, :3])))

    @property
    def force_dilution(self) -> float:
        """Root of the sum of squares of `force_noise`; does not depend on the axes."""
        return float(np.sqrt(np.trace(self.covariance[3:, 3:])))

    @cached_property
    def leakage(self) -> FloatArray:
        """J⁺P (6, 6): what each of ωx², ωy², ωz², ωxωy, ωxωz, ωyωz adds to ω̇ and f where it is not corrected."""
        return self.inverse @ self.array.products

    @cached_property
    def null_space(self) -> FloatArray:
        """Orthonormal combinations (K − 6, K) that feel neither ω̇ nor f, of measurements divided by their noise."""
        left, _, _ = np.linalg.svd(scaled_matrix(self.array, 1.0 / self.noise).matrix)
        return np.ascontiguousarray(left[:, 6:].T)

    @cached_property
    def measured_products(self) -> FloatArray:
        """Independent combinations (m, 6) of ωx² … ωyωz that the redundancy measures directly; m is 0 without any."""
        weighted = self.array.products / self.noise[:, None]
        _, values, rows = np.linalg.svd(np.vstack([self.null_space @ weighted, np.zeros((6, 6))]))
        found: FloatArray = rows[values > _ZERO * max(float(np.abs(weighted).max()), 1e-300)]
        return echelon(found) if len(found) else found

    def summary(self) -> str:
        """All of this in words."""
        from northdown.arrays.summary import summarise

        return summarise(self)

    def leaks(self) -> list[str]:
        """Outputs with what leaks into them, such as ``"ω̇x: ωyωz"`` or ``"fx: 25 mm · (ωyωz)"``."""
        limit = _ZERO * np.array([1.0] * 3 + [self.length] * 3)
        rows = enumerate(zip(_OUTPUTS, self.leakage, limit, strict=True))
        return [f"{name}: {_leak(row, k)}" for k, (name, row, least) in rows if np.abs(row).max() > least]

    def redundancy(self) -> str:
        """What the null space of Jᵀ shows, in words."""
        spare = len(self.array) - 6
        if spare == 0:
            return "none: six accelerometers for six unknowns"
        found = self.measured_products
        if not len(found):
            return f"{spare} more than needed, which measure no products of rates: they only average noise"
        if len(found) == 6:
            return f"{spare} more than needed, which measure all six products of rates: the rate, up to its sign"
        return f"{spare} more than needed, which measure {listed([combination(row) for row in found])} directly"


def _leak(row: FloatArray, output: int) -> str:
    """A row of the leakage in words: of specific force in mm, as those lengths are small."""
    if output < 3:
        return combination(row)
    largest = float(np.abs(row).max())
    return f"{1e3 * largest:.3g} mm · ({combination(row / largest)})"


def analyse(array: AccelerometerArray, noise: npt.ArrayLike | None = None) -> ArrayAnalysis:
    """Find what an array of accelerometers can measure.

    Parameters
    ----------
    array : AccelerometerArray
        Six accelerometers or more.
    noise : (K,) array, optional
        Noise of each relative to a common unit; all alike when not given. Raising one's makes the solution rely on it
        less.

    Raises
    ------
    InputError
        With fewer than six, two that measure the same, a singular or nearly singular geometry (condition above
        `northdown.arrays.MAX_CONDITION`): what is not measured is named.
    """
    sizes = _check_noise(array, noise)
    form = scaled_matrix(array, 1.0 / sizes)
    check_measures_all(array, form)
    return ArrayAnalysis(array, sizes, _inverse(form, sizes), form.length, form.condition)


def solution(array: AccelerometerArray, noise: npt.ArrayLike | None = None) -> FloatArray:
    """Weighted least squares inverse (6, K) of J; see `analyse` for the parameters and errors."""
    return analyse(array, noise).inverse


def _inverse(form: ScaledMatrix, noise: FloatArray) -> FloatArray:
    about_centre: FloatArray = np.linalg.pinv(form.matrix) / noise
    angular = about_centre[:3] / form.length
    # from the mean position to the body's origin: f_o = f_c − ω̇ × centre
    force = about_centre[3:] - np.cross(angular, form.centre, axisa=0, axisc=0)
    return np.vstack([angular, force])


def _check_noise(array: AccelerometerArray, noise: npt.ArrayLike | None) -> FloatArray:
    if not isinstance(array, AccelerometerArray):
        raise InputError(expected("an AccelerometerArray", type(array).__name__))
    if noise is None:
        return np.ones(len(array))
    sizes = as_float_array("noise", noise)
    if sizes.shape != (len(array),) or not (np.isfinite(sizes) & (sizes > 0.0)).all():
        what = f"{len(array)} numbers above 0 for noise, one for each accelerometer"
        raise InputError(expected(what, f"{sizes.tolist()!s:.100}"))
    return sizes
