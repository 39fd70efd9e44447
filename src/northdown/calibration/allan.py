"""Overlapping Allan deviation of a sensor at rest.

Averages of the signal over neighbouring clusters of the length τ differ; half their mean squared difference is the
Allan variance σ²(τ). Its dependence on τ tells white noise (falls as 1/τ) from bias instability (flat) and from a
random walk (rises as τ). The overlapping estimate takes all clusters, at every start.

Source: IEEE Std 952-1997, annex C; D. W. Allan, "Statistics of atomic frequency standards", Proc. IEEE 54(2), 1966.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from northdown._validation import BoolArray, FloatArray, check_choice, check_number, check_vectors
from northdown.checks.base import run_bounds
from northdown.errors import InputError, expected

IndexArray = npt.NDArray[np.int64]
Spacing = Literal["octave", "decade"]

LEAST_SAMPLES = 256
"""Fewer samples give too few cluster times for a fit."""

# The longest cluster is a quarter of the record: beyond, one or two differences decide.
_LONGEST = 4


@dataclass(frozen=True, eq=False)
class AllanCurve:
    """Overlapping Allan deviation of three axes.

    Attributes
    ----------
    tau : (T,) array
        Cluster times, s.
    deviation : (T, 3) array
        Allan deviation of each axis, in the unit of the values.
    size : (T,) array of int
        Samples in a cluster.
    count : (T,) array of int
        Second differences that went into each value. They overlap, so they are far from independent.
    lengths : (R,) array of int
        Samples in each run without a gap.
    rate : float
        Sampling rate, Hz.
    """

    tau: FloatArray
    deviation: FloatArray
    size: IndexArray
    count: IndexArray
    lengths: IndexArray
    rate: float


def allan_deviation(values: npt.ArrayLike, rate: float, *, spacing: Spacing = "octave") -> AllanCurve:
    """Overlapping Allan deviation of values sampled at a constant rate.

    Parameters
    ----------
    values : (N, 3) array
        Angular rate, specific force or field: a signal, not its integral. A row with NaN splits the record: no
        cluster reaches across it, and the squared differences of all runs are averaged.
    rate : float
        Sampling rate, Hz.
    spacing : {"octave", "decade"}
        Samples in a cluster: 1, 2, 4, 8 … or 1, 2, 4, 10, 20, 40, 100 …, up to a quarter of the longest run.

    Returns
    -------
    AllanCurve
        In the unit of `values`.

    Raises
    ------
    InputError
        For wrong shapes, infinite values, or runs of which none has eight samples.

    Examples
    --------
    White noise of the standard deviation 0.2 at 100 Hz has the deviation 0.02/√τ:

    >>> import numpy as np
    >>> noise = np.random.default_rng(0).normal(0.0, 0.2, (100_000, 3))
    >>> curve = allan_deviation(noise, 100.0)
    >>> bool(np.allclose(curve.deviation[:8], 0.02 / np.sqrt(curve.tau[:8, None]), rtol=0.03))
    True
    """
    check_choice("spacing", spacing, ("octave", "decade"))
    array = check_vectors("values", values)
    rate = check_number("rate", rate, above=0.0, unit="Hz")
    starts, stops = run_bounds(sample_rows(array))
    return _curve(array, rate, starts.astype(np.int64), stops.astype(np.int64), spacing)


def sample_rows(values: FloatArray) -> BoolArray:
    """Rows (N,) of an (N, 3) array that are samples, that is, without NaN."""
    there: BoolArray = ~np.isnan(values.sum(axis=1))
    return there


def curve_of_runs(values: FloatArray, rate: float, starts: Any, stops: Any) -> AllanCurve:
    """The curve of runs [start, stop) of an (N, 3) array without NaN in them, at octaves."""
    return _curve(values, rate, np.asarray(starts, np.int64), np.asarray(stops, np.int64), "octave")


def _curve(values: FloatArray, rate: float, starts: IndexArray, stops: IndexArray, spacing: Spacing) -> AllanCurve:
    from northdown.kernels import allan

    lengths = stops - starts
    longest = int(lengths.max()) if len(lengths) else 0
    if longest < 2 * _LONGEST:
        raise InputError(expected(f"a run of {2 * _LONGEST} samples or more without a gap", f"{longest} samples"))
    size = _sizes(longest // _LONGEST, spacing)
    square = np.zeros((3, len(size)))
    count = np.zeros(len(size), np.int64)
    for axis in range(3):
        count[:] = 0
        allan.sums()(np.ascontiguousarray(values[:, axis]), starts, stops, size, square[axis], count)
    variance = square.T / (2.0 * size.astype(np.float64) ** 2 * count)[:, None]
    if not np.isfinite(variance).all():
        raise InputError(expected("values whose squares are finite numbers", "an overflow", do="check their unit"))
    return AllanCurve(size / rate, np.sqrt(variance), size, count, lengths, rate)


def _sizes(most: int, spacing: Spacing) -> IndexArray:
    if spacing == "octave":
        return 2 ** np.arange(int(np.log2(most)) + 1, dtype=np.int64)
    decades = 10 ** np.arange(int(np.log10(most)) + 1, dtype=np.int64)
    sizes: IndexArray = np.outer(decades, np.array([1, 2, 4], dtype=np.int64)).ravel()
    return sizes[sizes <= most]
