"""Table 4.14: the gyro-free filter beside one with a gyroscope of growing noise, and table 4.15.

K06 does not say what its "error" is, nor on what motion. The size of its "measurement" row says at rest. Standard
deviations about the mean of the last half of two seconds give its other rows but that of the least noise; those of
the last quarter give all of them. The filter with a gyroscope is `GyroEulerEKF` (K06 section 4-5), told the true
noise.

The gyro-free row and table 4.15 come out with neither, when the radius is the one that meets tables 4.2 to 4.13: the
rates are twice as noisy as printed. With twice that radius they come out, so that is shown too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from northdown._validation import FloatArray
from northdown.evaluation.kao2006 import derived, published
from northdown.evaluation.kao2006._algebra import euler_angles, matrix_nb
from northdown.evaluation.kao2006.constants import DOCUMENTED, DURATION, RATE, Constants
from northdown.evaluation.kao2006.published import Method
from northdown.evaluation.kao2006.signals import Signals, measured_angles, simulate
from northdown.evaluation.kao2006.thesis_filter import estimate
from northdown.recording import Recording
from northdown.simulation.seeds import Seed, generator

RUNS: Final = 200
WINDOWS: Final = (1.0, 1.5)
"""Starts of the two spans, s, that end at two seconds."""
WIDER: Final = 2.0
"""Factor on the radius with which the gyro-free row comes out."""
METHODS: Final[tuple[Method, ...]] = ("direct", "indirect")
# a gate this wide lets every sample of the field through with full weight
_OPEN: Final = 1e6


@dataclass(frozen=True)
class Rows:
    """Rows of table 4.14 (degrees, roll, pitch, yaw) and of 4.15 (rad/s, x, y, z), by one statistic.

    Parameters
    ----------
    start : float
        From when on to two seconds the standard deviation is taken, s.
    measurement : (3,) array
        Accelerometer and magnetometer of each sample alone.
    gyro_based : mapping of float to (3,) array
        By the noise of the gyroscope, rad/s.
    gyro_free, rate : mapping of str to (3,) array
        Filters without a gyroscope by name, and their rates: K06's ``"direct"`` and ``"indirect"``, the same
        ``"…, radius ×2"``, and `GyroFreeDirect`.
    """

    start: float
    measurement: FloatArray
    gyro_based: Mapping[float, FloatArray]
    gyro_free: Mapping[str, FloatArray]
    rate: Mapping[str, FloatArray]

    def crossing(self, name: str = "direct") -> FloatArray:
        """Noise of a gyroscope (3,), rad/s, that makes roll, pitch and yaw as good as without one."""
        return crossing(self.gyro_based, self.gyro_free[name])


@dataclass(frozen=True)
class Comparison:
    """Tables 4.14 and 4.15 by both statistics.

    Parameters
    ----------
    runs : int
        Of which they are the root mean squares.
    second, half : Rows
        Of the last second and of the last half second.
    """

    runs: int
    second: Rows
    half: Rows


def crossing(gyro_based: Mapping[float, FloatArray], gyro_free: FloatArray) -> FloatArray:
    """Where the gyro-based errors, on a line between rows in logarithms of both, equal the gyro-free ones."""
    noise = np.log(list(gyro_based))
    rows = np.log(list(gyro_based.values()))
    return np.array([math.exp(float(np.interp(math.log(gyro_free[k]), rows[:, k], noise))) for k in range(3)])


def published_crossing() -> FloatArray:
    """The same of K06's own numbers."""
    rows = {noise: np.array(row) for noise, row in published.GYRO_BASED.items()}
    return crossing(rows, np.array(published.GYRO_FREE))


def compare(
    runs: int = RUNS,
    seed: Seed = 0,
    *,
    constants: Constants = DOCUMENTED,
    progress: Callable[[str], object] | None = None,
) -> Comparison:
    """Make tables 4.14 and 4.15 again.

    Parameters
    ----------
    runs : int
        How many runs of two seconds at rest.
    seed : int or numpy.random.Generator
        Of all noise.
    constants : Constants
        Of noise and geometry.
    progress : callable, optional
        Called with the name of each row before it is made.
    """
    rng = generator(seed)
    tell = progress or (lambda _: None)
    tell("gyro-free")
    signals = simulate(constants.motion("rest"), constants, runs, rng)
    wide = replace(constants, radius=WIDER * constants.radius)
    free = {
        **_gyro_free(signals),
        **_gyro_free(simulate(wide.motion("rest"), wide, runs, rng), f", radius ×{WIDER:g}"),
    }
    own = [derived.run(signals, "direct", index=k) for k in range(runs)]
    rates = np.stack([found.rate for found in own if found.rate is not None])
    free["GyroFreeDirect"] = euler_angles(np.stack([found.quat for found in own])), rates
    tell("measurement alone")
    triad, gyr_noise = _triad(signals, rng), rng.standard_normal((runs, len(signals.time), 3))
    alone, gyro_based = measured_angles(-triad, signals.mag), {}
    for noise in published.GYRO_BASED:
        tell(f"gyroscope of {noise:g} rad/s")
        gyro_based[noise] = _gyro_based(signals, triad, noise * gyr_noise, noise)
    second, half = (_rows(start, alone, gyro_based, free) for start in WINDOWS)
    return Comparison(runs, second, half)


def _rows(
    start: float,
    alone: FloatArray,
    gyro_based: Mapping[float, FloatArray],
    free: Mapping[str, tuple[FloatArray, FloatArray]],
) -> Rows:
    return Rows(
        start=start,
        measurement=np.rad2deg(spread(alone, start)),
        gyro_based={noise: np.rad2deg(spread(angles, start)) for noise, angles in gyro_based.items()},
        gyro_free={name: np.rad2deg(spread(angles, start)) for name, (angles, _) in free.items()},
        rate={name: spread(rate, start) for name, (_, rate) in free.items()},
    )


def spread(values: FloatArray, start: float) -> FloatArray:
    """Standard deviation (3,) from `start` (s) on of two-second runs (R, N, 3), about each run's mean there."""
    late = values[:, int(values.shape[1] * start / DURATION) :]
    rms: FloatArray = np.sqrt(np.mean(np.var(late, axis=1), axis=0))
    return rms


def _gyro_free(signals: Signals, suffix: str = "") -> dict[str, tuple[FloatArray, FloatArray]]:
    """Angles and rates of K06's filters."""
    found = {f"{method}{suffix}": estimate(signals, method) for method in METHODS}
    return {name: (one.euler, one.rate) for name, one in found.items()}


def _triad(signals: Signals, rng: np.random.Generator) -> FloatArray:
    """Specific force (R, N, 3) of three accelerometers at the origin, at rest."""
    down_b = matrix_nb(signals.quat)[:, 2]
    noise = rng.standard_normal(signals.mag.shape)
    force: FloatArray = -signals.constants.gravity * down_b + signals.constants.acc_noise * noise
    return force


def _gyro_based(signals: Signals, triad: FloatArray, gyr: FloatArray, noise: float) -> FloatArray:
    """Roll, pitch and yaw (R, N, 3) of the filter with a gyroscope."""
    from scipy.spatial.transform import Rotation

    from northdown.estimators.gyro_euler_ekf import GyroEulerEKF

    constants, density = signals.constants, 1.0 / math.sqrt(RATE)
    chosen = GyroEulerEKF(
        gyr_noise=noise * density,
        gyr_scale=0.0,
        acc_noise=constants.acc_noise * density,
        motion_time=0.0,
        mag_noise=constants.mag_noise * derived.FIELD * density,
        field=derived.FIELD,
        norm_gate=_OPEN,
        dip_gate=_OPEN,
        gravity=constants.gravity,
        start_tilt=0.01,
        start_heading=0.02,
    )
    start = Rotation.from_quat(np.roll(signals.quat[0], -1))
    found = np.empty_like(triad)
    for k in range(len(triad)):
        recording = Recording(time=signals.time, gyr=gyr[k], acc=triad[k], mag=derived.FIELD * signals.mag[k])
        found[k] = euler_angles(chosen.run(recording, initial=start).quat)
    return found
