"""Estimators, one to a file; `registry` finds them, `get` gives one by name."""

from __future__ import annotations

from northdown.estimators._registry import find_class, get, registry
from northdown.estimators._stream import Stream
from northdown.estimators.base import Estimator

__all__ = ["Estimator", "Stream", "find_class", "get", "registry"]
