"""From samples to what is drawn: breaks at gaps, angles wrapped without strokes, and as few points as can be seen."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray

# A figure of A4 width has about so many pixels at 200 dpi.
COLUMNS = 1500
# Between neighbouring samples no body turns by such a part of a turn; it is a jump of the angle itself.
_JUMP = 0.25

IntArray = npt.NDArray[np.intp]


def trace(
    time: FloatArray,
    value: FloatArray,
    *,
    gap: float,
    period: float | None = None,
    columns: int = COLUMNS,
) -> tuple[FloatArray, FloatArray]:
    """Points of a line through samples, with NaN where it is to be broken.

    Parameters
    ----------
    time, value : (N,) arrays
        Samples; NaN in `value` is no sample.
    gap : float
        The line is broken where neighbouring samples are further apart (s).
    period : float, optional
        For angles, a full turn: the line leaves at one edge, comes back at the other, and is broken in between.
    columns : int
        Width of the drawing. Of each column the first, smallest, largest and last sample are kept: no peak is lost.

    Returns
    -------
    time, value : (M,) arrays
    """
    there = np.isfinite(value)
    t, v = time[there], value[there]
    if not len(t):
        return t, v
    broken = np.diff(t) > gap
    if period is not None:
        v = np.unwrap(v, period=period)
        broken |= np.abs(np.diff(v)) > _JUMP * period
    segment: IntArray = np.concatenate([[0], np.cumsum(broken)])
    keep = _thin(t, v, segment, columns)
    t, v, segment = t[keep], v[keep], segment[keep]
    if period is not None:
        return _wrap(t, v, segment, period)
    where = np.flatnonzero(np.diff(segment)) + 1
    return np.insert(t, where, t[where]), np.insert(v, where, np.nan)


def _thin(t: FloatArray, v: FloatArray, segment: IntArray, columns: int) -> IntArray:
    """Indices of the samples that can be seen: first, smallest, largest and last of each column and segment."""
    n = len(t)
    if n <= 4 * columns:
        return np.arange(n)
    group = segment * columns + column_of(t, columns)
    start = np.flatnonzero(np.diff(group, prepend=group[0] - 1))
    last = np.append(start[1:], n) - 1
    order = np.lexsort((v, group))
    return np.unique(np.concatenate([start, last, order[start], order[last]]))


def column_of(t: FloatArray, columns: int) -> IntArray:
    """Column of each time, the whole span being `columns` wide."""
    span = float(t[-1] - t[0])
    share = (t - t[0]) / span if span > 0.0 else np.zeros(len(t))
    return np.minimum((share * columns).astype(np.intp), columns - 1)


def _wrap(t: FloatArray, v: FloatArray, segment: IntArray, period: float) -> tuple[FloatArray, FloatArray]:
    """Bring continuous angles to ±period/2; at each crossing of the edge the line ends there and starts opposite."""
    half = 0.5 * period
    turn = np.floor((v + half) / period)
    same = np.diff(segment) == 0
    change = np.where(same, np.diff(turn), 0.0)
    # Each crossing adds three points: the edge, nothing, and the opposite edge.
    crossings = np.abs(change).astype(np.intp)
    number = np.arange(crossings.sum()) - np.repeat(np.cumsum(crossings) - crossings, crossings)
    left: IntArray = np.repeat(np.arange(len(crossings)), crossings)
    sign = np.sign(change[left])
    edge = (turn[left] + np.where(sign > 0.0, number + 1.0, -number)) * period - half
    step = v[left + 1] - v[left]
    when = t[left] + (t[left + 1] - t[left]) * (edge - v[left]) / step
    extra_t = np.repeat(when, 3)
    extra_v = np.column_stack([sign * half, np.full(len(sign), np.nan), -sign * half]).ravel()
    gaps = np.flatnonzero(~same)
    where = np.concatenate([np.repeat(left, 3), gaps]) + 1
    times = np.concatenate([extra_t, t[gaps + 1]])
    values = np.concatenate([extra_v, np.full(len(gaps), np.nan)])
    return np.insert(t, where, times), np.insert(v - turn * period, where, values)


def isolated(value: FloatArray) -> npt.NDArray[np.bool_]:
    """Points with a break (or nothing) on both sides, which a line would not show."""
    there = np.isfinite(np.concatenate([[np.nan], value, [np.nan]]))
    result: npt.NDArray[np.bool_] = there[1:-1] & ~there[:-2] & ~there[2:]
    return result


def band(
    time: FloatArray,
    low: FloatArray,
    high: FloatArray,
    *,
    gap: float,
    period: float | None = None,
    columns: int = COLUMNS,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Edges of a filled band, with NaN where it is broken.

    Of an angle with a period, the parts that reach beyond ±period/2 come back at the opposite edge.
    """
    there = np.isfinite(low) & np.isfinite(high)
    t, low, high = time[there], low[there], high[there]
    if not len(t):
        return t, low, high
    segment: IntArray = np.concatenate([[0], np.cumsum(np.diff(t) > gap)])
    if period is not None:
        middle = 0.5 * (low + high)
        shift = np.unwrap(middle, period=period) - middle
        low, high = low + shift, high + shift
        segment[1:] += np.cumsum(np.abs(np.diff(middle + shift)) > _JUMP * period)
    if len(t) > 2 * columns:
        group = segment * columns + column_of(t, columns)
        start = np.flatnonzero(np.diff(group, prepend=group[0] - 1))
        low, high = np.minimum.reduceat(low, start), np.maximum.reduceat(high, start)
        t, segment = t[start], segment[start]
    where = np.flatnonzero(np.diff(segment)) + 1
    t, low, high = np.insert(t, where, t[where]), np.insert(low, where, np.nan), np.insert(high, where, np.nan)
    if period is None:
        return t, low, high
    return _fold(t, low, high, period)


def _fold(
    t: FloatArray, low: FloatArray, high: FloatArray, period: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """One copy of the band for each turn it touches, cut to ±period/2."""
    half = 0.5 * period
    # A full turn already says 'anything'; more would be drawn over itself.
    middle, width = 0.5 * (low + high), np.minimum(0.5 * (high - low), half)
    low, high = middle - width, middle + width
    first, last = np.nanmin(np.floor((low + half) / period)), np.nanmax(np.floor((high + half) / period))
    pieces: list[Any] = []
    for turn in np.arange(first, last + 1.0):
        a, b = np.clip(low - turn * period, -half, half), np.clip(high - turn * period, -half, half)
        touched = b > a
        near = touched | np.append(touched[1:], False) | np.insert(touched[:-1], 0, False)
        if not touched.any():
            continue
        a, b = np.where(near, a, np.nan), np.where(near, b, np.nan)
        keep = near | np.append(near[1:], False)
        pieces += [np.array([t[keep], a[keep], b[keep]]), np.array([[t[0]], [np.nan], [np.nan]])]
    if not pieces:
        return t[:0], low[:0], high[:0]
    folded: FloatArray = np.concatenate(pieces, axis=1)
    return folded[0], folded[1], folded[2]


def spans(time: FloatArray, mask: npt.NDArray[np.bool_]) -> list[tuple[float, float]]:
    """(start, width) of the stretches where a mask is true; each reaches to the next sample."""
    if not len(time):
        return []
    edge = np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8))
    start, stop = np.flatnonzero(edge == 1), np.flatnonzero(edge == -1)
    end = time[np.minimum(stop, len(time) - 1)]
    return [(float(a), float(b - a)) for a, b in zip(time[start], end, strict=True)]
