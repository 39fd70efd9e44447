"""`measure`: what the sensors on a moving body say, with the truth beside it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray, check_number
from northdown.arrays import AccelerometerArray
from northdown.errors import InputError, expected
from northdown.frames import check_frame
from northdown.orientation import Orientation
from northdown.recording import Recording
from northdown.simulation import _quaternions as quaternions
from northdown.simulation.array_errors import ArrayErrors
from northdown.simulation.dipole import Dipole
from northdown.simulation.imu_bench import Bench
from northdown.simulation.imu_errors import SensorErrors
from northdown.simulation.motion import STANDARD_GRAVITY, Motion, vector
from northdown.simulation.seeds import Seed, check_seed


def measure(
    motion: Motion,
    errors: SensorErrors | None = None,
    seed: Seed = 0,
    *,
    rate: float = 100.0,
    time: npt.ArrayLike | None = None,
    field: npt.ArrayLike | None = None,
    gravity: float = STANDARD_GRAVITY,
    position: npt.ArrayLike = (0.0, 0.0, 0.0),
    disturbances: Sequence[Dipole] = (),
    frame: str = "NED",
    name: str | None = None,
    array: AccelerometerArray | None = None,
    array_errors: ArrayErrors | None = None,
) -> Recording:
    """Let sensors measure a motion.

    Parameters
    ----------
    motion : Motion
        What the body does.
    errors : SensorErrors, optional
        Which sensors there are and what they add to the truth; all three, without errors, when not given.
    seed : int or numpy.random.Generator
        The same seed gives the same recording, byte by byte. Each source of error has a stream of its own, so that a
        changed parameter leaves the other errors as they are.
    rate : float
        Sampling rate, Hz.
    time : (N,) array, optional
        Sampling times instead of a rate, increasing, within the motion's span, s.
    field : (3,) array, optional
        Magnetic field in NED, µT; 50 µT with 65° dip when not given. See `northdown.fields`.
    gravity : float
        Gravity, m/s².
    position : (3,) array
        Place of the sensors in the body, m: the accelerometer feels the turning of its lever arm.
    disturbances : sequence of Dipole
        Magnets in the surroundings.
    frame : {"NED", "ENU", "NWU"}
        Frame in which the recording states its truth.
    name : str, optional
        Name of the recording; the motion's when not given.
    array : AccelerometerArray, optional
        Accelerometers beside the other sensors, placed from the body's origin; see `simulate_array`.
    array_errors : ArrayErrors, optional
        What these add to the truth; nothing when not given.

    Returns
    -------
    Recording
        Its `reference` is the truth at its time stamps, with the gyroscope's true bias. `movement` marks samples with
        rotation, velocity or acceleration; it is None where there are none.

    Notes
    -----
    A sample of the gyroscope is the mean rate since the sample before, log(R_{k−1}ᵀ R_k)/Δt, so that the exact
    integration of error-free samples gives back the truth.
    """
    unit = _array_of(array, array_errors)
    parts = list(_parts(motion, errors, seed, rate, time, field, gravity, position, disturbances, unit))
    joined = {k: np.concatenate([p[k] for p in parts]) for k in parts[0]}
    moves = bool(joined["movement"].any())
    return _recording(joined, check_frame(frame), name or motion.name, array, keep_movement=moves)


def measure_chunks(
    motion: Motion,
    errors: SensorErrors | None = None,
    seed: Seed = 0,
    *,
    chunk: int = 65536,
    rate: float = 100.0,
    time: npt.ArrayLike | None = None,
    field: npt.ArrayLike | None = None,
    gravity: float = STANDARD_GRAVITY,
    position: npt.ArrayLike = (0.0, 0.0, 0.0),
    disturbances: Sequence[Dipole] = (),
    frame: str = "NED",
    name: str | None = None,
    array: AccelerometerArray | None = None,
    array_errors: ArrayErrors | None = None,
) -> Iterator[Recording]:
    """Let sensors measure a motion of any length in little memory.

    Parameters
    ----------
    chunk : int
        Samples in each of the recordings, of which the last may be shorter.
    motion, errors, seed, rate, time, field, gravity, position, disturbances, frame, name, array, array_errors
        See `measure`.

    Yields
    ------
    Recording
        The next part. Together they are byte by byte what `measure` returns, except that `movement` is always given.
    """
    if chunk < 1:
        raise InputError(expected("a chunk of one sample or more", f"{chunk}"))
    check_frame(frame)
    waiting: list[dict[str, npt.NDArray[Any]]] = []
    count = 0
    unit = _array_of(array, array_errors)
    for part in _parts(motion, errors, seed, rate, time, field, gravity, position, disturbances, unit):
        waiting.append(part)
        count += len(part["time"])
        if count < chunk:
            continue
        joined = {k: np.concatenate([p[k] for p in waiting]) for k in part}
        done = count - count % chunk
        for first in range(0, done, chunk):
            some = {k: v[first : first + chunk] for k, v in joined.items()}
            yield _recording(some, check_frame(frame), name or motion.name, array, keep_movement=True)
        waiting = [{k: v[done:] for k, v in joined.items()}]
        count -= done
    if count:
        joined = {k: np.concatenate([p[k] for p in waiting]) for k in waiting[0]}
        yield _recording(joined, check_frame(frame), name or motion.name, array, keep_movement=True)


def _parts(
    motion: Motion,
    errors: SensorErrors | None,
    seed: Seed,
    rate: float,
    time: npt.ArrayLike | None,
    field: npt.ArrayLike | None,
    gravity: float,
    position: npt.ArrayLike,
    disturbances: Sequence[Dipole],
    array: tuple[AccelerometerArray, ArrayErrors] | None,
) -> Iterator[dict[str, npt.NDArray[Any]]]:
    if not isinstance(motion, Motion):
        raise InputError(expected("a Motion", type(motion).__name__))
    for dipole in disturbances:
        if not isinstance(dipole, Dipole):
            raise InputError(expected("disturbances that are Dipoles", type(dipole).__name__))
    field_n = 50.0 * np.array([np.cos(np.deg2rad(65.0)), 0.0, np.sin(np.deg2rad(65.0))])
    bench = Bench(
        motion,
        SensorErrors() if errors is None else errors,
        check_seed(seed),
        rate=rate,
        time=time,
        field=field_n if field is None else vector("field", field),
        gravity=check_number("gravity", gravity, low=0.0, unit="m/s²"),
        position=vector("position", position),
        disturbances=tuple(disturbances),
        array=array,
    )
    yield from bench.blocks()


def _array_of(
    array: AccelerometerArray | None, errors: ArrayErrors | None
) -> tuple[AccelerometerArray, ArrayErrors] | None:
    """Array with its errors, checked."""
    if array is None:
        if errors is not None:
            raise InputError(expected("array with array_errors", "array_errors alone"))
        return None
    if not isinstance(array, AccelerometerArray):
        raise InputError(expected("an AccelerometerArray", type(array).__name__))
    if errors is not None and not isinstance(errors, ArrayErrors):
        raise InputError(expected("ArrayErrors", type(errors).__name__, do="make them with ArrayErrors.of"))
    return array, ArrayErrors() if errors is None else errors


def _recording(
    part: dict[str, npt.NDArray[Any]],
    frame: Any,
    name: str,
    array: AccelerometerArray | None,
    *,
    keep_movement: bool,
) -> Recording:
    quat: FloatArray = np.ascontiguousarray(quaternions.normalize(part["quat"].T).T)
    truth = Orientation(part["time"], quat, "NED", gyr_bias=part.get("gyr_bias"), name="truth").to_frame(frame)
    return Recording(
        part["time"],
        part.get("gyr"),
        part.get("acc"),
        part.get("mag"),
        reference=truth,
        movement=part["movement"] if keep_movement else None,
        frame=frame,
        name=name,
        array=array,
        array_acc=part.get("array_acc"),
    )
