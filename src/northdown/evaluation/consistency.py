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

from northdown._validation import FloatArray, as_float_array, check_number
from northdown.errors import InputError, expected
from northdown.evaluation.alignment import Alignment, AlignmentKind
from northdown.evaluation.matching import Truth, match
from northdown.evaluation.metrics import attitude_error
from northdown.frames import Frame
from northdown.orientation import Orientation

DEGREES_OF_FREEDOM: Final = 3
"""Components of an attitude error, and so the mean of its NEES."""

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


def nis(innovations: npt.ArrayLike, covariances: npt.ArrayLike) -> FloatArray:
    """Normalised innovation squared yᵀ S⁻¹ y, which needs no truth: χ² with M degrees of freedom in a right filter.

    Parameters
    ----------
    innovations : (N, M) array
        Measured minus predicted. A row with NaN is no measurement.
    covariances : (N, M, M) array
        Their covariances S, as the filter claims.

    Returns
    -------
    (N,) array
        NaN where there was no measurement.

    Raises
    ------
    InputError
        On wrong shapes, infinite values, and covariances that are not symmetric and positive definite.
    """
    y, s = as_float_array("innovations", innovations), as_float_array("covariances", covariances)
    if y.ndim != 2 or not y.shape[1]:
        raise InputError(expected("innovations of shape (N, M)", f"shape {y.shape}"))
    n, m = y.shape
    if s.shape != (n, m, m):
        raise InputError(expected(f"covariances of shape ({n}, {m}, {m})", f"shape {s.shape}"))
    infinite = np.isinf(y).any(axis=1)
    if infinite.any():
        raise InputError(expected("finite innovations", "infinity", at=int(np.argmax(infinite))))
    there = ~np.isnan(y).any(axis=1)
    result = np.full(n, np.nan)
    result[there] = normalized_square(y[there], s[there], np.flatnonzero(there))
    return result


def chi2_bounds(dof: float, runs: int = 1, confidence: float = 0.95) -> tuple[float, float]:
    """Interval in which the mean of independent χ² numbers lies.

    Parameters
    ----------
    dof : float
        Degrees of freedom of each.
    runs : int
        How many there are in the mean.
    confidence : float
        Probability that the mean lies within; the rest is split evenly between both sides.

    Raises
    ------
    InputError
        When one of them is out of range.
    """
    from scipy.stats import chi2

    count = check_number("runs", runs, low=1.0)
    tail = 0.5 * (1.0 - check_confidence(confidence))
    total = count * check_number("dof", dof, above=0.0)
    return float(chi2.ppf(tail, total)) / count, float(chi2.isf(tail, total)) / count


def check_confidence(confidence: float) -> float:
    """Check a probability strictly between 0 and 1."""
    value = check_number("confidence", confidence, above=0.0)
    if value >= 1.0:
        raise InputError(expected("confidence below 1", f"{value:g}", do="give 0.95 for 95 %"))
    return value


def normalized_square(
    vector: FloatArray, covariance: FloatArray, number: npt.NDArray[np.intp] | None = None
) -> FloatArray:
    """Squares vᵀ P⁻¹ v (N,) of vectors (N, M) with covariances (N, M, M), by Cholesky's factors of all at once.

    `number` names the samples in errors, where they are part of more.
    """
    lower, upper = covariance, np.swapaxes(covariance, 1, 2)
    # NaN fails the comparison as well
    wrong = ~(np.abs(lower - upper) <= 1e-6 * np.abs(lower).max(axis=(1, 2), initial=0.0)[:, None, None]).all((1, 2))
    m = vector.shape[1]
    factor = np.zeros_like(covariance)
    y = np.zeros_like(vector)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for j in range(m):
            for i in range(j, m):
                rest = covariance[:, i, j] - np.sum(factor[:, i, :j] * factor[:, j, :j], axis=1)
                factor[:, i, j] = np.sqrt(rest) if i == j else rest / factor[:, j, j]
            y[:, j] = (vector[:, j] - np.sum(factor[:, j, :j] * y[:, :j], axis=1)) / factor[:, j, j]
        square: FloatArray = np.sum(y * y, axis=1)
    wrong |= ~np.isfinite(square)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(
            expected(
                "symmetric, positive definite covariances of finite numbers",
                "another",
                at=row if number is None else int(number[row]),
            )
        )
    return square
