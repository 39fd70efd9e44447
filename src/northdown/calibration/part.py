"""`SensorCalibration`: how one sensor's samples are corrected, how well that is known, and from what."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from northdown._validation import FloatArray, as_float_array, check_choice, check_number, check_vectors
from northdown.errors import InputError, expected

SENSORS: Final = ("gyr", "acc", "mag")
UNITS: Final = {"gyr": ("rad/s",), "acc": ("m/s^2",), "mag": ("uT", "arbitrary")}

# A correction that stretches one direction this many times more than another is a mistake, not a calibration.
_MOST_STRETCH: Final = 100.0


@dataclass(frozen=True)
class Evidence:
    """What a calibration was made from, and what it achieved.

    Attributes
    ----------
    model : str
        What was fitted, such as ``"ellipsoid"``.
    quantity : str
        What `before` and `after` measure, such as ``"spread of the field's norm"``.
    unit : str
        Their unit.
    before, after : float
        Standard deviation or root mean square without and with the calibration, over the samples that were kept.
    samples : int
        Number of points, positions or turns in the fit.
    used : float
        Share of them that was kept, 0 to 1.
    coverage : float
        Share of all directions in which the sensor was held, 0 to 1; NaN where it does not matter.
    condition : float
        Condition number of the fit; NaN where there was none. Some tens are good.
    notes : tuple of str
        What the user should know, in words.
    held_out_before, held_out_after : float
        Robust standard deviation, of the same quantity, without and with a correction over parts that were left out
        when it was made, each part in turn; NaN where this was not tried.
    """

    model: str
    quantity: str = ""
    unit: str = ""
    before: float = math.nan
    after: float = math.nan
    samples: int = 0
    used: float = 1.0
    coverage: float = math.nan
    condition: float = math.nan
    notes: tuple[str, ...] = ()
    held_out_before: float = math.nan
    held_out_after: float = math.nan

    def __eq__(self, other: object) -> bool:
        # NaN stands for 'no number' here, and equals itself
        return isinstance(other, Evidence) and repr(self) == repr(other)

    def __hash__(self) -> int:
        return hash(repr(self))


@dataclass(frozen=True, eq=False)
class TemperatureSlope:
    """How an offset depends on temperature: a polynomial that is 0 at a reference temperature.

    Parameters
    ----------
    reference : float
        Temperature (°C) at which the calibration's `offset` holds.
    coefficients : (D, 3) array
        Of the first to the D-th power of (temperature − reference), in the sensor's unit per °C, per °C² ….
    low, high : float
        Range of temperatures (°C) that was measured. Outside it the offset stays as it is at the nearer end: a
        polynomial must not be extrapolated.
    """

    reference: float
    coefficients: FloatArray
    low: float
    high: float

    def __post_init__(self) -> None:
        values = as_float_array("coefficients", self.coefficients)
        if values.ndim != 2 or values.shape[1] != 3 or not 1 <= len(values) <= 5 or not np.isfinite(values).all():
            raise InputError(expected("finite coefficients of shape (D, 3), D from 1 to 5", f"shape {values.shape}"))
        object.__setattr__(self, "coefficients", _read_only(values))
        for name in ("reference", "low", "high"):
            object.__setattr__(self, name, check_number(name, getattr(self, name), low=-273.15, high=1e4, unit="°C"))
        if self.low > self.high:
            raise InputError(expected("low not above high", f"{self.low:g} and {self.high:g} °C"))

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, TemperatureSlope)
            and (self.reference, self.low, self.high) == (other.reference, other.low, other.high)
            and np.array_equal(self.coefficients, other.coefficients)
        )

    __hash__ = None  # type: ignore[assignment]

    def change(self, temperature: Any) -> FloatArray:
        """Change of the offset (N, 3) from the reference temperature to temperatures (N,) in °C."""
        t = as_float_array("temperature", temperature)
        if t.ndim != 1 or not np.isfinite(t).all():
            raise InputError(expected("finite temperatures of shape (N,)", f"shape {t.shape} or missing values"))
        x = np.clip(t, self.low, self.high) - self.reference
        powers = x[:, None] ** np.arange(1, len(self.coefficients) + 1)
        change: FloatArray = powers @ self.coefficients
        return change


@dataclass(frozen=True, eq=False)
class SensorCalibration:
    """Correction of one sensor: calibrated = matrix · (raw − offset).

    Parameters
    ----------
    sensor : {"gyr", "acc", "mag"}
        Which sensor.
    offset : (3,) array
        Bias, or hard iron, in `unit` and the sensor's own axes.
    matrix : (3, 3) array
        Scale, cross-axis sensitivity and alignment; for the magnetometer also soft iron. The unit matrix when only
        the offset is known.
    offset_sigma, matrix_sigma : (3,) and (3, 3) arrays
        Their 1-σ; 0 for what was not estimated.
    unit : str
        Of the raw and the calibrated samples: ``"rad/s"``, ``"m/s^2"``, ``"uT"`` or ``"arbitrary"``.
    norm : float
        Size that calibrated samples have: the field, or gravity; NaN for the gyroscope.
    temperature : TemperatureSlope, optional
        How the offset changes with temperature.
    evidence : Evidence
        From what it was made.

    Raises
    ------
    InputError
        For wrong shapes, values that are not finite, or a matrix that mirrors space or flattens it.
    """

    sensor: str
    offset: FloatArray = field(default_factory=lambda: np.zeros(3))
    matrix: FloatArray = field(default_factory=lambda: np.eye(3))
    offset_sigma: FloatArray = field(default_factory=lambda: np.zeros(3))
    matrix_sigma: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    unit: str = ""
    norm: float = math.nan
    temperature: TemperatureSlope | None = None
    evidence: Evidence = field(default_factory=lambda: Evidence("given"))

    def __post_init__(self) -> None:
        check_choice("sensor", self.sensor, SENSORS)
        unit = self.unit or UNITS[self.sensor][0]
        object.__setattr__(self, "unit", check_choice(f"unit of {self.sensor}", unit, UNITS[self.sensor]))
        for name, shape in (("offset", (3,)), ("offset_sigma", (3,)), ("matrix", (3, 3)), ("matrix_sigma", (3, 3))):
            value = as_float_array(name, getattr(self, name))
            if value.shape != shape or not np.isfinite(value).all():
                raise InputError(
                    expected(f"finite {name} of shape {shape}", f"shape {value.shape} or missing values")
                )
            if name.endswith("sigma") and (value < 0.0).any():
                raise InputError(expected(f"{name} of at least 0", f"{value.min():g}"))
            object.__setattr__(self, name, _read_only(value))
        stretch = np.linalg.svd(self.matrix, compute_uv=False)
        if not stretch[2] * _MOST_STRETCH > stretch[0] or np.linalg.det(self.matrix) <= 0.0:
            raise InputError(
                expected(
                    f"a matrix of the {self.sensor} that neither mirrors nor flattens space",
                    f"singular values {stretch[0]:.3g} to {stretch[2]:.3g}",
                    do="make the calibration again",
                )
            )

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, SensorCalibration)
            and (self.sensor, self.unit, self.evidence) == (other.sensor, other.unit, other.evidence)
            and (self.norm == other.norm or (math.isnan(self.norm) and math.isnan(other.norm)))
            and self.temperature == other.temperature
            and all(
                np.array_equal(getattr(self, name), getattr(other, name))
                for name in ("offset", "matrix", "offset_sigma", "matrix_sigma")
            )
        )

    __hash__ = None  # type: ignore[assignment]

    def correct(self, raw: Any, temperature: Any = None) -> FloatArray:
        """Calibrated samples (N, 3) from raw ones (N, 3) in `unit`; rows of NaN stay so.

        Parameters
        ----------
        raw : (N, 3) array
            Samples of the sensor.
        temperature : (N,) array, optional
            Of the sensor at each sample, °C; needed when the calibration depends on it.

        Raises
        ------
        InputError
            For wrong shapes, or a temperature that is missing.
        """
        samples = check_vectors(self.sensor, raw)
        offset: FloatArray = self.offset
        if self.temperature is not None:
            if temperature is None:
                raise InputError(
                    expected(
                        f"the temperature at each sample, as this calibration of {self.sensor} depends on it",
                        "none",
                        do="give temperature=, or choose one with at_temperature()",
                    )
                )
            change = self.temperature.change(temperature)
            if len(change) != len(samples):
                raise InputError(expected(f"{len(samples)} temperatures", f"{len(change)}"))
            offset = offset + change
        corrected: FloatArray = (samples - offset) @ self.matrix.T
        return corrected

    def at_temperature(self, temperature: float) -> SensorCalibration:
        """The calibration at one temperature (°C), which no longer depends on it."""
        value = check_number("temperature", temperature, unit="°C")
        if self.temperature is None:
            return self
        return replace(self, offset=self.offset + self.temperature.change([value])[0], temperature=None)

    def then(self, second: SensorCalibration) -> SensorCalibration:
        """First this calibration, then `second`, as one.

        Notes
        -----
        A₂(A₁(x − o₁) − o₂) = A₂A₁ (x − o₁ − A₁⁻¹o₂). The σ are carried over to first order, with elements taken
        as uncorrelated.

        Raises
        ------
        InputError
            When sensors or units differ, or when both depend on temperature.
        """
        if self.sensor != second.sensor or self.unit != second.unit:
            raise InputError(
                expected(
                    f"a calibration of {self.sensor} in {self.unit} to follow",
                    f"one of {second.sensor} in {second.unit}",
                )
            )
        if self.temperature is not None and second.temperature is not None:
            raise InputError(
                expected("one calibration that depends on temperature", "two", do="choose one with at_temperature()")
            )
        back = np.linalg.inv(self.matrix)
        slope = self.temperature
        if second.temperature is not None:
            slope = replace(second.temperature, coefficients=second.temperature.coefficients @ back.T)
        variance = second.matrix_sigma**2 @ self.matrix**2 + second.matrix**2 @ self.matrix_sigma**2
        first, last = self.evidence, second.evidence
        return SensorCalibration(
            self.sensor,
            self.offset + back @ second.offset,
            second.matrix @ self.matrix,
            np.sqrt(self.offset_sigma**2 + back**2 @ second.offset_sigma**2),
            np.sqrt(variance),
            self.unit,
            self.norm if math.isnan(second.norm) else second.norm,
            slope,
            replace(last, model=f"{first.model}, then {last.model}", notes=(*first.notes, *last.notes)),
        )


def _read_only(array: FloatArray) -> FloatArray:
    copy = np.array(array)
    copy.setflags(write=False)
    return copy
