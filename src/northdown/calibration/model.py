"""`Calibration`: the corrections of a sensor unit, applied to recordings, joined, saved."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from northdown.calibration.part import SENSORS, SensorCalibration
from northdown.errors import InputError, expected
from northdown.recording import Recording


@dataclass(frozen=True)
class Calibration:
    """Corrections of gyroscope, accelerometer and magnetometer; a sensor without one is left as it is.

    Parameters
    ----------
    gyr, acc, mag : SensorCalibration, optional
        Correction of each sensor.

    Raises
    ------
    InputError
        When a correction is of another sensor.

    Examples
    --------
    >>> import numpy as np
    >>> import northdown as nd
    >>> from northdown.calibration import Calibration, SensorCalibration
    >>> bias = Calibration(gyr=SensorCalibration("gyr", offset=np.array([0.01, 0.0, 0.0])))
    >>> scale = Calibration(gyr=SensorCalibration("gyr", matrix=1.02 * np.eye(3)))
    >>> both = scale @ bias  # the right one first
    >>> both == bias.then(scale)
    True
    >>> recording = nd.simulate(2.0)
    >>> np.allclose(both.apply(recording).gyr, 1.02 * (recording.gyr - [0.01, 0.0, 0.0]))
    True
    """

    gyr: SensorCalibration | None = None
    acc: SensorCalibration | None = None
    mag: SensorCalibration | None = None

    def __post_init__(self) -> None:
        for sensor in SENSORS:
            part = getattr(self, sensor)
            if part is None:
                continue
            if not isinstance(part, SensorCalibration) or part.sensor != sensor:
                got = part.sensor if isinstance(part, SensorCalibration) else type(part).__name__
                raise InputError(expected(f"a calibration of {sensor} as {sensor}", f"one of {got}"))

    @property
    def parts(self) -> tuple[SensorCalibration, ...]:
        """Corrections that are there, in the order gyr, acc, mag."""
        return tuple(part for part in (self.gyr, self.acc, self.mag) if part is not None)

    def apply(self, recording: Recording, *, temperature: Any = None) -> Recording:
        """Correct a recording.

        Parameters
        ----------
        recording : Recording
            Raw samples. Sensors that it lacks are passed over.
        temperature : (N,) array, optional
            Of the sensor unit at each sample, °C; needed when a part depends on it.

        Returns
        -------
        Recording
            The same with corrected samples; rows without a sample stay so.

        Raises
        ------
        InputError
            When no part concerns a sensor of the recording, the magnetometer's unit differs, or the
            temperature is missing.
        """
        corrected: dict[str, Any] = {}
        for part in self.parts:
            samples = getattr(recording, part.sensor)
            if samples is None:
                continue
            if part.sensor == "mag" and part.unit != recording.mag_unit:
                raise InputError(
                    expected(
                        f"a recording with its magnetic field in {part.unit}, as the calibration is",
                        recording.mag_unit,
                        do="read the recording with the unit that was used for calibrating",
                    )
                )
            corrected[part.sensor] = part.correct(samples, temperature)
        if not corrected:
            have = ", ".join(part.sensor for part in self.parts) or "nothing"
            raise InputError(expected("a recording with a sensor that the calibration is for", f"one without {have}"))
        return replace(recording, **corrected)

    def at_temperature(self, temperature: float) -> Calibration:
        """The calibration at one temperature (°C), which no longer depends on it."""
        return Calibration(**{part.sensor: part.at_temperature(temperature) for part in self.parts})

    def then(self, second: Calibration) -> Calibration:
        """First this calibration, then `second`, as one: what `second @ self` gives."""
        joined: dict[str, SensorCalibration | None] = {}
        for sensor in SENSORS:
            first, last = getattr(self, sensor), getattr(second, sensor)
            joined[sensor] = first.then(last) if first is not None and last is not None else first or last
        return Calibration(**joined)

    def __matmul__(self, first: object) -> Calibration:
        return first.then(self) if isinstance(first, Calibration) else NotImplemented

    def __str__(self) -> str:
        from northdown.calibration.words import describe

        return describe(self)
