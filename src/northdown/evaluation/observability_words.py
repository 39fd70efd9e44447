"""Directions of change, told in words: heading, a bias about an axis, the length of the quaternion.

A set of directions, written as `Changes` have it, is searched for those that have a name.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np

from northdown._validation import FloatArray
from northdown.evaluation.observability_changes import Changes

# A direction with a name lies in a set of directions when it is less than 6° off it.
_WITHIN: Final = 0.99
# Share of a direction's length from which on a part of it is told.
_TOLD: Final = 0.1

_TURNED: Final = {"attitude": "rotation", "gyr_bias": "gyroscope bias", "rate": "angular rate"}
_PLAIN: Final = {
    "length": ("length of the quaternion",),
    "field": ("horizontal part of the field", "vertical part of the field"),
    "dip": ("dip of the field",),
}


class Namer:
    """Puts directions into words.

    Parameters
    ----------
    changes : Changes
        How the directions are written, at N times.
    rate : (3, N) array
        Body rates, rad/s.
    field : tuple of two floats
        The field's part to the north and down.
    """

    def __init__(self, changes: Changes, rate: FloatArray, field: tuple[float, float]) -> None:
        self._changes = changes
        self._rate = np.einsum("nij,jn->ni", changes.mats, rate)
        self._field = np.array([field[0], 0.0, field[1]])

    def describe_states(self, at: int, states: FloatArray) -> tuple[str, ...]:
        """Words for what changes of the state (n, m) span at sample `at`, one for each of the m."""
        return self.describe(at, self._changes.maps[at] @ states)

    def describe(self, at: int, changes: FloatArray) -> tuple[str, ...]:
        """Words for what changes (n, m) span at sample `at`, one for each of the m."""
        if not changes.shape[1]:
            return ()
        left: FloatArray = np.linalg.qr(changes)[0]
        axes = self._axes(at)
        found = []
        for text, named in self._named(axes):
            inside = left.T @ named
            if left.shape[1] >= named.shape[1] and ((inside * inside).sum(axis=0) >= _WITHIN).all():
                found.append(text)
                left = _without(left, inside)
        found += [self._mixture(vector, axes) for vector in left.T]
        return tuple(found)

    def _axes(self, at: int) -> dict[str, FloatArray]:
        """Axes with a name, in NED, of unit length."""
        mat = self._changes.mats[at]
        axes = {
            "the vertical": np.array([0.0, 0.0, 1.0]),
            "north": np.array([1.0, 0.0, 0.0]),
            "east": np.array([0.0, 1.0, 0.0]),
            **{f"body {name}": mat[:, k] for k, name in enumerate("xyz")},
        }
        for name, vector in (("the magnetic field", self._field), ("the axis of turning", self._rate[at])):
            length = float(np.linalg.norm(vector))
            if length > 1e-9:
                axes[name] = vector / length
        return axes

    def _named(self, axes: Mapping[str, FloatArray]) -> Iterator[tuple[str, FloatArray]]:
        """Directions with a name, those first that are preferred."""
        size = self._changes.maps.shape[1]
        every = np.eye(size)
        for group, place in self._changes.places.items():
            if group in _PLAIN:
                for text, row in zip(_PLAIN[group], every[place], strict=True):
                    yield text, row[:, None]
                continue
            yield f"{_TURNED[group]} about all axes", every[place].T
            names = list(axes)
            if group != "attitude":  # constant in the body, so that its axes come first
                names.sort(key=lambda n: n.startswith(("north", "east")))
            for name in names:
                direction = np.zeros((size, 1))
                direction[place, 0] = axes[name]
                yield _about(group, name), direction

    def _mixture(self, vector: FloatArray, axes: Mapping[str, FloatArray]) -> str:
        """A direction without a name as a sum of changes."""
        parts = []
        for group, place in self._changes.places.items():
            part = vector[place]
            length = float(np.linalg.norm(part))
            if length < _TOLD:
                continue
            if group in _PLAIN:
                parts += [t for t, v in zip(_PLAIN[group], part, strict=True) if abs(v) >= _TOLD]
                continue
            fits = (n for n, axis in axes.items() if abs(axis @ part) ** 2 >= _WITHIN * length * length)
            parts.append(_about(group, next(fits, "a slanted axis")))
        return " together with ".join(parts)


def _about(group: str, axis: str) -> str:
    if group == "attitude" and axis == "the vertical":
        return "heading"
    return f"{_TURNED[group]} about {axis}"


def _without(basis: FloatArray, inside: FloatArray) -> FloatArray:
    """Orthonormal basis of the part of a space at right angles to directions given by their coordinates in it."""
    columns = basis @ np.linalg.qr(inside, mode="complete")[0]
    return np.ascontiguousarray(columns[:, inside.shape[1] :])
