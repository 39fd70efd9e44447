"""Figure of quaternion components, with continuous sign."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from northdown._validation import FloatArray
from northdown.evaluation import Truth, attitude_error
from northdown.evaluation.matching import find_reference, longest_gap
from northdown.orientation import Orientation
from northdown.plots._canvas import (
    REFERENCE,
    STYLES,
    Clock,
    check_orientations,
    draw,
    finish,
    label,
    line_handle,
    names_of,
    new_figure,
    reference_handle,
    within,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def quaternion(orientations: Orientation | Sequence[Orientation], reference: Truth | None = None) -> Figure:
    """Draw the four quaternion components over time.

    q and −q are the same orientation: signs are chosen so that each line is continuous and that all lie on the same
    side as the first estimate.

    Parameters
    ----------
    orientations : Orientation or sequence of Orientation
        Estimates, at most six. All are drawn in the frame of the first.
    reference : Orientation or Recording, optional
        The truth, drawn in black dashes; a recording also says how it is to be aligned (with the first estimate).

    Returns
    -------
    matplotlib.figure.Figure
        Four panels: w, x, y, z.

    Raises
    ------
    InputError
        When there is nothing to draw or too much to be told apart, or when the reference does not fit.
    MissingDependencyError
        Without matplotlib.
    """
    found = check_orientations(orientations)
    frame = found[0].frame
    found = [o.to_frame(frame) for o in found]
    truth: Orientation | None = None
    if reference is not None:
        truth = find_reference(reference)
        alignment = attitude_error(found[0], reference).alignment
        truth = (truth if alignment is None else alignment.apply_inverse(truth)).to_frame(frame)
    figure, axes = new_figure([1.0] * 4)
    clock = Clock(min(o.time[0] for o in found), max(o.time[-1] for o in found))
    handles = []
    first = continuous(found[0])
    lines = [(found[0], first)] + [(o, continuous(o, found[0].time, first)) for o in found[1:]]
    for (orientation, quat), name, (color, style) in zip(lines, names_of(found), STYLES, strict=False):
        for i, ax in enumerate(axes):
            gap = longest_gap(orientation.time)
            draw(ax, clock, orientation.time, quat[:, i], gap=gap, color=color, linestyle=style, linewidth=1.5)
        handles.append(line_handle(name, color=color, linestyle=style))
    if truth is not None:
        truth = within(truth, clock)
        quat = continuous(truth, found[0].time, first)
        for i, ax in enumerate(axes):
            draw(ax, clock, truth.time, quat[:, i], gap=longest_gap(truth.time), **REFERENCE)
        handles.append(reference_handle(truth.name))
    for ax, name in zip(axes, "wxyz", strict=True):
        label(ax, f"{name} (–)")
        ax.set_ylim(-1.08, 1.08)
        ax.set_yticks([-1.0, -0.5, 0.0, 0.5, 1.0])
    finish(figure, axes, clock, f"quaternion (w, x, y, z), body → {frame}", handles)
    return figure


def continuous(
    orientation: Orientation, like_time: FloatArray | None = None, like: FloatArray | None = None
) -> FloatArray:
    """Quaternions (N, 4) with signs that do not jump.

    After each gap the sign is free: it is then that of the nearest quaternions `like` (M, 4) at `like_time`, by the
    majority, or w ≥ 0 at the first sample when there is nothing to compare with.
    """
    q, time = orientation.quat, orientation.time
    flips = np.einsum("ni,ni->n", q[1:], q[:-1]) < 0.0
    sign = np.where(np.concatenate([[False], np.cumsum(flips) % 2 == 1]), -1.0, 1.0)
    result: FloatArray = q * sign[:, None]
    if like is None or like_time is None:
        return result if result[0, 0] >= 0.0 else -result
    start = np.concatenate([[0], np.flatnonzero(np.diff(time) > longest_gap(time)) + 1])
    nearest = np.clip(np.searchsorted(like_time, time), 0, len(like_time) - 1)
    same = np.add.reduceat(np.einsum("ni,ni->n", result, like[nearest]), start)
    length = np.diff(np.append(start, len(time)))
    result *= np.repeat(np.where(same < 0.0, -1.0, 1.0), length)[:, None]
    return result
