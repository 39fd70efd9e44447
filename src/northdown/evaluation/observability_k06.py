"""The eight configurations whose singular values K06 draws in figures 3.4 to 3.11, and what it concludes from each.

Source: C.-F. Kao, M.S. thesis, National Chiao Tung University, 2006, section 3-2. The motion is that of its section
4-1. K06 prints neither the attitude at the start nor the dip of the field; neither changes a rank here, where the
indirect measurements are defined.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from northdown.evaluation.observability_analysis import observability
from northdown.evaluation.observability_models import Method, State, Variant
from northdown.evaluation.observability_result import Observability
from northdown.simulation.motion import Motion
from northdown.simulation.motion_library import k06_sine

RATE: Final = 400.0
"""Samples per second of K06."""


@dataclass(frozen=True)
class K06Configuration:
    """One of K06's configurations.

    Parameters
    ----------
    figure : str
        Number of its figure.
    sensors : str
        As for `observability`.
    state : {"quaternion", "quaternion+norm", "euler"}
        How the attitude is written.
    method : {"direct", "indirect"}
        What is measured.
    zeros : int
        Singular values that are zero in the figure.
    """

    figure: str
    sensors: str
    state: State
    method: Method
    zeros: int

    def run(
        self,
        motion: Motion | None = None,
        *,
        order: int = 3,
        variant: Variant = "scale-free",
        dip: float = math.radians(60.0),
    ) -> Observability:
        """Analyse it.

        Parameters
        ----------
        motion : Motion, optional
            Two seconds of K06's rotation about three axes (`k06_sine`) when not given.
        order, variant, dip
            As for `observability`. K06 does not say up to which derivative it went.
        """
        path = k06_sine(2.0) if motion is None else motion
        return observability(
            path,
            self.sensors,
            state=self.state,
            method=self.method,
            order=order,
            variant=variant,
            dip=dip,
            times=path.times(RATE),
        )

    def agrees(self, found: Observability) -> bool:
        """Whether a result has K06's number of zeros at all times."""
        return bool((found.zeros() == self.zeros).all())


K06_CONFIGURATIONS: Final[tuple[K06Configuration, ...]] = (
    K06Configuration("3.4", "acc xyz, mag xyz", "quaternion", "indirect", 1),
    K06Configuration("3.5", "acc xyz, mag xyz", "quaternion+norm", "indirect", 0),
    K06Configuration("3.6", "acc xyz, mag xyz", "euler", "indirect", 0),
    K06Configuration("3.7", "acc xyz", "quaternion+norm", "indirect", 1),
    K06Configuration("3.8", "acc xyz", "euler", "indirect", 1),
    K06Configuration("3.9", "acc xyz, mag xyz", "quaternion", "direct", 0),
    K06Configuration("3.10", "acc yz, mag xy", "quaternion", "direct", 0),
    K06Configuration("3.11", "acc xyz", "quaternion", "direct", 1),
)
"""In the order of the figures."""


def k06_configurations() -> dict[str, K06Configuration]:
    """K06's eight configurations by the number of their figure, ``"3.4"`` to ``"3.11"``.

    Examples
    --------
    >>> from northdown.evaluation import k06_configurations
    >>> found = k06_configurations()["3.10"].run()
    >>> found.observable
    True
    """
    return {c.figure: c for c in K06_CONFIGURATIONS}
