"""K06's figures made again: 3.4 to 3.11, 4.2 to 4.58 (block diagrams left out), 4.60."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from northdown.errors import InputError, expected
from northdown.evaluation.kao2006 import published
from northdown.evaluation.kao2006.comparison import Comparison
from northdown.evaluation.kao2006.figures import FIGURES, Panel, Run, ThesisFigure, panels, simulate_run
from northdown.evaluation.kao2006.results import Results
from northdown.plots._canvas import REFERENCE, STYLES, Clock, draw, finish, label, line_handle, new_figure
from northdown.plots._observability import observability
from northdown.simulation.seeds import generator

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MEASURED: Final[dict[str, Any]] = {"color": "0.62", "linestyle": "none", "marker": ".", "markersize": 2.0}
_FILTERS: Final[dict[str, dict[str, Any]]] = {
    "EKF": {"color": STYLES[0][0], "linestyle": "-", "linewidth": 1.4},
    "IKF": {"color": STYLES[1][0], "linestyle": (0, (4, 2)), "linewidth": 1.1},
}
_TRUTH: Final[dict[str, Any]] = {**REFERENCE, "linewidth": 1.0}
# Only of signals that are nothing but measured.
_SIGNAL: Final[dict[str, Any]] = {"color": STYLES[0][0], "linestyle": "-", "linewidth": 0.6}
_DEGREES: Final = (0.03, 0.1, 0.3, 1.0)
# Before that, errors and sigma are those of the start.
_SETTLING: Final = 0.1


class Made(NamedTuple):
    """A figure with K06's number and what it shows."""

    number: str
    title: str
    figure: Figure


def kao2006(results: Results) -> Iterator[Made]:
    """Draw K06's figures, one after the other.

    Parameters
    ----------
    results : Results
        From `northdown.evaluation.kao2006.reproduce`.

    Yields
    ------
    Made
        Number, title and figure: 3.4 to 3.11, 4.2 to 4.58 without the block diagrams, and 4.60. The runs that they
        show are simulated as they come, with the seed of the results.
    """
    if not isinstance(results, Results):
        raise InputError(expected("the results of kao2006.reproduce()", type(results).__name__))
    for one in results.configurations:
        c = one.configuration
        title = f"K06 figure {c.figure}: {c.method}, {c.sensors}, {c.state}: singular values"
        yield Made(c.figure, title, observability(one.found))
    shown: tuple[str, str] | None = None
    for k, described in enumerate(FIGURES):
        if shown != (described.motion, described.method):
            shown = (described.motion, described.method)
            run = simulate_run(described.motion, described.method, generator(results.seed, 4, k))
        yield Made(described.number, described.title, _draw(described, run))
    title = "K06 figure 4.60: error with a gyroscope by its noise, and without one"
    yield Made("4.60", title, _draw_comparison(results.comparison, title))


def _draw(described: ThesisFigure, run: Run) -> Figure:
    found = panels(described, run)
    time = run.signals.time
    figure, axes = new_figure([0.75] * len(found))
    clock = Clock(float(time[0]), float(time[-1]))
    wraps = described.shown == "Euler angles"
    for ax, panel in zip(axes, found, strict=True):
        for name, values in panel.curves.items():
            style = _style(name, panel)
            if style["linestyle"] == "none":
                ax.plot(time, values, **style, zorder=1)
            else:
                draw(ax, clock, time, values, gap=0.1, period=360.0 if wraps else None, **style)
        _limit(ax, described, panel, time > _SETTLING)
        label(ax, panel.label)
    handles = [line_handle(name, **_style(name, found[0])) for name in found[0].curves]
    finish(figure, axes, clock, described.title, handles)
    return figure


def _style(name: str, panel: Panel) -> dict[str, Any]:
    if name == "truth":
        return _TRUTH
    if name == "measured":
        return _SIGNAL if len(panel.curves) == 1 else _MEASURED
    return _FILTERS[name]


def _limit(ax: Axes, described: ThesisFigure, panel: Panel, settled: Any) -> None:
    """Range of values after the start, so that the start does not flatten what follows."""
    if not described.shown.endswith(("sigma", "error")):
        return
    values = np.concatenate([v[settled] for v in panel.curves.values()])
    top = float(np.max(np.abs(values[np.isfinite(values)]), initial=1e-9))
    ax.set_ylim(*((0.0, 2.0 * top) if described.shown.endswith("sigma") else (-1.15 * top, 1.15 * top)))


def _draw_comparison(found: Comparison, title: str) -> Figure:
    figure, axes = new_figure([1.2, 1.2, 1.2])
    noise = np.array(list(published.GYRO_BASED))
    free = (
        found.second.gyro_free["direct"],
        found.half.gyro_free["indirect, radius ×2"],
        np.array(published.GYRO_FREE),
    )
    rows = (found.second.gyro_based, found.half.gyro_based, published.GYRO_BASED)
    names = ("ours, last second", "ours, last half second", "K06")
    free_names = ("direct", "indirect, radius ×2", "K06")
    handles = []
    for style, row, level, name, free_name in zip(STYLES[:3], rows, free, names, free_names, strict=True):
        values = np.array(list(row.values()))
        line: dict[str, Any] = {"color": style[0], "linestyle": style[1], "marker": "o", "markersize": 3.0}
        dots: dict[str, Any] = {"color": style[0], "linestyle": (0, (1, 1)), "linewidth": 0.9}
        for k, ax in enumerate(axes):
            ax.loglog(noise, values[:, k], **line)
            ax.axhline(float(level[k]), **dots)
        handles += [line_handle(name, **line), line_handle(f"without: {free_name}", **dots)]
    for ax, name in zip(axes, ("roll", "pitch", "yaw"), strict=True):
        ax.set_yticks(_DEGREES, [f"{d:g}" for d in _DEGREES])
        ax.minorticks_off()
        label(ax, f"{name} (°)")
    clock = Clock(float(noise[0]), float(noise[-1]))
    clock.label = "noise of the gyroscope (rad/s)"
    clock.limits = (0.8 * float(noise[0]), 1.25 * float(noise[-1]))
    finish(figure, axes, clock, title, handles)
    return figure
