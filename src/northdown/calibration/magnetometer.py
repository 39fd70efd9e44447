"""Magnetometer: hard and soft iron from turning the sensor in a constant field.

A sensor in a constant field sees vectors of one size; hard iron (magnets that turn with it) shifts their sphere, soft
iron (iron that turns with it), scale and cross-axis sensitivity make it an ellipsoid. From the size alone the
correction is known up to a rotation, so the matrix is taken symmetric: of all that make the ellipsoid a sphere it
turns vectors least, and it does not depend on how the axes are named. What rotation remains is found by
`align_magnetometer`.

Few recordings see all directions, and no field indoors is quite even. So hard and soft iron have priors: they are
small (3 % of the field, 1-σ) unless the data say otherwise. Where they say little there is hardly any soft iron,
and where they say nothing it leaves a sensor that was calibrated before as it is. Whether the result is any good
is then measured on parts of the recording that were left out.

Sources: V. Renaudin, M. H. Afzal, G. Lachapelle, J. Sensors 2010, 967245 (ellipsoid model); P. D. Sampson, CGIP 18,
1982 (distance); Gelman et al., Bayesian Data Analysis, 3rd ed., 2013, section 17.2 (Student's t as a prior); Maronna,
Martin, Yohai, Robust Statistics, 2006 (MM estimator and its covariance).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from northdown._validation import FloatArray, check_number
from northdown.calibration._ellipsoid import Sphere, weakest
from northdown.calibration._held_out import HeldOut, held_out
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
from northdown.calibration.words import SHOWN
from northdown.errors import InputError, expected
from northdown.recording import Recording

# Share of points that must agree, and spread (relative) beyond which the field was not constant.
_FEWEST_USED, _MOST_SPREAD = 0.6, 0.1
_LEAST_SPREAD = 0.05  # below this share of its mean the field may as well be noise about one direction
# 1-σ of the offset (relative to the field) from which on nothing is known.
_HOPELESS = 0.3
# 1-σ of a sphere's centre (relative) from which on an ellipsoid is not tried: it would run away.
_FLAT = 1.0
# 1-σ of the offset (relative to the field) above which the user is told.
_WELL_KNOWN = 0.02
# Ratio of spreads that may differ from 1 by chance.
_BY_CHANCE = 1.1
# σ of the matrix that comes from the prior more than from the data, which have at most 1.5 % left of it.
_HARDLY_KNOWN = 0.01


def calibrate_magnetometer(
    recording: Recording | Sequence[Recording],
    *,
    field: float | None = None,
    tolerance: float = 0.05,
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
        Largest predicted 1-σ of the offset (relative to the field) that is accepted. A larger one accepts less
        complete turning; an offset of 5 % that is wrong turns the heading by up to 7° where the dip is 65°.

    Returns
    -------
    Calibration
        Its part `mag`. ``evidence.model`` is ``"ellipsoid"``, or ``"sphere"`` when there were too few directions for
        more than hard iron. ``evidence.held_out_before`` and ``held_out_after`` are the spread of the field's size
        over parts of the recording that were left out; the notes say what to know of it.

    Raises
    ------
    InputError
        When the directions do not fix the offset (turned in one plane, about one axis, too little, too few
        samples); when the field was not constant; or when the correction does not make the field's size more even
        over the parts left out, unless the sensor evidently needs none.

    Notes
    -----
    Successive samples from one direction (2°) count as one point. Up to some 40 % of points, such as a
    walk past iron, may be disturbed. The σ are those of the fit with residuals as they are, correlation in time
    and the prior on soft iron included. The prior on hard iron makes no σ smaller: what only it decides is uncertain.
    """
    tolerance = check_number("tolerance", tolerance, above=0.0, high=0.2)
    recordings = gather(recording, ("mag",))
    unit = recordings[0].mag_unit
    if field is not None:
        field = check_number("field", field, above=0.0, unit=unit)
    points, rough = gather_points(recordings)
    _check_turned(points)
    fitted = _fit(points, rough)
    refusal = _why_not(fitted, tolerance, unit)
    if refusal or fitted is None:
        raise InputError(refusal)
    _check_field(fitted, points)
    proof = held_out(points, fitted)
    if not (proof.gains or _needs_none(fitted, proof)):
        raise InputError(_no_gain(proof))
    return Calibration(mag=_part(fitted, points, unit, field, proof))


def _fit(points: FloatArray, rough: Sphere) -> Fitted | None:
    """Ellipsoid where there are points enough, else sphere; none, or a hopeless sphere, for a flat set of points."""
    sphere = fit_sphere(points, rough)
    if sphere is None or len(points) < FEWEST_ELLIPSOID or not weakest(sphere.solution)[1] < _FLAT:
        return sphere
    return fit_ellipsoid(points, sphere)


def _check_turned(points: FloatArray) -> None:
    """Refuse a sensor that lay still: a sphere would fit its noise."""
    centre = points.mean(axis=0)
    spread = float(np.sqrt(((points - centre) ** 2).sum(axis=1).mean()) / np.linalg.norm(centre))
    if spread < _LEAST_SPREAD:
        got = f"one that hardly turned: its field stays within {100.0 * spread:.1g} % of its mean"
        raise InputError(expected("a magnetometer turned into directions all around", got, do=HOW))


def _why_not(fitted: Fitted | None, tolerance: float, unit: str) -> str:
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


def _needs_none(fitted: Fitted, proof: HeldOut) -> bool:
    """Whether nothing is gained because the sensor is right already, which the data show well."""
    sigma = weakest(fitted.solution)[1]
    no_offset = float(np.linalg.norm(fitted.offset)) <= 3.0 * sigma * fitted.radius
    return sigma <= _WELL_KNOWN and no_offset and proof.after <= _BY_CHANCE * proof.before


def _no_gain(proof: HeldOut) -> str:
    """Message for a correction that does not help."""
    after = f"{100.0 * proof.after:.2g} %" if math.isfinite(proof.after) else "no fit"
    got = f"a spread of its size over parts left out of the fit of {100.0 * proof.before:.2g} % before, {after} after"
    do = "turn the sensor about all three axes in one place, away from iron and magnets that move"
    return expected("a field that a correction makes more even", got, do=do)


def _check_field(fitted: Fitted, points: FloatArray) -> None:
    """Refuse a field that wasn't constant."""
    used = fitted.solution.used
    spread = fitted.solution.scale
    if used >= _FEWEST_USED and spread <= _MOST_SPREAD:
        return
    got = f"one whose size fits for {100.0 * used:.0f} % of the directions, to {100.0 * spread:.1f} %"
    do = "record in one place, away from iron and cables; or it is no single sensor"
    raise InputError(expected("a field of constant size", got, do=do))


def _part(fitted: Fitted, points: FloatArray, unit: str, field: float | None, proof: HeldOut) -> SensorCalibration:
    scale = 1.0 if field is None else field / fitted.radius
    norm = fitted.radius if field is None else field
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
        norm,
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
            tuple(_notes(fitted, seen, after / (scale * fitted.radius), unit, proof)),
            proof.before * norm,
            proof.after * norm if math.isfinite(proof.after) else math.nan,
        ),
    )


def _notes(fitted: Fitted, seen: Coverage, spread: float, unit: str, proof: HeldOut) -> Iterator[str]:
    count = len(fitted.solution.weights)
    direction, sigma = weakest(fitted.solution)
    if sigma > _WELL_KNOWN:
        size = f"{sigma * fitted.radius:.2g} {SHOWN[unit][0]}, {100.0 * sigma:.1f} % of the field"
        yield f"the offset along {axis_words(direction)} is uncertain to {size} (1-σ): turn more about all axes"
    if fitted.model == "sphere":
        yield f"only hard iron was corrected: soft iron needs {FEWEST_ELLIPSOID} directions, there were {count}"
    elif fitted.matrix_sigma.max() > _HARDLY_KNOWN:
        yield f"soft iron is hardly known (± {100.0 * fitted.matrix_sigma.max():.1f} %) and was kept small"
    if not proof.gains:
        yield "nothing was gained: over parts left out of the fit the field's size is as uneven as before"
    if fitted.solution.used < 0.95:
        yield f"{100.0 * (1.0 - fitted.solution.used):.0f} % of the directions were left out as disturbed"
    if spread > 0.03:
        yield f"the field's size still varies by {100.0 * spread:.1f} %: it was disturbed while recording"
    if seen.share < 0.6:
        missing = axis_words(seen.missing)
        yield f"{100.0 * seen.share:.0f} % of all directions were seen; those around {missing} are missing most"
