"""K06's simulations made again: its tables, the data of its figures, and what it claims.

K06: C.-F. Kao, "Orientation Estimation Using Coplanar Accelerometers and Magnetic Sensors", M.S. thesis, National
Chiao Tung University, 2006. ``northdown reproduce kao2006`` writes it all.

>>> from northdown.evaluation import kao2006
>>> row = kao2006.Row("rest", "direct", "EKF")
>>> ratio = kao2006.thesis_sigma(row, runs=1) / kao2006.SIGMA[row]
>>> bool((abs(ratio - 1.0) < 0.3).all())
True
"""

from northdown.evaluation.kao2006.claims import Claim
from northdown.evaluation.kao2006.comparison import Comparison, compare
from northdown.evaluation.kao2006.constants import DERIVED, DOCUMENTED, Constants
from northdown.evaluation.kao2006.published import ENTRIES, SIGMA, Row
from northdown.evaluation.kao2006.results import STEPS, Results, reproduce
from northdown.evaluation.kao2006.signals import Signals, simulate
from northdown.evaluation.kao2006.tables import Agreement, Entry, agreement, derived_sigma, thesis_sigma
from northdown.evaluation.kao2006.thesis_filter import Estimate, estimate

__all__ = [
    "DERIVED",
    "DOCUMENTED",
    "ENTRIES",
    "SIGMA",
    "STEPS",
    "Agreement",
    "Claim",
    "Comparison",
    "Constants",
    "Entry",
    "Estimate",
    "Results",
    "Row",
    "Signals",
    "agreement",
    "compare",
    "derived_sigma",
    "estimate",
    "reproduce",
    "simulate",
    "thesis_sigma",
]
