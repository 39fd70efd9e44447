"""Checks of sizes: norms of accelerometer and magnetometer that suggest another unit, and a field that varies."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from northdown._validation import FloatArray
from northdown.checks.base import Finding, Severity, Signals


def magnitudes(s: Signals) -> Iterator[Finding]:
    """Sizes that suggest another unit, for accelerometer and magnetometer."""
    if "acc" in s.sensors:
        yield from _acc_size(*_quietest(s.norms["acc"], s.step))
    if "mag" in s.sensors and s.mag_unit == "uT":
        yield from _mag_size(s.medians["mag"])


# Blocks of this length (s), and the share of them that is quietest.
_BLOCK, _QUIETEST = 0.5, 0.2
# Relative spread of the norm in these above which the body never came to rest.
_RESTLESS = 0.05
# Factor by which gravity may be off: a sensor's error at rest; with the body always shaken.
_OFF, _OFF_RESTLESS = 1.12, 1.8

_GRAVITY = 9.80665
# size of gravity in the unit, its name, what turns it into m/s²
_ACC_UNITS = (
    (1.0, "g", "multiply by 9.80665"),
    (1000.0, "mg (or cm/s²)", "multiply by 0.00980665 (or 0.01)"),
    (_GRAVITY**2, "m/s² converted from g twice", "divide by 9.80665"),
    (32.17, "ft/s²", "multiply by 0.3048"),
)


def _quietest(norm: FloatArray, step: float) -> tuple[float, float]:
    """Norm where it varies least, which is nearest to gravity, and its relative spread there."""
    width = max(2, round(_BLOCK / step)) if 0.0 < step < _BLOCK else 2
    n = len(norm) // width
    if n < 5:
        return float(np.median(norm)), 0.0
    blocks = norm[: n * width].reshape(n, width)
    spread = blocks.std(axis=1)
    quiet = np.argsort(spread)[: max(1, round(_QUIETEST * n))]
    size = float(np.median(blocks[quiet]))
    return size, float(np.median(spread[quiet])) / size if size > 0.0 else 0.0


def _acc_size(norm: float, spread: float) -> Iterator[Finding]:
    text = f"acc has a norm of {norm:.4g} m/s² where it is quietest, and gravity alone gives 9.81"
    restless = spread > _RESTLESS
    off = _OFF_RESTLESS if restless else _OFF
    for size, name, do in _ACC_UNITS[: 3 if restless else 4]:
        if size / off < norm < size * off:
            yield Finding("acc-unit", "error", f"{text}: it looks like {name}; {do}", 0)
            return
    low, high = (3.0, 50.0) if restless else (6.0, 16.0)
    if low < norm < high:
        return
    exponent = round(math.log2(norm)) if 0.0 < norm < math.inf else 0
    if norm <= low:
        do = "gravity seems to have been removed; tilt needs the raw accelerometer"
        yield Finding("acc-size", "error", f"{text}: {do}", 0)
    elif exponent >= 7 and abs(norm / 2.0**exponent - 1.0) < 0.06:
        do = f"multiply by {_GRAVITY:g} / {2**exponent}"
        yield Finding("acc-unit", "error", f"{text}: it looks like raw counts, {2**exponent} per g; {do}", 0)
    else:
        yield Finding("acc-size", "error", f"{text}; find its unit and convert it to m/s²", 0)


# range of the norm of the Earth's field, somewhat widened for buildings, in the unit; name; what turns it into µT
_MAG_UNITS = (
    (1.5e-5, 9e-5, "tesla", "multiply by 1e6"),
    (0.015, 0.09, "mT", "multiply by 1000"),
    (0.15, 0.9, "gauss", "multiply by 100"),
    (150.0, 900.0, "mG", "multiply by 0.1"),
    (1.5e4, 9e4, "nT", "divide by 1000"),
)


def _mag_size(median: float) -> Iterator[Finding]:
    text = f"mag has a median norm of {median:.4g} µT, where the Earth's field has 22 to 67"
    for low, high, name, do in _MAG_UNITS:
        if low < median < high:
            yield Finding("mag-unit", "warning", f"{text}: it looks like {name}; {do}", 0)
            return
    if 0.9 <= median <= 1.2:
        do = 'say so with mag_unit="arbitrary"'
        yield Finding("mag-unit", "warning", f"{text}: it looks like a field of unit norm; {do}", 0)
    elif not 10.0 < median < 150.0:
        do = 'find its unit, or declare mag_unit="arbitrary"'
        yield Finding("mag-size", "warning", f"{text}; {do}", 0)


def field_norm(s: Signals) -> Iterator[Finding]:
    """Magnetic norm that varies, and whether a constant offset explains it."""
    if "mag" not in s.sensors or len(s.norms["mag"]) < 20:
        return
    norm = s.norms["mag"]
    spread = float(norm.std() / norm.mean()) if 0.0 < norm.mean() < math.inf else 0.0
    if spread < 0.05:
        return
    severity: Severity = "warning" if spread > 0.1 else "note"
    unit = "µT" if s.mag_unit == "uT" else "of its unit"
    text = f"the magnetic norm varies by {100 * spread:.0f} % (mean {norm.mean():.4g}, std {norm.std():.3g} {unit})"
    offset, rest = _sphere(s.samples("mag"))
    if rest < 0.5 * spread:
        values = ", ".join(f"{v:.3g}" for v in offset)
        do = (
            f"a constant offset of ({values}) {unit} in body axes explains most of it and leaves {100 * rest:.0f} %: "
            "calibrate the magnetometer for hard iron"
        )
    else:
        do = "a constant offset does not explain it: the field is disturbed on the way, or the sensor by soft iron"
    yield Finding("mag-norm", severity, f"{text}; {do}")


def _sphere(mag: FloatArray) -> tuple[FloatArray, float]:
    """Centre of the sphere through the samples and the relative spread left, or infinity when undetermined."""
    v = mag[:: max(1, len(mag) // 2000)]
    mean = v.mean(axis=0)
    v = v - mean
    extent = np.linalg.svd(v, compute_uv=False) / math.sqrt(len(v))
    # |v − c|² = r² is linear in c and r² − |c|²
    solution = np.linalg.lstsq(np.column_stack((2.0 * v, np.ones(len(v)))), (v * v).sum(axis=1), rcond=None)[0]
    centre = solution[:3]
    radius = np.linalg.norm(v - centre, axis=1)
    mean_radius = float(radius.mean())
    if extent[2] < 0.1 * mean_radius:  # turned about one axis only: the sphere could be any
        return centre, math.inf
    return centre + mean, float(radius.std()) / mean_radius


CHECKS = (magnitudes, field_norm)
