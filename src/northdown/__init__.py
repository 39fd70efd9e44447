"""northdown: attitude and heading from inertial and magnetic sensors, with honest uncertainty.

Conventions
-----------
These hold everywhere in the package.

Units
    SI and radians: rad/s, m/s², s. The magnetic field is in µT. Degrees appear only where a name ends in ``_deg``,
    in ``as_euler(degrees=True)``, on plots and on the command line.
Accelerometer
    Measures specific force: +9.81 m/s² on the axis that points *up* at rest.
Rotations
    Body → navigation frame: ``v_n = mat_nb @ v_b``. Quaternions are Hamilton, (w, x, y, z), of unit norm; the public
    type is `scipy.spatial.transform.Rotation` (whose own arrays are x, y, z, w).
Frames
    ``"NED"`` (default), ``"ENU"`` or ``"NWU"``; every result carries its frame. North is magnetic north.
Arrays
    (N, 3) float64; order of arguments gyr, acc, mag. A row with NaN in acc or mag means that there was no
    sample. A sample of the gyroscope stands for the time since the sample before it.

>>> import northdown as nd
>>> recording = nd.simulate(20.0, seed=1)
>>> orientation = nd.Mahony(kp=0.74).run(recording, frame="ENU")
>>> orientation.frame, len(orientation)
('ENU', 2001)
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from northdown.arrays import AccelerometerArray
from northdown.errors import FormatError, InputError, MissingDependencyError, NorthdownError
from northdown.orientation import Flag, Orientation
from northdown.recording import Recording

if TYPE_CHECKING:
    # For editors and type checkers only. At run time estimators are found by their files, see `__getattr__`.
    from northdown import (
        arrays,
        calibration,
        datasets,
        estimators,
        evaluation,
        fields,
        frames,
        io,
        navigation,
        plots,
        simulation,
    )
    from northdown.estimators.calibrating_ekf import CalibratingEKF
    from northdown.estimators.complementary import Complementary
    from northdown.estimators.cross_product import CrossProduct
    from northdown.estimators.double_stage_ekf import DoubleStageEKF
    from northdown.estimators.euler_ukf import EulerUKF
    from northdown.estimators.gyro_euler_ekf import GyroEulerEKF
    from northdown.estimators.gyro_free_direct import GyroFreeDirect
    from northdown.estimators.gyro_free_indirect import GyroFreeIndirect
    from northdown.estimators.gyro_free_mekf import GyroFreeMEKF
    from northdown.estimators.gyro_integration import GyroIntegration
    from northdown.estimators.madgwick import Madgwick
    from northdown.estimators.mahony import Mahony
    from northdown.estimators.mekf import MEKF
    from northdown.estimators.quaternion_ekf import QuaternionEKF
    from northdown.estimators.tilt_compass import TiltCompass
    from northdown.estimators.triad import Triad
    from northdown.estimators.vqf import VQF
    from northdown.evaluation import align, attitude_error, clock_offset, observability
    from northdown.io import read, read_array, read_orientation, write_array, write_orientation, write_recording
    from northdown.navigation import Trajectory, navigate
    from northdown.simulation import simulate, simulate_array

__version__ = "0.1.0"

__all__ = [
    "MEKF",
    "VQF",
    "AccelerometerArray",
    "CalibratingEKF",
    "Complementary",
    "CrossProduct",
    "DoubleStageEKF",
    "EulerUKF",
    "Flag",
    "FormatError",
    "GyroEulerEKF",
    "GyroFreeDirect",
    "GyroFreeIndirect",
    "GyroFreeMEKF",
    "GyroIntegration",
    "InputError",
    "Madgwick",
    "Mahony",
    "MissingDependencyError",
    "NorthdownError",
    "Orientation",
    "QuaternionEKF",
    "Recording",
    "TiltCompass",
    "Trajectory",
    "Triad",
    "align",
    "arrays",
    "attitude_error",
    "calibration",
    "clock_offset",
    "datasets",
    "estimators",
    "evaluation",
    "fields",
    "frames",
    "io",
    "navigate",
    "navigation",
    "observability",
    "plots",
    "read",
    "read_array",
    "read_orientation",
    "simulate",
    "simulate_array",
    "simulation",
    "write_array",
    "write_orientation",
    "write_recording",
]

_MODULES = (
    "arrays",
    "calibration",
    "datasets",
    "estimators",
    "evaluation",
    "fields",
    "frames",
    "io",
    "navigation",
    "plots",
    "simulation",
)
_HOMES = {
    "Trajectory": "navigation",
    "align": "evaluation",
    "attitude_error": "evaluation",
    "clock_offset": "evaluation",
    "navigate": "navigation",
    "observability": "evaluation",
    "read": "io",
    "read_array": "io",
    "read_orientation": "io",
    "simulate": "simulation",
    "simulate_array": "simulation",
    "write_array": "io",
    "write_orientation": "io",
    "write_recording": "io",
}


def __getattr__(name: str) -> Any:
    """Load submodules, functions and estimators on first use, so that the import itself is cheap."""
    if name in _MODULES:
        return importlib.import_module(f"northdown.{name}")
    if name in _HOMES:
        value = getattr(importlib.import_module(f"northdown.{_HOMES[name]}"), name)
        globals()[name] = value
        return value
    if name[:1].isupper():
        from northdown.estimators import find_class

        estimator = find_class(name)
        if estimator is not None:
            globals()[name] = estimator
            return estimator
    raise AttributeError(f"module 'northdown' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
