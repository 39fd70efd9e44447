"""Compare an estimated orientation with the true one: matching in time, alignment, error metrics."""

from northdown.evaluation.alignment import Alignment, AlignmentKind, align
from northdown.evaluation.matching import Matched, Truth, match
from northdown.evaluation.metrics import AttitudeError, ErrorSummary, attitude_error

__all__ = [
    "Alignment",
    "AlignmentKind",
    "AttitudeError",
    "ErrorSummary",
    "Matched",
    "Truth",
    "align",
    "attitude_error",
    "match",
]
