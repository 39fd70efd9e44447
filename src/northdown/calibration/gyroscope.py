"""Gyroscope: bias from rest, and scale and alignment from turns between rests.

Bias: at rest a gyroscope shows its bias (and the Earth's rotation, 7.3e-5 rad/s, which is left in it). Scale and
alignment: see `northdown.calibration.turns`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from northdown._validation import check_number
from northdown.calibration._inputs import gather
from northdown.calibration._known_noise import chi2_limit
from northdown.calibration.model import Calibration
from northdown.calibration.part import Evidence, SensorCalibration
from northdown.calibration.rest import Rest, find_rests, noise_density
from northdown.calibration.turns import TurnFit, fit_turns
from northdown.errors import InputError, expected
from northdown.recording import Recording

_HOW: Final = "let the sensor lie still for 10 s or more, not held by hand"
# Bias of no common sensor (rad/s): 20 °/s.
_LARGEST_BIAS: Final = 0.35


def calibrate_gyroscope(
    recording: Recording | Sequence[Recording],
    *,
    turns: bool | None = None,
    tolerance: float = 0.01,
    min_duration: float = 1.0,
) -> Calibration:
    """Bias of a gyroscope from rest, and its scale and alignment from turns between rests.

    Parameters
    ----------
    recording : Recording or sequence of these
        With `gyr`, and for scale and alignment with `acc`, calibrated before. The sensor lies still, is turned
        to another position within some seconds, lies still again, and so on, about all axes.
    turns : bool, optional
        Whether scale and alignment are wanted: True refuses when the turns do not fix them, False takes the bias
        only. When not given, they are estimated if the turns suffice.
    tolerance : float
        Largest predicted 1-σ of the matrix's elements that is accepted.
    min_duration : float
        Shortest rest, s.

    Returns
    -------
    Calibration
        Its part `gyr`; the matrix takes the gyroscope's axes to those of the accelerometer. ``evidence.model`` is
        ``"bias"``, ``"bias and scale"`` or ``"bias, scale and alignment"``.

    Raises
    ------
    InputError
        When there is no rest; with ``turns=True`` also when the turns do not excite all axes.

    Notes
    -----
    The bias' σ is that of a mean over all rests with the noise as the rests show it; when the rests differ by more,
    it is enlarged accordingly. It says nothing of how the bias changes later.
    """
    tolerance = check_number("tolerance", tolerance, above=0.0, high=0.2)
    recordings = gather(recording, ("gyr", "acc") if turns else ("gyr",))
    rested = [(r, find_rests(r, min_duration=min_duration)) for r in recordings]
    part = _bias(rested, min_duration)
    if turns is False:
        return Calibration(gyr=part)
    fitted = fit_turns(rested, tolerance=tolerance)
    if isinstance(fitted, str):
        if turns:
            raise InputError(fitted)
        note = "only the bias was found; scale and alignment need turns between rests"
        return Calibration(gyr=_noted(part, note))
    return Calibration(gyr=_with_turns(part, fitted))


def _noted(part: SensorCalibration, note: str) -> SensorCalibration:
    return replace(part, evidence=replace(part.evidence, notes=(*part.evidence.notes, note)))


def _bias(rested: Sequence[tuple[Recording, tuple[Rest, ...]]], min_duration: float) -> SensorCalibration:
    rests = [rest for _, found in rested for rest in found if rest.gyr is not None]
    if not rests:
        total = sum(r.duration for r, _ in rested)
        raise InputError(expected("rests of the sensor", f"none of {min_duration:g} s in {total:.0f} s", do=_HOW))
    means = np.array([rest.gyr for rest in rests])
    duration = np.array([rest.duration for rest in rests])
    density = max(noise_density(rested, "gyr"), 1e-18)
    weight = duration / duration.sum()
    bias = weight @ means
    sigma = math.sqrt(density / float(duration.sum())) * np.ones(3)
    notes = [f"{len(rests)} rests, {duration.sum():.1f} s"]
    if len(rests) > 1:
        ratio = ((means - bias) ** 2 * duration[:, None] / density).sum(axis=0) / (len(rests) - 1)
        more = ratio > chi2_limit(len(rests) - 1) / (len(rests) - 1)
        sigma = sigma * np.sqrt(np.where(more, ratio, 1.0))
        if more.any():
            notes.append("the rests differ by more than the noise: the bias changes; its σ was enlarged")
    if np.linalg.norm(bias) > _LARGEST_BIAS:
        size = f"{np.linalg.norm(bias):.3g} rad/s"
        raise InputError(expected("a gyroscope that shows nearly 0 at rest", size, do="check the unit of gyr"))
    before, after = (float(np.sqrt(weight @ ((means - b) ** 2).sum(axis=1))) for b in (np.zeros(3), bias))
    evidence = Evidence("bias", "rate at rest", "rad/s", before, after, len(rests), notes=tuple(notes))
    return SensorCalibration("gyr", bias, offset_sigma=sigma, evidence=evidence)


def _with_turns(part: SensorCalibration, fitted: TurnFit) -> SensorCalibration:
    evidence = Evidence(
        f"bias{fitted.model}",
        "error of gravity's direction after a turn",
        "rad",
        fitted.before,
        fitted.after,
        fitted.turns,
        fitted.used,
        condition=fitted.condition,
        notes=(*part.evidence.notes, *fitted.notes),
    )
    return replace(part, matrix=fitted.matrix, matrix_sigma=fitted.sigma, evidence=evidence)
