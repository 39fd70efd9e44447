"""What kernels take of an accelerometer array's least squares solution, and the two equations that hold for it.

Tuple a, 69 entries: L_α 0–17, L_f 18–35; C_αα (triangle) 36–41, C_αf V 42–50, V 51–59, Λ 60–62, C_ff (triangle)
63–68, with the components of f that are measurements, C_ff = V Λ Vᵀ. `_array` defines them.
"""

from __future__ import annotations

from typing import Any, Final

from northdown.kernels.block_kalman import product, transposed
from northdown.kernels.jit import inline
from northdown.kernels.quaternion import add, down_b, scale
from northdown.kernels.rate_kalman import products, products_slope, times3
from northdown.kernels.weighting import ACCELERATING
from northdown.orientation import Flag

N_ARRAY: Final = 69
_ACC_REJECTED = int(Flag.ACC_REJECTED)


@inline
def subtract(a: Any, b: Any) -> Any:
    """Difference of two vectors."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@inline
def force_products(a: Any) -> Any:
    """L_f, 18 entries by rows."""
    return a[18:36]


@inline
def force_axis(a: Any, i: int) -> Any:
    """Column i of V; zero where fewer components of f are measured."""
    v = a[51:60]
    return (v[i], v[3 + i], v[6 + i])


@inline
def force_variance(a: Any, i: int) -> float:
    """Variance of f along that column, for channels of variance 1."""
    return a[60:63][i]  # type: ignore[no-any-return]


@inline
def coupling(a: Any, loose: float) -> Any:
    """G, and the six entries of the covariance of ω̇'s noise that it leaves, for channels of variance 1.

    `loose` is the variance, in the same unit, that linear acceleration adds to each component of f.
    """
    cav, axes = a[42:51], a[51:60]
    k = (1.0 / (a[60] + loose), 1.0 / (a[61] + loose), 1.0 / (a[62] + loose))
    scaled = (
        cav[0] * k[0],
        cav[1] * k[1],
        cav[2] * k[2],
        cav[3] * k[0],
        cav[4] * k[1],
        cav[5] * k[2],
        cav[6] * k[0],
        cav[7] * k[1],
        cav[8] * k[2],
    )
    lost = product(scaled, transposed(cav))
    c = a[36:42]
    left = (c[0] - lost[0], c[1] - lost[1], c[2] - lost[2], c[3] - lost[4], c[4] - lost[5], c[5] - lost[8])
    return product(scaled, transposed(axes)), left


@inline
def looseness(a: Any, acc_var: float, motion_time: float, motion: float, per: float) -> float:
    """Variance that linear acceleration adds to each component of f, for channels of variance 1.

    From its mean square, which holds noise of variance `per` a channel; as noise that stays for motion_time.
    """
    # Tilt errors too look like acceleration. Not taking them off errs on the safe side; taking off what P expects
    # of them would trust gravity most when tilt is least known.
    return motion_time * max(0.0, motion - per * (a[63] + a[66] + a[68])) / acc_var  # type: ignore[no-any-return]


@inline
def acceleration_flag(a: Any, loose: float, age_acc: float) -> int:
    """Whether the last sample's f was used with less than a tenth of its weight at rest."""
    return _ACC_REJECTED if age_acc == 0.0 and 3.0 * loose > ACCELERATING * (a[63] + a[66] + a[68]) else 0


@inline
def force_residual(a: Any, gravity: float, q: Any, rate: Any, force: Any) -> Any:
    """Specific force, free of biases, less what attitude and rate explain."""
    return add(subtract(force, products(a[18:36], rate)), scale(gravity, down_b(q)))


@inline
def turning(a: Any, gravity: float, q: Any, rate: Any, alpha: Any, force: Any, g: Any) -> Any:
    """Angular acceleration at a rate, from α and f free of biases."""
    known = subtract(alpha, products(a[:18], rate))
    return subtract(known, times3(g, force_residual(a, gravity, q, rate, force)))


@inline
def turning_slope(a: Any, rate: Any, g: Any) -> Any:
    """Derivative of the products of rates that `turning` takes off, nine entries by rows."""
    at = products_slope(a[:18], rate)
    leak = products_slope(a[18:36], rate)
    by_force = product(g, leak[0] + leak[1] + leak[2])
    return (
        at[0][0] - by_force[0],
        at[0][1] - by_force[1],
        at[0][2] - by_force[2],
        at[1][0] - by_force[3],
        at[1][1] - by_force[4],
        at[1][2] - by_force[5],
        at[2][0] - by_force[6],
        at[2][1] - by_force[7],
        at[2][2] - by_force[8],
    )
