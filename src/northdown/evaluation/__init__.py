"""Compare an estimated orientation with the true one: matching in time, alignment, error metrics, covariances.

And find out what an estimate can tell at all: observability.
"""

from northdown.evaluation.alignment import Alignment, AlignmentKind, align
from northdown.evaluation.chi_square import chi2_bounds, nis
from northdown.evaluation.clock import Clock, ClockOffset, clock_offset
from northdown.evaluation.consistency import Coverage, NormalizedError, coverage, nees
from northdown.evaluation.consistency_conditions import Conditions
from northdown.evaluation.consistency_runs import ConsistencyResult, monte_carlo
from northdown.evaluation.matching import Matched, Truth, match
from northdown.evaluation.metrics import AttitudeError, ErrorSummary, attitude_error
from northdown.evaluation.observability_analysis import observability
from northdown.evaluation.observability_k06 import K06Configuration, k06_configurations
from northdown.evaluation.observability_result import Observability, Unobservable

__all__ = [
    "Alignment",
    "AlignmentKind",
    "AttitudeError",
    "Clock",
    "ClockOffset",
    "Conditions",
    "ConsistencyResult",
    "Coverage",
    "ErrorSummary",
    "K06Configuration",
    "Matched",
    "NormalizedError",
    "Observability",
    "Truth",
    "Unobservable",
    "align",
    "attitude_error",
    "chi2_bounds",
    "clock_offset",
    "coverage",
    "k06_configurations",
    "match",
    "monte_carlo",
    "nees",
    "nis",
    "observability",
]
