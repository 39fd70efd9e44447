"""A calibration in words: what was found with its uncertainty, what it achieved, and what to know of it."""

from __future__ import annotations

import math
import textwrap
from typing import TYPE_CHECKING, Final

import numpy as np

from northdown.calibration.part import Evidence, SensorCalibration

if TYPE_CHECKING:
    from northdown.calibration.model import Calibration

_WIDTH: Final = 80
_TITLES: Final = {"gyr": "Gyroscope", "acc": "Accelerometer", "mag": "Magnetometer"}
_OFFSETS: Final = {"gyr": "Bias", "acc": "Offset", "mag": "Hard iron"}
# How values are shown: unit as written in files, unit as shown, factor.
SHOWN: Final = {
    "rad/s": ("°/s", math.degrees(1.0)),
    "rad": ("°", math.degrees(1.0)),
    "m/s^2": ("m/s²", 1.0),
    "uT": ("µT", 1.0),
    "arbitrary": ("(arbitrary unit)", 1.0),
}


def describe(calibration: Calibration) -> str:
    """All parts of a calibration in lines of at most 80 columns."""
    parts = calibration.parts
    if not parts:
        return "a calibration of nothing"
    return "\n\n".join("\n".join(_lines(part)) for part in parts)


def rows(part: SensorCalibration) -> list[tuple[str, str]]:
    """What was found, without the evidence, as labelled lines; an empty label goes on with the one before."""
    unit, factor = SHOWN[part.unit]
    found = [(_TITLES[part.sensor], part.evidence.model)]
    label = _OFFSETS[part.sensor]
    for axis, value, sigma in zip("xyz", factor * part.offset, factor * part.offset_sigma, strict=True):
        found.append((label, f"{axis} {with_sigma(float(value), float(sigma))} {unit}"))
        label = ""
    if not np.array_equal(part.matrix, np.eye(3)):
        label = "Matrix"
        for values, sigmas in zip(part.matrix, part.matrix_sigma, strict=True):
            row = "  ".join(f"{v:9.5f}" for v in values)
            found.append((label, row + (f"   ± {sigmas.max():.5f}" if sigmas.any() else "")))
            label = ""
    if part.temperature is not None:
        slope = part.temperature
        found.append(
            (
                "Temperature",
                f"from {slope.low:.1f} to {slope.high:.1f} °C; the bias above is at {slope.reference:.1f} °C",
            )
        )
        first = "  ".join(f"{factor * c:.3g}" for c in slope.coefficients[0])
        found.append(("", f"{first} {unit} per °C there"))
    if part.sensor == "mag" and not math.isnan(part.norm):
        found.append(("Field", f"{part.norm:.4g} {unit}"))
    return found


def evidence_rows(evidence: Evidence) -> list[tuple[str, str]]:
    """Residual before and after, coverage and condition, as labelled lines."""
    found = []
    if evidence.quantity:
        unit, factor = SHOWN.get(evidence.unit, (evidence.unit, 1.0))
        before, after = factor * evidence.before, factor * evidence.after
        digits = _digits(min(before, after) if after > 0.0 else before)
        found.append(("Residual", f"{before:.{digits}f} → {after:.{digits}f} {unit}  ({evidence.quantity})"))
    if math.isfinite(evidence.held_out_after):
        unit, factor = SHOWN.get(evidence.unit, (evidence.unit, 1.0))
        before, after = factor * evidence.held_out_before, factor * evidence.held_out_after
        digits = _digits(min(before, after) if after > 0.0 else before)
        found.append(
            ("Held out", f"{before:.{digits}f} → {after:.{digits}f} {unit}  (over parts left out of the fit)")
        )
    if evidence.samples:
        kept = "" if evidence.used == 1.0 else f", {100.0 * evidence.used:.0f} % kept"
        found.append(("Fit of", f"{evidence.samples} observations{kept}"))
    if not math.isnan(evidence.coverage):
        found.append(("Coverage", f"{100.0 * evidence.coverage:.0f} % of all directions"))
    if not math.isnan(evidence.condition):
        found.append(("Condition", f"{evidence.condition:.3g} (below 50 is good)"))
    return found


def with_sigma(value: float, sigma: float) -> str:
    """A value with its 1-σ, both to two digits of the latter."""
    if not sigma > 0.0:
        return f"{value:.4g}"
    digits = _digits(sigma)
    return f"{value:.{digits}f} ± {sigma:.{digits}f}"


def _digits(value: float) -> int:
    """Decimals that show two digits of a value."""
    if not (value > 0.0 and math.isfinite(value)):
        return 3
    return min(max(1 - math.floor(math.log10(value)), 0), 9)


def _lines(part: SensorCalibration) -> list[str]:
    pairs = rows(part) + evidence_rows(part.evidence)
    width = max(len(label) for label, _ in pairs)
    lines = []
    for label, text in pairs:
        lines += (
            textwrap.wrap(text, _WIDTH, initial_indent=f"{label:<{width}}  ", subsequent_indent=" " * (width + 2))
            if label not in ("Matrix", "")
            else [f"{label:<{width}}  {text}"]
        )
    for note in part.evidence.notes:
        lines += textwrap.wrap(note, _WIDTH, initial_indent="- ", subsequent_indent="  ")
    return lines
