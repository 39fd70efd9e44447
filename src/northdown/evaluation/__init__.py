"""Compare an estimated orientation with the true one: matching in time, alignment, error metrics, covariances."""

from northdown.evaluation.alignment import Alignment, AlignmentKind, align
from northdown.evaluation.chi_square import chi2_bounds, nis
from northdown.evaluation.consistency import Coverage, NormalizedError, coverage, nees
from northdown.evaluation.consistency_conditions import Conditions
from northdown.evaluation.consistency_runs import ConsistencyResult, monte_carlo
from northdown.evaluation.matching import Matched, Truth, match
from northdown.evaluation.metrics import AttitudeError, ErrorSummary, attitude_error

__all__ = [
    "Alignment",
    "AlignmentKind",
    "AttitudeError",
    "Conditions",
    "ConsistencyResult",
    "Coverage",
    "ErrorSummary",
    "Matched",
    "NormalizedError",
    "Truth",
    "align",
    "attitude_error",
    "chi2_bounds",
    "coverage",
    "match",
    "monte_carlo",
    "nees",
    "nis",
]
