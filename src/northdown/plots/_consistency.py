"""Figure of a covariance's test: errors within their bands, and the normalised error squared within its bounds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from northdown._validation import FloatArray
from northdown.errors import InputError, expected
from northdown.evaluation.chi_square import chi2_bounds
from northdown.evaluation.consistency import AXIS_NAMES, DEGREES_OF_FREEDOM, NormalizedError
from northdown.evaluation.consistency_runs import ConsistencyResult
from northdown.evaluation.matching import longest_gap
from northdown.plots._canvas import (
    STYLES,
    Clock,
    draw,
    draw_band,
    finish,
    label,
    line_handle,
    new_figure,
    patch_handle,
    usual,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOR: Final = STYLES[0][0]
_MEAN: Final[dict[str, Any]] = {"color": "black", "linewidth": 0.8, "linestyle": (0, (5, 2))}
_CONFIDENCE: Final = 0.95


def consistency(result: NormalizedError | ConsistencyResult) -> Figure:
    """Draw the components of the attitude error with their bands of ±3σ, and the normalised error squared (NEES).

    Parameters
    ----------
    result : NormalizedError or ConsistencyResult
        From `nees`, or from `monte_carlo`: then the errors are those of the first run, and the NEES is the mean of
        all runs.

    Returns
    -------
    matplotlib.figure.Figure
        Three panels in degrees, about the axes of the frame, and one of the NEES with the interval of χ², in which
        it lies in 95 % of all cases (or the result's own confidence) when the covariance is right. Of a
        `monte_carlo` also one of the normalised innovation squared (NIS) per degree of freedom, where the filter
        tells it.

    Raises
    ------
    InputError
        When `result` is something else, or holds no samples.
    MissingDependencyError
        Without matplotlib.
    """
    if isinstance(result, ConsistencyResult):
        run, value, bounds, confidence = result.example, result.mean_nees, result.bounds, result.confidence
        title, what = f"{result.name}: first of {result.runs} runs, and the mean of all", "mean NEES"
    elif isinstance(result, NormalizedError):
        run, value, confidence, what = result, result.nees, _CONFIDENCE, "NEES"
        bounds = chi2_bounds(DEGREES_OF_FREEDOM, confidence=confidence)
        title = f"{result.name or 'estimate'}: errors in {result.frame} and what the covariance says"
    else:
        raise InputError(expected("the result of nees() or monte_carlo()", type(result).__name__))
    if not len(run):
        raise InputError(expected("errors to draw", "none"))
    innovations = isinstance(result, ConsistencyResult) and result.mean_nis is not None
    figure, axes = new_figure([1.0, 1.0, 1.0, 1.2] + [1.0] * innovations)
    clock = Clock(run.time[0], run.time[-1])
    for k, ax in enumerate(axes[:3]):
        _draw_component(ax, clock, run, k)
    _draw_square(axes[3], clock, run.time, value, DEGREES_OF_FREEDOM, bounds)
    label(axes[3], what)
    if isinstance(result, ConsistencyResult) and result.mean_nis is not None and result.nis_time_bounds is not None:
        _draw_square(axes[4], clock, run.time, result.mean_nis, 1.0, result.nis_time_bounds)
        label(axes[4], "mean NIS per\nmeasurement")
    handles = [
        line_handle("error", color=_COLOR),
        patch_handle("±3σ", facecolor=_COLOR, alpha=0.22),
        line_handle("expected", **_MEAN),
        patch_handle(f"{100.0 * confidence:g} % of χ²", facecolor="0.85"),
    ]
    finish(figure, axes, clock, title, handles)
    return figure


def _draw_component(ax: Axes, clock: Clock, run: NormalizedError, k: int) -> None:
    gap = longest_gap(run.time)
    error, width = np.rad2deg(run.error[:, k]), np.minimum(np.rad2deg(3.0 * run.sigma[:, k]), 180.0)
    draw_band(ax, clock, run.time, -width, width, gap=gap, color=_COLOR)
    draw(ax, clock, run.time, error, gap=gap, color=_COLOR, linewidth=0.8)
    # the usual band, not that of the start, which can be a hundred times as wide
    size = max(1.4 * usual(width), 1.1 * float(np.percentile(np.abs(error), 99.5)), 1e-9)
    ax.set_ylim(-size, size)
    label(ax, f"error about\n{AXIS_NAMES[run.frame][k]} (°)")


def _draw_square(
    ax: Axes, clock: Clock, time: FloatArray, value: FloatArray, right: float, bounds: tuple[float, float]
) -> None:
    there = ~np.isnan(value)
    time, value = time[there], value[there]
    ax.axhspan(*bounds, facecolor="0.85", edgecolor="none", zorder=0)
    ax.axhline(right, zorder=3, **_MEAN)
    draw(ax, clock, time, value, gap=longest_gap(time), color=_COLOR, linewidth=0.8)
    top = float(np.percentile(value, 99.5))
    if top > 20.0 * bounds[1]:
        # far too confident: both the bounds and the values have to be seen
        ax.set_yscale("log")
        ax.set_ylim(0.5 * bounds[0], 2.0 * float(value.max()))
    else:
        ax.set_ylim(0.0, 1.15 * max(top, bounds[1]))
