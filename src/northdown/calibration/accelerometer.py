"""Accelerometer: offset, scale and cross-axis sensitivity from several positions of rest.

At rest an accelerometer measures specific force of one known size, gravity's reaction, whatever its position. So the
means over rests lie on an ellipsoid, as a magnetometer's samples do, and the same fit finds

    calibrated = A (raw − b),   |calibrated| = g.

A is taken symmetric, not triangular. Both have six elements, and the size of vectors cannot tell them apart: they
differ by a rotation. The triangular form makes one sensitive axis the body's x axis and lays the next in its
x–y plane, so what comes out depends on which axis is called x. The symmetric form is the least change of all that
serve, treats the axes alike, and turns with them when they are renamed. Which rotation is right is a question of the
housing, and needs other measurements.

Sources: I. Frosio, F. Pedersini, N. A. Borghese, IEEE Trans. Instrum. Meas. 58(6), 2009 (model and minimum of
positions); D. Tedaldi, A. Pretto, E. Menegatti, ICRA 2014 (rests found by their variance).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from northdown._validation import FloatArray, check_number
from northdown.calibration._ellipsoid import DIAGONAL, FULL, OFFSET, elements, ellipsoid_model, symmetric, weakest
from northdown.calibration._inputs import axis_words, gather
from northdown.calibration._known_noise import ignored, known_noise
from northdown.calibration._solve import Solution
from northdown.calibration.model import Calibration
from northdown.calibration.part import Evidence, SensorCalibration
from northdown.calibration.rest import Rest, find_rests, noise_density
from northdown.errors import InputError, expected
from northdown.recording import Recording

STANDARD_GRAVITY: Final = 9.80665

# Models from the most to the least complete: the unknowns, and what the others (1-σ) usually amount to.
_MODELS: Final = (
    ("offset, scale and cross-axis", FULL, 0.0),
    ("offset and scale", DIAGONAL, 0.005),
    ("offset", OFFSET, 0.01),
)
# Rests further apart than this (rad) are two positions.
_APART: Final = math.radians(15.0)
# Sizes of specific force at rest (relative) that no accelerometer in its unit shows.
_PLAUSIBLE: Final = (0.7, 1.3)
_HOW: Final = (
    "let the sensor rest for 2 s or more in nine or more positions: on each of its six faces and on edges between, "
    "not held by hand"
)


@dataclass(frozen=True, eq=False)
class _Fitted:
    model: str
    solution: Solution
    offset: FloatArray
    matrix: FloatArray
    offset_sigma: FloatArray
    matrix_sigma: FloatArray


def calibrate_accelerometer(
    recording: Recording | Sequence[Recording],
    *,
    gravity: float = STANDARD_GRAVITY,
    tolerance: float = 0.005,
    min_duration: float = 1.0,
) -> Calibration:
    """Offset, scale and cross-axis sensitivity of an accelerometer that rested in several positions.

    Parameters
    ----------
    recording : Recording or sequence of these
        With `acc`; rests are found by the noise of accelerometer and gyroscope.
    gravity : float
        Local gravity, m/s²; it varies from 9.78 at the equator to 9.83 at the poles, and by −3 mm/s² per km.
    tolerance : float
        Largest predicted 1-σ of the offset (relative to gravity) and of the matrix's elements that is accepted.
    min_duration : float
        Shortest rest, s.

    Returns
    -------
    Calibration
        Its part `acc`. ``evidence.model`` says what the positions sufficed for: ``"offset, scale and
        cross-axis"`` (nine positions or more), ``"offset and scale"`` (six or more) or ``"offset"``.

    Raises
    ------
    InputError
        When there is no rest, or the positions do not even fix the offset.
    """
    gravity = check_number("gravity", gravity, low=9.0, high=10.5, unit="m/s²")
    tolerance = check_number("tolerance", tolerance, above=0.0, high=0.1)
    recordings = gather(recording, ("acc",))
    rested = [(r, find_rests(r, min_duration=min_duration)) for r in recordings]
    means, duration = _means(rested)
    if not len(means):
        got = f"none of {min_duration:g} s in {sum(r.duration for r in recordings):.0f} s"
        raise InputError(expected("rests of the sensor", got, do=_HOW))
    _check_size(means, gravity)
    positions = count_positions(means)
    floor = 1e-7 * gravity  # for data without noise
    sigma = np.sqrt(np.maximum(noise_density(rested, "acc") / duration, floor**2)) / gravity
    refusals = []
    for name, free, usual in _MODELS:
        if positions < len(free):
            refusals.append(f"{positions} positions are too few for {name}, {len(free)} are needed")
            continue
        fitted = _fit(name, means / gravity, sigma, free, usual)
        refusal = _why_not(fitted, tolerance)
        if not refusal:
            return Calibration(acc=_part(fitted, means, gravity, positions, refusals))
        refusals.append(refusal)
    raise InputError(expected("rests in positions all around", refusals[-1], do=_HOW))


def _means(rested: Sequence[tuple[Recording, tuple[Rest, ...]]]) -> tuple[FloatArray, FloatArray]:
    """Means (R, 3) of specific force at rest, and durations (R,)."""
    rests = [rest for _, found in rested for rest in found if rest.shows_gravity]
    means = np.array([rest.acc for rest in rests], dtype=np.float64).reshape(-1, 3)
    return means, np.array([rest.duration for rest in rests])


def _check_size(means: FloatArray, gravity: float) -> None:
    size = float(np.median(np.linalg.norm(means, axis=1))) / gravity
    if not _PLAUSIBLE[0] < size < _PLAUSIBLE[1]:
        raise InputError(
            expected(f"about {gravity:.2f} m/s² at rest", f"{size * gravity:.4g}", do="check the unit of acc")
        )


def count_positions(means: FloatArray) -> int:
    """Number of positions that are at least 15° apart from each other."""
    unit = means / np.linalg.norm(means, axis=1)[:, None]
    chosen: list[FloatArray] = []
    for direction in unit:
        if all(float(direction @ other) < math.cos(_APART) for other in chosen):
            chosen.append(direction)
    return len(chosen)


def _fit(name: str, points: FloatArray, sigma: FloatArray, free: tuple[int, ...], usual: float) -> _Fitted:
    whole = np.concatenate([np.zeros(3), elements(np.eye(3))])
    index = list(free)
    distances = ellipsoid_model(points, free=free, fixed=whole)

    def model(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        residual, jacobian = distances(x)
        return residual / sigma, jacobian / sigma[:, None]

    solution = known_noise(model, whole[index])
    if usual and np.isfinite(solution.covariance).all():
        rest = [k for k in FULL if k not in free]
        every = ellipsoid_model(points)(_insert(whole, index, solution.x))[1] / sigma[:, None]
        extra = ignored(every[:, index], every[:, rest], solution.weights, usual)
        solution = replace(solution, covariance=solution.covariance + extra)
    full = _insert(whole, index, solution.x)
    deviations = _insert(np.zeros(9), index, solution.sigma)
    return _Fitted(name, solution, full[:3], symmetric(full[3:]), deviations[:3], symmetric(deviations[3:]))


def _insert(base: FloatArray, index: list[int], values: FloatArray) -> FloatArray:
    full = base.copy()
    full[index] = values
    return full


def _why_not(fitted: _Fitted, tolerance: float) -> str:
    """What is not known well enough; empty when everything is."""
    direction, sigma = weakest(fitted.solution)
    positive = np.linalg.eigvalsh(fitted.matrix)[0] > 0.5
    if not math.isfinite(sigma) or sigma > 0.1 or not positive:
        return f"positions that do not fix {fitted.model}"
    if sigma > tolerance:
        got = f"leave the offset along {axis_words(direction)} uncertain to {100.0 * sigma:.2g} % of gravity (1-σ)"
        return f"positions that, for {fitted.model}, {got}"
    worst = float(fitted.matrix_sigma.max())
    if worst > tolerance:
        return f"positions that leave {fitted.model} uncertain to {100.0 * worst:.2g} % (1-σ)"
    return ""


def _part(
    fitted: _Fitted, means: FloatArray, gravity: float, positions: int, refusals: list[str]
) -> SensorCalibration:
    kept = fitted.solution.weights > 0.0
    offset = gravity * fitted.offset
    corrected = (means - offset) @ fitted.matrix.T
    before, after = (
        float(np.sqrt(np.mean((np.linalg.norm(v[kept], axis=1) - gravity) ** 2))) for v in (means, corrected)
    )
    notes = [f"{len(means)} rests in {positions} positions"]
    if refusals:
        notes.append(f"only {fitted.model} was found: {refusals[-1]}")
    if int(kept.sum()) <= len(fitted.solution.x):
        notes.append("as many unknowns as rests: nothing checks the result; add positions")
    if not kept.all():
        notes.append(f"{int((~kept).sum())} rests were left out, as they contradict the others")
    if fitted.solution.scale > 1.0:
        notes.append(
            f"the rests differ {fitted.solution.scale:.1f} times more than the noise explains; the σ were enlarged"
        )
    return SensorCalibration(
        "acc",
        offset,
        fitted.matrix,
        gravity * fitted.offset_sigma,
        fitted.matrix_sigma,
        norm=gravity,
        evidence=Evidence(
            fitted.model,
            "error of gravity's size at rest",
            "m/s^2",
            before,
            after,
            len(means),
            float(kept.mean()),
            condition=fitted.solution.condition,
            notes=tuple(notes),
        ),
    )
