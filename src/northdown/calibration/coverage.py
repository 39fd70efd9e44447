"""How much of the sphere of directions has been seen."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import numpy as np

from northdown._validation import FloatArray, check_vectors
from northdown.errors import InputError, expected

BINS: Final = 100


@dataclass(frozen=True, eq=False)
class Coverage:
    """Directions counted in bins of equal area.

    Attributes
    ----------
    centres : (100, 3) array
        Unit vectors to the bins' centres.
    counts : (100,) array of int
        Number of directions in each bin.
    """

    centres: FloatArray
    counts: np.typing.NDArray[np.intp]

    @property
    def share(self) -> float:
        """Share of the bins that hold at least one direction, 0 to 1."""
        return float((self.counts > 0).mean())

    @property
    def largest_gap(self) -> float:
        """Angle (rad) from the loneliest bin's centre to the nearest bin with a direction in it."""
        filled = self.counts > 0
        if not filled.any():
            return float(np.pi)
        nearest = (self.centres @ self.centres[filled].T).max(axis=1)
        return float(np.arccos(np.clip(nearest.min(), -1.0, 1.0)))

    @property
    def missing(self) -> FloatArray:
        """Unit vector (3,) towards the middle of what was not seen; NaN when everything was."""
        empty = self.centres[self.counts == 0]
        if not len(empty):
            return np.full(3, np.nan)
        total = empty.sum(axis=0)
        # where the holes lie opposite each other, their sum says nothing: then the loneliest bin
        if np.linalg.norm(total) < 0.2 * len(empty):
            nearest = (self.centres @ self.centres[self.counts > 0].T).max(axis=1, initial=-1.0)
            total = self.centres[int(np.argmin(nearest))]
        direction: FloatArray = total / np.linalg.norm(total)
        return direction


@cache
def centres() -> FloatArray:
    """Points of a Fibonacci lattice: nearly equal areas, no axis preferred."""
    k = np.arange(BINS) + 0.5
    z = 1.0 - 2.0 * k / BINS
    azimuth = np.pi * (3.0 - np.sqrt(5.0)) * k
    r = np.sqrt(1.0 - z * z)
    centres: FloatArray = np.column_stack([r * np.cos(azimuth), r * np.sin(azimuth), z])
    centres.setflags(write=False)
    return centres


def coverage(vectors: Any) -> Coverage:
    """Count the directions of vectors (N, 3), such as calibrated samples of a field; rows of NaN do not count."""
    values = check_vectors("vectors", vectors)
    values = values[~np.isnan(values).any(axis=1)]
    size = np.linalg.norm(values, axis=1)
    if (size == 0.0).any():
        raise InputError(expected("vectors with a direction", "a zero vector", at=int(np.argmin(size))))
    return Coverage(centres(), np.bincount(nearest(values), minlength=BINS))


def nearest(vectors: FloatArray) -> np.typing.NDArray[np.intp]:
    """Number (N,) of the bin in whose direction each vector (N, 3) is."""
    # in parts, as there are a hundred products for each
    parts = np.array_split(vectors, max(1, len(vectors) // 50_000))
    return np.concatenate([np.argmax(part @ centres().T, axis=1) for part in parts])
