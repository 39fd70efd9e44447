"""Noise as filters take it: one number for each sensor, under the names of their parameters."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from typing import Final

from northdown.calibration.noise_model import AllanResult
from northdown.errors import InputError, expected

PARAMETERS: Final = {
    "gyr_noise": ("gyr", "white_noise", "rad/s/√Hz"),
    "gyr_bias_walk": ("gyr", "random_walk", "rad/s²/√Hz"),
    "acc_noise": ("acc", "white_noise", "m/s²/√Hz"),
    "mag_noise": ("mag", "white_noise", "µT/√Hz"),
}
"""Name of each parameter: sensor, coefficient and unit."""


def noise_parameters(results: AllanResult | Iterable[AllanResult]) -> dict[str, float]:
    """Noise parameters of filters, from the noise of one sensor or of several.

    Parameters
    ----------
    results : AllanResult or iterable of them
        At most one for each sensor.

    Returns
    -------
    dict
        ``gyr_noise`` (rad/s/√Hz), ``gyr_bias_walk`` (rad/s²/√Hz), ``acc_noise`` (m/s²/√Hz) and ``mag_noise``
        (µT/√Hz), each the root mean square over the three axes. A parameter is left out when its sensor is not
        there, when some axis does not determine it, or when the field's unit is unknown.

    Raises
    ------
    InputError
        When a sensor occurs twice.
    """
    return {name: value for name, (value, _) in _collect(results).items() if value is not None}


def noise_toml(results: AllanResult | Iterable[AllanResult]) -> str:
    """The parameters of `noise_parameters` as TOML, with units, and reasons for those left out, in comments."""
    lines = ["# Noise for northdown's filters, from the Allan deviation at rest.", ""]
    for name, (value, words) in _collect(results).items():
        lines.append(f"# {words}")
        if value is not None:
            lines.append(f"{name} = {value:.6e}")
    return "\n".join(lines) + "\n"


def write_noise_toml(results: AllanResult | Iterable[AllanResult], path: str | os.PathLike[str]) -> None:
    """Write `noise_toml` to a file, which appears whole or not at all.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    from northdown.io.atomic import atomic_write

    text = noise_toml(results)
    with atomic_write(path) as file:
        file.write(text.encode())


def _collect(results: AllanResult | Iterable[AllanResult]) -> dict[str, tuple[float | None, str]]:
    """Value of each parameter whose sensor is there, or None, and words for it."""
    given = [results] if isinstance(results, AllanResult) else list(results)
    by_sensor: dict[str, AllanResult] = {}
    for result in given:
        if not isinstance(result, AllanResult):
            raise InputError(expected("results of identify_noise()", type(result).__name__))
        if result.sensor in by_sensor:
            raise InputError(expected("one result for each sensor", f"two for {result.sensor}"))
        by_sensor[result.sensor] = result
    return {
        name: _parameter(name, by_sensor[sensor], field, unit)
        for name, (sensor, field, unit) in PARAMETERS.items()
        if sensor in by_sensor
    }


def _parameter(name: str, result: AllanResult, field: str, unit: str) -> tuple[float | None, str]:
    if result.arbitrary:
        return None, f"{name}: the unit of the field is unknown"
    coefficients = [getattr(model, field) for model in result.axes]
    label = coefficients[0].name
    values = [float(c.value) for c in coefficients if c.value is not None]
    if len(values) < len(coefficients):
        limit = max(c.high for c in coefficients)
        which = ", ".join(m.axis for m, c in zip(result.axes, coefficients, strict=True) if c.value is None)
        return None, f"{name}: {label} not determined ({which}); at most {limit:.2e} {unit}"
    by_axis = ", ".join(f"{model.axis} {v:.2e}" for model, v in zip(result.axes, values, strict=True))
    mean = math.sqrt(sum(v * v for v in values) / len(values))
    return mean, f"{name} in {unit}: {label}, {by_axis}"
