"""`Conditions`: simulated data that are just as a Kalman filter's model supposes, and the filter told of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from northdown._validation import check_number
from northdown.arrays import AccelerometerArray, coplanar7
from northdown.errors import InputError, expected
from northdown.evaluation.matching import find_reference

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

    from northdown.estimators import Estimator
    from northdown.recording import Recording

# Far beyond any departure of the field, so that nothing is weighted down.
_OPEN: Final = 1e3
_RADIUS: Final = 0.05
# Runs begin at rest, rad/s. Larger, it would be too cautious for the first second.
_START_RATE: Final = 0.01
# Purposes of the random streams of a run.
_MOTION, _SENSORS, _START = range(3)


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """What the runs are like; the filter is told of all of it but the motion.

    A filter without gyroscope gets an accelerometer array for gyroscope and accelerometer.

    Parameters
    ----------
    duration : float
        Length of a run, s.
    rate : float
        Sampling rate, Hz.
    turn : float
        Root mean square of the angular rate of each axis, rad/s.
    gyr_noise, acc_noise, mag_noise : float
        White noise densities, rad/s/√Hz, m/s²/√Hz, µT/√Hz.
    gyr_bias_walk : float
        Random walk of the gyroscope's bias, rad/s²/√Hz. Without it and without a bias for a filter that knows none.
    start_bias : float
        Standard deviation of the bias at the start, rad/s.
    field, dip : float
        Size (µT) of the field and its angle below the horizontal (rad).
    gravity : float
        m/s².
    start_tilt, start_heading : float
        Standard deviations of the error of the attitude at the start about horizontal axes and the vertical, rad.
        Small, as first measurements far better than the start expose the linearisation of any such filter.
    array : AccelerometerArray, optional
        Geometry of the array; K06's seven in a plane on a radius of 50 mm when not given.
    array_noise : float
        White noise density of each of its accelerometers, m/s²/√Hz.
    array_bias : float
        Standard deviation of their constant biases, m/s², for a filter that estimates them.
    """

    duration: float = 30.0
    rate: float = 100.0
    turn: float = 0.6
    gyr_noise: float = 2e-3
    acc_noise: float = 0.02
    mag_noise: float = 0.2
    gyr_bias_walk: float = 1e-4
    start_bias: float = 0.01
    field: float = 50.0
    dip: float = math.radians(65.0)
    gravity: float = 9.80665
    start_tilt: float = 0.02
    start_heading: float = 0.03
    array: AccelerometerArray | None = None
    array_noise: float = 0.005
    array_bias: float = 0.005

    def __post_init__(self) -> None:
        for f in fields(self):
            if f.name == "dip":
                check_number("dip", self.dip, low=-1.5, high=1.5, unit="rad")
            elif f.name == "array":
                if self.array is not None and not isinstance(self.array, AccelerometerArray):
                    raise InputError(expected("an AccelerometerArray for array", type(self.array).__name__))
            elif f.name in ("gyr_bias_walk", "turn", "array_bias"):
                check_number(f.name, getattr(self, f.name), low=0.0)
            else:
                check_number(f.name, getattr(self, f.name), above=0.0)

    def configured(self, estimator: type[Estimator], parameters: Mapping[str, Any] | None = None) -> Estimator:
        """The filter that is told these densities and that nothing else disturbs it.

        `parameters` are those of the estimator that shall nevertheless be others.
        """
        told = {
            "gyr_scale": 0.0,
            "motion_time": 0.0,
            "norm_gate": _OPEN,
            "dip_gate": _OPEN,
        } | {f.name: getattr(self, f.name) for f in fields(self)}
        if "array" in estimator.needs:
            told |= {"acc_noise": self.array_noise, "start_bias": self.array_bias, "acc_bias_walk": 0.0}
            told |= {"array": self._geometry(), "start_rate": _START_RATE}
        known = {f.name for f in fields(estimator)}
        return estimator(**({name: value for name, value in told.items() if name in known} | dict(parameters or {})))

    def draw(self, seed: int, *, bias: bool, array: bool = False) -> tuple[Recording, Rotation]:
        """One run: a recording in NED with its truth, and an attitude to start from.

        With an accelerometer array beside the other sensors, or not; `bias` is that of gyroscope and array.
        """
        from scipy.spatial.transform import Rotation

        from northdown.simulation import ArrayErrors, SensorErrors, TriadErrors, measure, random_motion
        from northdown.simulation.seeds import generator

        motion = random_motion(self.duration, generator(seed, _MOTION), turn=self.turn, reach=0.0)
        sensors = SensorErrors(
            gyr=TriadErrors(
                noise=self.gyr_noise,
                bias=self.start_bias if bias else 0.0,
                walk=self.gyr_bias_walk if bias else 0.0,
            ),
            acc=TriadErrors(noise=self.acc_noise),
            mag=TriadErrors(noise=self.mag_noise),
        )
        recording = measure(
            motion,
            sensors,
            generator(seed, _SENSORS),
            rate=self.rate,
            field=(self.field * math.cos(self.dip), 0.0, self.field * math.sin(self.dip)),
            gravity=self.gravity,
            array=self._geometry() if array else None,
            array_errors=ArrayErrors(noise=self.array_noise, bias=self.array_bias if bias else 0.0)
            if array
            else None,
        )
        sigma = np.array([self.start_tilt, self.start_tilt, self.start_heading])
        off = Rotation.from_rotvec(-sigma * generator(seed, _START).standard_normal(3))
        return recording, off * find_reference(recording).rotation[0]

    def _geometry(self) -> AccelerometerArray:
        return coplanar7(_RADIUS) if self.array is None else self.array
