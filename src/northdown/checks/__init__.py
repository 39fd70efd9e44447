"""Findings of a recording's check.

Each check is a function that takes the recording's signals and yields findings; they stand by subject in
`time` (times), `sensors` (each sensor by itself), `size` (units and field), `agree`
(the sensors against each other) and `up` (which way is up). A new one is added to the `CHECKS` of its file.
"""

from __future__ import annotations

import numpy as np

from northdown._validation import FloatArray
from northdown.checks import agree, sensors, size, up
from northdown.checks import time as time_checks
from northdown.checks.base import Finding, Findings, Severity, Signals, sampling_step
from northdown.orientation import Orientation

__all__ = ["CHECKS", "Finding", "Findings", "Severity", "check_recording", "sampling_step"]

CHECKS = (
    *time_checks.CHECKS,
    *sensors.CHECKS,
    *size.CHECKS,
    *agree.CHECKS,
    *up.CHECKS,
)
_ORDER = ("error", "warning", "note")


def check_recording(
    time: FloatArray,
    gyr: FloatArray | None,
    acc: FloatArray | None,
    mag: FloatArray | None,
    *,
    frame: str,
    mag_unit: str,
    reference: Orientation | None = None,
    reference_offset: str = "none",
) -> Findings:
    """Check the arrays of a recording; see `Recording.check`."""
    signals = Signals(time, gyr, acc, mag, frame, mag_unit, reference, reference_offset)
    # absurdly large values overflow to infinity, which no check takes for anything
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        found = [finding for check in CHECKS for finding in check(signals)]
    return Findings(sorted(found, key=lambda finding: _ORDER.index(finding.severity)))
