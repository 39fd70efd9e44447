"""Figure of the Allan deviation: curve, interval, fit and coefficients of each axis."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from northdown._validation import FloatArray
from northdown.calibration._noise_fit import design_matrix
from northdown.calibration.noise_model import AllanResult, NoiseModel
from northdown.errors import InputError, expected
from northdown.plots._canvas import STYLES, label, line_handle, new_figure, patch_handle

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SENSORS: Final = {"gyr": "gyroscope", "acc": "accelerometer", "mag": "magnetometer"}
_SMALL: Final = 8.0
_FIT: Final[dict[str, Any]] = {"color": "black", "linewidth": 0.9, "linestyle": "-"}
_SLOPE: Final[dict[str, Any]] = {"color": "0.45", "linewidth": 0.8, "linestyle": (0, (5, 2))}
_LEFT_OUT: Final[dict[str, Any]] = {"markerfacecolor": "white"}
_POINT: Final[dict[str, Any]] = {"linestyle": "none", "marker": "o", "markersize": 3.5, "markeredgewidth": 0.9}


def allan(result: AllanResult) -> Figure:
    """Draw the Allan deviation of each axis over cluster time, both on logarithmic axes.

    Parameters
    ----------
    result : AllanResult
        From `identify_noise`.

    Returns
    -------
    matplotlib.figure.Figure
        A panel for each axis: estimates with their interval, those left out of the fit hollow, the fitted curve, and
        the slope and value of each coefficient that the record determines.

    Raises
    ------
    InputError
        When `result` is something else.
    MissingDependencyError
        Without matplotlib.
    """
    if not isinstance(result, AllanResult):
        raise InputError(expected("the result of identify_noise()", type(result).__name__))
    figure, axes = new_figure([1.3, 1.3, 1.3])
    unit = result.units("")[0]
    for k, (ax, model) in enumerate(zip(axes, result.axes, strict=True)):
        color = STYLES[k][0]
        _draw_axis(ax, result, model, k, unit.factor, color)
        label(ax, f"{model.axis} ({unit.name})")
    axes[-1].set_xlabel("cluster time τ (s)", fontsize=9.0)
    axes[-1].set_xlim(0.7 * result.curve.tau[0], 1.4 * result.curve.tau[-1])
    figure.align_ylabels(axes)
    percent = f"{100.0 * result.confidence:g} %"
    handles = [
        line_handle("Allan deviation", color=STYLES[0][0], **_POINT),
        patch_handle(f"{percent} interval", facecolor=STYLES[0][0], alpha=0.22),
        line_handle("fit", **_FIT),
        line_handle("parts of the fit", **_SLOPE),
    ]
    if any(model.shortest > result.curve.tau[0] for model in result.axes):
        handles.insert(1, line_handle("not in the fit", color=STYLES[0][0], **_POINT, **_LEFT_OUT))
    lasted = result.stop - result.start
    figure.legend(
        handles=handles,
        loc="outside upper center",
        ncols=len(handles),
        fontsize=_SMALL,
        frameon=False,
        title=f"{result.name or 'recording'}: {_SENSORS[result.sensor]} at rest for {lasted:.4g} s",
        title_fontsize=10.0,
    )
    return figure


def _draw_axis(ax: Axes, result: AllanResult, model: NoiseModel, k: int, factor: float, color: str) -> None:
    tau, deviation = result.curve.tau, factor * result.curve.deviation[:, k]
    ax.set_xscale("log")
    ax.set_yscale("log")
    # matplotlib labels these where an axis spans little more than a decade
    ax.tick_params(which="minor", labelsize=6.5)
    ax.fill_between(
        tau, factor * result.low[:, k], factor * result.high[:, k], color=color, alpha=0.22, linewidth=0.0
    )
    used = tau >= model.shortest
    ax.plot(tau[used], deviation[used], color=color, **_POINT)
    ax.plot(tau[~used], deviation[~used], color=color, **_POINT, **_LEFT_OUT)
    fine = np.geomspace(model.shortest, tau[-1], 200)
    total = factor * model.deviation(fine)
    ax.plot(fine, total, **_FIT)
    parts = factor * np.sqrt(design_matrix(fine)) * np.abs(model.fitted)
    ax.set_ylim(0.45 * min(deviation.min(), total.min()), 1.5 * max((factor * result.high[:, k]).max(), total.max()))
    for column, coefficient in enumerate(model):
        if coefficient.value is not None:
            shown = np.where(parts[:, column] > 0.3 * total, parts[:, column], np.nan)
            ax.plot(fine, shown, zorder=1, **_SLOPE)
            _mark(ax, coefficient.symbol, fine, parts[:, column], total)
    _write_values(ax, result, model, below=bool(total[0] > total[-1]))


def _mark(ax: Axes, symbol: str, tau: FloatArray, part: FloatArray, total: FloatArray) -> None:
    """Name a slope, in the middle of where it makes most of the curve."""
    share = part / total
    where = np.flatnonzero(share > 0.95 * share.max())
    middle = int(where[len(where) // 2])
    rising = bool(part[-1] > part[0])
    ax.annotate(
        symbol,
        (tau[middle], part[middle]),
        xytext=(3.0 if rising else -3.0, -5.0),
        textcoords="offset points",
        ha="left" if rising else "right",
        va="top",
        fontsize=_SMALL,
        fontweight="bold",
    )


def _write_values(ax: Axes, result: AllanResult, model: NoiseModel, *, below: bool) -> None:
    """List the coefficients in the corner that a falling or a rising curve leaves free."""
    lines = []
    for c in model:
        unit = result.units(c.symbol)[0]
        low, high = unit.factor * c.low, unit.factor * c.high
        if c.value is not None:
            lines.append(f"{c.symbol}  {unit.factor * c.value:.3g} {unit.name}  ({low:.3g} to {high:.3g})")
        elif np.isfinite(high) and c.symbol != "Q":
            lines.append(f"{c.symbol}  at most {high:.3g} {unit.name}")
    ax.text(
        0.012,
        0.04 if below else 0.96,
        "\n".join(lines),
        transform=ax.transAxes,
        ha="left",
        va="bottom" if below else "top",
        fontsize=_SMALL,
        linespacing=1.35,
    )
