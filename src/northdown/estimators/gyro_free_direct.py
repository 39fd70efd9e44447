r"""Attitude and rate without a gyroscope: accelerometer array and magnetometer, measured directly.

States are the angular rate, driven by the array's angular acceleration, and the attitude (`_gyro_free` has the
prediction). Measured, in body axes, are the specific force and the field's direction, in K06 (m_x, m_y, g_y, g_z):

.. math::

    z = \begin{pmatrix} f_m \\ m_b / B \end{pmatrix}, \qquad
    h(\omega, q) = \begin{pmatrix} -g\, R_{nb}^T e_3 + L_f\, p(\omega) \\
                                   R_{nb}^T (\cos D, 0, \sin D)^T \end{pmatrix}

with the dip D and the size B of the local field. No angle occurs, so that no attitude is singular. The noise of f_m
comes from the channels' through the least squares solution of the array (`_array`). Its covariance is full; in the
axes in which it is diagonal each component is a scalar update.

Source: C.-F. Kao, M.S. thesis, National Chiao Tung University, 2006 (K06), (3.1) to (3.8), (3.19) to (3.28).

Deviations. The iterated update is :math:`x_{i+1} = x^- + K_i (z - h(x_i) - H_i (x^- - x_i))`, which is (3.7) with the
inverses that its print lacks; (3.6) is P − P Hᵀ(H P Hᵀ + R)⁻¹ H P; the centripetal terms of (3.25) are subtracted.
Process and measurement noise come from the same accelerometers; their correlation, which K06 leaves out, is treated
exactly (`_array`). The attitude's error has three states, not four. The
covariance that is given allows for linear acceleration (`_gyro_free`); that of ``motion_time=0`` is K06's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from northdown._validation import FloatArray
from northdown.errors import InputError, expected
from northdown.estimators._array import Reduction
from northdown.estimators._array_coupling import force_axis, force_products, force_variance
from northdown.estimators._array_filter import Reduced
from northdown.estimators._gyro_free import (
    N_COMMON,
    N_OUT,
    N_STATE,
    GyroFreeKalman,
    aligned,
    block,
    corrected,
    finished,
    flagged,
    learn_field,
    moving,
    output,
    own,
    predict,
    rate_at,
)
from northdown.estimators.base import parameter
from northdown.frames import Frame
from northdown.kernels.direction_error import is_sample
from northdown.kernels.jit import inline
from northdown.kernels.kalman import NO_CORRECTION
from northdown.kernels.quaternion import add, cross, dot, scale, unit
from northdown.kernels.rate_kalman import (
    correct_attitude_row,
    correct_row,
    from_prior,
    matrix_nb,
    products,
    products_slope,
)
from northdown.kernels.runner import Kernel

Axes = Literal["xyz", "xy", "xz", "yz"]

# The mean of the first is taken when the specific force has a part along it of at least this share.
_WELL_PLACED = 0.5


@inline
def force_row(a: Any, m: Any, slope: Any, g: float) -> Any:
    """Derivative of the specific force along a by (δ, ω), before `from_prior`."""
    north, east = dot(a, m[0]), dot(a, m[1])
    x = a[0] * slope[0][0] + a[1] * slope[1][0] + a[2] * slope[2][0]
    y = a[0] * slope[0][1] + a[1] * slope[1][1] + a[2] * slope[2][1]
    z = a[0] * slope[0][2] + a[1] * slope[1][2] + a[2] * slope[2][2]
    return (-g * east, g * north, 0.0), (x, y, z)


@inline
def correct_force(p: Any, cov: Any, d: Any, at: Any, y: Any, m: Any, slope: Any, per: float) -> Any:
    """Update with the specific force less the expected at the point `at`, in the axes in which its noise is diagonal.

    A channel's noise has the variance per. Returns (P, correction, number of scalar updates).
    """
    point, dof = (at[0], at[1], at[2]), 0.0
    for i in range(3):
        a = force_axis(block(p), i)
        if dot(a, a) > 0.0:
            angle, rate = force_row(a, m, slope, p[2])
            angle = from_prior(angle, point)
            h = angle + rate
            z = dot(a, y) + dot(angle, point) + dot(rate, (at[3], at[4], at[5]))
            cov, d = correct_row(cov, d, h, z, per * force_variance(block(p), i))
            dof += 1.0
    return cov, d, dof


@inline
def correct_mag(cov: Any, d: Any, at: Any, used: Any, mag: Any, m: Any, north: float, down: float, r: float) -> Any:
    """Update with the components of the field that are used, likewise."""
    point = (at[0], at[1], at[2])
    u = (north, 0.0, down)
    for i in range(3):
        if used[i] != 0.0:
            axis = (m[0][i], m[1][i], m[2][i])
            h = from_prior(cross(axis, u), point)
            cov, d = correct_attitude_row(cov, d, h, mag[i] - dot(axis, u) + dot(h, point), r)
    return cov, d


@inline
def step(p: Any, s: Any, dt: float, gyr: Any, acc: Any, mag: Any) -> Any:
    """One sample; gyr and acc are α_m and f_m of the array."""
    acc_var, mag_var, g, iterations = p[:4]
    age_acc, age_mag, field = s[36] + dt, s[37] + dt, (s[38], s[39], s[40])
    motion, dof = s[42], 0.0
    used, inverse_size, leak = own(p)[:3], own(p)[3], force_products(block(p))

    q, w, cov = predict(p, s, dt)

    has_acc = is_sample(acc) and age_acc > 0.0
    has_mag = age_mag > 0.0
    for i in range(3):
        has_mag = has_mag and (used[i] == 0.0 or mag[i] == mag[i])
    north, down = p[7], p[8]
    shift = (0.0, 0.0, 0.0)
    if has_acc:
        _, rate = rate_at(p, q, w, gyr, acc, dt)
        shift = add(rate, scale(-1.0, w))
        motion = moving(p, motion, rate, acc, age_acc)
    if has_mag:
        has_mag = not is_sample(mag) or dot(mag, mag) > 0.0
    if has_mag:
        if inverse_size > 0.0:
            mag = scale(inverse_size, mag)
        else:
            mag = unit(mag)
            if north != north and has_acc:
                force = add(acc, scale(-1.0, products(leak, add(w, shift))))
                if dot(force, force) > 0.0:
                    field = learn_field(p, field, force, mag, age_mag)
        if north != north:
            has_mag = field[2] > 0.0
            if has_mag:
                k = 1.0 / math.sqrt(field[0] * field[0] + field[1] * field[1])
                north, down = k * field[0], k * field[1]

    d = NO_CORRECTION
    if has_acc or has_mag:
        prior = cov
        for _ in range(int(iterations)):
            at, d, cov, dof = d, NO_CORRECTION, prior, 0.0
            q_at, w_at = corrected(q, w, at)
            m = matrix_nb(q_at)
            if has_acc:
                rate = add(w_at, shift)
                y = add(acc, add(scale(g, m[2]), scale(-1.0, products(leak, rate))))
                slope = products_slope(leak, rate)
                cov, d, dof = correct_force(p, cov, d, at, y, m, slope, acc_var / age_acc)
            if has_mag:
                cov, d = correct_mag(cov, d, at, used, mag, m, north, down, mag_var / age_mag)
                # two also of a unit vector, as noise along it is gone
                dof += 2.0
        q, w = corrected(q, w, d)
    if has_acc:
        age_acc = 0.0
    if has_mag:
        age_mag = 0.0
    state = finished(p, s, q, w, cov, (gyr, acc), dt)
    return state + (age_acc, age_mag) + field + (0.0, motion, d[6], dof)


@dataclass(frozen=True, kw_only=True)
class GyroFreeDirect(GyroFreeKalman):
    """Kalman filter of attitude and rate on an accelerometer array and the components of a known field.

    Parameters
    ----------
    dip : float or None
        Angle of the field below the horizontal, rad. None: learned from the samples, as their mean so far. Raising it
        tips the result about the east axis.
    field_window : float
        Time constant (s) with which a learned dip follows the field. Raising it adapts more slowly to a new place.
    force_axes : {"xyz", "xy", "xz", "yz"}
        Components of specific force that are measured; K06 uses "yz". The others serve only for the start.
    mag_axes : {"xyz", "xy", "xz", "yz"}
        Components of the field that are measured. With three the field's size need not be known. With two, K06 uses
        "xy", it must be `field` µT and `dip` be given; NaN in the third is then no missing sample.

    References
    ----------
    C.-F. Kao, M.S. thesis, National Chiao Tung University, 2006, (3.19) to (3.28).
    """

    name = "gyro-free-direct"
    kernel = Kernel(
        "gyro-free-direct",
        step,
        n_params=N_COMMON + 4,
        n_state=N_STATE,
        n_out=N_OUT,
        output=output,
        aligned=aligned,
        flagged=flagged,
        covariance=7,
    )

    dip: float | None = parameter(None, unit="rad", low=-1.56, high=1.56)
    field_window: float = parameter(100.0, unit="s", above=0.0)
    force_axes: Axes = "xyz"
    mag_axes: Axes = "xyz"

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.mag_axes) < 3 and self.dip is None:
            do = "give dip in rad, and field in µT"
            raise InputError(expected("a known field with a magnetometer of two axes", "no dip", do=do))

    def _parameters(self, frame: Frame) -> Sequence[float]:
        return (
            *self._common(self.dip, self.field_window, self.reduction(), self.force_axes),
            *(float(axis in self.mag_axes) for axis in "xyz"),
            0.0 if len(self.mag_axes) == 3 else 1.0 / self.field,
        )

    def reduced(self, made: Reduction, row: FloatArray, mag: FloatArray | None) -> Reduced:
        """What the kernel takes; with two axes, the third component of the field is found for the start."""
        result = super().reduced(made, row, mag)
        if mag is None or len(self.mag_axes) == 3:
            return result
        return result._replace(mag=self.completed(result.force, mag))

    def completed(self, force: FloatArray, mag: FloatArray) -> FloatArray:
        """The field with its third component for the start, from its dip: f · m = −|f| B sin D.

        Left as NaN where specific force is nearly at right angles to the missing axis.
        """
        missing = next(i for i, axis in enumerate("xyz") if axis not in self.mag_axes)
        there = [i for i in range(3) if i != missing]
        size = np.sqrt(np.sum(force**2, axis=-1))
        along = -size * self.field * math.sin(self.dip or 0.0) - np.sum(force[..., there] * mag[..., there], axis=-1)
        placed = np.abs(force[..., missing]) > _WELL_PLACED * size
        found = mag.copy()
        found[..., missing] = np.where(placed, along / np.where(placed, force[..., missing], 1.0), np.nan)
        return found
