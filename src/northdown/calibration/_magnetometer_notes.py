"""What a user should know of a magnetometer's fit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from northdown._validation import FloatArray
from northdown.calibration._ellipsoid import normalised_covariance, weakest, weakest_scale
from northdown.calibration._held_out import HeldOut
from northdown.calibration._inputs import axis_words
from northdown.calibration._magnetometer_fit import FEWEST_ELLIPSOID, FLOOR, Fitted
from northdown.calibration.coverage import Coverage
from northdown.calibration.words import SHOWN

# 1-σ relative to the field above which the user is told.
WELL_KNOWN: Final = 0.02
# σ of the matrix above which the prior decides more than the points: its own, 3 % · √(3/9) about no soft iron.
_HARDLY_KNOWN: Final = 0.017
# 95 % quantiles of χ² for the three unknowns of hard iron and the five of soft iron.
_HARD_CHANCE: Final = 7.81
_SOFT_CHANCE: Final = 11.07


@dataclass(frozen=True)
class Weakest:
    """What a fit knows worst: the offset along a direction (3,), or the scale; its 1-σ relative to the field."""

    what: str
    direction: FloatArray
    sigma: float


def weakest_of(fitted: Fitted) -> Weakest:
    """What a fit knows worst, from the points alone."""
    solution = fitted.solution
    found = Weakest("the offset", *weakest(solution))
    if fitted.model == "ellipsoid":
        direction, sigma = weakest_scale(solution.x, solution.covariance)
        if sigma > found.sigma:
            return Weakest("scale and offset", direction, sigma)
    return found


def _by_chance(fitted: Fitted) -> bool:
    """Whether hard and soft iron are both what chance may give a sensor that has none."""
    solution = fitted.solution
    offset = fitted.offset / fitted.radius
    # of points without noise nothing is by chance
    covariance = solution.covariance[:3, :3] + FLOOR**2 * np.eye(3)
    hard = float(offset @ np.linalg.solve(covariance, offset))
    if fitted.model == "sphere" or hard > _HARD_CHANCE:
        return hard <= _HARD_CHANCE
    off = (fitted.matrix - np.eye(3)).ravel()
    # of the nine elements five are free
    values, vectors = np.linalg.eigh(normalised_covariance(solution.x, solution.covariance) + FLOOR**2 * np.eye(9))
    return float(((vectors[:, -5:].T @ off) ** 2 / values[-5:]).sum()) <= _SOFT_CHANCE


def notes(
    fitted: Fitted, points: FloatArray, seen: Coverage, spread: float, unit: str, proof: HeldOut
) -> Iterator[str]:
    """Sentences on what is uncertain, what was gained and what was disturbed."""
    count, used = len(points), fitted.solution.used
    worst = weakest_of(fitted)
    if fitted.model == "sphere":
        few = f"{count} directions are too few for soft iron, {FEWEST_ELLIPSOID} are needed"
        yield f"only hard iron was corrected: {few}"
    if worst.sigma > WELL_KNOWN:
        size = f"{worst.sigma * fitted.radius:.2g} {SHOWN[unit][0]}, {100.0 * worst.sigma:.1f} % of the field"
        axis = axis_words(worst.direction)
        yield f"{worst.what} along {axis} may be wrong by {size} (1-σ): turn more about all axes, away from iron"
    if fitted.model == "ellipsoid" and fitted.matrix_sigma.max() > _HARDLY_KNOWN:
        yield f"soft iron is hardly known (± {100.0 * fitted.matrix_sigma.max():.1f} %) and was kept small"
    if _by_chance(fitted):
        yield "hard and soft iron are no larger than their uncertainty: a calibrated sensor is better left as it is"
    if not proof.gains:
        yield "nothing was gained: over parts left out of the fit the field's size is as uneven as before"
    else:
        yield from _nothing_overall(fitted, points)
    if used < 0.95:
        yield f"{100.0 * (1.0 - used):.0f} % of the directions were left out as disturbed"
    if spread > 0.03:
        yield f"the field's size still varies by {100.0 * spread:.1f} %: it was disturbed while recording"
    if seen.share < 0.6:
        missing = axis_words(seen.missing)
        yield f"{100.0 * seen.share:.0f} % of all directions were seen; those around {missing} are missing most"


def _nothing_overall(fitted: Fitted, points: FloatArray) -> Iterator[str]:
    """A word where disturbed directions count so much that over all together nothing is gained."""
    size = np.linalg.norm(points, axis=1)
    corrected = np.linalg.norm((points - fitted.offset) @ fitted.matrix.T, axis=1)
    before, after = float(size.std() / size.mean()), float(corrected.std() / corrected.mean())
    if after >= before:
        share = f"{100.0 * before:.1f} % before, {100.0 * after:.1f} % after"
        yield f"over all directions, disturbed ones too, the field's size is no more even: it varies by {share}"
