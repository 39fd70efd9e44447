"""Arrays of single-axis accelerometers on one rigid body, which can stand in for gyroscopes.

>>> from northdown.arrays import analyse, coplanar7
>>> found = analyse(coplanar7(0.0175))
>>> len(found.array), round(found.condition, 2)
(7, 1.57)
"""

from northdown.arrays.analysis import ArrayAnalysis, analyse, solution
from northdown.arrays.budget import ErrorBudget
from northdown.arrays.design import Placement, best_in_plane, leave_one_out
from northdown.arrays.geometry import AccelerometerArray
from northdown.arrays.library import (
    GEOMETRIES,
    coplanar6,
    coplanar7,
    cube6,
    cube9,
    geometry,
    ring,
    tetrahedron12,
    triads,
)
from northdown.arrays.rank import MAX_CONDITION, missing_directions, scaled_matrix

__all__ = [
    "GEOMETRIES",
    "MAX_CONDITION",
    "AccelerometerArray",
    "ArrayAnalysis",
    "ErrorBudget",
    "Placement",
    "analyse",
    "best_in_plane",
    "coplanar6",
    "coplanar7",
    "cube6",
    "cube9",
    "geometry",
    "leave_one_out",
    "missing_directions",
    "ring",
    "scaled_matrix",
    "solution",
    "tetrahedron12",
    "triads",
]
