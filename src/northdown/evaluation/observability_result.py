"""`Observability`: what an analysis of observability found, as numbers, in words and as a table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from northdown._validation import BoolArray, FloatArray
from northdown.evaluation.observability_models import Model

if TYPE_CHECKING:
    import pandas as pd

_MOST_LINES: Final = 5


@dataclass(frozen=True)
class Unobservable:
    """A direction of the state that the measurements do not show.

    Parameters
    ----------
    text : str
        What it is, in words.
    share : float
        Part of the times, above 0 up to 1, at which it is unobservable.
    """

    text: str
    share: float


@dataclass(frozen=True, eq=False)
class Observability:
    """Observability along a motion, of N times and n states.

    Parameters
    ----------
    time : (N,) array
        Time, s.
    singular_values : (N, n) array
        Of the observability matrix, falling; in units of the measurements' derivatives (1/sᵏ) per unit of the states
        (1, rad or rad/s). NaN where not `defined`.
    rank : (N,) array of int
        Number of singular values above `limit`; 0 where not `defined`.
    directions : (N, n, n) array
        Right singular vectors: row i belongs to singular value i, its components are the states. The rows from `rank`
        on span what is unobservable.
    unobservable : tuple of N tuples of str
        The unobservable directions in words.
    weakest : str
        The least observable of the observable directions, where its singular value is smallest over all times; those
        of equal singular values with "or" between them.
    defined : (N,) array of bool
        False where the states or measurements have no value, as Euler angles at pitch ±90°.
    overall : (n,) array
        Singular values of the matrices of all defined times together, over the root of their number, for changes at
        the first time of the quaternion's length, of attitude, bias and rate about north, east and down, and of the
        field.
    overall_rank : int
        Number of them that do not count as zero.
    overall_unobservable : tuple of str
        What stays unobservable over all times, in words that hold at the first.
    model : Model
        States, measurements and equations.
    order : int
        Highest derivative of the measurements.
    tolerance : float
        Singular values up to this part of the largest one, or of 1 where that is larger, count as zero.
    name : str
        Of the motion.
    """

    time: FloatArray
    singular_values: FloatArray
    rank: npt.NDArray[np.intp]
    directions: FloatArray
    unobservable: tuple[tuple[str, ...], ...]
    weakest: str
    defined: BoolArray
    overall: FloatArray
    overall_rank: int
    overall_unobservable: tuple[str, ...]
    model: Model
    order: int
    tolerance: float
    name: str = ""

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        ranks = f"{self.rank.min()} to {self.rank.max()}" if len(self) else "none"
        return f"<Observability {self.name or 'unnamed'}: {len(self)} times, rank {ranks} of {self.states}>"

    def __str__(self) -> str:
        return self.summary()

    @property
    def states(self) -> int:
        """Number of states, n."""
        return len(self.model.state_names)

    @property
    def observable(self) -> bool:
        """Whether all states are observable at all times."""
        return bool((self.rank == self.states).all())

    @property
    def smallest(self) -> FloatArray:
        """Smallest singular value at each time, (N,)."""
        return np.ascontiguousarray(self.singular_values[:, -1])

    @property
    def limit(self) -> FloatArray:
        """Up to which singular values count as zero, (N,); NaN where not defined."""
        return zero_limit(self.singular_values, self.tolerance)

    @property
    def findings(self) -> tuple[Unobservable, ...]:
        """Unobservable directions and the share of times, most frequent first."""
        counted = Counter(text for words in self.unobservable for text in dict.fromkeys(words))
        return tuple(Unobservable(text, number / len(self)) for text, number in counted.most_common())

    def zeros(self) -> npt.NDArray[np.intp]:
        """Number of unobservable directions at each time, (N,)."""
        return self.states - self.rank

    def summary(self) -> str:
        """States, measurements, rank and unobservable directions, in a few lines."""
        return "\n".join(f"{label:<14} {text}" for label, text in self.lines())

    def lines(self) -> Iterator[tuple[str, str]]:
        """Label and text of each line of the summary."""
        model = self.model
        yield "States", f"{self.states}: {', '.join(model.state_names)}"
        yield "Measured", f"{', '.join(model.measurement_names)}; derivatives up to order {self.order}"
        yield (
            "Motion",
            f"{self.name or 'unnamed'}, {len(self)} times from {self.time.min():g} to {self.time.max():g} s",
        )
        bad = int((~self.defined).sum())
        if bad:
            yield "Undefined", f"at {_percent(bad / len(self))} of the times: {self._reason()}"
        if bad == len(self):
            return
        ranks = sorted(Counter(self.rank[self.defined].tolist()).items(), reverse=True)
        texts = [f"{r} of {self.states} at {_percent(c / len(self))} of the times" for r, c in ranks]
        yield "Rank", f"{ranks[0][0]} of {self.states} at all times" if ranks[0][1] == len(self) else ", ".join(texts)
        findings = self.findings
        for k, found in enumerate(findings[:_MOST_LINES]):
            when = "" if found.share == 1.0 else f" ({_percent(found.share)} of the times)"
            yield "" if k else "Unobservable", f"{found.text}{when}"
        if len(findings) > _MOST_LINES:
            yield "", f"and {len(findings) - _MOST_LINES} more, less often"
        if not findings:
            yield "Unobservable", "nothing"
        yield "Taken together", self._together()
        value, when_least = self._least()
        yield "Weakest", f"{self.weakest}: singular value {value:.3g} at {when_least:g} s"
        yield "Counts as 0", f"up to {self.tolerance:g} of the largest singular value, or of 1"

    def _together(self) -> str:
        text = f"rank {self.overall_rank} of {self.states} over all times"
        if self.overall_rank:
            text += f", smallest singular value {self.overall[self.overall_rank - 1]:.3g}"
        return f"{text}; unobservable: {'; '.join(self.overall_unobservable) or 'nothing'}"

    def _least(self) -> tuple[float, float]:
        """Smallest singular value that does not count as zero, and its time."""
        last = self.singular_values[np.arange(len(self)), np.maximum(self.rank - 1, 0)]
        last = np.where(self.rank > 0, last, np.inf)
        at = int(np.argmin(last))
        return float(last[at]), float(self.time[at])

    def _reason(self) -> str:
        if self.model.method == "indirect":
            return "an angle near ±90°, where the indirect measurements are"
        return "pitch near ±90°, where roll and yaw are"

    def to_pandas(self) -> pd.DataFrame:
        """Table with one row per time: time (s), singular values, rank, unobservable directions in words."""
        import pandas as pd

        columns: dict[str, object] = {"time": self.time}
        columns |= {f"sigma_{k + 1}": self.singular_values[:, k] for k in range(self.states)}
        columns["rank"] = self.rank
        columns["unobservable"] = ["; ".join(words) for words in self.unobservable]
        table = pd.DataFrame(columns)
        table.attrs = {"name": self.name, "states": list(self.model.state_names), "order": self.order}
        return table


def zero_limit(values: FloatArray, tolerance: float) -> FloatArray:
    """Up to which singular values (N, n) count as zero, (N,); see `Observability.tolerance`."""
    limit: FloatArray = tolerance * np.maximum(values[:, 0], 1.0)
    return limit


def _percent(share: float) -> str:
    """A share as text; one that is neither nothing nor all is not written as such."""
    text = f"{100.0 * share:.1f}"
    if share < 1.0 and text == "100.0":
        text = "99.9"
    if share > 0.0 and text == "0.0":
        text = "under 0.1"
    return f"{text} %"
