"""`simulate_array`: an array of accelerometers on a moving body, with the truth beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy.typing as npt

from northdown.arrays import AccelerometerArray
from northdown.recording import Recording
from northdown.simulation.array_errors import ArrayErrors
from northdown.simulation.dipole import Dipole
from northdown.simulation.imu import measure
from northdown.simulation.imu_errors import SensorErrors, TriadErrors
from northdown.simulation.motion import STANDARD_GRAVITY, Motion
from northdown.simulation.seeds import Seed


def simulate_array(
    motion: Motion,
    array: AccelerometerArray,
    errors: ArrayErrors | None = None,
    seed: Seed = 0,
    *,
    rate: float = 100.0,
    time: npt.ArrayLike | None = None,
    mag: TriadErrors | None = TriadErrors(),  # noqa: B008  (a value that never changes)
    gyr: TriadErrors | None = None,
    field: npt.ArrayLike | None = None,
    gravity: float = STANDARD_GRAVITY,
    disturbances: Sequence[Dipole] = (),
    frame: str = "NED",
    name: str | None = None,
) -> Recording:
    """Let an array of accelerometers and a magnetometer measure a motion.

    Parameters
    ----------
    motion : Motion
        What the body does.
    array : AccelerometerArray
        Geometry as the recording states it.
    errors : ArrayErrors, optional
        What the accelerometers add to the truth, and how far the true geometry differs; nothing when not given.
    seed : int or numpy.random.Generator
        The same seed gives the same recording, byte by byte.
    rate : float
        Sampling rate, Hz.
    time : (N,) array, optional
        Sampling times instead of a rate, increasing, within the motion's span, s.
    mag : TriadErrors or None
        Errors of the magnetometer at the body's origin; None for no magnetometer.
    gyr : TriadErrors or None
        Errors of a gyroscope to compare with; none unless given. ``TriadErrors()`` measures the truth.
    field, gravity, disturbances, frame, name
        See `northdown.simulation.measure`.

    Returns
    -------
    Recording
        With `array`, `array_acc`, `mag` and `reference`, the truth.

    Notes
    -----
    Each accelerometer measures d · (f + ω̇ × r + ω × (ω × r)) with the exact angular acceleration of the motion, at
    the instant of its sample: unlike a gyroscope's, its samples are no means.
    """
    alone = mag is None and gyr is None
    sensors = SensorErrors(gyr=TriadErrors() if alone else gyr, acc=None, mag=mag)
    recording = measure(
        motion,
        sensors,
        seed,
        rate=rate,
        time=time,
        field=field,
        gravity=gravity,
        disturbances=disturbances,
        frame=frame,
        name=name,
        array=array,
        array_errors=errors,
    )
    if not alone or recording.reference is None:
        return recording
    # the gyroscope was there only because there has to be a sensor beside the array
    return replace(recording, gyr=None, reference=replace(recording.reference, gyr_bias=None))
