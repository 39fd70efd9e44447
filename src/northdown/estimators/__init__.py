"""Estimators, one to a file; `registry` finds them, `get` gives one by name."""

from __future__ import annotations

from northdown.estimators.base import Estimator, Stream, get, registry

__all__ = ["Estimator", "Stream", "get", "registry"]
