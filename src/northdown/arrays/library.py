"""Named geometries of accelerometer arrays."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from northdown._validation import check_choice, check_number, check_vectors
from northdown.arrays.geometry import AccelerometerArray
from northdown.errors import InputError, expected

K06_RADIUS: Final = 0.0175
"""Radius with which K06's results are best reproduced, m; K06 does not print it."""

# Angles of positions (in units of π/9) and of sensing directions (π/18) in the plane, K06 table 2.1; None is along z.
_TABLE_21: Final[dict[str, tuple[float, float | None]]] = {
    "A1": (4, 17), "A2": (10, -7), "A3x": (-5, -18), "A3y": (1, 9),
    "A4": (2, None), "A5": (8, None), "A6": (14, None),
}  # fmt: skip
_CORRECTED: Final[dict[str, float]] = {"A1": 0, "A2": 9}
_AXES: Final = "xyz"


def coplanar7(radius: float = K06_RADIUS, *, printed: bool = False) -> AccelerometerArray:
    """K06's seven accelerometers in one plane.

    Parameters
    ----------
    radius : float
        Of the circle on which they sit, m.
    printed : bool
        Take the sensing directions of A1 and A2 as printed in table 2.1, at 170° and −70°. They contradict (2.25),
        whose weights of one half hold exactly, with no products of rates left over, for +x and +y: the default.

    Notes
    -----
    A1 and A3x face each other across the circle and sense along ±x, A2 and A3y likewise along y; A4 to A6 sense along
    z, 120° apart.
    """
    r = check_number("radius", radius, above=0.0, unit="m")
    position, direction = [], []
    for name, (place, stated) in _TABLE_21.items():
        place_rad = place * np.pi / 9.0
        position.append([r * np.cos(place_rad), r * np.sin(place_rad), 0.0])
        line = stated if printed else _CORRECTED.get(name, stated)
        direction.append([0.0, 0.0, 1.0] if line is None else _in_plane(line * np.pi / 18.0))
    title = "coplanar seven (K06 table 2.1 as printed)" if printed else "coplanar seven (K06)"
    return AccelerometerArray(np.array(position), np.array(direction), tuple(_TABLE_21), title)


def coplanar6(radius: float = K06_RADIUS, *, printed: bool = False, without: str = "A3y") -> AccelerometerArray:
    """K06's six accelerometers in one plane: the seven without one.

    Parameters
    ----------
    radius, printed
        See `coplanar7`.
    without : {"A3y", "A3x"}
        Which one to leave out: A3y as in K06 (2.23), or A3x as in K06's direct method.
    """
    seven = coplanar7(radius, printed=printed)
    left = seven.without(seven.names.index(check_choice("without", without, ("A3y", "A3x"))))
    return AccelerometerArray(left.position, left.direction, left.names, seven.name.replace("seven", "six"))


def cube6(side: float = 0.05) -> AccelerometerArray:
    """Six accelerometers in the middle of a cube's faces, sensing along the faces' diagonals.

    Parameters
    ----------
    side : float
        Of the cube, m.

    Notes
    -----
    The two of a pair of opposite faces sense along diagonals at right angles to each other, so that angular
    acceleration and specific force come out with the same noise about every axis, and no product of rates enters the
    former (J.-H. Chen, S.-C. Lee, D. B. DeBra, Journal of Guidance, Control and Dynamics 17(2), 1994).
    """
    half = 0.5 * check_number("side", side, above=0.0, unit="m")
    position, direction = [], []
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        for sign in (1.0, -1.0):
            place, line = np.zeros(3), np.zeros(3)
            place[axis], line[first], line[second] = sign * half, 1.0, sign
            position.append(place)
            direction.append(line)
    names = [f"{sign}{axis}" for axis in _AXES for sign in ("p", "m")]
    return AccelerometerArray(np.array(position), np.array(direction), names, "cube of six")


def cube9(side: float = 0.05) -> AccelerometerArray:
    """Nine accelerometers at four corners of a cube: three at the origin and two on each axis, across it.

    Parameters
    ----------
    side : float
        Of the cube, m.

    Notes
    -----
    The scheme of A. J. Padgaonkar, K. W. Krieger, A. I. King (Journal of Applied Mechanics 42(3), 1975), who take
    differences of them in which no product of rates is left. Least squares has less noise and leaves a third of some
    products in, which the three redundant accelerometers measure.
    """
    arm = check_number("side", side, above=0.0, unit="m")
    position = [np.zeros(3)] * 3
    direction = list(np.eye(3))
    names = [f"o{c}" for c in _AXES]
    for axis in range(3):
        for across in sorted({0, 1, 2} - {axis}):
            position.append(arm * np.eye(3)[axis])
            direction.append(np.eye(3)[across])
            names.append(f"{_AXES[axis]}{_AXES[across]}")
    return AccelerometerArray(np.array(position), np.array(direction), names, "cube of nine")


def triads(position: npt.ArrayLike, names: Sequence[str] = (), name: str = "triads") -> AccelerometerArray:
    """Three-axis accelerometers at given places, their axes along the body's.

    Parameters
    ----------
    position : (M, 3) array
        Of each, m.
    names : sequence of str, optional
        One for each; ``t1``, ``t2``, … when not given. Their axes get ``x``, ``y``, ``z`` appended.
    name : str
        Of the array.
    """
    places = check_vectors("position", position)
    own = tuple(names) or tuple(f"t{k + 1}" for k in range(len(places)))
    if len(own) != len(places):
        raise InputError(expected(f"{len(places)} names, one for each place", f"{len(own)}"))
    lines = np.tile(np.eye(3), (len(places), 1))
    return AccelerometerArray(np.repeat(places, 3, axis=0), lines, [f"{n}{c}" for n in own for c in _AXES], name)


def tetrahedron12(radius: float = 0.05) -> AccelerometerArray:
    """Four three-axis accelerometers at the corners of a regular tetrahedron: twelve.

    Parameters
    ----------
    radius : float
        Distance of the corners from the middle, which is the body's origin, m.

    Notes
    -----
    They measure the gradient of specific force along every axis, and so all six products of rates.
    """
    r = check_number("radius", radius, above=0.0, unit="m") / np.sqrt(3.0)
    corners = r * np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
    return triads(corners, name="tetrahedron of twelve")


def ring(count: int = 8, radius: float = 0.05) -> AccelerometerArray:
    """Accelerometers on a circle in the plane z = 0, in turn along z and along the circle.

    Parameters
    ----------
    count : int
        How many, K; even, 6 or more.
    radius : float
        Of the circle, m.

    Notes
    -----
    With M = K/2 of each kind the six unknowns are independent of each other. For each unit of noise, angular
    acceleration has √(2/M)/r about x and y and √(1/M)/r about z; specific force √(2/M) along x and y and √(1/M)
    along z.
    """
    r = check_number("radius", radius, above=0.0, unit="m")
    if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or count < 6 or count % 2 or count > 256:
        raise InputError(expected("an even number of accelerometers from 6 to 256", f"{count!r}"))
    angle = 2.0 * np.pi * np.arange(count) / count
    position = r * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])
    direction = np.array(
        [[0.0, 0.0, 1.0] if k % 2 == 0 else [-np.sin(a), np.cos(a), 0.0] for k, a in enumerate(angle)]
    )
    names = [f"{'z' if k % 2 == 0 else 't'}{k // 2 + 1}" for k in range(count)]
    return AccelerometerArray(position, direction, names, f"ring of {count}")


def _in_plane(angle: float) -> list[float]:
    # exact along the axes, so that the zeros of J are zeros
    return [float(np.round(np.cos(angle), 15)), float(np.round(np.sin(angle), 15)), 0.0]


GEOMETRIES: Final[dict[str, Callable[[float], AccelerometerArray]]] = {
    "coplanar6": coplanar6,
    "coplanar7": coplanar7,
    "coplanar7-printed": lambda radius: coplanar7(radius, printed=True),
    "cube6": cube6,
    "cube9": cube9,
    "tetrahedron12": tetrahedron12,
}
"""Geometries by name, from radius (of cubes the side), m. ``ring8`` and the like are known to `geometry` too."""


def geometry(name: str, size: float | None = None) -> AccelerometerArray:
    """Make a named geometry.

    Parameters
    ----------
    name : str
        A name in `GEOMETRIES`, or ``ring`` with the number of accelerometers, such as ``ring8``.
    size : float, optional
        Radius, or side of a cube, m; 17.5 mm for K06's arrays and 50 mm for the others when not given.
    """
    known = (*GEOMETRIES, "ring6, ring8, …")
    found = re.fullmatch(r"ring(\d{1,4})", name) if isinstance(name, str) else None
    if found:
        return ring(int(found[1]), 0.05 if size is None else size)
    if name not in GEOMETRIES:
        raise InputError(expected(f"a geometry out of {', '.join(known)}", f"{name!r:.60}"))
    default = K06_RADIUS if name.startswith("coplanar") else 0.05
    return GEOMETRIES[name](default if size is None else size)
