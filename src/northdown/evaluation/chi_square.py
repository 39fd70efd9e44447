"""Squares of errors over their covariance, and the χ² distribution that they should have.

Source: Y. Bar-Shalom, X.-R. Li, T. Kirubarajan, Estimation with Applications to Tracking and Navigation, Wiley 2001,
section 5.4, doi:10.1002/0471221279.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray, as_float_array, check_number
from northdown.errors import InputError, expected


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
