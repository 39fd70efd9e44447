"""Figure of attitude errors: total, heading and inclination over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from northdown._validation import FloatArray
from northdown.errors import InputError, expected
from northdown.evaluation import AttitudeError
from northdown.evaluation.matching import longest_gap
from northdown.plots._canvas import (
    STYLES,
    Clock,
    check_count,
    draw,
    draw_band,
    finish,
    label,
    line_handle,
    names_of,
    new_figure,
    usual,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LABELS = ("total\nerror (°)", "heading\nerror (°)", "inclination\nerror (°)")
_HEADING = 1  # the panel whose errors have a sign


def errors(errors: AttitudeError | Sequence[AttitudeError]) -> Figure:
    """Draw the total, signed heading and inclination error of one or several estimates over time.

    Parameters
    ----------
    errors : AttitudeError or sequence of AttitudeError
        Errors to compare, at most six, from `attitude_error`.

    Returns
    -------
    matplotlib.figure.Figure
        Three panels in degrees; the root mean square of the total error stands in the legend, and in the title
        whether clocks were aligned.

    Raises
    ------
    InputError
        When there is nothing to draw, or too much to be told apart.
    MissingDependencyError
        Without matplotlib.
    """
    found = [errors] if isinstance(errors, AttitudeError) else list(errors)
    wrong = [type(e).__name__ for e in found if not isinstance(e, AttitudeError)]
    if wrong:
        raise InputError(expected("errors from attitude_error()", wrong[0]))
    check_count("errors", len(found))
    figure, axes = new_figure([1.0, 1.0, 1.0])
    clock = Clock(min(e.time[0] for e in found), max(e.time[-1] for e in found))
    handles = []
    for error, name, (color, style) in zip(found, names_of(found), STYLES, strict=False):
        draw_errors(axes, clock, error, color, style)
        handles.append(line_handle(f"{name}: RMSE {error.rmse().total_deg:.2f}°", color=color, linestyle=style))
    limit_errors(axes, found, np.zeros(3))
    aligned = ", clocks aligned" if any(e.clock is not None for e in found) else ""
    finish(figure, axes, clock, f"attitude error in {found[0].frame}{aligned}", handles)
    return figure


def draw_errors(
    axes: Sequence[Axes],
    clock: Clock,
    error: AttitudeError,
    color: str,
    style: object,
    covariance: FloatArray | None = None,
) -> FloatArray:
    """Draw an error in three panels, over a band of three sigma where a covariance (M, 3, 3) is given.

    The band is three times the root mean square that the covariance P of the error vector predicts: √trace P in
    total, √P_zz in heading, √(P_xx + P_yy) in inclination.

    Returns
    -------
    (3,) array
        Usual width of the band in each panel, degrees; zero without a covariance.
    """
    gap = longest_gap(error.time)
    widths = np.zeros(3)
    if covariance is not None:
        xx, yy, zz = (covariance[:, i, i] for i in range(3))
        for i, variance in enumerate((xx + yy + zz, zz, xx + yy)):
            width = np.minimum(np.rad2deg(3.0 * np.sqrt(np.maximum(variance, 0.0))), 180.0)
            low = -width if i == _HEADING else np.zeros_like(width)
            draw_band(axes[i], clock, error.time, low, width, gap=gap, color=color)
            widths[i] = usual(width)
    for i, value in enumerate((error.total, error.heading_signed, error.inclination)):
        period = 360.0 if i == _HEADING else None
        draw(axes[i], clock, error.time, np.rad2deg(value), gap=gap, period=period, color=color, linestyle=style)
        label(axes[i], _LABELS[i])
    return widths


def limit_errors(axes: Sequence[Axes], found: Sequence[AttitudeError], widths: FloatArray) -> None:
    """Limits that show zero, every error, and the usual band as far as it is not much wider than these."""
    for i, (ax, key) in enumerate(zip(axes, ("total", "heading_signed", "inclination"), strict=True)):
        values = np.rad2deg(np.concatenate([getattr(e, key) for e in found]))
        size = max(float(np.abs(values).max()), 1e-6)
        band = min(1.1 * float(widths[i]), 4.0 * size)
        low, high = min(float(values.min()), -band), max(float(values.max()), band)
        margin = 0.06 * (high - min(low, 0.0))
        if i == _HEADING:
            ax.set_ylim(max(min(low, 0.0) - margin, -185.0), min(max(high, 0.0) + margin, 185.0))
        else:
            ax.set_ylim(0.0, min(max(high, size) + margin, 185.0))
