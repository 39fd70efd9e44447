"""Estimators, one to a file; `registry` finds them, `get` gives one by name.

`LearntCalibration` is what `CalibratingEKF` learns of its sensors.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from northdown.estimators._registry import find_class, get, registry
from northdown.estimators._stream import Stream
from northdown.estimators.base import Estimator

if TYPE_CHECKING:
    from northdown.estimators._calibrating_learnt import LearntCalibration

__all__ = ["Estimator", "LearntCalibration", "Stream", "find_class", "get", "registry"]


def __getattr__(name: str) -> Any:
    """Load on first use what needs the filter's own files."""
    if name == "LearntCalibration":
        from northdown.estimators._calibrating_learnt import LearntCalibration

        return LearntCalibration
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
