"""Figures 3.4 to 3.11: how many singular values are zero, in K06 and here."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from northdown.evaluation.kao2006.constants import DOCUMENTED
from northdown.evaluation.observability_k06 import K06_CONFIGURATIONS, K06Configuration
from northdown.evaluation.observability_result import Observability


@dataclass(frozen=True, eq=False)
class Configured:
    """One of the eight configurations, analysed along the three-axis rotation.

    Parameters
    ----------
    configuration : K06Configuration
        Figure, sensors, states, K06's number of zeros.
    found : Observability
        The analysis.
    """

    configuration: K06Configuration
    found: Observability

    @property
    def zeros(self) -> tuple[int, int]:
        """Least and largest number of zeros over time."""
        zeros = self.found.zeros()
        return int(zeros.min()), int(zeros.max())

    @property
    def smallest(self) -> float:
        """Smallest singular value that does not count as zero, over all times; NaN when there is none."""
        values, zeros = self.found.singular_values, self.found.zeros()
        last = [row[-1 - z] for row, z in zip(values, zeros, strict=True) if z < len(row)]
        return float(np.min(last)) if last else float("nan")

    @property
    def agrees(self) -> bool:
        """Whether the number of zeros is K06's at all times."""
        return self.configuration.agrees(self.found)


def configurations() -> tuple[Configured, ...]:
    """All eight, in the order of the figures."""
    motion = DOCUMENTED.motion("sine")
    return tuple(Configured(c, c.run(motion, dip=DOCUMENTED.dip)) for c in K06_CONFIGURATIONS)


def as_printed() -> Configured:
    """Figure 3.4 with K06's equations to the letter: z₂ not divided by |q|², q̇ divided by ‖q‖."""
    first = K06_CONFIGURATIONS[0]
    return Configured(first, first.run(DOCUMENTED.motion("sine"), dip=DOCUMENTED.dip, variant="printed"))
