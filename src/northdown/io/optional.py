"""Optional packages: imported where they are needed, with one clear line when they are absent."""

from __future__ import annotations

import importlib
from typing import Any

from northdown.errors import MissingDependencyError, expected


def import_optional(module: str, extra: str) -> Any:
    """Import a module of an optional package.

    Parameters
    ----------
    module : str
        Full name such as ``"pyarrow.parquet"``.
    extra : str
        Extra of northdown that installs it.

    Raises
    ------
    MissingDependencyError
        When the package is not installed; names the command that installs it.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        package = module.partition(".")[0]
        raise MissingDependencyError(
            expected(f"the package {package}", "none installed", do=f"run: pip install 'northdown[{extra}]'")
        ) from None
