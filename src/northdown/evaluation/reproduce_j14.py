"""J14's experiment made again: a board at rest, its three sensors simulated, the quaternion EKF beside the Euler UKF.

J14 (R.-C. Jia, Optics and Precision Engineering 22(12), 2014, doi:10.3788/OPE.20142212.3280) recorded 7200 s at
100 Hz, the field at 50 Hz, with the board level and its x axis to the north. That recording is not public, so the
sensors (`northdown.simulation.presets.J14`) are simulated from their data sheets.

Table 1 prints a standard deviation, a 'zero difference' (零差) and an 'error' of each angle. In all six of its rows
the error is √((std² + zero difference²) / 2) to the last digit, the root mean square divided by √2. So it is here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from northdown._validation import FloatArray, check_number
from northdown.estimators.base import Estimator
from northdown.estimators.euler_ukf import EulerUKF
from northdown.estimators.quaternion_ekf import QuaternionEKF
from northdown.orientation import Orientation
from northdown.recording import Recording
from northdown.simulation import measure, rest
from northdown.simulation.imu_errors import SensorErrors, TriadErrors
from northdown.simulation.presets import J14

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

RATE: Final = 100.0
"""Samples per second."""
DIP: Final = math.radians(57.0)
"""Dip of the field (rad), about that of J14's town; J14 does not give it."""
FIELD: Final = 54.0
"""Size of the field, µT, likewise."""
ANGLES: Final = ("pitch", "roll", "heading")

PUBLISHED: Final = {
    "pitch": {"EKF": (0.0312, 0.0026, 0.0221), "UKF": (0.0250, 0.0021, 0.0177)},
    "roll": {"EKF": (0.0156, -0.0236, 0.0200), "UKF": (0.0140, -0.0178, 0.0160)},
    "heading": {"EKF": (0.0519, -0.0153, 0.0383), "UKF": (0.0451, 0.0151, 0.0336)},
}
"""J14 table 1, degrees: standard deviation, zero difference, error."""


@dataclass(frozen=True)
class AngleStatistics:
    """One row of table 1, degrees."""

    std: float
    bias: float

    @property
    def error(self) -> float:
        """What table 1 calls the error: √((std² + bias²) / 2)."""
        return math.hypot(self.std, self.bias) / math.sqrt(2.0)


def board(duration: float = 7200.0, seed: int = 0, *, calibrated: bool = True, drift: bool = True) -> Recording:
    """Record J14's board at rest: level, axes right-forward-up, x to the north.

    Parameters
    ----------
    duration : float
        Length, s.
    seed : int
        Seed of the noise.
    calibrated : bool
        Whether the sensors' constant errors (zero offset, scale, misalignment) have been removed. As the data sheets
        have them they tilt every result by degrees, a hundred times what table 1 prints.

    drift : bool
        Whether the bias of gyroscope and accelerometer wanders during the recording.

    Returns
    -------
    Recording
        With the truth as its reference, in ENU.
    """
    from scipy.spatial.transform import Rotation

    check_number("duration", duration, above=0.0, unit="s")
    gyr, acc, mag = (_changed(triad, calibrated, drift) for triad in (J14.gyr, J14.acc, J14.mag))
    errors = SensorErrors(gyr=gyr, acc=acc, mag=mag)
    field = (FIELD * math.cos(DIP), 0.0, FIELD * math.sin(DIP))
    still = rest(duration, attitude=Rotation.from_euler("x", 180.0, degrees=True))
    return measure(still, errors, seed, rate=RATE, field=field, frame="ENU", name="J14's board")


def filters(start: float = 0.01) -> dict[str, Estimator]:
    """Both filters with one set of noise, and the EKF once more without its bias.

    The noise is that of the data sheets and of the rounding to whole digits; both are told the dip.

    Parameters
    ----------
    start : float
        Standard deviation of the starting attitude, rad.
    """
    acc_noise = _density(J14.acc, RATE)
    mag_noise = _density(J14.mag, RATE / 2.0)
    gyr_noise = _density(J14.gyr, RATE)
    ekf = QuaternionEKF(
        gyr_noise=gyr_noise,
        gyr_scale=0.0,
        gyr_bias_walk=1e-6,
        start_bias=1e-3,
        acc_noise=acc_noise,
        motion_time=0.0,
        mag_noise=mag_noise,
        field=FIELD,
        norm_gate=1.0,
        dip_gate=1.0,
        start_tilt=start,
        start_heading=start,
        dip=DIP,
    )
    ukf = EulerUKF(
        gyr_noise=gyr_noise,
        gyr_scale=0.0,
        acc_noise=acc_noise,
        motion_time=0.0,
        mag_noise=mag_noise,
        field=FIELD,
        norm_gate=1.0,
        dip_gate=1.0,
        start_tilt=start,
        start_heading=start,
        dip=DIP,
        axes="rfu",
    )
    without = replace(ekf, gyr_bias_walk=0.0, start_bias=1e-12)
    return {"EKF": ekf, "UKF": ukf, "EKF without bias": without}


def angle_errors(orientation: Orientation, recording: Recording) -> FloatArray:
    """Errors (N, 3) of pitch, roll and heading in degrees, of small errors near the truth.

    Pitch turns about the body's x axis, roll about y, heading about z downwards.
    """
    truth = recording.reference
    if truth is None:
        raise ValueError("a simulated recording has its truth")
    error: Rotation = truth.to_frame(orientation.frame).rotation.inv() * orientation.rotation
    small: FloatArray = np.rad2deg(error.as_rotvec()) * (1.0, 1.0, -1.0)
    return small


def statistics(errors: FloatArray, settle: float = 60.0) -> dict[str, AngleStatistics]:
    """Rows of table 1 from the errors at `RATE`, without the first `settle` seconds."""
    steady = errors[round(settle * RATE) :]
    return {
        name: AngleStatistics(float(np.std(column)), float(np.mean(column)))
        for name, column in zip(ANGLES, steady.T, strict=True)
    }


def settling_time(errors: FloatArray, within: float = 1.0) -> float:
    """Time (s) after which the three errors together stay below `within` degrees."""
    outside = np.flatnonzero(np.linalg.norm(errors, axis=1) >= within)
    return float((outside[-1] + 1) / RATE) if len(outside) else 0.0


def _changed(errors: TriadErrors | None, calibrated: bool, drift: bool) -> TriadErrors | None:
    if errors is None:
        return None
    if calibrated:
        errors = replace(errors, bias=0.0, scale=0.0, misalignment=0.0)
    return errors if drift else replace(errors, instability=0.0)


def _density(errors: TriadErrors | None, rate: float) -> float:
    """White noise density of the worst axis, rounding included."""
    if errors is None:
        raise ValueError("J14's board has all three sensors")
    rounding = errors.resolution / math.sqrt(12.0 * rate)
    return math.hypot(float(np.max(errors.noise)), rounding)
