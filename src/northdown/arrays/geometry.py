r"""Where the accelerometers of an array sit, where they point, and what they measure together.

An accelerometer at r (from the body's origin) that senses along the unit vector d measures

.. math::  y = d \cdot f + (r \times d) \cdot \dot\omega + d \cdot (\omega \times (\omega \times r))

of a rigid body with the specific force f at its origin and the angular rate ω. K of them are

.. math::  y = J \begin{pmatrix} \dot\omega \\ f \end{pmatrix} + P\,
           (\omega_x^2, \omega_y^2, \omega_z^2, \omega_x\omega_y, \omega_x\omega_z, \omega_y\omega_z)^T

with J (K, 6) and P (K, 6) constants of the geometry. J of rank 6 gives angular acceleration and specific force when ω
is known.

Source: C.-F. Kao, M.S. thesis, National Chiao Tung University, 2006, (2.18) to (2.22).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from northdown._validation import FloatArray, check_vectors
from northdown.errors import InputError, expected


@dataclass(frozen=True, eq=False)
class AccelerometerArray:
    """Single-axis accelerometers on one rigid body.

    Parameters
    ----------
    position : (K, 3) array
        Of each accelerometer from the body's origin, in body axes, m.
    direction : (K, 3) array
        Sensing direction in body axes; made unit vectors.
    names : sequence of str, optional
        One for each; ``a1``, ``a2``, … when not given.
    name : str
        Of the array, for tables and figures.
    """

    position: FloatArray
    direction: FloatArray
    names: Sequence[str] = ()
    name: str = ""

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        position = check_vectors("position", self.position)
        direction = check_vectors("direction", self.direction, len(position))
        size = np.linalg.norm(direction, axis=1)
        for what, bad in (("position", np.isnan(position).any(axis=1)), ("direction", ~(size > 0.0))):
            if bad.any():
                at = int(np.argmax(bad))
                got = f"{getattr(self, what)[at]} of accelerometer {at + 1}"
                raise InputError(expected(f"a {what} of finite numbers, a direction other than zero", got))
        set_field(self, "position", position)
        set_field(self, "direction", direction / size[:, None])
        names = tuple(self.names) or tuple(f"a{k + 1}" for k in range(len(position)))
        if len(names) != len(position) or len(set(names)) != len(names):
            raise InputError(expected(f"{len(position)} different names", f"{names}"))
        set_field(self, "names", names)

    def __len__(self) -> int:
        return len(self.position)

    @cached_property
    def matrix(self) -> FloatArray:
        """J (K, 6): what each measures of unit angular acceleration (rad/s²) and specific force (m/s²), body axes."""
        return np.hstack([np.cross(self.position, self.direction), self.direction])

    @cached_property
    def products(self) -> FloatArray:
        """P (K, 6): what each measures of ωx², ωy², ωz², ωxωy, ωxωz, ωyωz (rad²/s²)."""
        r, d = self.position, self.direction
        along = np.sum(r * d, axis=1)
        squares = d * r - along[:, None]
        mixed = np.column_stack([d[:, i] * r[:, k] + d[:, k] * r[:, i] for i, k in ((0, 1), (0, 2), (1, 2))])
        return np.hstack([squares, mixed])

    def turned(self, mat: FloatArray) -> AccelerometerArray:
        """The same array in other body axes, v' = mat v, with a rotation matrix (3, 3)."""
        return replace(self, position=self.position @ mat.T, direction=self.direction @ mat.T)
