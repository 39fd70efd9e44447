"""Magnetometer: hard and soft iron from turning the sensor in a constant field.

A sensor in a constant field sees vectors of one size; hard iron (magnets that turn with it) shifts their sphere, soft
iron (iron that turns with it), scale and cross-axis sensitivity make it an ellipsoid. From the size alone the
correction is known up to a rotation, so the matrix is taken symmetric: of all that make the ellipsoid a sphere it
turns vectors least, and it does not depend on how the axes are named. What rotation remains is found by
`align_magnetometer`.

Sources: V. Renaudin, M. H. Afzal, G. Lachapelle, J. Sensors 2010, 967245 (ellipsoid model); P. D. Sampson, CGIP 18,
1982 (distance); Maronna, Martin, Yohai, Robust Statistics, 2006 (MM estimator and its covariance).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from northdown._validation import FloatArray, check_number
from northdown.calibration._ellipsoid import weakest
from northdown.calibration._inputs import axis_words, gather
from northdown.calibration._magnetometer_fit import (
    FEWEST_ELLIPSOID,
    HOW,
    Fitted,
    fit_ellipsoid,
    fit_sphere,
    gather_points,
)
from northdown.calibration.coverage import Coverage, coverage
from northdown.calibration.model import Calibration
from northdown.calibration.part import Evidence, SensorCalibration
from northdown.errors import InputError, expected
from northdown.recording import Recording

# Share of points that must agree, and spread (relative) beyond which the field was not constant.
_FEWEST_USED, _MOST_SPREAD = 0.6, 0.1
_LEAST_SPREAD = 0.05  # below this share of its mean the field may as well be noise about one direction
# 1-σ of the offset (relative to the field) from which on nothing is known.
_HOPELESS = 0.3


def calibrate_magnetometer(
    recording: Recording | Sequence[Recording],
    *,
    field: float | None = None,
    tolerance: float = 0.02,
) -> Calibration:
    """Hard and soft iron of a magnetometer that was turned about in a constant field.

    Parameters
    ----------
    recording : Recording or sequence of these
        With `mag`; all of one sensor in one place.
    field : float, optional
        Size of the local field in the recording's unit, such as the World Magnetic Model gives. When not given, the
        size is kept: it becomes the geometric mean of the ellipsoid's semi-axes.
    tolerance : float
        Largest predicted 1-σ of the offset (relative to the field) and of the matrix's elements that is
        accepted. With a larger one less complete turning is accepted.

    Returns
    -------
    Calibration
        Its part `mag`. When the directions suffice for a sphere but not for an ellipsoid, only hard iron is
        corrected; ``evidence.model`` says ``"ellipsoid"`` or ``"sphere"``, and a note says why.

    Raises
    ------
    InputError
        When the directions do not fix the offset (turned in one plane, about one axis, too little, too few
        samples), or the field was not constant.

    Notes
    -----
    Successive samples from one direction (2°) count as one point. Up to some 40 % of points, such as a
    walk past iron, may be disturbed. The σ are those of the fit with residuals as they are, correlation in time
    included.
    """
    tolerance = check_number("tolerance", tolerance, above=0.0, high=0.2)
    recordings = gather(recording, ("mag",))
    unit = recordings[0].mag_unit
    if field is not None:
        field = check_number("field", field, above=0.0, unit=unit)
    points, rough = gather_points(recordings)
    _check_turned(points)
    sphere = fit_sphere(points, rough)
    ellipsoid = fit_ellipsoid(points, sphere) if sphere and len(points) >= FEWEST_ELLIPSOID else None
    why_not = _why_not_ellipsoid(ellipsoid, tolerance, len(points))
    fitted = sphere if why_not else ellipsoid
    refusal = _why_not_sphere(sphere, tolerance, unit) if why_not else ""
    if refusal or fitted is None:
        raise InputError(refusal)
    _check_field(fitted, points)
    return Calibration(mag=_part(fitted, points, unit, field, why_not))


def _check_turned(points: FloatArray) -> None:
    """Refuse a sensor that lay still: a sphere would fit its noise."""
    centre = points.mean(axis=0)
    spread = float(np.sqrt(((points - centre) ** 2).sum(axis=1).mean()) / np.linalg.norm(centre))
    if spread < _LEAST_SPREAD:
        got = f"one that hardly turned: its field stays within {100.0 * spread:.1g} % of its mean"
        raise InputError(expected("a magnetometer turned into directions all around", got, do=HOW))


def _why_not_sphere(fitted: Fitted | None, tolerance: float, unit: str) -> str:
    """Message of refusal when the offset isn't known well enough; empty when it is."""
    direction, sigma = (np.full(3, np.nan), math.inf) if fitted is None else weakest(fitted.solution)
    if sigma <= tolerance:
        return ""
    if fitted is None or not math.isfinite(sigma):
        got = "directions that fix no sphere: they lie close together or in one plane"
    elif sigma > _HOPELESS:
        got = f"directions that say nothing of the offset along {axis_words(direction)}: they lie close to a plane"
    else:
        got = (
            f"directions that leave the offset along {axis_words(direction)} uncertain to "
            f"{sigma * fitted.radius:.2g} of {fitted.radius:.3g} {unit} (1-σ)"
        )
    do = HOW if sigma > _HOPELESS else f"{HOW}, or accept it with a larger tolerance"
    return expected("a magnetometer turned into directions all around", got, do=do)


def _why_not_ellipsoid(fitted: Fitted | None, tolerance: float, points: int) -> str:
    """Note on why only hard iron was corrected; empty when soft iron is known well enough."""
    only = "only hard iron was corrected: "
    if points < FEWEST_ELLIPSOID:
        return only + f"{points} directions are too few for soft iron, {FEWEST_ELLIPSOID} are needed"
    if fitted is None:
        return only + "the directions fix no ellipsoid; turn about all three axes for soft iron"
    sigma = float(fitted.matrix_sigma.max())
    if sigma > tolerance:
        return only + f"soft iron would be uncertain to {100.0 * sigma:.1f} %; turn about all three axes for it"
    if weakest(fitted.solution)[1] > tolerance:
        return only + "an ellipsoid would leave the offset uncertain; turn about all three axes for soft iron"
    return ""


def _check_field(fitted: Fitted, points: FloatArray) -> None:
    """Refuse a field that wasn't constant."""
    used = fitted.solution.used
    spread = fitted.solution.scale
    if used >= _FEWEST_USED and spread <= _MOST_SPREAD:
        return
    got = f"one whose size fits for {100.0 * used:.0f} % of the directions, to {100.0 * spread:.1f} %"
    do = "record in one place, away from iron and cables; or it is no single sensor"
    raise InputError(expected("a field of constant size", got, do=do))


def _part(fitted: Fitted, points: FloatArray, unit: str, field: float | None, why_not: str) -> SensorCalibration:
    scale = 1.0 if field is None else field / fitted.radius
    kept = fitted.solution.weights > 0.0
    before = float(np.linalg.norm(points[kept], axis=1).std())
    corrected = (points - fitted.offset) @ fitted.matrix.T
    after = float(np.linalg.norm(corrected[kept], axis=1).std()) * scale
    seen = coverage(corrected[kept])
    relative = fitted.radius_sigma / fitted.radius
    sigma = np.sqrt(
        (scale * fitted.matrix_sigma) ** 2 + (0.0 if field is None else scale * relative * fitted.matrix) ** 2
    )
    return SensorCalibration(
        "mag",
        fitted.offset,
        scale * fitted.matrix,
        fitted.offset_sigma,
        sigma,
        unit,
        fitted.radius if field is None else field,
        None,
        Evidence(
            fitted.model,
            "spread of the field's size",
            unit,
            before,
            after,
            len(points),
            fitted.solution.used,
            seen.share,
            fitted.solution.condition,
            tuple(_notes(fitted, seen, after / (scale * fitted.radius), why_not)),
        ),
    )


def _notes(fitted: Fitted, seen: Coverage, spread: float, why_not: str) -> Iterator[str]:
    if why_not:
        yield why_not
    if fitted.solution.used < 0.95:
        yield f"{100.0 * (1.0 - fitted.solution.used):.0f} % of the directions were left out as disturbed"
    if spread > 0.03:
        yield f"the field's size still varies by {100.0 * spread:.1f} %: it was disturbed while recording"
    if seen.share < 0.6:
        missing = axis_words(seen.missing)
        yield f"{100.0 * seen.share:.0f} % of all directions were seen; those around {missing} are missing most"
