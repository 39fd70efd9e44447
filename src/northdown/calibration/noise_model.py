"""What is known of a sensor's noise: its Allan deviation, and coefficients with intervals or reasons."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray
from northdown.calibration._noise_fit import design_matrix
from northdown.calibration._noise_units import NAMES, Unit, shown_units
from northdown.calibration.allan import AllanCurve

Sensor = Literal["gyr", "acc", "mag"]


@dataclass(frozen=True)
class Coefficient:
    """One noise coefficient of one axis, in SI units.

    Attributes
    ----------
    symbol : {"Q", "N", "B", "K", "R"}
        Quantisation, white noise, bias instability, random walk, ramp.
    value : float or None
        The coefficient; None when the record does not determine it.
    low, high : float
        Its interval of the chosen confidence. Where `value` is None, `low` is 0 and `high` an upper limit.
    unit : str
        SI unit, such as ``"rad/s/√Hz"``.
    reason : str
        Why there is no value; empty when there is one.
    """

    symbol: str
    value: float | None
    low: float
    high: float
    unit: str
    reason: str = ""

    @property
    def name(self) -> str:
        """Name in words, such as 'white noise'."""
        return NAMES[self.symbol]


@dataclass(frozen=True)
class NoiseModel:
    """Noise coefficients of one axis.

    Attributes
    ----------
    axis : {"x", "y", "z"}
        Axis of the sensor.
    quantisation, white_noise, bias_instability, random_walk, ramp : Coefficient
        Q, N, B, K and R. White noise of N has the standard deviation N·√rate from sample to sample. The flat part
        of the Allan deviation lies at 0.664 B.
    fitted : tuple of float
        Q, N, B, K, R of the best fit, SI, also those that are not determined: what the fitted curve is drawn with.
    shortest : float
        Shortest cluster time (s) in the fit; those below it contradict the model.
    widening : float
        1 when the model fits; else the factor by which it misses the curve, and by which intervals are wider.
    lag : float
        What a low-pass filter takes from the curve beyond `shortest`, as a coefficient like Q of the opposite sign; 0
        where all cluster times are in the fit.
    """

    axis: str
    quantisation: Coefficient
    white_noise: Coefficient
    bias_instability: Coefficient
    random_walk: Coefficient
    ramp: Coefficient
    fitted: tuple[float, ...]
    shortest: float
    widening: float
    lag: float = 0.0

    def __iter__(self) -> Iterator[Coefficient]:
        return iter((self.quantisation, self.white_noise, self.bias_instability, self.random_walk, self.ramp))

    def deviation(self, tau: npt.ArrayLike) -> FloatArray:
        """Allan deviation (T,) of the best fit at cluster times (T,) in s."""
        square = np.array(self.fitted) ** 2
        square[0] -= self.lag**2
        result: FloatArray = np.sqrt(np.maximum(design_matrix(tau) @ square, 0.0))
        return result


@dataclass(frozen=True, eq=False)
class AllanResult:
    """Noise of one sensor: its Allan deviation and the coefficients of each axis.

    Attributes
    ----------
    sensor : {"gyr", "acc", "mag"}
        Which sensor.
    curve : AllanCurve
        Overlapping Allan deviation (T, 3) in rad/s, m/s² or µT.
    low, high : (T, 3) arrays
        Interval of the deviation, of the chosen confidence, from χ² with `freedom`.
    freedom : (T, 3) array
        Equivalent degrees of freedom of each estimate, for the noise that was found.
    axes : tuple of NoiseModel
        Coefficients of x, y and z.
    start, stop : float
        Time (s) of the first and last sample used.
    confidence : float
        Confidence of all intervals, such as 0.95.
    arbitrary : bool
        Whether the field's unit is unknown; numbers are then in that unit instead of µT.
    notes : tuple of str
        What the user should know.
    name : str
        Name of the recording.
    """

    sensor: Sensor
    curve: AllanCurve
    low: FloatArray
    high: FloatArray
    freedom: FloatArray
    axes: tuple[NoiseModel, NoiseModel, NoiseModel]
    start: float
    stop: float
    confidence: float
    arbitrary: bool = False
    notes: tuple[str, ...] = ()
    name: str = ""

    def units(self, symbol: str) -> tuple[Unit, ...]:
        """Units in which a data sheet gives the coefficient, the usual one first: name and factor from SI."""
        return shown_units(self.sensor, symbol, arbitrary=self.arbitrary)

    def to_dict(self) -> dict[str, Any]:
        """Everything as numbers, texts and lists, in SI units; None where something is not determined."""

        def entry(c: Coefficient) -> dict[str, Any]:
            high = c.high if math.isfinite(c.high) else None
            return {"value": c.value, "low": c.low, "high": high, "unit": c.unit, "reason": c.reason}

        return {
            "sensor": self.sensor,
            "name": self.name,
            "start": self.start,
            "stop": self.stop,
            "rate": self.curve.rate,
            "samples": int(self.curve.lengths.sum()),
            "confidence": self.confidence,
            "axes": {
                model.axis: {c.symbol: entry(c) for c in model}
                | {"shortest": model.shortest, "widening": model.widening}
                for model in self.axes
            },
            "tau": self.curve.tau.tolist(),
            "deviation": self.curve.deviation.tolist(),
            "low": self.low.tolist(),
            "high": self.high.tolist(),
            "notes": list(self.notes),
        }
