"""Inertial navigation: velocity and position from a gyroscope and an accelerometer, kept from drifting by rests.

Specific force is turned to the navigation frame, gravity is taken away, and the rest is integrated twice. The Earth
is flat and does not turn, and gravity is the same everywhere: no Schuler oscillation, no Coriolis acceleration. That
is right for minutes and kilometres with sensors whose gyroscope does not resolve the Earth's 15 °/h.

>>> import northdown as nd
>>> from northdown.simulation import measure, rest
>>> trajectory = nd.navigate(measure(rest(5.0)))
>>> trajectory.still.all(), abs(trajectory.position).max() < 1e-6
(np.True_, np.True_)
"""

from northdown.navigation.noise import NavigationNoise
from northdown.navigation.still import AngularRateEnergy, Detector, Shoe
from northdown.navigation.strapdown import integrate, strapdown
from northdown.navigation.trajectory import Trajectory
from northdown.navigation.writing import write_trajectory
from northdown.navigation.zupt import navigate

__all__ = [
    "AngularRateEnergy",
    "Detector",
    "NavigationNoise",
    "Shoe",
    "Trajectory",
    "integrate",
    "navigate",
    "strapdown",
    "write_trajectory",
]
