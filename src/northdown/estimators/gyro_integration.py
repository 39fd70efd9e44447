r"""Integration of the gyroscope alone, by quaternion and by the naive sum of each angle.

``"quaternion"`` integrates :math:`\dot q = \tfrac12 q \otimes (0, \omega)` with the chosen integrator (W section
4; K06 (2.16)). ``"per-angle"`` adds up each axis by itself (M20 3.2):

.. math::  \phi \mathrel{+}= \omega_x \Delta t, \quad \theta \mathrel{+}= \omega_y \Delta t, \quad
           \psi \mathrel{+}= \omega_z \Delta t

which is right only for turns about one axis, from level: turns do not commute, and body rates are not the rates
of the Euler angles. It is here so that the difference can be shown.

Both drift with the gyroscope's bias and noise; nothing corrects them. The start is found from the first accelerometer
and magnetometer samples unless given.

K06's form divides the rate matrix by 2‖q‖ and does not renormalise. The norm then grows by about ω²Δt²/8 a step, and
with it the division slows the rotation down: at 1 rad/s and 100 Hz by 10.6 % after 100 s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from northdown._validation import FloatArray
from northdown.estimators.base import Estimator
from northdown.frames import Frame, quat_from_ned
from northdown.kernels import euler, strapdown
from northdown.kernels.jit import inline
from northdown.kernels.quaternion import multiply, normalize
from northdown.kernels.runner import Kernel


@inline
def euler_in_frame(turn: Any, q: Any) -> Any:
    """Roll, pitch, yaw of the attitude q (body → NED) in the frame to which `turn` leads."""
    return euler.to_zyx(multiply(turn, q))


@inline
def quaternion_from_frame(turn: Any, angles: Any) -> Any:
    """Inverse of `euler_in_frame`."""
    return multiply((turn[0], -turn[1], -turn[2], -turn[3]), euler.from_zyx(angles))


@inline
def step(p: Any, s: Any, dt: float, gyr: Any, acc: Any, mag: Any) -> Any:
    """One sample: s = (w, x, y, z, roll, pitch, yaw), p = (per angle, integrator, turn w, x, y, z)."""
    q = (s[0], s[1], s[2], s[3])
    angles = (s[4], s[5], s[6])
    if p[0] != 0.0:
        angles = (angles[0] + gyr[0] * dt, angles[1] + gyr[1] * dt, angles[2] + gyr[2] * dt)
        q = quaternion_from_frame((p[2], p[3], p[4], p[5]), angles)
    else:
        q = strapdown.step(p[1], q, gyr, dt)
    return q + angles


@inline
def aligned(p: Any, s: Any, q: Any, heading_known: bool) -> Any:
    """State for an attitude found from the sensors."""
    return q + euler_in_frame((p[2], p[3], p[4], p[5]), q)


@inline
def output(p: Any, s: Any) -> Any:
    """The unit quaternion; K06's form leaves the state's norm free."""
    return normalize((s[0], s[1], s[2], s[3]))


@dataclass(frozen=True, kw_only=True)
class GyroIntegration(Estimator):
    """Integration of the gyroscope from a known start; drifts.

    Parameters
    ----------
    method : {"quaternion", "per-angle"}
        Quaternion strapdown, or M20's naive sum of each angle in the frame of the result.
    integrator : {"closed-form", "rk4", "first-order", "normalized-rate"}
        For the quaternion: exact for a rate that is constant over the step; fourth-order Runge–Kutta; W's Euler step,
        renormalised; K06's Euler step with its 1/(2‖q‖), not renormalised.

    References
    ----------
    W section 4, M20 section 3.2, K06 (2.16).
    """

    name = "gyro-integration"
    needs = ("gyr",)
    uses = ("gyr",)
    kernel = Kernel("gyro-integration", step, n_params=6, n_state=7, n_out=4, output=output, aligned=aligned)

    method: Literal["quaternion", "per-angle"] = "quaternion"
    integrator: Literal["closed-form", "rk4", "first-order", "normalized-rate"] = "closed-form"

    def _parameters(self, frame: Frame) -> Sequence[float]:
        return (float(self.method == "per-angle"), strapdown.code(self.integrator), *quat_from_ned(frame))

    def _initial_state(self, quat: FloatArray, frame: Frame) -> Sequence[float]:
        return tuple(euler_in_frame(tuple(quat_from_ned(frame)), tuple(quat)))
