"""Figures for A4 paper and colour-blind readers, one function for each kind.

Each function returns a `matplotlib.figure.Figure` that has nothing to do with pyplot's global state: show it in a
notebook by naming it, or write it with `save`. Angles in degrees unless asked otherwise; times in seconds.
"""

from northdown.plots._allan import allan
from northdown.plots._array import array
from northdown.plots._consistency import consistency
from northdown.plots._errors import errors
from northdown.plots._euler import euler
from northdown.plots._kao2006 import kao2006
from northdown.plots._observability import observability
from northdown.plots._path import path
from northdown.plots._quaternion import quaternion
from northdown.plots._save import save
from northdown.plots._sensors import sensors

__all__ = [
    "allan",
    "array",
    "consistency",
    "errors",
    "euler",
    "kao2006",
    "observability",
    "path",
    "quaternion",
    "save",
    "sensors",
]
