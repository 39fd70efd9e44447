"""Write a figure to a file."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from northdown.errors import InputError, expected
from northdown.io.atomic import atomic_write

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FORMATS: Final = ("png", "pdf", "svg")
# Without the date, the same figure gives the same file.
_NO_DATE: Final[dict[str, dict[str, Any]]] = {"png": {}, "pdf": {"CreationDate": None}, "svg": {"Date": None}}


def save(figure: Figure, path: str | os.PathLike[str], *, dpi: float = 200.0) -> Path:
    """Write a figure as .png, .pdf or .svg, at once: the file is either complete or not there.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        From a function of `northdown.plots`.
    path : path
        File to write; one that is there is replaced.
    dpi : float
        Dots per inch of a .png.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    InputError
        When the suffix is another, the folder does not exist, or the file cannot be written.
    """
    target = Path(path)
    suffix = target.suffix.lower().lstrip(".")
    if suffix not in _FORMATS:
        raise InputError(
            expected("a file name ending in .png, .pdf or .svg", repr(target.name), do="give one of these suffixes")
        )
    with atomic_write(target) as file:
        figure.savefig(file, format=suffix, dpi=dpi, metadata=_NO_DATE[suffix])
    return target
