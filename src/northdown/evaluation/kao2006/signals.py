"""Signals of K06's seven accelerometers and its magnetometer, for many runs of one motion at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from northdown._validation import FloatArray
from northdown.arrays import AccelerometerArray
from northdown.arrays.library import coplanar7
from northdown.evaluation.kao2006._algebra import euler_angles, matrix_nb
from northdown.evaluation.kao2006.constants import RATE, Constants
from northdown.simulation.motion import Motion
from northdown.simulation.seeds import Seed, generator


@dataclass(frozen=True, eq=False)
class Signals:
    """What the sensors measured in R runs of a motion, and the truth.

    Parameters
    ----------
    constants : Constants
        With which they were made.
    array : AccelerometerArray
        A1, A2, A3x, A3y, A4, A5, A6.
    time : (N,) array
        s.
    quat : (N, 4) array
        True attitude, body to NED.
    rate : (N, 3) array
        True rate, rad/s, body axes.
    array_acc : (R, N, 7) array
        Specific force along each accelerometer, m/s². K06 writes the opposite sign of gravity.
    mag : (R, N, 3) array
        Field in body axes, in sizes of the field.
    """

    constants: Constants
    array: AccelerometerArray
    time: FloatArray
    quat: FloatArray
    rate: FloatArray
    array_acc: FloatArray
    mag: FloatArray

    @property
    def euler(self) -> FloatArray:
        """True roll, pitch, yaw (N, 3), rad."""
        return euler_angles(self.quat)

    def gravity(self) -> FloatArray:
        """Gravity (R, N, 3) in body axes that the accelerometers measure at rest, K06 (2.26), m/s²."""
        return -self.array_acc @ gravity_weights(self.array).T

    def measured_angles(self) -> FloatArray:
        """Roll, pitch and yaw (R, N, 3) from each sample alone, K06 (3.11) to (3.15), rad."""
        return measured_angles(self.gravity(), self.mag)


def gravity_weights(array: AccelerometerArray) -> FloatArray:
    """Weights (3, 7) of K06 (2.25): ½ (A1 − A3x), ½ (A2 + A3y), and the z accelerometers' value at the centre."""
    weights = np.zeros((3, 7))
    weights[0, [0, 2]] = 0.5, -0.5
    weights[1, [1, 3]] = 0.5
    plane = np.column_stack([array.position[4:, :2], np.ones(3)])
    weights[2, 4:] = np.linalg.inv(plane)[2]
    return weights


def measured_angles(gravity: FloatArray, mag: FloatArray) -> FloatArray:
    """Roll, pitch and yaw (..., 3) of gravity and field (..., 3), in body axes, rad."""
    x, y, z = np.moveaxis(gravity, -1, 0)
    level = np.hypot(y, z)
    roll, pitch = np.arctan2(y, z), np.arctan2(-x, level)
    across = (z * mag[..., 1] - y * mag[..., 2]) / level
    toward = (y * mag[..., 1] + z * mag[..., 2]) / level
    yaw = np.arctan2(-across, np.cos(pitch) * mag[..., 0] + np.sin(pitch) * toward)
    return np.stack([roll, pitch, yaw], axis=-1)


def simulate(motion: Motion, constants: Constants, runs: int = 1, seed: Seed = 0) -> Signals:
    """Simulate the sensors.

    Parameters
    ----------
    motion : Motion
        Such as from `Constants.motion`.
    constants : Constants
        Noise, geometry, field, gravity.
    runs : int
        How often, with other noise.
    seed : int or numpy.random.Generator
        Of the noise.
    """
    state = motion.at(motion.times(RATE))
    array = coplanar7(constants.radius)
    force = state.specific_force(constants.gravity)
    clean = np.hstack([state.angular_acceleration, force]) @ array.matrix.T
    clean += rate_products(state.rate) @ array.products.T
    field = np.einsum("nji,j->ni", matrix_nb(state.quat), constants.field_n)
    rng = generator(seed)
    return Signals(
        constants=constants,
        array=array,
        time=state.time,
        quat=state.quat,
        rate=state.rate,
        array_acc=clean + constants.acc_noise * rng.standard_normal((runs, *clean.shape)),
        mag=field + constants.mag_noise * rng.standard_normal((runs, *field.shape)),
    )


def rate_products(rate: FloatArray) -> FloatArray:
    """ωx², ωy², ωz², ωxωy, ωxωz, ωyωz, (..., 6)."""
    x, y, z = np.moveaxis(rate, -1, 0)
    return np.stack([x * x, y * y, z * z, x * y, x * z, y * z], axis=-1)
