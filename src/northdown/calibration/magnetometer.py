"""Magnetometer: hard and soft iron from turning the sensor in a constant field.

A sensor in a constant field sees vectors of one size; hard iron (magnets that turn with it) shifts their sphere, soft
iron (iron that turns with it), scale and cross-axis sensitivity make it an ellipsoid. From the size alone the
correction is known up to a rotation, so the matrix is taken symmetric: of all that make the ellipsoid a sphere it
turns vectors least, and it does not depend on how the axes are named. What rotation remains is found by
`align_magnetometer`.

A calibration is accepted by what the points alone tell of it, errors of an uneven field counted: those that persist,
those that come back with the direction, and gradients that pass for iron (`northdown.calibration._uneven`). Within
that, soft iron has a prior: it is small (3 % of the field, 1-σ) unless the points say otherwise. Hard iron has none,
so that a constant added to all samples is found again exactly. Whether the result is any good is then measured on
parts of the recording that were left out.

Sources: V. Renaudin, M. H. Afzal, G. Lachapelle, J. Sensors 2010, 967245 (ellipsoid model); P. D. Sampson, CGIP 18,
1982 (distance); Gelman et al., Bayesian Data Analysis, 3rd ed., 2013, section 17.2 (Student's t as a prior); Maronna,
Martin, Yohai, Robust Statistics, 2006 (MM estimator and its covariance).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from northdown._validation import FloatArray, check_number
from northdown.calibration._ellipsoid import Sphere, weakest
from northdown.calibration._ellipsoid_fit import fit_ellipsoid
from northdown.calibration._held_out import HeldOut, held_out
from northdown.calibration._inputs import axis_words, gather
from northdown.calibration._magnetometer_fit import (
    FEWEST_ELLIPSOID,
    HOW,
    Fitted,
    fit_sphere,
    gather_points,
)
from northdown.calibration._magnetometer_notes import WELL_KNOWN, Weakest, notes, weakest_of
from northdown.calibration.coverage import coverage
from northdown.calibration.model import Calibration
from northdown.calibration.part import Evidence, SensorCalibration
from northdown.errors import InputError, expected
from northdown.recording import Recording

# Share of points that must agree, and spread (relative) beyond which the field was not constant.
_FEWEST_USED, _MOST_SPREAD = 0.6, 0.1
_LEAST_SPREAD = 0.05  # below this share of its mean the field may as well be noise about one direction
# Errors that persist, relative to the field, beyond which it was not constant: a walk past iron, or a magnet that was
# there for a part of the time.
_MOST_PERSISTENT = 0.05
# 1-σ of the offset (relative to the field) from which on nothing is known, and the largest that may be accepted.
_HOPELESS, _LARGEST_TOLERANCE = 0.3, 0.2
# 1-σ of a sphere's centre (relative) from which on an ellipsoid is not tried: it would run away.
_FLAT = 1.0
# Ratio of extents of a set of points that is said to lie close to a plane.
_THIN = 0.3
# Ratio of spreads that may differ from 1 by chance.
_BY_CHANCE = 1.1


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
        Largest 1-σ, relative to the field, that is accepted of the offset along the axis known worst, and of the
        scale along any axis; both as the points alone tell them, without the prior. A larger one accepts less
        complete turning and a less even field. With the offset wrong by 5 % the heading is wrong by up to 7° where
        the dip is 65°. A sensor without iron needs it small (0.02), as a correction may do more harm than good; one
        with much iron gains even so.

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
    walk past iron, may be disturbed. The σ are those of the points alone, with residuals as they are. They allow for
    a field that is uneven in step with the direction, which no recording can tell from iron, by as much as the
    residuals make likely. In simulated rooms and over seven recordings of one sensor they are right on average; but a
    gradient that happens to lie along the field leaves no residuals, and of the rooms' offsets 17 % instead of 5 %
    are outside what 95 % should be in.
    """
    tolerance = check_number("tolerance", tolerance, above=0.0, high=_LARGEST_TOLERANCE)
    recordings = gather(recording, ("mag",))
    unit = recordings[0].mag_unit
    if field is not None:
        field = check_number("field", field, above=0.0, unit=unit)
    points, rough = gather_points(recordings)
    _check_turned(points)
    fitted = _fit(points, rough)
    _check_known(weakest_of(fitted), fitted.radius, tolerance, unit)
    _check_field(fitted)
    proof = held_out(points, fitted)
    if not (proof.gains or _needs_none(fitted, proof)):
        raise InputError(_no_gain(proof))
    return Calibration(mag=_part(fitted, points, unit, field, proof))


def _fit(points: FloatArray, rough: Sphere) -> Fitted:
    """Ellipsoid where there are points enough, else sphere."""
    sphere = fit_sphere(points, rough)
    if sphere is None:
        raise _unknown(_flat(_thinnest(points)))
    direction, sigma = weakest(sphere.solution)
    if not sigma < _FLAT:
        raise _unknown(_flat(direction))
    if len(points) < FEWEST_ELLIPSOID:
        return sphere
    fitted = fit_ellipsoid(points, sphere)
    if fitted is None:
        got = f"samples to which no ellipsoid fits, least of all for the offset along {axis_words(direction)}"
        raise _unknown(got)
    return fitted


def _thinnest(points: FloatArray) -> FloatArray:
    """Direction (3,) along which the points extend least; NaN when it is none in particular."""
    values, vectors = np.linalg.eigh(np.cov(points.T))
    if not values[0] < _THIN**2 * values[1]:
        return np.full(3, np.nan)
    direction: FloatArray = vectors[:, 0] * np.sign(vectors[np.argmax(np.abs(vectors[:, 0])), 0])
    return direction


def _unknown(got: str, more: str = "") -> InputError:
    return InputError(expected("a magnetometer turned into directions all around", got, do=HOW + more))


def _flat(direction: FloatArray) -> str:
    if not np.isfinite(direction).all():
        return "directions that fix no sphere: they lie close together or in one plane"
    return f"directions that say nothing of the offset along {axis_words(direction)}: they lie close to a plane"


def _check_turned(points: FloatArray) -> None:
    """Refuse a sensor that lay still: a sphere would fit its noise."""
    centre = points.mean(axis=0)
    spread, mean = float(np.sqrt(((points - centre) ** 2).sum(axis=1).mean())), float(np.linalg.norm(centre))
    if spread < _LEAST_SPREAD * mean:
        got = f"one that hardly turned: its field stays within {100.0 * spread / mean:.1g} % of its mean"
        raise InputError(expected("a magnetometer turned into directions all around", got, do=HOW))


def _check_known(worst: Weakest, radius: float, tolerance: float, unit: str) -> None:
    """Refuse what the directions do not fix well enough."""
    if worst.sigma <= tolerance:
        return
    if not worst.sigma <= _HOPELESS:
        raise _unknown(_flat(worst.direction))
    got = (
        f"directions that leave {worst.what} along {axis_words(worst.direction)} uncertain to "
        f"{worst.sigma * radius:.2g} of {radius:.3g} {unit} (1-σ)"
    )
    raise _unknown(got, ", or accept it with a larger tolerance" if worst.sigma <= _LARGEST_TOLERANCE else "")


def _needs_none(fitted: Fitted, proof: HeldOut) -> bool:
    """Whether nothing is gained because the sensor is right already, which the data show well."""
    sigma = weakest(fitted.solution)[1]
    no_offset = float(np.linalg.norm(fitted.offset)) <= 3.0 * sigma * fitted.radius
    return sigma <= WELL_KNOWN and no_offset and proof.after <= _BY_CHANCE * proof.before


def _no_gain(proof: HeldOut) -> str:
    """Message for a correction that does not help."""
    after = f"{100.0 * proof.after:.2g} %" if math.isfinite(proof.after) else "no fit"
    got = f"a spread of its size over parts left out of the fit of {100.0 * proof.before:.2g} % before, {after} after"
    do = "turn the sensor about all three axes in one place, away from iron and magnets that move"
    return expected("a field that a correction makes more even", got, do=do)


def _check_field(fitted: Fitted) -> None:
    """Refuse a field that wasn't constant."""
    used, spread, persistent = fitted.solution.used, fitted.solution.scale, fitted.solution.persistent
    if used >= _FEWEST_USED and spread <= _MOST_SPREAD and persistent <= _MOST_PERSISTENT:
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
            tuple(notes(fitted, points, seen, after / (scale * fitted.radius), unit, proof)),
            proof.before * norm,
            proof.after * norm if math.isfinite(proof.after) else math.nan,
        ),
    )
