"""Figure of an analysis of observability: singular values, those that count as zero, and the rank."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from northdown._validation import FloatArray
from northdown.errors import InputError, expected
from northdown.evaluation.observability_result import Observability
from northdown.plots._canvas import (
    MISSING,
    STYLES,
    Clock,
    draw,
    finish,
    label,
    line_handle,
    new_figure,
    patch_handle,
    shade,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_FLOOR: Final = 1e-17
"""Where smaller singular values are drawn, relative to the largest: rounding alone makes them differ there."""
_ZERO: Final[dict[str, Any]] = {"facecolor": "0.92", "edgecolor": "none"}
_MANY: Final[dict[str, Any]] = {"color": "0.6", "linestyle": "-"}
_SUBSCRIPTS: Final = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")


def observability(result: Observability) -> Figure:
    """Draw the singular values over time, and below them the rank.

    Parameters
    ----------
    result : Observability
        From `northdown.evaluation.observability`.

    Returns
    -------
    matplotlib.figure.Figure
        Singular values on a logarithmic axis; what counts as zero lies in the grey area, and exact zeros on the lower
        edge. In the title what is unobservable.

    Raises
    ------
    InputError
        When `result` is something else, or was defined nowhere.
    MissingDependencyError
        Without matplotlib.
    """
    if not isinstance(result, Observability):
        raise InputError(expected("the result of observability()", type(result).__name__))
    if not result.defined.any():
        raise InputError(expected("an analysis that is defined at some time", "one that is nowhere"))
    figure, axes = new_figure([2.2, 0.8])
    clock = Clock(result.time[0], result.time[-1])
    gap = 1.5 * float(np.diff(result.time).max(initial=0.0))  # so that lines break where nothing is defined
    handles = _draw_values(axes[0], clock, result, gap)
    label(axes[0], "singular values")
    _draw_rank(axes[1], clock, result, gap)
    handles.append(patch_handle("counts as zero", **_ZERO))
    if not result.defined.all():
        for ax in axes:
            shade(ax, clock, result.time, ~result.defined, **MISSING)
        handles.append(patch_handle("undefined", **MISSING))
    finish(figure, axes, clock, _title(result), handles)
    return figure


def _title(result: Observability) -> str:
    model = result.model
    written = {"quaternion+norm": "quaternion with norm", "euler": "Euler angles", "tangent": "rotation vector"}
    state = ", ".join([written.get(model.state, model.state), *(u.replace("_", " ") for u in model.unknown)])
    first = f"{model.method}: {', '.join(n for n in model.measurement_names if n != 'norm')}; {state}"
    findings = [f.text + ("" if f.share == 1.0 else " at times") for f in result.findings]
    return f"{first}\nunobservable: {'; '.join(findings) or 'nothing'}"


def _draw_values(ax: Axes, clock: Clock, result: Observability, gap: float) -> list[Any]:
    values = result.singular_values
    top = float(np.nanmax(values))
    floor = _FLOOR * max(top, 1.0)
    shown: FloatArray = np.maximum(values, floor)
    few = result.states - len(STYLES)
    handles: list[Any] = []
    for k in range(result.states):
        # with more lines than there are styles, the largest, which matter least, are alike
        color, style = STYLES[k - max(few, 0)] if k >= few else (_MANY["color"], _MANY["linestyle"])
        draw(ax, clock, result.time, shown[:, k], gap=gap, color=color, linestyle=style)
        name = f"σ{k + 1}".translate(_SUBSCRIPTS)
        if k >= few or k == 0:
            text = f"σ₁ to σ{few}".translate(_SUBSCRIPTS) if few > 1 and k == 0 else name
            handles.append(line_handle(text, color=color, linestyle=style))
    limit = np.maximum(result.limit, floor)
    ax.fill_between(
        clock(result.time),
        np.full(len(result), 0.1 * floor),
        limit,
        linewidth=0.0,
        zorder=0.5,
        color=_ZERO["facecolor"],
    )
    ax.set_yscale("log")
    lowest = float(np.nanmin(shown))
    ax.set_ylim(0.5 * min(lowest, float(np.nanmin(limit))), 3.0 * max(top, 1.0))
    return handles


def _draw_rank(ax: Axes, clock: Clock, result: Observability, gap: float) -> None:
    rank: FloatArray = np.where(result.defined, result.rank, np.nan).astype(np.float64)
    draw(ax, clock, result.time, rank, gap=gap, color="black", drawstyle="steps-mid")
    low = float(np.nanmin(rank))
    ax.set_ylim(low - 0.8, result.states + 0.5)
    ax.set_yticks(np.arange(low, result.states + 1))
    label(ax, f"rank\n(of {result.states})")
