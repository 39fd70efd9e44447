r"""Is a covariance to be believed? Errors against what the covariance predicts of them.

With δ the rotation vector of the attitude error, true rotation = exp(δ) · estimate, and P its covariance,

.. math::  \mathrm{NEES} = \delta^{\mathsf T} P^{-1} \delta

(normalised estimation error squared) has the χ² distribution with 3 degrees of freedom, and so the mean 3, when P is
right and errors are normal. Larger: the filter is overconfident. Smaller: it is too cautious.

Source: Y. Bar-Shalom, X.-R. Li, T. Kirubarajan, Estimation with Applications to Tracking and Navigation, Wiley 2001,
section 5.4, doi:10.1002/0471221279.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray
from northdown.errors import InputError, expected
from northdown.evaluation.alignment import Alignment, AlignmentKind
from northdown.evaluation.chi_square import normalized_square
from northdown.evaluation.matching import Truth, match
from northdown.evaluation.metrics import attitude_error
from northdown.frames import Frame
from northdown.orientation import Orientation

DEGREES_OF_FREEDOM: Final = 3
"""Components of an attitude error, and so the mean of its NEES."""

AXIS_NAMES: Final[dict[Frame, tuple[str, str, str]]] = {
    "NED": ("north", "east", "down"),
    "ENU": ("east", "north", "up"),
    "NWU": ("north", "west", "up"),
}
"""What the axes of each frame are called."""

NORMAL_SHARES: Final = tuple(math.erf(k / math.sqrt(2.0)) for k in (1, 2, 3))
"""Share of normal errors within 1, 2 and 3 standard deviations."""


@dataclass(frozen=True, eq=False)
class NormalizedError:
    """Attitude errors and what the covariance says of them, at the samples that count.

    Parameters
    ----------
    time : (M,) array
        Time, s.
    error : (M, 3) array
        Rotation vector δ, rad, in axes of `frame`: true rotation = exp(δ) · estimate.
    sigma : (M, 3) array
        Standard deviations of its components that the estimate claims, rad.
    nees : (M,) array
        Normalised estimation error squared, δᵀ P⁻¹ δ.
    bias : (M, 3) array, optional
        Error of each axis of the gyroscope's bias over its sigma, body axes; None where either is not known.
    frame : {"NED", "ENU", "NWU"}
        Frame of the estimate.
    name : str
        Name of the estimate.
    alignment : Alignment, optional
        Constant rotations that were found and taken out first; None when there were none.
    """

    time: FloatArray
    error: FloatArray
    sigma: FloatArray
    nees: FloatArray
    bias: FloatArray | None
    frame: Frame
    name: str = ""
    alignment: Alignment | None = None

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        return f"<NormalizedError {self.name or 'unnamed'}: {len(self)} samples, mean NEES {self.nees.mean():.3g}>"


@dataclass(frozen=True, eq=False)
class Coverage:
    """How often errors lie within 1, 2 and 3 of the standard deviations that the covariance claims.

    Parameters
    ----------
    share : (3, 3) array
        Share of samples within 1, 2, 3 σ (rows), for each axis of `frame` (columns); see `NORMAL_SHARES`.
    rms_error, rms_sigma : (3,) arrays
        Root mean square of the error and of σ for each axis, rad. Equal when the covariance is right.
    mean_nees : float
        Mean of the normalised error squared; 3 when the covariance is right.
    count : int
        Samples.
    frame : {"NED", "ENU", "NWU"}
        Frame of the estimate.
    name : str
        Name of the estimate.
    """

    share: FloatArray
    rms_error: FloatArray
    rms_sigma: FloatArray
    mean_nees: float
    count: int
    frame: Frame
    name: str = ""

    @property
    def factor(self) -> float:
        """How many times as large the errors are as the covariance says, √(mean NEES / 3)."""
        return math.sqrt(self.mean_nees / DEGREES_OF_FREEDOM)


def nees(
    estimate: Orientation,
    truth: Truth,
    *,
    mask: npt.ArrayLike | None = None,
    alignment: AlignmentKind | Alignment | None = None,
    max_gap: float | None = None,
) -> NormalizedError:
    """Normalised estimation error squared, sample by sample.

    Parameters
    ----------
    estimate : Orientation
        Estimate with a covariance.
    truth, mask, alignment, max_gap
        As for `attitude_error`.

    Raises
    ------
    InputError
        When the estimate has no covariance or one that is not positive definite, and as `attitude_error` does.

    Notes
    -----
    The bias is compared axis by axis, as of its covariance only the sigmas are known; and not at all where body axes
    were aligned, which are then not those of the true bias.
    """
    if estimate.covariance is None:
        raise InputError(
            expected(
                "an estimate with a covariance",
                f"{estimate.name or 'one'} without",
                do="run one of the Kalman filters, such as mekf",
            )
        )
    found = attitude_error(estimate, truth, mask=mask, alignment=alignment, max_gap=max_gap)
    error: FloatArray = -found.rotvec
    covariance = estimate.covariance[found.index]
    value = normalized_square(error, covariance)
    bias: FloatArray | None = None
    if estimate.gyr_bias is not None and estimate.gyr_bias_sigma is not None and found.alignment is None:
        true_bias = match(estimate, truth, mask=mask, max_gap=max_gap).truth.gyr_bias
        if true_bias is not None:
            bias = (true_bias - estimate.gyr_bias[found.index]) / estimate.gyr_bias_sigma[found.index]
    sigma: FloatArray = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    return NormalizedError(
        found.time, error, sigma, value, bias, estimate.frame, estimate.name, alignment=found.alignment
    )


def coverage(
    estimate: Orientation | NormalizedError,
    truth: Truth | None = None,
    mask: npt.ArrayLike | None = None,
    *,
    alignment: AlignmentKind | Alignment | None = None,
    max_gap: float | None = None,
) -> Coverage:
    """Share of samples whose error lies within 1, 2, 3 standard deviations, for each axis.

    Parameters
    ----------
    estimate : Orientation or NormalizedError
        Estimate with a covariance, or what `nees` made of it, which needs nothing else.
    truth, mask, alignment, max_gap
        As for `attitude_error`.

    Raises
    ------
    InputError
        As `nees` does.
    """
    if isinstance(estimate, NormalizedError):
        found = estimate
    elif truth is None:
        raise InputError(expected("a truth with the estimate", "none"))
    else:
        found = nees(estimate, truth, mask=mask, alignment=alignment, max_gap=max_gap)
    return Coverage(
        share=within_sigma(found),
        rms_error=np.sqrt(np.mean(found.error**2, axis=0)),
        rms_sigma=np.sqrt(np.mean(found.sigma**2, axis=0)),
        mean_nees=float(found.nees.mean()),
        count=len(found),
        frame=found.frame,
        name=found.name,
    )


def within_sigma(found: NormalizedError) -> FloatArray:
    """Share of samples within 1, 2 and 3 σ (rows) for each axis (columns)."""
    ratio: FloatArray = np.abs(found.error) / found.sigma
    return np.array([np.mean(ratio <= k, axis=0) for k in (1.0, 2.0, 3.0)])
