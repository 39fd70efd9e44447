"""Figure of an array of accelerometers: where they sit and along which lines they sense."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from northdown._validation import FloatArray
from northdown.arrays import AccelerometerArray
from northdown.errors import InputError, expected
from northdown.plots._canvas import STYLES, line_handle, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SMALL, _NORMAL, _TITLE = 8.0, 9.0, 10.0
_IN, _OUT = STYLES[0][0], STYLES[3][0]
# Axis to the right, axis up, and the axis towards the viewer with its sign.
_VIEWS: Final = ((0, 1, 2, 1.0), (0, 2, 1, -1.0), (1, 2, 0, 1.0))
# Length of an arrow and half the width, relative to the array: of one picture, and of three smaller ones.
_ARROW: Final = (0.2, 0.4)
_REACH: Final = (1.35, 1.9)
# Neighbours within this distance, relative to the array, keep a label away.
_NEAR: Final = 0.4
# Part of a unit direction below which it is not drawn as seen, or as pointing at the viewer.
_LEAST: Final = 0.1


def array(array: AccelerometerArray) -> Figure:
    """Draw the places and sensing directions of an array's accelerometers.

    Parameters
    ----------
    array : AccelerometerArray
        A flat one in the plane of x and y is shown from above, any other from three sides.

    Returns
    -------
    matplotlib.figure.Figure
        Arrows: the part of a sensing direction that lies in the picture, to scale; a ring with a dot: the direction
        points towards the viewer, with a cross: away.

    Raises
    ------
    InputError
        For anything but an array.
    MissingDependencyError
        Without matplotlib.
    """
    if not isinstance(array, AccelerometerArray):
        raise InputError(expected("an AccelerometerArray", type(array).__name__))
    extent = float(np.abs(array.position).max()) or 1.0
    flat = float(np.ptp(array.position[:, 2])) < 1e-3 * extent
    views = _VIEWS[:1] if flat else _VIEWS
    figure, _ = new_figure([1.0], 11.5 if flat else 8.2)
    figure.clear()
    grid = figure.add_gridspec(1, len(views))
    for k, view in enumerate(views):
        _draw(figure.add_subplot(grid[0, k]), array, view, 1e3 * extent, int(not flat))
    handles = [
        line_handle("senses in the picture", color=_IN, marker=(3, 0, -90), linestyle="-"),
        line_handle(
            "towards the viewer", color=_OUT, marker="$\\odot$", markersize=9.0, markeredgewidth=0.2, linestyle="none"
        ),
        line_handle("away", color=_OUT, marker="$\\otimes$", markersize=9.0, markeredgewidth=0.2, linestyle="none"),
    ]
    figure.legend(
        handles=handles,
        loc="outside upper center",
        ncols=3,
        fontsize=_SMALL,
        frameon=False,
        title=array.name or "array of accelerometers",
        title_fontsize=_TITLE,
    )
    return figure


def _draw(ax: Axes, array: AccelerometerArray, view: tuple[int, int, int, float], extent: float, small: int) -> None:
    right, up, towards, sign = view
    seen = 1e3 * array.position[:, [right, up]]
    line = array.direction[:, [right, up]]
    depth = sign * array.direction[:, towards]
    reach, arrow = _REACH[small] * extent, _ARROW[small] * extent
    ax.set_xlim(-reach, reach)
    ax.set_ylim(-reach, reach)
    ax.set_aspect("equal")
    ax.axhline(0.0, color="0.8", linewidth=0.6, zorder=0)
    ax.axvline(0.0, color="0.8", linewidth=0.6, zorder=0)
    places = _places(seen, array.names, extent)
    for place, (names, members) in places.items():
        ax.plot(*place, color="black", marker="o", markersize=2.5, linestyle="none", zorder=3)
        for k in members:
            if np.hypot(*line[k]) > _LEAST:
                arrow_style: dict[str, Any] = {
                    "arrowstyle": "-|>",
                    "color": _IN,
                    "linewidth": 1.2,
                    "shrinkA": 0,
                    "shrinkB": 0,
                }
                tip = np.array(place) + arrow * line[k]
                ax.annotate("", tip, place, arrowprops=arrow_style)
            if abs(depth[k]) > _LEAST:
                _end_on(ax, place, depth[k] > 0.0)
        apart = np.array([p for p in places if p != place]).reshape(-1, 2) - place
        distance = np.hypot(apart[:, 0], apart[:, 1])
        near = distance < _NEAR * extent
        drawn = [k for k in members if np.hypot(*line[k]) > _LEAST]
        around = np.vstack([line[drawn], apart[near] / distance[near, None]])
        offset = _label_offset(around)
        side = {-1: "right", 0: "center", 1: "left"}[round(offset[0] / 9.0)]
        level = {-1: "top", 0: "center", 1: "bottom"}[round(offset[1] / 9.0)]
        ax.annotate(
            _label(names),
            place,
            offset,
            textcoords="offset points",
            fontsize=_SMALL,
            ha=side,
            va=level,
            linespacing=0.95,
        )
    ax.set_xlabel(f"{'xyz'[right]} (mm)", fontsize=_NORMAL)
    ax.set_ylabel(f"{'xyz'[up]} (mm)", fontsize=_NORMAL)
    ax.tick_params(labelsize=_SMALL, length=3)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)


def _end_on(ax: Axes, place: tuple[float, float], towards: bool) -> None:
    style: dict[str, Any] = {"linestyle": "none", "color": _OUT, "zorder": 4}
    ax.plot(*place, marker="o", markersize=9.0, markerfacecolor="none", markeredgewidth=1.2, **style)
    if towards:
        ax.plot(*place, marker="o", markersize=3.5, **style)
    else:
        ax.plot(*place, marker="x", markersize=6.0, markeredgewidth=1.2, **style)


def _places(seen: FloatArray, names: Any, extent: float) -> dict[tuple[float, float], tuple[list[str], list[int]]]:
    """Accelerometers by their place in the picture, as some lie behind each other."""
    found: dict[tuple[float, float], tuple[list[str], list[int]]] = {}
    for k, name in enumerate(names):
        place = next((p for p in found if np.hypot(*(seen[k] - p)) < 1e-3 * extent), None)
        if place is None:
            place = (float(seen[k, 0]), float(seen[k, 1]))
            found[place] = ([], [])
        found[place][0].append(name)
        found[place][1].append(k)
    return found


def _label(names: list[str]) -> str:
    """Names at one place, a line each; those of several axes in short, as ``t1xyz``."""
    groups: dict[str, list[str]] = {}
    for name in names:
        cut = len(name) - (name[-1] in "xyz" and len(name) > 1)
        groups.setdefault(name[:cut], []).append(name[cut:])
    return "\n".join(start + "".join(ends) for start, ends in groups.items())


def _label_offset(lines: FloatArray) -> tuple[float, float]:
    """Where, in points, a label is farthest in angle from lines (M, 2), the arrows and neighbours of its place."""
    angles = np.deg2rad(np.arange(-90.0, 270.0, 45.0))
    candidates = np.column_stack([np.cos(angles), np.sin(angles)])
    nearest = (candidates @ lines.T).max(axis=1, initial=-1.0)
    best = candidates[int(np.argmin(np.round(nearest, 3)))]
    return 9.0 * float(best[0]), 9.0 * float(best[1])
