"""What a magnetometer's calibration does to samples that it was not made from.

A correction always makes the field's size more even where it was fitted. Whether it does so elsewhere is told by
cross-validation in blocks (Roberts et al., Ecography 40, 2017, 913–929): neighbours in time share their disturbance,
so that whole stretches are left out, not single samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from northdown._validation import FloatArray
from northdown.calibration._ellipsoid import Sphere
from northdown.calibration._ellipsoid_fit import refit_ellipsoid
from northdown.calibration._magnetometer_fit import FEWEST_ELLIPSOID, Fitted, fit_sphere
from northdown.calibration._solve import robust_scale

# Stretches into which a recording is cut, in turn given to the parts of which one at a time is left out.
_BLOCKS: Final = 50
_PARTS: Final = 5
# Directions that are used at most: more do not change the spread, but take time.
_MOST: Final = 2000


@dataclass(frozen=True)
class HeldOut:
    """Spread of the field's size over directions left out of the fit, relative to that size.

    Attributes
    ----------
    before, after : float
        Robust standard deviation (1.48 times the median deviation from the median) without and with the correction
        that the other directions give; infinite when they give none.
    """

    before: float
    after: float

    @property
    def gains(self) -> bool:
        """Whether the correction makes the size more even."""
        return self.after < self.before


def relative_spread(size: FloatArray) -> float:
    """Robust standard deviation of positive numbers about their median, relative to it."""
    middle = float(np.median(size))
    return robust_scale(size - middle) / middle


def held_out(points: FloatArray, fitted: Fitted) -> HeldOut:
    """Cross-validate a fit.

    Parameters
    ----------
    points : (N, 3) array
        Directions in order of time.
    fitted : Fitted
        The fit to all of them: its model is used, and the search begins at it.
    """
    thinned = points[:: math.ceil(len(points) / _MOST)]
    part = np.arange(len(thinned)) * _BLOCKS // len(thinned) % _PARTS
    after = np.empty(len(thinned))
    for k in range(_PARTS):
        left_out = part == k
        fit = _fit(thinned[~left_out], fitted)
        if fit is None:
            return HeldOut(relative_spread(np.linalg.norm(thinned, axis=1)), math.inf)
        after[left_out] = np.linalg.norm((thinned[left_out] - fit.offset) @ fit.matrix.T, axis=1) / fit.radius
    return HeldOut(relative_spread(np.linalg.norm(thinned, axis=1)), relative_spread(after))


def _fit(points: FloatArray, fitted: Fitted) -> Fitted | None:
    if fitted.model == "sphere" or len(points) < FEWEST_ELLIPSOID:
        return fit_sphere(points, Sphere(fitted.offset, fitted.radius))
    return refit_ellipsoid(points, fitted)
