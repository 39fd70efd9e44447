"""The registry: estimators are found by their files."""

from __future__ import annotations

import difflib
import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache

from northdown.errors import InputError, expected
from northdown.estimators.base import Estimator


@cache
def _modules() -> tuple[str, ...]:
    """Names of the files that hold estimators."""
    package = importlib.import_module("northdown.estimators")
    names = (m.name for m in pkgutil.iter_modules(package.__path__))
    return tuple(sorted(n for n in names if not n.startswith("_") and n != "base"))


@cache
def _load(module_name: str) -> type[Estimator]:
    """The estimator of one file."""
    module = importlib.import_module(f"northdown.estimators.{module_name}")
    for value in vars(module).values():
        if isinstance(value, type) and issubclass(value, Estimator) and value.__module__ == module.__name__:
            return value
    raise TypeError(f"estimators/{module_name}.py defines no Estimator")


def registry() -> Mapping[str, type[Estimator]]:
    """All estimators by name, in the order of their names."""
    found = [_load(module_name) for module_name in _modules()]
    return {estimator.name: estimator for estimator in sorted(found, key=lambda e: e.name)}


def get(name: str) -> type[Estimator]:
    """Estimator class by its name, such as ``"mahony"``; only its own file is loaded."""
    module_name = name.replace("-", "_")
    if module_name in _modules() and "_" not in name:
        return _load(module_name)
    known = [m.replace("_", "-") for m in _modules()]
    close = difflib.get_close_matches(name, known, n=1)
    hint = f"did you mean {close[0]!r}?" if close else None
    raise InputError(expected(f"an estimator out of {', '.join(known)}", repr(name), do=hint))


def find_class(class_name: str) -> type[Estimator] | None:
    """Estimator by the name of its class, such as ``"GyroEulerEKF"``, whose file is ``gyro_euler_ekf``."""
    for module_name in _modules():
        if module_name.replace("_", "") == class_name.lower():
            return _load(module_name)
    return None
