"""Covariances of many states as rows of one flat array, worked on in place.

A symmetric matrix of n states stands at an offset of the state array in n rows of `WIDTH` numbers; the entries beyond
the nth stay zero, so that all loops have one length, known when they are compiled, and run in vector registers. Both
triangles are kept: rows can then be read as columns.
"""

from __future__ import annotations

from typing import Any, Final

from northdown.kernels.jit import inline

WIDTH: Final = 24
"""Numbers in a row: the states, filled up to whole vector registers."""


@inline
def copy_row(s: Any, target: int, source: int) -> None:
    """Row at `target` becomes the row at `source`."""
    for j in range(WIDTH):
        s[target + j] = s[source + j]


@inline
def add_row(s: Any, target: int, factor: float, source: int) -> None:
    """Add `factor` times the row at `source` to that at `target`."""
    for j in range(WIDTH):
        s[target + j] += factor * s[source + j]


@inline
def add_three_rows(s: Any, target: int, factors: Any, source: int) -> None:
    """Add the three rows from `source` on, each times its factor, to that at `target`, which is none of them."""
    x, y, z = factors
    for j in range(WIDTH):
        s[target + j] += x * s[source + j] + y * s[source + WIDTH + j] + z * s[source + 2 * WIDTH + j]


@inline
def weigh_rows(s: Any, target: int, factors: Any, at: int, n: int, source: int) -> None:
    """Row at `target` becomes the sum of the n rows from `source` on, times `factors`, an array, from `at` on."""
    for j in range(WIDTH):
        total = 0.0
        for k in range(n):
            total += factors[at + k] * s[source + k * WIDTH + j]
        s[target + j] = total


@inline
def mirror_row(s: Any, cov: int, n: int, i: int) -> None:
    """Column i becomes row i."""
    for j in range(n):
        s[cov + j * WIDTH + i] = s[cov + i * WIDTH + j]


@inline
def take_measurement(s: Any, cov: int, n: int, gain: int, error: int, variance: float, innovation: float) -> None:
    """Scalar update: error += K y, P −= (P Hᵀ)(P Hᵀ)ᵀ / S with S = `variance` of the innovation y.

    At `gain` stands the row P Hᵀ, and afterwards K = P Hᵀ / S.
    """
    inverse = 1.0 / variance
    for i in range(n):
        k = s[gain + i] * inverse
        row = cov + i * WIDTH
        for j in range(WIDTH):
            s[row + j] -= k * s[gain + j]
    for j in range(WIDTH):
        s[gain + j] *= inverse
        s[error + j] += s[gain + j] * innovation
