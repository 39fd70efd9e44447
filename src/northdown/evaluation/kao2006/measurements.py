"""K06's two sets of measurements, of the attitude q: what is measured, what is expected, and its Jacobian.

Indirect, K06 (3.16): z = (−tan ψ, −sin θ, tan φ), of gravity g and field m as measured,

    z₁ = (cos φ m_y − sin φ m_z) / (cos θ m_x + sin θ (sin φ m_y + cos φ m_z)),  z₂ = g_x / g,  z₃ = g_y / g_z

with roll φ and pitch θ of the same g. At pitch ±90° z₁ and z₃ are quotients of nothing.

Direct, K06 (3.23): z = (m_x, m_y, g_y, g_z), with the local field known.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from northdown._validation import FloatArray
from northdown.evaluation.kao2006._algebra import matrix_nb, matrix_of_slopes, slopes_nb
from northdown.evaluation.kao2006.constants import Constants


class Expected(NamedTuple):
    """Of R attitudes: measurements (R, M), and their slope by the quaternion (R, M, 4)."""

    value: FloatArray
    slope: FloatArray


def direct_measured(gravity: FloatArray, mag: FloatArray) -> FloatArray:
    """m_x, m_y, g_y, g_z, (..., 4)."""
    return np.concatenate([mag[..., :2], gravity[..., 1:]], axis=-1)


def direct_expected(quat: FloatArray, constants: Constants) -> Expected:
    """The same from attitudes (R, 4)."""
    slopes = slopes_nb(quat)
    m = matrix_of_slopes(slopes, quat)
    g, field = constants.gravity, constants.field_n
    value = np.concatenate([(field @ m)[:, :2], g * m[:, 2, 1:]], axis=-1)
    field_slope = field[0] * slopes[:, 0, :2] + field[2] * slopes[:, 2, :2]
    slope = np.concatenate([field_slope, g * slopes[:, 2, 1:]], axis=1)
    return Expected(value, slope)


def direct_noise(constants: Constants) -> FloatArray:
    """R, (1, 4, 4)."""
    sigma = (constants.mag_noise, constants.mag_noise, *constants.gravity_noise[1:])
    return np.diag(np.square(sigma))[None]


def indirect_measured(gravity: FloatArray, mag: FloatArray, constants: Constants) -> FloatArray:
    """−tan ψ, −sin θ, tan φ, (..., 3), of gravity (m/s²) and field."""
    across, toward, _, _, _, _, _ = _level(gravity / constants.gravity, mag)
    x, y, z = np.moveaxis(gravity, -1, 0)
    return np.stack([across / toward, x / constants.gravity, y / z], axis=-1)


def indirect_expected(quat: FloatArray) -> Expected:
    """The same from attitudes (R, 4)."""
    slopes = slopes_nb(quat)
    m = matrix_of_slopes(slopes, quat)
    north, east, down = slopes[:, 0, 0], slopes[:, 1, 0], slopes[:, 2]
    c, s, x, y, z = m[:, 0, 0], m[:, 1, 0], m[:, 2, 0], m[:, 2, 1], m[:, 2, 2]
    value = np.stack([-s / c, x, y / z], axis=-1)
    slope = np.stack(
        [
            (s[:, None] * north - c[:, None] * east) / (c * c)[:, None],
            down[:, 0],
            (z[:, None] * down[:, 1] - y[:, None] * down[:, 2]) / (z * z)[:, None],
        ],
        axis=1,
    )
    return Expected(value, slope)


def indirect_noise(quat: FloatArray, constants: Constants) -> FloatArray:
    """R (R, 3, 3): the noise of gravity and field taken through z at the attitudes (R, 4)."""
    m = matrix_nb(quat)
    slope = indirect_slope(m[:, 2], constants.field_n @ m)
    sigma = (*np.divide(constants.gravity_noise, constants.gravity), *(constants.mag_noise,) * 3)
    scaled = slope * np.asarray(sigma)
    noise: FloatArray = scaled @ scaled.transpose(0, 2, 1)
    return noise


def indirect_slope(gravity: FloatArray, mag: FloatArray) -> FloatArray:
    """∂z/∂(g, m), (R, 3, 6), at directions of gravity of size one and fields, (R, 3) each."""
    across, toward, sr, cr, sp, cp, level = _level(gravity, mag)
    mx, my, mz = mag.T
    _, y, z = gravity.T
    slope = np.zeros((len(gravity), 3, 6))
    by_pitch = -sp * mx + cp * (sr * my + cr * mz)
    by_roll = sp * across
    # pitch = −arcsin g_x, roll = atan2(g_y, g_z)
    slope[:, 0, 0] = -across / toward**2 * by_pitch * (-1.0 / cp)
    roll = (-(sr * my + cr * mz) * toward - across * by_roll) / toward**2
    slope[:, 0, 1] = roll * z / level
    slope[:, 0, 2] = -roll * y / level
    slope[:, 0, 3] = -across / toward**2 * cp
    slope[:, 0, 4] = (cr * toward - across * sp * sr) / toward**2
    slope[:, 0, 5] = (-sr * toward - across * sp * cr) / toward**2
    slope[:, 1, 0] = 1.0
    slope[:, 2, 1] = 1.0 / z
    slope[:, 2, 2] = -y / z**2
    return slope


def _level(gravity: FloatArray, mag: FloatArray) -> tuple[FloatArray, ...]:
    """Field turned level: across and toward north; sines and cosines of roll and pitch; g_y² + g_z²."""
    x, y, z = np.moveaxis(gravity, -1, 0)
    level = y * y + z * z
    sp = np.clip(-x, -1.0, 1.0)
    cp = np.sqrt(1.0 - sp * sp)
    sr, cr = y / np.sqrt(level), z / np.sqrt(level)
    across = cr * mag[..., 1] - sr * mag[..., 2]
    toward = cp * mag[..., 0] + sp * (sr * mag[..., 1] + cr * mag[..., 2])
    return across, toward, sr, cr, sp, cp, level
