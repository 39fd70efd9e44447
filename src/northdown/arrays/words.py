"""Directions and combinations of products of rates in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from northdown._validation import FloatArray

PRODUCTS: Final = ("ωx²", "ωy²", "ωz²", "ωxωy", "ωxωz", "ωyωz")
"""What the columns of `AccelerometerArray.products` belong to."""

# Numbers are said to two digits, so what is smaller than this beside others is not said.
_SAID: Final = 0.02


def axis_name(vector: FloatArray) -> str:
    """``"z"`` for a vector along z or against it, else its components, to two digits: ``"(0.71, 0.71, 0)"``."""
    unit = vector / np.linalg.norm(vector)
    along = int(np.argmax(np.abs(unit)))
    if np.delete(np.abs(unit), along).max() < _SAID:
        return "xyz"[along]
    unit = unit * np.sign(unit[np.argmax(np.abs(unit) > _SAID)])
    return f"({', '.join(_number(x) for x in unit)})"


def subspace_name(basis: FloatArray, prefix: str) -> str:
    """Name the space that rows (m, 3) span, such as ``"about x and y"`` with the prefix ``"about"``."""
    if len(basis) == 3:
        return f"{prefix} any axis"
    if len(basis) == 2:
        normal = axis_name(np.cross(basis[0], basis[1]))
        if normal in "xyz":
            first, second = (c for c in "xyz" if c != normal)
            return f"{prefix} {first} and {second}"
        return f"{prefix} any axis at right angles to {normal}"
    return f"{prefix} {axis_name(basis[0])}"


def echelon(rows: FloatArray) -> FloatArray:
    """Reduced row echelon form of independent rows, pivots chosen by size: the same space, said most simply."""
    m = rows.copy()
    done = 0
    for column in range(m.shape[1]):
        if done == len(m):
            break
        best = done + int(np.argmax(np.abs(m[done:, column])))
        if abs(m[best, column]) < _SAID * np.abs(m[best]).max():
            continue
        m[[done, best]] = m[[best, done]]
        m[done] /= m[done, column]
        others = np.arange(len(m)) != done
        m[others] -= np.outer(m[others, column], m[done])
        done += 1
    return m[:done]


def combination(weights: FloatArray, names: Sequence[str] = PRODUCTS) -> str:
    """Say a weighted sum: ``"ωx² − 0.5 ωy²"``; what is below 2 % of the largest weight is left out."""
    parts: list[str] = []
    for weight, name in zip(weights, names, strict=True):
        if abs(weight) < _SAID * np.abs(weights).max():
            continue
        size = f"{abs(weight):.2g}"
        sign = "−" if weight < 0.0 else "+"
        term = name if size == "1" else f"{size} {name}"
        parts.append(f"{sign} {term}" if parts else f"−{term}" if weight < 0.0 else term)
    return " ".join(parts)


def listed(items: Sequence[str]) -> str:
    """Items with commas and an 'and'."""
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}"


def _number(value: float) -> str:
    text = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text.replace("-", "−")
