"""Design of arrays: which accelerometer contributes least, and the best places in a plane.

The best places maximise, or minimise, of the information M = Σ_k j_k j_kᵀ of the rows j_k = ((r_k × d_k)/L, d_k),

========= ================================================== =============================================
criterion of M                                               meaning
========= ================================================== =============================================
D         greatest determinant                               smallest volume of the error's ellipsoid; does
                                                             not depend on L
A         smallest trace of the inverse                      smallest mean square error of L ω̇ and f
========= ================================================== =============================================

with L half the plane's side (V. V. Fedorov, Theory of Optimal Experiments, 1972, for the criteria).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from northdown._validation import FloatArray, check_choice, check_number
from northdown.arrays.analysis import ArrayAnalysis, analyse
from northdown.arrays.geometry import AccelerometerArray
from northdown.errors import InputError, expected

_MOST: Final = 64
# Iterations from each start, and then from the best of their ends.
_ROUNDS: Final = (80, 200)
_POLISHED: Final = 3
# Weight of what accelerometers that are too close add to the criterion, growing as the search ends.
_PUSHES: Final = (1e2, 1e4, 1e6)
# A start of random places that is nearly singular would send the search to nowhere.
_RIDGE: Final = 1e-9


@dataclass(frozen=True, eq=False)
class Removal:
    """What an array is without one of its accelerometers.

    Attributes
    ----------
    name : str
        The accelerometer.
    angular, force : float
        Factor by which the noise of angular acceleration and of specific force (totals) grows; infinite where the
        rest cannot measure everything.
    condition : float
        Of the rest.
    """

    name: str
    angular: float
    force: float
    condition: float


def leave_one_out(analysis: ArrayAnalysis) -> list[Removal]:
    """Take each accelerometer away in turn.

    Returns
    -------
    list of Removal
        The one that contributes least first: that of the smallest growth of angular noise, then of force noise.
    """
    found = []
    for k, name in enumerate(analysis.array.names):
        try:
            rest = analyse(analysis.array.without(k), np.delete(analysis.noise, k))
        except InputError:
            found.append(Removal(name, math.inf, math.inf, math.inf))
            continue
        angular = rest.angular_dilution / analysis.angular_dilution
        force = rest.force_dilution / analysis.force_dilution
        found.append(Removal(name, angular, force, rest.condition))
    return sorted(found, key=lambda r: (round(r.angular, 9), round(r.force, 9)))


@dataclass(frozen=True, eq=False)
class Placement:
    """Best places that a search has found.

    Attributes
    ----------
    analysis : ArrayAnalysis
        Of the array.
    criterion : {"D", "A"}
        What was best.
    side, spacing : float
        Of the square, and least distance of two accelerometers, m.
    starts : int
        Searches from random starts.
    spread : float
        How much worse the third best of them is, relative to the best (for D, of the sixth root): where this is
        large, more starts may find a better one.
    """

    analysis: ArrayAnalysis
    criterion: str
    side: float
    spacing: float
    starts: int
    spread: float

    @property
    def array(self) -> AccelerometerArray:
        """The array."""
        return self.analysis.array


def best_in_plane(
    count: int,
    side: float,
    *,
    criterion: str = "D",
    spacing: float | None = None,
    seed: int = 0,
    starts: int = 24,
) -> Placement:
    """Find the best places and sensing directions of accelerometers in a square of the plane z = 0.

    Parameters
    ----------
    count : int
        How many, 6 to 64.
    side : float
        Of the square, whose middle is the body's origin, m.
    criterion : {"D", "A"}
        See above. A weighs angular acceleration against specific force, D does not need to.
    spacing : float, optional
        Least distance between two, m; a twentieth of the side when not given. Without any the best is several in one
        place.
    seed : int
        Of the random starts; the same seed gives the same array.
    starts : int
        Searches; raising it makes a better array likelier and takes as much longer.

    Raises
    ------
    InputError
        When so many do not fit at that spacing.

    Notes
    -----
    Quasi-Newton search (BFGS) with exact gradients. The solution is a good one, not proven to be the best.
    """
    if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or not 6 <= count <= _MOST:
        raise InputError(expected(f"6 to {_MOST} accelerometers", f"{count!r}"))
    half = 0.5 * check_number("side", side, above=0.0, high=1e3, unit="m")
    gap = 0.1 * half if spacing is None else check_number("spacing", spacing, low=0.0, unit="m")
    check_choice("criterion", criterion, ("D", "A"))
    if isinstance(starts, bool) or not isinstance(starts, (int, np.integer)) or not 1 <= starts <= 1000:
        raise InputError(expected("1 to 1000 starts", f"{starts!r}"))
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise InputError(expected("a seed that is a whole number of 0 or more", repr(seed)))
    search = _Search(int(count), gap / half, criterion)
    rng = np.random.default_rng(seed)
    rough = sorted((search.improve(search.start(rng), _PUSHES[:1], _ROUNDS[0]) for _ in range(starts)), key=_value)
    ends = sorted((search.improve(x, _PUSHES, _ROUNDS[1]) for _, x in rough[:_POLISHED]), key=_value)
    good = [(value, x) for value, x in ends if search.nearest(x) > 0.995 * search.gap]
    if not good:
        got = f"{count} in a square of {1e3 * side:g} mm"
        raise InputError(expected(f"room for accelerometers {1e3 * gap:.3g} mm apart", got, do="lower the spacing"))
    (best, places), (last, _) = good[0], good[-1]
    position, direction = search.geometry(places)
    names = [f"a{k + 1}" for k in range(count)]
    array = AccelerometerArray(half * position, direction, names, f"best {count} in {1e3 * side:g} mm ({criterion})")
    spread = math.expm1((last - best) / 6.0) if criterion == "D" else last / best - 1.0
    return Placement(analyse(_tidy(array)), criterion, float(side), gap, int(starts), spread)


def _value(end: tuple[float, FloatArray]) -> float:
    return end[0]


class _Search:
    """Search in the square of side 2.

    The variables of each accelerometer are u, v and the two angles of its direction; its place is x = sin u,
    y = sin v, which keeps it in the square.
    """

    def __init__(self, count: int, gap: float, criterion: str) -> None:
        self.gap = gap
        self._count, self._criterion = count, criterion
        self._pairs = np.triu_indices(count, 1)

    def start(self, rng: np.random.Generator) -> FloatArray:
        """Random variables."""
        k = self._count
        places = rng.uniform(-1.0, 1.0, 2 * k)
        return np.concatenate(
            [np.arcsin(places), np.arccos(rng.uniform(-1.0, 1.0, k)), rng.uniform(0.0, 2.0 * np.pi, k)]
        )

    def improve(self, x: FloatArray, pushes: Sequence[float], rounds: int) -> tuple[float, FloatArray]:
        """Search from given variables: value of the criterion at the end, and the variables there."""
        from scipy.optimize import minimize

        for push in pushes if self.gap > 0.0 else (0.0,):
            done = minimize(self._cost, x, (push,), "BFGS", jac=True, options={"maxiter": rounds, "gtol": 1e-4})
            x = np.asarray(done.x, dtype=np.float64)
        return self._cost(x, 0.0)[0], x

    def geometry(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions and unit directions (K, 3)."""
        k = self._count
        up, round_ = x[2 * k : 3 * k], x[3 * k :]
        direction = np.column_stack([np.sin(up) * np.cos(round_), np.sin(up) * np.sin(round_), np.cos(up)])
        return np.column_stack([np.sin(x[: 2 * k]).reshape(k, 2), np.zeros(k)]), direction

    def nearest(self, x: FloatArray) -> float:
        """Least distance of two accelerometers."""
        i, j = self._pairs
        places = np.sin(x[: 2 * self._count]).reshape(-1, 2)
        return float(np.linalg.norm(places[i] - places[j], axis=1).min())

    def _cost(self, x: FloatArray, push: float) -> tuple[float, FloatArray]:
        """Criterion (to be small) with its gradient; `push` weighs pairs that are too close."""
        k = self._count
        r, d = self.geometry(x)
        rows = np.hstack([_cross(r, d), d])
        values, axes = np.linalg.eigh(rows.T @ rows)
        values = np.maximum(values, 0.0) + _RIDGE
        power = 1 if self._criterion == "D" else 2
        cost = -float(np.log(values).sum()) if power == 1 else float((1.0 / values).sum())
        # of −log det M and of tr M⁻¹ alike: −2 M⁻¹ j_k and −2 M⁻² j_k
        by_row = -2.0 * rows @ (axes / values**power) @ axes.T
        turn, line = by_row[:, :3], by_row[:, 3:]
        by_place = _cross(d, turn)[:, :2]
        by_line = line + _cross(turn, r)
        up, round_ = x[2 * k : 3 * k], x[3 * k :]
        tilt = np.column_stack([np.cos(up) * np.cos(round_), np.cos(up) * np.sin(round_), -np.sin(up)])
        spin = np.column_stack([-d[:, 1], d[:, 0], np.zeros(k)])
        extra, away = self._closeness(x)
        inside = np.cos(x[: 2 * k])
        slope = np.concatenate(
            [(by_place + push * away).ravel() * inside, (by_line * tilt).sum(1), (by_line * spin).sum(1)]
        )
        return cost + push * extra, slope

    def _closeness(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Sum of squares of what pairs lack to the spacing, relative to it, and its gradient (K, 2)."""
        k = self._count
        gradient = np.zeros((k, 2))
        if self.gap == 0.0:
            return 0.0, gradient
        i, j = self._pairs
        places = np.sin(x[: 2 * k]).reshape(-1, 2)
        apart = places[i] - places[j]
        distance = np.maximum(np.linalg.norm(apart, axis=1), 1e-12)
        lack = np.maximum(1.0 - distance / self.gap, 0.0)
        each = (-2.0 * lack / (self.gap * distance))[:, None] * apart
        for axis in range(2):
            gradient[:, axis] = np.bincount(i, each[:, axis], k) - np.bincount(j, each[:, axis], k)
        return float((lack * lack).sum()), gradient


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    # three times as fast on a few rows as numpy's
    x, y, z = a.T
    u, v, w = b.T
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=1)


def _tidy(array: AccelerometerArray) -> AccelerometerArray:
    """The same array, each direction turned so that its largest component is positive, in order around the middle."""
    d = array.direction
    largest = np.take_along_axis(d, np.argmax(np.abs(d), axis=1)[:, None], axis=1)
    order = np.argsort(np.round(np.arctan2(array.position[:, 1], array.position[:, 0]), 9), kind="stable")
    turned = (d * np.sign(largest))[order]
    return AccelerometerArray(array.position[order], turned, array.names, array.name)
