"""What the checks of a recording work with: the signals with what is derived from them, and a finding."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt

from northdown._validation import BoolArray, FloatArray
from northdown.orientation import Orientation

IndexArray = npt.NDArray[np.intp]
Severity = Literal["error", "warning", "note"]

SENSOR_NAMES = {"gyr": "gyroscope", "acc": "accelerometer", "mag": "magnetometer"}

# A step is a gap when it is longer than this many times what nine steps out of ten keep to.
_GAP = 1.5
_QUANTILE = 0.9


@dataclass(frozen=True)
class Finding:
    """One thing found in a recording.

    Parameters
    ----------
    kind : str
        Short stable name such as ``"gyr-unit"``, for programs.
    severity : {"error", "warning", "note"}
        ``"error"``: results will be wrong; ``"warning"``: may be; ``"note"``: for information.
    message : str
        What was found and what to do, for people.
    at : int, optional
        First sample concerned.
    """

    kind: str
    severity: Severity
    message: str
    at: int | None = None


class Findings(tuple[Finding, ...]):
    """Findings, worst first."""

    __slots__ = ()

    def __str__(self) -> str:
        return "\n".join(f"{f.severity}: {f.message}" for f in self) or "nothing found"


def gap_limit(dt: FloatArray) -> float:
    """Longest step (s) that is not a gap; NaN when no step is positive."""
    forward = dt[dt > 0.0]
    return _GAP * float(np.quantile(forward, _QUANTILE)) if forward.size else float("nan")


def sampling_step(time: FloatArray) -> float:
    """Mean step (s) of a recording's times, leaving out gaps and steps backwards; NaN when there is none.

    The mean, because the median of times that were rounded (3, 4, 3, 4 ms) or came in packets is none of the
    sensor's.
    """
    dt = np.diff(time)
    inside = dt[(dt >= 0.0) & (dt <= gap_limit(dt))]
    return float(inside.mean()) if inside.size else float("nan")


@dataclass(frozen=True, eq=False)
class Signals:
    """Arrays of a recording, (N,) and (N, 3), as the checks see them; parameters as in `Recording`."""

    time: FloatArray
    gyr: FloatArray | None
    acc: FloatArray | None
    mag: FloatArray | None
    frame: str
    mag_unit: str
    reference: Orientation | None = None
    reference_offset: str = "none"

    @cached_property
    def dt(self) -> FloatArray:
        """Steps of time, (N − 1,), s."""
        return np.diff(self.time)

    @cached_property
    def gap(self) -> float:
        """Longest step that is not a gap, s."""
        return gap_limit(self.dt)

    @cached_property
    def step(self) -> float:
        """Sampling step, s; NaN when there is none."""
        return sampling_step(self.time)

    @cached_property
    def sensors(self) -> dict[str, FloatArray]:
        """The sensors that there are and that have a sample, by name."""
        return {k: v for k in SENSOR_NAMES if (v := getattr(self, k)) is not None and self.present[k].any()}

    @cached_property
    def present(self) -> dict[str, BoolArray]:
        """Rows in which a sensor has a sample, by name."""
        named = {k: getattr(self, k) for k in SENSOR_NAMES}
        return {k: ~np.isnan(v.sum(axis=1)) for k, v in named.items() if v is not None}

    @cached_property
    def norms(self) -> dict[str, FloatArray]:
        """Norm of each sample that is there, by name."""
        return {k: np.sqrt(np.einsum("ij,ij->i", w, w)) for k in self.sensors if (w := self.samples(k)) is not None}

    @cached_property
    def medians(self) -> dict[str, float]:
        """Median norm, by name."""
        return {k: float(np.median(v)) for k, v in self.norms.items()}

    def samples(self, sensor: str) -> FloatArray:
        """Rows of a sensor that are there, (M, 3)."""
        here = self.present[sensor]
        value: FloatArray = self.sensors[sensor]
        return value if here.all() else value[here]

    @cached_property
    def repeated(self) -> dict[str, tuple[BoolArray, BoolArray]]:
        """By name: whether each sample equals the one before, on each axis (M − 1, 3) and on all (M − 1,)."""
        result = {}
        for name in self.sensors:
            w = self.samples(name)
            each = w[1:] == w[:-1]
            result[name] = each, each[:, 0] & each[:, 1] & each[:, 2]
        return result

    def where(self, at: int) -> str:
        """Words for a place: sample and time."""
        return f"sample {at} ({self.time[at]:.6g} s)"


def run_bounds(mask: BoolArray) -> tuple[IndexArray, IndexArray]:
    """Starts and stops (exclusive) of the runs of true values of an (N,) mask."""
    edge = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return edge[::2], edge[1::2]


def count(n: int, what: str) -> str:
    """'1 sample', '3 samples'."""
    return f"{n} {what}{'' if n == 1 else 's'}"


def percent(part: float, whole: float) -> str:
    """Share in percent, never rounded to nothing."""
    share = 100.0 * part / whole if whole else 0.0
    return "under 0.01 %" if 0.0 < share < 0.01 else f"{share:.2g} %" if share < 10.0 else f"{share:.0f} %"


def duration(seconds: float) -> str:
    """Length of time in ms or s, to four digits and at least to 0.01 ms."""
    if seconds >= 0.9995:
        return f"{seconds:.4g} s"
    if 0.0 < seconds < 5e-6:
        return "under 0.01 ms"
    return f"{1e3 * seconds:.2f} ms" if seconds < 0.1 else f"{1e3 * seconds:.0f} ms"
