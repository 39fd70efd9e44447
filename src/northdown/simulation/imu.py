"""A simulated recording: what the sensors of a moving body say, with known truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from northdown._validation import FloatArray, check_number
from northdown.errors import InputError, expected
from northdown.frames import check_frame
from northdown.orientation import Orientation
from northdown.recording import Recording
from northdown.simulation.motion import Motion, random_motion

STANDARD_GRAVITY = 9.80665


@dataclass(frozen=True)
class SensorErrors:
    """Errors of a nine-axis sensor: white noise and a constant bias of each kind.

    Parameters
    ----------
    gyr_noise, acc_noise, mag_noise : float
        Noise densities, rad/s/√Hz, m/s²/√Hz and µT/√Hz.
    gyr_bias, acc_bias, mag_bias : float
        Standard deviations of the constant bias of each axis, rad/s, m/s², µT.
    """

    gyr_noise: float = 0.0
    acc_noise: float = 0.0
    mag_noise: float = 0.0
    gyr_bias: float = 0.0
    acc_bias: float = 0.0
    mag_bias: float = 0.0


LOW_COST = SensorErrors(gyr_noise=1.75e-4, acc_noise=3e-3, mag_noise=0.06, gyr_bias=5e-3, acc_bias=0.03, mag_bias=0.5)
"""Errors of a common MEMS part after calibration: 0.01 °/s/√Hz, 300 µg/√Hz, 0.6 µT at 100 Hz; bias 0.3 °/s."""


def measure(
    motion: Motion,
    errors: SensorErrors,
    rng: np.random.Generator,
    *,
    field: FloatArray | None = None,
    gravity: float = STANDARD_GRAVITY,
    frame: str = "NED",
    name: str = "simulated",
) -> Recording:
    """Let a nine-axis sensor measure a motion.

    Parameters
    ----------
    motion : Motion
        What the body does.
    errors : SensorErrors
        Errors to add.
    rng : numpy.random.Generator
        Source of the randomness.
    field : (3,) array, optional
        Magnetic field in NED, µT; 50 µT with 65° dip when not given.
    gravity : float
        Gravity, m/s².
    frame : {"NED", "ENU", "NWU"}
        Frame in which the recording states its truth.
    name : str
        Name of the recording.

    Returns
    -------
    Recording
        The gyroscope's sample is the mean rate since the sample before: log(R_{k−1}ᵀ R_k)/Δt, so that the exact
        integration of error-free samples gives back the truth.
    """
    rotation, n = motion.rotation, len(motion.time)
    if n < 2:
        raise InputError(expected("a motion of two samples or more", f"{n}"))
    if field is None:
        field = 50.0 * np.array([np.cos(np.deg2rad(65.0)), 0.0, np.sin(np.deg2rad(65.0))])
    dt = np.diff(motion.time)
    step = (rotation[:-1].inv() * rotation[1:]).as_rotvec() / dt[:, None]
    gyr = np.vstack([step[:1], step])
    acc = rotation.inv().apply(motion.acceleration - np.array([0.0, 0.0, gravity]))
    mag = rotation.inv().apply(field)
    root_rate = np.sqrt(1.0 / np.median(dt))

    def spoil(true: FloatArray, noise: float, bias: float) -> FloatArray:
        offset = rng.normal(0.0, 1.0, 3) * bias
        spoiled: FloatArray = true + offset + rng.normal(0.0, 1.0, (n, 3)) * (noise * root_rate)
        return spoiled

    truth = Orientation.from_rotation(motion.time, rotation, "NED", name="truth").to_frame(frame)
    moving = np.linalg.norm(gyr, axis=1) > 1e-6
    return Recording(
        motion.time,
        spoil(gyr, errors.gyr_noise, errors.gyr_bias),
        spoil(acc, errors.acc_noise, errors.acc_bias),
        spoil(mag, errors.mag_noise, errors.mag_bias),
        reference=truth,
        movement=moving if moving.any() else None,
        frame=check_frame(frame),
        name=name,
    )


def simulate(duration: float = 60.0, *, rate: float = 100.0, seed: int = 0, frame: str = "NED") -> Recording:
    """Recording of a handheld low-cost sensor in smooth random motion, with its truth.

    Parameters
    ----------
    duration : float
        Length, s.
    rate : float
        Sampling rate, Hz.
    seed : int
        The same seed gives the same recording.
    frame : {"NED", "ENU", "NWU"}
        Frame in which the recording states its truth.

    Returns
    -------
    Recording
        With `reference` (the truth at every sample) and `movement`.
    """
    duration = check_number("duration", duration, low=1.0, unit="s")
    rate = check_number("rate", rate, low=1.0, high=10_000.0, unit="Hz")
    rng = np.random.default_rng(seed)
    motion = random_motion(duration, rate, rng)
    return measure(motion, LOW_COST, rng, frame=frame, name=f"simulated-{seed}")
