"""The sensor noise that all Kalman filters take, in the units that an Allan deviation gives.

The defaults are larger than a sensor's own noise: they stand also for what the models leave out (scale,
misalignment, clock offset, inhomogeneous field) and do well on real recordings. For a covariance that means what it
says on data of known noise, give the sensor's own figures and set `gyr_scale` and `motion_time` to 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

from northdown.estimators.base import Estimator, parameter
from northdown.kernels.jit import inline
from northdown.kernels.weighting import ACCELERATING, REJECTED
from northdown.orientation import Flag

_ACC_REJECTED = int(Flag.ACC_REJECTED)
_MAG_REJECTED = int(Flag.MAG_REJECTED)


class NoiseTerms(NamedTuple):
    """Variances and weights, in the order in which kernels take them."""

    gyr: float
    scale: float
    walk: float
    acc: float
    motion_time: float
    motion_window: float
    mag: float
    gravity: float
    norm_gate: float
    dip_gate: float
    field_window: float
    tilt: float
    heading: float
    bias: float


@inline
def start_covariance(p: Any, heading_known: bool) -> Any:
    """Upper triangle of P for a fresh attitude; an unknown heading is uniform over the circle."""
    tilt, heading, bias = p[11], p[12], p[13]
    if not heading_known:
        heading = math.pi * math.pi / 3.0
    zero3, zero2 = (0.0, 0.0, 0.0), (0.0, 0.0)
    rows = (tilt, 0.0, 0.0) + zero3 + (tilt, 0.0) + zero3 + (heading,) + zero3
    return rows + (bias,) + zero2 + (bias, 0.0, bias)


@inline
def weighting_flags(acc_var: float, motion_time: float, motion: float, age_acc: float, u: float) -> int:
    """Flags of a sample, from the mean square of linear acceleration, the accelerometer's age and the field's u."""
    flags = 0
    if age_acc == 0.0 and motion_time * motion > ACCELERATING * acc_var:
        flags = _ACC_REJECTED
    if u > REJECTED:
        flags |= _MAG_REJECTED
    return flags


@dataclass(frozen=True, kw_only=True)
class KalmanFilter(Estimator):
    """Parameters of every Kalman filter.

    Parameters
    ----------
    gyr_noise : float
        White noise density of the gyroscope, rad/s/√Hz. Raising it trusts accelerometer and magnetometer more.
    gyr_scale : float
        Noise density that grows with the rate, as a fraction of it per √Hz, for scale errors and misalignment.
        Raising it trusts the gyroscope less in fast motion.
    acc_noise : float
        White noise density of the accelerometer, m/s²/√Hz. Raising it levels more slowly.
    motion_time : float
        Time (s) over which linear accelerations stay correlated. Raising it distrusts the accelerometer more whenever
        the body has been accelerating.
    motion_window : float
        Time constant (s) of the mean square of linear acceleration. Raising it distrusts for longer after each
        acceleration.
    mag_noise : float
        White noise density of the magnetometer, µT/√Hz, in a field of `field` µT; only the ratio counts. Raising it
        makes heading follow the magnetometer more slowly.
    field : float
        Size of the field to which `mag_noise` refers, µT. Raising it is lowering `mag_noise`.
    norm_gate : float
        Relative departure of the field's norm that lowers the magnetometer's weight to 1/e. Raising it accepts more
        disturbance.
    dip_gate : float
        Departure of the field's dip, rad, that does the same. Raising it accepts more disturbance.
    field_window : float
        Time constant (s) with which the reference of norm and dip follows the field. Raising it adapts more slowly to
        a new place, and is fooled less by a long disturbance.
    gravity : float
        Local gravity, m/s². Raising it lowers the accelerometer's weight in proportion.
    start_tilt : float
        Standard deviation of the starting attitude about a horizontal axis, rad. Raising it converges faster from a
        bad start and more nervously from a good one.
    start_heading : float
        The same about the vertical. Raising it turns faster to the magnetometer's north at first.

    Notes
    -----
    What lowered the weight of a sample is told with it: `Orientation.diagnostics` holds the statistics, `flags` what
    passed the threshold.

    - ``acceleration``: rms of linear acceleration over `motion_window`, m/s². Above 3 acc_noise / √motion_time
      (8.7 m/s² at the defaults) the accelerometer's sample has less than a tenth of its weight at rest:
      `Flag.ACC_REJECTED`.
    - ``field_departure``: u of the field's norm and dip, see `mekf`; 0 for a sample without field. Above 4.6 the
      magnetometer's sample has less than 1 % of its weight: `Flag.MAG_REJECTED`.
    - ``nis``, ``nis_dof``: normalised innovation squared yᵀ S⁻¹ y of the sample, and how many scalar measurements it
      is made of, 0 for none; a field made a unit vector counts two, as noise along it is gone, and one where only its
      heading is compared. In a right filter it is χ² with so many degrees of freedom.
    """

    gyr_noise: float = parameter(0.01, unit="rad/s/√Hz", above=0.0)
    gyr_scale: float = parameter(3e-3, unit="1/√Hz", low=0.0)
    acc_noise: float = parameter(0.5, unit="m/s²/√Hz", above=0.0)
    motion_time: float = parameter(0.03, unit="s", low=0.0)
    motion_window: float = parameter(10.0, unit="s", above=0.0)
    mag_noise: float = parameter(2.7, unit="µT/√Hz", above=0.0)
    field: float = parameter(50.0, unit="µT", above=0.0)
    norm_gate: float = parameter(0.05, above=0.0)
    dip_gate: float = parameter(0.025, unit="rad", above=0.0)
    field_window: float = parameter(100.0, unit="s", above=0.0)
    gravity: float = parameter(9.80665, unit="m/s²", above=0.0)
    start_tilt: float = parameter(0.05, unit="rad", above=0.0)
    start_heading: float = parameter(0.1, unit="rad", above=0.0)

    def _noise(self, walk: float = 0.0, bias: float = 0.0) -> NoiseTerms:
        """Squares of the densities and standard deviations, for the kernel."""
        return NoiseTerms(
            self.gyr_noise**2,
            self.gyr_scale**2,
            walk**2,
            self.acc_noise**2,
            self.motion_time,
            self.motion_window,
            (self.mag_noise / self.field) ** 2,
            self.gravity,
            self.norm_gate,
            self.dip_gate,
            self.field_window,
            self.start_tilt**2,
            self.start_heading**2,
            bias**2,
        )


@dataclass(frozen=True, kw_only=True)
class BiasKalmanFilter(KalmanFilter):
    """Parameters of the Kalman filters that estimate the gyroscope's bias.

    Parameters
    ----------
    gyr_bias_walk : float
        Random walk of the bias, rad/s²/√Hz. Raising it lets the bias change faster and makes it noisier.
    start_bias : float
        Standard deviation of the bias at the start, rad/s. Raising it learns the bias faster at first.
    """

    gyr_bias_walk: float = parameter(2e-4, unit="rad/s²/√Hz", low=0.0)
    start_bias: float = parameter(0.02, unit="rad/s", above=0.0)

    def _bias_noise(self) -> NoiseTerms:
        return self._noise(self.gyr_bias_walk, self.start_bias)
