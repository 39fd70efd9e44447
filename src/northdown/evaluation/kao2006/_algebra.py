"""Quaternions and their Jacobians for many runs at once: arrays (..., 4), w, x, y, z, from body to NED."""

from __future__ import annotations

from typing import Final

import numpy as np

from northdown._validation import FloatArray


def _quadratic_forms() -> FloatArray:
    """M (3, 3, 4, 4), symmetric, with (R_nb)ᵢⱼ = qᵀ Mᵢⱼ q, K06 (2.14)."""
    square = np.diag((1.0, 1.0, -1.0, -1.0)), np.diag((1.0, -1.0, 1.0, -1.0)), np.diag((1.0, -1.0, -1.0, 1.0))
    forms = np.zeros((3, 3, 4, 4))
    for i, k, other in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        forms[i, i] = square[i]
        # 2 (qᵢ qₖ ∓ w q_other)
        for row, column, sign in ((i, k, -1.0), (k, i, 1.0)):
            forms[row, column, 1 + i, 1 + k] = forms[row, column, 1 + k, 1 + i] = 1.0
            forms[row, column, 0, 1 + other] = forms[row, column, 1 + other, 0] = sign
    return forms


_FORMS: Final = _quadratic_forms()
# q̇ = ½ E ω with rows of E linear in q: E[:, j] = q ⊗ (0, e_j), and with the factors exchanged
_RIGHT: Final = np.array(
    [
        [[0, -1, 0, 0], [0, 0, -1, 0], [0, 0, 0, -1]],
        [[1, 0, 0, 0], [0, 0, 0, -1], [0, 0, 1, 0]],
        [[0, 0, 0, 1], [1, 0, 0, 0], [0, -1, 0, 0]],
        [[0, 0, -1, 0], [0, 1, 0, 0], [1, 0, 0, 0]],
    ],
    dtype=np.float64,
)
_LEFT: Final = np.where(np.arange(4)[:, None, None] * np.arange(4) > 0, -_RIGHT, _RIGHT)


def _linear(tensor: FloatArray, value: FloatArray) -> FloatArray:
    """Matrices (..., m, n) that are linear in vectors (..., k), by a tensor (m, n, k)."""
    flat: FloatArray = value @ tensor.reshape(-1, tensor.shape[-1]).T
    return flat.reshape(*value.shape[:-1], *tensor.shape[:-1])


def slopes_nb(quat: FloatArray) -> FloatArray:
    """∂(R_nb)ᵢⱼ/∂qₖ, (..., 3, 3, 4)."""
    return _linear(2.0 * _FORMS, quat)


def matrix_of_slopes(slopes: FloatArray, quat: FloatArray) -> FloatArray:
    """R_nb (..., 3, 3) of its slopes, as it is quadratic in q."""
    matrix: FloatArray = 0.5 * (slopes @ quat[..., None, :, None])[..., 0]
    return matrix


def matrix_nb(quat: FloatArray) -> FloatArray:
    """Rotation matrices (..., 3, 3); quadratic in q, without division by its norm, as K06 (2.14)."""
    return matrix_of_slopes(slopes_nb(quat), quat)


def rate_to_quat(quat: FloatArray) -> FloatArray:
    """E (..., 4, 3) with q̇ = ½ E ω, body rates."""
    return _linear(_RIGHT, quat)


def quat_to_quat(rate: FloatArray) -> FloatArray:
    """Ω (..., 4, 4) with q̇ = ½ Ω q."""
    return _linear(_RIGHT.transpose(0, 2, 1), rate)


def euler_angles(quat: FloatArray) -> FloatArray:
    """Roll, pitch, yaw (..., 3), rad."""
    m = matrix_nb(quat)
    pitch = np.arctan2(-m[..., 2, 0], np.hypot(m[..., 2, 1], m[..., 2, 2]))
    return np.stack([np.arctan2(m[..., 2, 1], m[..., 2, 2]), pitch, np.arctan2(m[..., 1, 0], m[..., 0, 0])], axis=-1)


def slope_of_euler(quat: FloatArray) -> FloatArray:
    """∂(roll, pitch, yaw)/∂q, (..., 3, 4), on unit quaternions."""
    slopes = slopes_nb(quat)
    m = matrix_of_slopes(slopes, quat)
    down = slopes[..., 2, :, :]
    y, z = m[..., 2, 1, None], m[..., 2, 2, None]
    level = np.maximum(y * y + z * z, 1e-12)
    c, s = m[..., 0, 0, None], m[..., 1, 0, None]
    roll = (z * down[..., 1, :] - y * down[..., 2, :]) / level
    yaw = (c * slopes[..., 1, 0, :] - s * slopes[..., 0, 0, :]) / np.maximum(c * c + s * s, 1e-12)
    return np.stack([roll, -down[..., 0, :] / np.sqrt(level), yaw], axis=-2)


def turn_to_quat(quat: FloatArray) -> FloatArray:
    """B (..., 4, 3) with δq = B δ for a small rotation vector δ in NED that turns the body, rad."""
    return 0.5 * _linear(_LEFT, quat)


def attitude_error(quat: FloatArray, truth: FloatArray) -> FloatArray:
    """Angle (...) of the rotation between two attitudes, rad."""
    inner = np.abs(np.sum(quat * truth, axis=-1))
    distance = np.minimum(np.linalg.norm(quat - truth, axis=-1), np.linalg.norm(quat + truth, axis=-1))
    angle: FloatArray = 2.0 * np.arctan2(distance * np.sqrt(np.maximum(1.0 - 0.25 * distance**2, 0.0)), inner)
    return angle
