"""`NavigationNoise`: what aided inertial navigation assumes of sensors, stances and start."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np

from northdown._validation import FloatArray, check_number
from northdown.navigation.strapdown import GRAVITY

_OPTIONAL: Final = ("start_heading", "start_velocity")
_POSITIVE: Final = ("acc_noise", "gyr_noise", "still_velocity", "still_rate", "gravity")


@dataclass(frozen=True, kw_only=True)
class NavigationNoise:
    """What the filter takes sensors, stances and start to be worth.

    The defaults suit a consumer IMU on a foot; scale and bias stand also for misalignment and impacts. For a
    covariance that means what it says on data of known noise, give the sensor's own figures.

    Parameters
    ----------
    acc_noise : float
        White noise density of the accelerometer, m/s²/√Hz. Raising it lets zero velocity correct more.
    gyr_noise : float
        White noise density of the gyroscope, rad/s/√Hz. Raising it lets zero velocity correct tilt more.
    acc_scale, gyr_scale : float
        Noise densities that grow with the specific force and the rate, as a fraction of them per √Hz. Raising them
        trusts fast motion less.
    acc_bias_walk, gyr_bias_walk : float
        Random walks of the biases, m/s³/√Hz and rad/s²/√Hz. Raising them lets the biases change faster.
    still_velocity : float
        Standard deviation of the velocity of a body that is called still, m/s. Raising it corrects less at stances.
    still_rate : float
        The same of its angular rate in long rests, rad/s. Raising it learns the gyroscope's bias more slowly.
    still_time : float
        Time (s) over which that creeping stays correlated. Raising it makes long stances count less.
    rest : float
        Shortest stillness (s) that is taken for a rest without rotation. Raising it uses fewer rests.
    start_tilt : float
        Standard deviation of the starting attitude about a horizontal axis, rad. Raising it lets the first stances
        level more.
    start_heading : float, optional
        The same about the vertical; it turns the whole path about its start. When not given, 0.1 where the heading is
        the magnetometer's, and 0 where it is given, or unknown and so the direction to which the path relates.
    start_velocity : float, optional
        Standard deviation of the starting velocity, m/s; when not given, 0 if the recording begins still, else 1.
    start_acc_bias, start_gyr_bias : float
        Standard deviations of the biases at the start, m/s² and rad/s. Raising them learns the biases faster.
    gravity : float
        Size of gravity, m/s². A wrong one is taken for a bias of the accelerometer, as far as that can be.
    """

    acc_noise: float = 0.01
    gyr_noise: float = 1e-3
    acc_scale: float = 0.01
    gyr_scale: float = 3e-3
    acc_bias_walk: float = 1e-3
    gyr_bias_walk: float = 1e-5
    still_velocity: float = 0.01
    still_rate: float = 2e-3
    still_time: float = 0.1
    rest: float = 1.0
    start_tilt: float = 0.1
    start_heading: float | None = None
    start_velocity: float | None = None
    start_acc_bias: float = 0.1
    start_gyr_bias: float = 0.01
    gravity: float = GRAVITY

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None or field.name not in _OPTIONAL:
                low: dict[str, Any] = {"above": 0.0} if field.name in _POSITIVE else {"low": 0.0}
                object.__setattr__(self, field.name, check_number(field.name, value, **low))

    def parameters(self) -> FloatArray:
        """Squares and the rest in the order of `northdown.kernels.navigation.forward`."""
        squares = (self.acc_noise, self.gyr_noise, self.acc_scale, self.gyr_scale, self.acc_bias_walk)
        more = (self.gyr_bias_walk, self.still_velocity, self.still_rate)
        return np.array([self.gravity, *(x * x for x in (*squares, *more)), self.still_time])

    def covariance(self, begins_still: bool, magnetic: bool) -> FloatArray:
        """Of the error state at the start, (15, 15)."""
        velocity = (0.0 if begins_still else 1.0) if self.start_velocity is None else self.start_velocity
        sigma = [0.0, velocity, self.start_tilt, self.start_acc_bias, self.start_gyr_bias]
        sigmas = np.repeat(sigma, 3)
        sigmas[8] = (0.1 if magnetic else 0.0) if self.start_heading is None else self.start_heading
        return np.diag(sigmas**2)
