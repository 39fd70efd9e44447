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

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from northdown._validation import FloatArray, check_number, check_vectors
from northdown.errors import InputError, expected

# What the names of a file's columns can hold without quoting, in any format.
_NAME: Final = re.compile(r"\w[\w .+-]{0,39}")
# All of them fit into an attribute of an HDF5 file, 64 KiB.
_MOST: Final = 256
# m; beyond this a position is a mistake of unit, and its squares no longer fit
_FARTHEST: Final = 1e4


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

    Raises
    ------
    InputError
        On wrong shapes, none or more than 256 of them, a position that is not a number or beyond 10 km, a direction
        of zeros, names that are not all different or not fit for the header of a file (letters, digits, blanks and
        ``_ - + .``, at most 40).

    Notes
    -----
    Any set of accelerometers can be made and studied, also one that cannot stand in for a gyroscope. Whether it can
    (six or more, no two that measure the same, nothing unmeasured) is for `northdown.arrays.analyse` and
    `northdown.arrays.solution` to decide, and so for whatever estimates with it.
    """

    position: FloatArray
    direction: FloatArray
    names: Sequence[str] = ()
    name: str = ""

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        position = check_vectors("position", self.position)
        direction = check_vectors("direction", self.direction, len(position))
        if not 1 <= len(position) <= _MOST:
            raise InputError(expected(f"1 to {_MOST} accelerometers", f"{len(position)}"))
        size = np.linalg.norm(direction, axis=1)
        far = ~(np.abs(position) <= _FARTHEST).all(axis=1)
        wanted = {
            "position": f"a position within {_FARTHEST:g} m",
            "direction": "a direction of finite numbers, not all zero",
        }
        for what, value, bad in (
            ("position", position, far),
            ("direction", direction, ~(size > 0.0)),
        ):
            if bad.any():
                at = int(np.argmax(bad))
                raise InputError(expected(wanted[what], f"{value[at].tolist()} of accelerometer {at + 1}"))
        set_field(self, "position", position)
        # those that are unit but for rounding stay as they are, so that copies and files keep every digit
        set_field(self, "direction", direction / np.where(np.abs(size - 1.0) < 1e-14, 1.0, size)[:, None])
        names = tuple(self.names) or tuple(f"a{k + 1}" for k in range(len(position)))
        if len(names) != len(position) or len(set(names)) != len(names):
            raise InputError(expected(f"{len(position)} different names", f"{names!r:.200}"))
        for name in names:
            if not isinstance(name, str) or not _NAME.fullmatch(name):
                raise InputError(
                    expected("names of letters, digits, blanks and _ + - ., 40 at most", f"{name!r:.60}")
                )
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

    def scaled(self, factor: float) -> AccelerometerArray:
        """The same array with all distances from the origin multiplied by `factor`."""
        k = check_number("factor", factor, above=0.0)
        return replace(self, position=k * self.position)

    def without(self, index: int) -> AccelerometerArray:
        """The array without one of its accelerometers, by its number from 0."""
        if not 0 <= index < len(self):
            raise InputError(expected(f"a number from 0 to {len(self) - 1}", f"{index}"))
        keep = [k for k in range(len(self)) if k != index]
        return replace(
            self,
            position=self.position[keep],
            direction=self.direction[keep],
            names=[self.names[k] for k in keep],
        )
