"""What is known of a fit's unknowns beforehand."""

from __future__ import annotations

import math
from dataclasses import dataclass

from northdown._validation import FloatArray


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of the unknowns beforehand: `root` · (x − `mean`) is about 0, each row with its 1-σ `scale`.

    Its tails are those of Student's t with `freedom` degrees of freedom, so that the data may contradict it: what
    they say clearly is hardly shrunk. The largest posterior is found by alternating it with the variance (Lange,
    Little, Taylor, J. Am. Stat. Assoc. 84, 1989).
    """

    mean: FloatArray
    root: FloatArray
    scale: float
    freedom: float

    def variance(self, x: FloatArray) -> float:
        """Of each row, at these unknowns."""
        if math.isinf(self.freedom):
            return self.scale**2
        off = self.root @ (x - self.mean)
        return (self.freedom * self.scale**2 + float(off @ off)) / (self.freedom + len(off))

    def precision(self, x: FloatArray) -> FloatArray:
        """Inverse covariance (P, P) at these unknowns."""
        result: FloatArray = self.root.T @ self.root / self.variance(x)
        return result
