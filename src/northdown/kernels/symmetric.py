"""Symmetric 3 × 3 matrices, given by their upper triangle by rows."""

from __future__ import annotations

from typing import Any

from northdown.kernels.jit import inline


@inline
def inverse3(m: Any) -> Any:
    """Of a positive definite one, by its adjugate."""
    xx, xy, xz, yy, yz, zz = m
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    d, e, f = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    k = 1.0 / (xx * a + xy * b + xz * c)
    return k * a, k * b, k * c, k * d, k * e, k * f


@inline
def product3(m: Any, v: Any) -> Any:
    """Of one and a vector."""
    return (
        m[0] * v[0] + m[1] * v[1] + m[2] * v[2],
        m[1] * v[0] + m[3] * v[1] + m[4] * v[2],
        m[2] * v[0] + m[4] * v[1] + m[5] * v[2],
    )
