"""Figure of a walked path: from above, its height, and the velocity over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from northdown.errors import InputError, expected
from northdown.evaluation.matching import longest_gap
from northdown.navigation.trajectory import AXES, Trajectory
from northdown.plots._canvas import (
    REST,
    STYLES,
    Clock,
    check_count,
    draw,
    draw_band,
    empty_figure,
    finish,
    label,
    line_handle,
    names_of,
    patch_handle,
    prepare,
    shade,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MARKS: Final[dict[str, Any]] = {"linestyle": "none", "marker": "o", "markersize": 3.0, "markerfacecolor": "white"}
# Points of a path that can be told apart in print.
_POINTS: Final = 6000
# A narrower plan is drawn with this much of its length around it.
_NARROW: Final = 0.18


def path(trajectories: Trajectory | Sequence[Trajectory]) -> Figure:
    """Draw the path of one or several trajectories.

    Parameters
    ----------
    trajectories : Trajectory or sequence of Trajectory
        At most six, in the same frame.

    Returns
    -------
    matplotlib.figure.Figure
        From above: both axes to the same scale, a circle in the middle of each stillness, and the ellipse of three
        sigma at the end. Below, over time: height with its band of three sigma, and the size of the velocity, the
        first trajectory's stillness in grey.

    Raises
    ------
    InputError
        When there is nothing to draw, too much to be told apart, or frames differ.
    MissingDependencyError
        Without matplotlib.
    """
    found = [trajectories] if isinstance(trajectories, Trajectory) else list(trajectories)
    wrong = [type(t).__name__ for t in found if not isinstance(t, Trajectory)]
    if wrong:
        raise InputError(expected("trajectories to draw", wrong[0]))
    check_count("trajectories", len(found))
    if any(not len(t) for t in found):
        raise InputError(expected("trajectories with samples", "none"))
    if len({t.frame for t in found}) > 1:
        frames = ", ".join(sorted({t.frame for t in found}))
        raise InputError(expected("trajectories in one frame", frames, do="convert them with to_frame()"))
    figure = empty_figure(20.0)
    plan, height, speed = figure.subplots(3, 1, height_ratios=[2.4, 1.0, 1.0])
    speed.sharex(height)
    height.tick_params(labelbottom=False)
    for ax in (plan, height, speed):
        prepare(ax)
    clock = Clock(min(t.time[0] for t in found), max(t.time[-1] for t in found))
    handles = []
    for trajectory, name, (color, style) in zip(found, names_of(found), STYLES, strict=False):
        _draw_plan(plan, trajectory, color, style)
        _draw_over_time(height, speed, clock, trajectory, color, style)
        length = trajectory.distance(horizontal=True)
        text = f"{name}: {length:.1f} m, ends {trajectory.closure(horizontal=True):.2f} m from its start"
        handles.append(line_handle(text, color=color, linestyle=style))
    _limit(plan, height, found)
    if any(t.still is not None and t.still.any() for t in found):
        handles.append(line_handle("still", color="0.3", **_MARKS))
    first = found[0]
    if first.still is not None and first.still.any():
        for ax in (height, speed):
            shade(ax, clock, first.time, first.still, **REST)
        handles.append(patch_handle("still, over time", **REST))
    if any(t.position_covariance is not None for t in found):
        handles.append(patch_handle("3σ", facecolor=STYLES[0][0], alpha=0.22))
    label(height, "height (m)")
    label(speed, "speed\n(m/s)")
    speed.set_ylim(bottom=0.0)
    finish(figure, [height, speed], clock, f"path in {first.frame}", handles)
    return figure


def _order(trajectory: Trajectory) -> tuple[int, int]:
    """Which components point right and up in the plan: a map, north up, east to the right."""
    return {"NED": (1, 0), "ENU": (0, 1), "NWU": (1, 0)}[trajectory.frame]


def _draw_plan(ax: Axes, trajectory: Trajectory, color: str, style: object) -> None:
    right, up = _order(trajectory)
    p = trajectory.position
    shown = np.unique(np.linspace(0, len(p) - 1, min(len(p), _POINTS)).astype(int))
    ax.plot(p[shown, right], p[shown, up], color=color, linestyle=style, linewidth=1.0)
    if trajectory.still is not None:
        edges = np.diff(np.concatenate([[False], trajectory.still, [False]]).astype(np.int8))
        middle = (np.flatnonzero(edges == 1) + np.flatnonzero(edges == -1)) // 2
        if len(middle):
            ax.plot(p[middle, right], p[middle, up], color=color, **_MARKS)
    ax.plot(*p[0, [right, up]], color=color, marker="s", markersize=5.0)
    ax.plot(*p[-1, [right, up]], color=color, marker="x", markersize=6.0, markeredgewidth=1.8)
    if trajectory.position_covariance is not None:
        cov = trajectory.position_covariance[-1][np.ix_([right, up], [right, up])]
        size, axes = np.linalg.eigh(cov)
        turn = np.linspace(0.0, 2.0 * np.pi, 100)
        circle = np.sqrt(np.maximum(size, 0.0)) * np.column_stack([np.cos(turn), np.sin(turn)])
        ellipse = p[-1, [right, up]] + 3.0 * circle @ axes.T
        ax.fill(ellipse[:, 0], ellipse[:, 1], color=color, alpha=0.22, linewidth=0.0)
    names = AXES[trajectory.frame]
    ax.set_xlabel(f"{names[right]} (m)   (square: start, cross: end)", fontsize=9.0)
    label(ax, f"{names[up]} (m)")


def _limit(plan: Axes, height: Axes, found: Sequence[Trajectory]) -> None:
    """The same scale on both axes; all of every path, with some room around a straight one."""
    right, up = _order(found[0])
    places = np.concatenate([t.position[:, [right, up]] for t in found])
    low, high = places.min(axis=0), places.max(axis=0)
    span = max(float((high - low).max()), 0.1)
    for t in found:
        if t.position_sigma is not None:
            # the ellipse at the end, as far as it does not make the path small
            end, width = t.position[-1, [right, up]], np.minimum(3.1 * t.position_sigma[-1, [right, up]], 0.4 * span)
            low, high = np.minimum(low, end - width), np.maximum(high, end + width)
    middle, half = 0.5 * (low + high), np.maximum(0.5 * (high - low), _NARROW * span) + 0.05 * span
    plan.set_aspect("equal", adjustable="box")
    plan.set_xlim(middle[0] - half[0], middle[0] + half[0])
    plan.set_ylim(middle[1] - half[1], middle[1] + half[1])
    if found[0].frame == "NWU":
        plan.invert_xaxis()
    heights = np.concatenate([t.height for t in found])
    extent = max(float(heights.max() - heights.min()), 0.1)
    sigma = [t.position_sigma[:, 2].max() for t in found if t.position_sigma is not None]
    band = min(3.0 * float(max(sigma, default=0.0)), 3.0 * extent)
    height.set_ylim(heights.min() - max(band, 0.05 * extent), heights.max() + max(band, 0.05 * extent))


def _draw_over_time(
    height: Axes, speed: Axes, clock: Clock, trajectory: Trajectory, color: str, style: object
) -> None:
    gap = longest_gap(trajectory.time)
    time = trajectory.time
    if trajectory.position_sigma is not None:
        width = 3.0 * trajectory.position_sigma[:, 2]
        draw_band(height, clock, time, trajectory.height - width, trajectory.height + width, gap=gap, color=color)
    draw(height, clock, time, trajectory.height, gap=gap, color=color, linestyle=style)
    size = np.linalg.norm(trajectory.velocity, axis=1)
    draw(speed, clock, time, size, gap=gap, color=color, linestyle=style)
