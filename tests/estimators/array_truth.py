"""Arrays of accelerometers and what they measure of a motion, written down from the kinematics of a rigid body."""

from __future__ import annotations

import dataclasses

import numpy as np

import northdown as nd
from northdown import Recording
from northdown.arrays import AccelerometerArray

GRAVITY = 9.80665


def coplanar(radius: float = 0.0175, names: str = "1 2 3x 3y 4 5 6") -> AccelerometerArray:
    """K06 table 2.1, in which 1 and 2 sense along +x and +y as its (2.25) demands."""
    degrees = {"1": 80.0, "2": 200.0, "3x": -100.0, "3y": 20.0, "4": 40.0, "5": 160.0, "6": 280.0}
    along = {"1": (1, 0, 0), "2": (0, 1, 0), "3x": (-1, 0, 0), "3y": (0, 1, 0)}
    chosen = names.split()
    angle = np.deg2rad([degrees[n] for n in chosen])
    position = radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))])
    return AccelerometerArray(position, np.array([along.get(n, (0, 0, 1)) for n in chosen], float), chosen)


def scattered(count: int, seed: int = 5, size: float = 0.1) -> AccelerometerArray:
    """Accelerometers anywhere, pointing anywhere: nothing is symmetric."""
    rng = np.random.default_rng(seed)
    return AccelerometerArray(rng.uniform(-size, size, (count, 3)), rng.normal(size=(count, 3)))


def measured(array: AccelerometerArray, state, gravity: float = GRAVITY) -> np.ndarray:
    """Channels (N, K) without errors: d · (f + ω̇ × r + ω × (ω × r)) for each."""
    places = zip(array.position, array.direction, strict=True)
    return np.column_stack([state.specific_force(gravity, r) @ d for r, d in places])


def with_array(
    recording: Recording, motion, array: AccelerometerArray, noise: float = 0.0, seed: int = 0
) -> Recording:
    """A recording with the channels of an array on its body; `noise` in m/s²/√Hz."""
    channels = measured(array, motion.at(recording.time))
    sigma = noise * np.sqrt(recording.rate) if noise else 0.0
    channels = channels + np.random.default_rng(seed).normal(0.0, 1.0, channels.shape) * sigma
    return dataclasses.replace(recording, array=array, array_acc=channels)


def recorded(
    motion,
    array: AccelerometerArray,
    *,
    rate: float = 400.0,
    seed: int | None = None,
    acc_noise: float = 0.005,
    mag_noise: float = 0.05,
    dip: float = np.pi / 3,
    size: float = 50.0,
) -> Recording:
    """An array's channels and the field, with white noise of the given densities (m/s²/√Hz, µT/√Hz) and the truth.

    Without a seed there is no noise. Densities are the estimators' defaults: 0.1 m/s² and 1 µT at 400 Hz, as in K06.
    """
    time = motion.times(rate)
    state = motion.at(time)
    channels = measured(array, state)
    mag = state.rotation.inv().apply(size * np.array([np.cos(dip), 0.0, np.sin(dip)]))
    if seed is not None:
        rng = np.random.default_rng(seed)
        channels = channels + rng.normal(0.0, acc_noise * np.sqrt(rate), channels.shape)
        mag = mag + rng.normal(0.0, mag_noise * np.sqrt(rate), mag.shape)
    reference = nd.Orientation(time, state.quat, rate=state.rate)
    return Recording(time, mag=mag, array=array, array_acc=channels, reference=reference)


def jacobian(f, x, h=1e-6):
    return np.array([(f(x + d) - f(x - d)) / (2.0 * h) for d in h * np.eye(len(x))]).T


def products(w):
    x, y, z = w
    return np.array([x * x, y * y, z * z, x * y, x * z, y * z])
