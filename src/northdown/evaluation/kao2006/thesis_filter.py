r"""K06's filters as its chapter 3 has them, for R runs at once: seven states, dense matrices.

State x = (ω, q). Six accelerometers, A1, A2, A3y and A4 to A6, give angular acceleration, which drives it by forward
Euler steps of Δ = 1/400 s, K06 (3.25) with the sign of the centripetal terms put right:

.. math::  \omega \leftarrow \omega + \Delta\, J^{-1}_{1:3} (A - P\,p(\omega)),\qquad
           q \leftarrow q + \tfrac12 \Delta\, \Omega(\omega)\, q

with the noise Q = Δ² J⁻¹ σ² J⁻ᵀ of K06 (3.27). Measurements are those of `measurements`. After each update q is
given its norm back and P is projected, so that it says nothing of q's norm, which K06 does not state; with the norm
as a further measurement of σ = 0.001 the tables change by less than 1 %. The iterated filter is the Gauss–Newton form
of K06 (3.5) to (3.8), misprints corrected.

The noise of the accelerometers enters ω̇ and the measured gravity both; that correlation is left out, as in K06.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from northdown._validation import FloatArray
from northdown.evaluation.kao2006 import measurements
from northdown.evaluation.kao2006._algebra import (
    attitude_error,
    euler_angles,
    quat_to_quat,
    rate_to_quat,
    slope_of_euler,
)
from northdown.evaluation.kao2006.constants import RATE
from northdown.evaluation.kao2006.published import Method
from northdown.evaluation.kao2006.signals import Signals, rate_products

ITERATIONS: Final = {"EKF": 1, "IKF": 3}
"""Linearisations per sample of the two filters; K06 does not print how often its IKF iterates."""
DRIVING: Final = (0, 1, 3, 4, 5, 6)
"""The accelerometers that drive the state, of the seven: all but A3x."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """What a filter made of R runs.

    Parameters
    ----------
    signals : Signals
        What it was given.
    rate, quat : (R, N, 3), (R, N, 4) arrays
        rad/s in body axes; w, x, y, z, body to NED.
    rate_variance, quat_covariance : (R, N, 3), (R, N, 4, 4) arrays
        Of the filter's own P.
    """

    signals: Signals
    rate: FloatArray
    quat: FloatArray
    rate_variance: FloatArray
    quat_covariance: FloatArray

    @property
    def euler(self) -> FloatArray:
        """Roll, pitch, yaw (R, N, 3), rad."""
        return euler_angles(self.quat)

    @property
    def euler_error(self) -> FloatArray:
        """Estimate minus truth (R, N, 3), the short way round, rad."""
        difference = self.euler - self.signals.euler
        short: FloatArray = (difference + np.pi) % (2.0 * np.pi) - np.pi
        return short

    @property
    def error(self) -> FloatArray:
        """Angle (R, N) between estimate and truth, rad."""
        return attitude_error(self.quat, self.signals.quat)

    def sigma(self, at: int | slice = slice(None)) -> FloatArray:
        """The filter's standard deviations, in the order and units of `published.ENTRIES`, of samples `at`."""
        covariance, quat = self.quat_covariance[:, at], self.quat[:, at]
        slope = slope_of_euler(quat)
        euler = np.einsum("...ij,...jk,...ik->...i", slope, covariance, slope)
        own = np.einsum("...ii->...i", covariance)[..., [1, 2, 3, 0]]
        variance = np.concatenate([self.rate_variance[:, at], own, np.rad2deg(np.rad2deg(euler))], axis=-1)
        sigma: FloatArray = np.sqrt(np.maximum(variance, 0.0))
        return sigma


def estimate(signals: Signals, method: Method, iterations: int = 1) -> Estimate:
    """Run a filter on all runs of some signals, from the true attitude and no rate.

    Parameters
    ----------
    signals : Signals
        From `simulate`.
    method : {"indirect", "direct"}
        Measurements.
    iterations : int
        Linearisations per sample: 1 is the EKF, more the IKF.
    """
    runs, samples = signals.array_acc.shape[:2]
    rate, quat = np.empty((runs, samples, 3)), np.empty((runs, samples, 4))
    variance, covariance = np.empty((runs, samples, 3)), np.empty((runs, samples, 4, 4))
    predict, correct = _predictor(signals), _corrector(signals, method, iterations)
    x = np.tile(np.concatenate([np.zeros(3), signals.quat[0]]), (runs, 1))
    p = np.tile(signals.constants.start_variance * np.eye(7), (runs, 1, 1))
    # beyond pitch ±90° the indirect measurements divide by nothing; what comes of that is the result
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for k in range(samples):
            if k:
                x, p = predict(x, p, k - 1)
            x, p = correct(x, p, k)
            rate[:, k], quat[:, k] = x[:, :3], x[:, 3:]
            variance[:, k], covariance[:, k] = np.einsum("rii->ri", p)[:, :3], p[:, 3:, 3:]
    return Estimate(signals, rate, quat, variance, covariance)


_Predict = Callable[[FloatArray, FloatArray, int], tuple[FloatArray, FloatArray]]
_Correct = Callable[[FloatArray, FloatArray, int], tuple[FloatArray, FloatArray]]


def _predictor(signals: Signals) -> _Predict:
    step = 1.0 / RATE
    chosen = list(DRIVING)
    to_acceleration = np.linalg.inv(signals.array.matrix[chosen])[:3]
    products = to_acceleration @ signals.array.products[chosen]
    measured = signals.array_acc[:, :, chosen] @ to_acceleration.T
    noise = np.zeros((7, 7))
    noise[:3, :3] = (step * signals.constants.acc_noise) ** 2 * to_acceleration @ to_acceleration.T

    def predict(x: FloatArray, p: FloatArray, k: int) -> tuple[FloatArray, FloatArray]:
        w, q = x[:, :3], x[:, 3:]
        turn = 0.5 * step * rate_to_quat(q)
        a = np.tile(np.eye(7), (len(x), 1, 1))
        a[:, :3, :3] -= step * products @ _slope_of_products(w)
        a[:, 3:, :3] = turn
        a[:, 3:, 3:] += 0.5 * step * quat_to_quat(w)
        w_next = w + step * (measured[:, k] - rate_products(w) @ products.T)
        q_next = q + np.einsum("rij,rj->ri", turn, w)
        return np.concatenate([w_next, q_next], axis=1), a @ p @ a.transpose(0, 2, 1) + noise

    return predict


def _slope_of_products(rate: FloatArray) -> FloatArray:
    """∂p/∂ω, (R, 6, 3)."""
    x, y, z = rate.T
    slope = np.zeros((len(rate), 6, 3))
    slope[:, 0, 0], slope[:, 1, 1], slope[:, 2, 2] = 2.0 * x, 2.0 * y, 2.0 * z
    slope[:, 3, 0], slope[:, 3, 1] = y, x
    slope[:, 4, 0], slope[:, 4, 2] = z, x
    slope[:, 5, 1], slope[:, 5, 2] = z, y
    return slope


def _corrector(signals: Signals, method: Method, iterations: int) -> _Correct:
    constants, gravity = signals.constants, signals.gravity()
    if method == "direct":
        measured = measurements.direct_measured(gravity, signals.mag)
        fixed = measurements.direct_noise(constants)
    else:
        with np.errstate(divide="ignore", invalid="ignore"):
            measured = measurements.indirect_measured(gravity, signals.mag, constants)

    def correct(x: FloatArray, p: FloatArray, k: int) -> tuple[FloatArray, FloatArray]:
        noise = fixed if method == "direct" else measurements.indirect_noise(x[:, 3:], constants)
        there = x
        for _ in range(iterations):
            q = there[:, 3:]
            value, h = (
                measurements.direct_expected(q, constants)
                if method == "direct"
                else measurements.indirect_expected(q)
            )
            ph = p[:, :, 3:] @ h.transpose(0, 2, 1)
            gain = np.linalg.solve(h @ ph[:, 3:] + noise, ph.transpose(0, 2, 1)).transpose(0, 2, 1)
            residual = measured[:, k] - value - np.einsum("rij,rj->ri", h, x[:, 3:] - q)
            there = x + np.einsum("rij,rj->ri", gain, residual)
        after = p - gain @ ph.transpose(0, 2, 1)
        return _unit(there, 0.5 * (after + after.transpose(0, 2, 1)))

    return correct


def _unit(x: FloatArray, p: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Give q its norm back, and take from P what it says of that norm."""
    q = x[:, 3:] / np.linalg.norm(x[:, 3:], axis=1, keepdims=True)
    along = np.tile(np.eye(7), (len(x), 1, 1))
    along[:, 3:, 3:] -= q[:, :, None] * q[:, None, :]
    return np.concatenate([x[:, :3], q], axis=1), along @ p @ along
