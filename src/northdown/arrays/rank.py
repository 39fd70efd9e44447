r"""Whether an array measures all of angular acceleration and specific force, and what it misses.

The rank of J and its condition must depend neither on the unit of length nor on where the body's origin is. So J is
taken about the accelerometers' mean position, and its angular part is divided by a length L, the root mean square of
their distances from there:

.. math::  J_c = W \begin{pmatrix} (r_k - \bar r) \times d_k / L & d_k \end{pmatrix}_k

Its condition number is the ratio of the largest to the smallest singular value (W: inverse noise of each
accelerometer, where they differ).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from northdown._validation import FloatArray, check_number
from northdown.arrays.geometry import AccelerometerArray
from northdown.arrays.words import axis_name, echelon, listed, subspace_name
from northdown.errors import InputError, expected

MAX_CONDITION: Final = 1000.0
"""Beyond this an array counts as nearly singular: accelerometers that are misplaced by a thousandth of the array's
size, or turned by a milliradian, would decide what is taken for the weakest of the six."""

# Relative to the largest singular value; the rounding of positions that are written with seven digits.
_ZERO: Final = 1e-7
# Components below this, of unit vectors, are taken for zero when directions are named.
_SMALL: Final = 0.02


@dataclass(frozen=True, eq=False)
class ScaledMatrix:
    """J about the mean position, without unit.

    Attributes
    ----------
    matrix : (K, 6) array
        J_c of the module's docstring.
    length : float
        L, m.
    centre : (3,) array
        Mean position, m.
    singular_values : (6,) array
        Of `matrix`, decreasing; zeros for those that fewer than six accelerometers cannot have.
    directions : (6, 6) array
        Rows: the combinations of L ω̇ and f that belong to them.
    """

    matrix: FloatArray
    length: float
    centre: FloatArray
    singular_values: FloatArray
    directions: FloatArray

    @property
    def rank(self) -> int:
        """Number of singular values that are not zero but for rounding."""
        return int((self.singular_values > _ZERO * self.singular_values[0]).sum())

    @property
    def condition(self) -> float:
        """Largest over smallest singular value; infinite where that is zero but for rounding."""
        if self.rank < 6:
            return float("inf")
        return float(self.singular_values[0] / self.singular_values[5])


def scaled_matrix(array: AccelerometerArray, weight: FloatArray | None = None) -> ScaledMatrix:
    """Take J about the mean position, scaled; `weight` (K,) multiplies its rows."""
    centre: FloatArray = array.position.mean(axis=0)
    arm = array.position - centre
    spread = float(np.sqrt((arm * arm).sum(axis=1).mean()))
    # all at one place but for rounding
    length = spread if spread > 1e-12 * float(np.abs(array.position).max(initial=0.0)) else 0.0
    turning = np.cross(arm, array.direction) / length if length > 0.0 else np.zeros_like(arm)
    matrix = np.hstack([turning, array.direction])
    if weight is not None:
        matrix = weight[:, None] * matrix
    _, values, directions = np.linalg.svd(np.vstack([matrix, np.zeros((max(0, 6 - len(matrix)), 6))]))
    return ScaledMatrix(matrix, length, centre, values, directions)


def missing_directions(array: AccelerometerArray, limit: float = MAX_CONDITION) -> list[str]:
    """Say what an array cannot measure, or hardly; an empty list when there is nothing.

    Parameters
    ----------
    array : AccelerometerArray
        Of any number of accelerometers.
    limit : float
        Condition number from which on a combination counts as not measured.

    Returns
    -------
    list of str
        Such as ``"no accelerometer measures angular acceleration about z"``, or ``"angular acceleration about z
        cannot be told from specific force along x"``, which is that at the body's origin.
    """
    return _in_words(scaled_matrix(array), check_number("limit", limit, above=1.0))


def _in_words(form: ScaledMatrix, limit: float) -> list[str]:
    weak = form.singular_values * limit < form.singular_values[0]
    null = form.directions[weak]
    if not len(null):
        return []
    # at the body's origin, f_o = f_c − ω̇ × centre, as J is; with the angular part in the same scale
    shift = np.cross(null[:, :3], form.centre) / (form.length or 1.0)
    null = np.linalg.qr(np.hstack([null[:, :3], null[:, 3:] - shift]).T)[0].T
    mixed, pure_angular = _split(null, null[:, 3:])
    mixed, pure_force = _split(mixed, mixed[:, :3])
    words = []
    if len(pure_angular):
        words.append(f"no accelerometer measures {subspace_name(pure_angular[:, :3], 'angular acceleration about')}")
    if len(pure_force):
        words.append(f"no accelerometer measures {subspace_name(pure_force[:, 3:], 'specific force along')}")
    if len(mixed):
        pairs = [
            f"angular acceleration about {axis_name(row[:3])} cannot be told from specific force along "
            f"{axis_name(row[3:])}"
            for row in echelon(mixed)
        ]
        words.append(listed(pairs))
    return words


def _split(rows: FloatArray, part: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Orthonormal rows as those with something in a part of their columns, and those with nothing there."""
    if not len(rows):
        return rows, rows
    left, values, _ = np.linalg.svd(part)
    size = np.concatenate([values, np.zeros(len(rows) - len(values))])
    turned: FloatArray = left.T @ rows
    return turned[size >= _SMALL], turned[size < _SMALL]


def check_measures_all(array: AccelerometerArray, form: ScaledMatrix) -> None:
    """Raise when an array, whose scaled matrix is `form`, cannot give angular acceleration and specific force.

    Raises
    ------
    InputError
        With fewer than six accelerometers, two that measure the same, or a geometry that is singular or nearly so;
        it says which direction is missing.
    """
    same = _duplicates(array)
    if same is not None:
        a, b = (array.names[k] for k in same)
        do = "move or turn one of them"
        raise InputError(expected("accelerometers that differ", f"{a} and {b} in one place and line", do=do))
    what = "an array that measures angular acceleration and specific force about and along every axis"
    if len(array) < 6:
        raise InputError(expected("six accelerometers or more", f"{len(array)}: that leaves something unmeasured"))
    words = _in_words(form, MAX_CONDITION)
    if words:
        condition = form.condition
        how = (
            "" if condition == float("inf") else f" well enough (condition {condition:.3g}, limit {MAX_CONDITION:g})"
        )
        do = "move or turn accelerometers so that some feel it"
        raise InputError(expected(what, f"one in which {'; '.join(words)}{how}", do=do))


def _duplicates(array: AccelerometerArray) -> tuple[int, int] | None:
    """The first two accelerometers at one place with parallel directions, if any."""
    size = float(np.abs(array.position).max(initial=0.0))
    for k in range(len(array)):
        apart = np.linalg.norm(array.position[k + 1 :] - array.position[k], axis=1) <= 1e-9 * size
        parallel = np.linalg.norm(np.cross(array.direction[k + 1 :], array.direction[k]), axis=1) < 1e-9
        both = np.flatnonzero(apart & parallel)
        if both.size:
            return k, k + 1 + int(both[0])
    return None
