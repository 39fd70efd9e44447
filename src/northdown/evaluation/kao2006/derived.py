"""The same tables from northdown's own gyro-free filters, in which all noise is derived and nothing is fitted.

`GyroFreeIndirect` gets all seven accelerometers by least squares and the three axes of the field, `GyroFreeDirect`
the six of K06's figure 3.12 and two axes. Both know that the noise of angular acceleration and that of specific force
come from the same accelerometers.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from northdown._validation import FloatArray
from northdown.arrays.library import coplanar6
from northdown.evaluation.kao2006._algebra import slope_of_euler, turn_to_quat
from northdown.evaluation.kao2006.constants import RATE, Constants
from northdown.evaluation.kao2006.published import Method
from northdown.evaluation.kao2006.signals import Signals
from northdown.orientation import Orientation
from northdown.recording import Recording

if TYPE_CHECKING:
    from northdown.estimators.gyro_free_direct import GyroFreeDirect
    from northdown.estimators.gyro_free_indirect import GyroFreeIndirect

FIELD = 50.0
"""Size that is given to the field, µT; only ratios count."""


def recording(signals: Signals, method: Method, run: int = 0) -> Recording:
    """One run of some signals, with the sensors that a method uses."""
    array, names = signals.array, list(signals.array.names)
    if method == "direct":
        array = coplanar6(signals.constants.radius, without="A3x")
    columns = [names.index(name) for name in array.names]
    mag = FIELD * signals.mag[run]
    return Recording(
        time=signals.time, mag=mag, array=array, array_acc=np.ascontiguousarray(signals.array_acc[run][:, columns])
    )


def estimator(constants: Constants, method: Method, iterations: int = 1) -> GyroFreeDirect | GyroFreeIndirect:
    """The filter of a method, told the noise that there is."""
    from northdown.estimators.gyro_free_direct import GyroFreeDirect
    from northdown.estimators.gyro_free_indirect import GyroFreeIndirect

    density = 1.0 / math.sqrt(RATE)
    acc_noise, mag_noise = constants.acc_noise * density, constants.mag_noise * FIELD * density
    if method == "direct":
        return GyroFreeDirect(
            acc_noise=acc_noise,
            mag_noise=mag_noise,
            field=FIELD,
            gravity=constants.gravity,
            iterations=iterations,
            motion_time=0.0,
            dip=constants.dip,
            force_axes="yz",
            mag_axes="xy",
        )
    return GyroFreeIndirect(
        acc_noise=acc_noise,
        mag_noise=mag_noise,
        field=FIELD,
        gravity=constants.gravity,
        iterations=iterations,
        motion_time=0.0,
    )


def run(signals: Signals, method: Method, iterations: int = 1, index: int = 0) -> Orientation:
    """Estimate one run from the true start."""
    from scipy.spatial.transform import Rotation

    start = Rotation.from_quat(np.roll(signals.quat[0], -1))
    return estimator(signals.constants, method, iterations).run(recording(signals, method, index), initial=start)


def sigma_at_end(found: Orientation) -> FloatArray:
    """Standard deviations of the last sample, in the order and units of `published.ENTRIES`."""
    if found.covariance is None or found.rate_sigma is None:
        raise ValueError("a gyro-free filter has the covariance of its attitude and the sigma of its rate")
    quat = found.quat[-1]
    to_quat = turn_to_quat(quat)
    of_quat = to_quat @ found.covariance[-1] @ to_quat.T
    slope = slope_of_euler(quat)
    of_euler = np.diag(slope @ of_quat @ slope.T)
    own = np.sqrt(np.diag(of_quat))[[1, 2, 3, 0]]
    return np.concatenate([found.rate_sigma[-1], own, np.rad2deg(np.sqrt(of_euler))])
