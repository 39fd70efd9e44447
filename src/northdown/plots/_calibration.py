"""Figure of a calibration: what should be constant, before and after."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from northdown._validation import FloatArray
from northdown.calibration.model import Calibration
from northdown.calibration.part import SensorCalibration
from northdown.calibration.rest import find_rests
from northdown.calibration.turns import turn_errors
from northdown.errors import InputError, expected
from northdown.plots._canvas import STYLES, line_handle, new_figure
from northdown.recording import Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SMALL, _NORMAL, _TITLE = 8.0, 9.0, 10.0
_BEFORE, _AFTER = STYLES[1][0], STYLES[0][0]  # a light and a dark one
_TRUE: Final[dict[str, Any]] = {"color": "black", "linewidth": 0.9, "linestyle": "-"}
# More points than this cover each other.
_MOST: Final = 3000
_PLANES: Final = ((0, 1), (0, 2), (1, 2))
_UNITS: Final = {"uT": "µT", "arbitrary": "arbitrary unit"}


def calibration(calibration: Calibration, recording: Recording | Sequence[Recording]) -> Figure:
    """Draw what a calibration of one sensor does to the recordings it was made from.

    Parameters
    ----------
    calibration : Calibration
        With one part.
    recording : Recording or sequence of these
        As recorded, without the calibration.

    Returns
    -------
    matplotlib.figure.Figure
        For the magnetometer: the field seen along each axis, which should lie on a circle, and its size over the
        samples. For the accelerometer: error of gravity's size at each rest. For the gyroscope: error of gravity's
        direction after each turn between rests; where there are no turns, the rate at each rest.

    Raises
    ------
    InputError
        When there is not one part, or nothing to draw.
    MissingDependencyError
        Without matplotlib.
    """
    parts = calibration.parts if isinstance(calibration, Calibration) else ()
    if len(parts) != 1:
        raise InputError(expected("a calibration of one sensor", f"{len(parts)}"))
    recordings = [recording] if isinstance(recording, Recording) else list(recording)
    part = parts[0]
    if part.sensor == "mag":
        return _magnetometer(part, recordings)
    before, after, label, what = (
        _accelerometer(part, recordings) if part.sensor == "acc" else _gyroscope(part, recordings)
    )
    figure, (ax,) = new_figure([1.6])
    index = np.arange(1, len(before) + 1)
    ax.plot(index, before, color=_BEFORE, linestyle="none", marker="o", markersize=4.0, markerfacecolor="white")
    ax.plot(index, after, color=_AFTER, linestyle="none", marker="o", markersize=4.0)
    ax.axhline(0.0, **_TRUE)
    ax.set_ylabel(label, fontsize=_NORMAL)
    ax.set_xlabel(what, fontsize=_NORMAL)
    _legend(figure, part, recordings)
    return figure


def _magnetometer(part: SensorCalibration, recordings: Sequence[Recording]) -> Figure:
    raw = np.concatenate([r.mag[~np.isnan(r.mag).any(axis=1)] for r in recordings if r.mag is not None])
    if not len(raw):
        raise InputError(expected("recordings with samples of the magnetometer", "none"))
    corrected = part.correct(raw)
    unit = _UNITS[part.unit]
    figure, _ = new_figure([1.0], 12.0)
    figure.clear()
    grid = figure.add_gridspec(2, 3, height_ratios=[2.0, 1.2])
    shown = np.linspace(0, len(raw) - 1, min(len(raw), _MOST)).astype(np.intp)
    angle = np.linspace(0.0, 2.0 * math.pi, 200)
    for k, (i, j) in enumerate(_PLANES):
        ax = figure.add_subplot(grid[0, k])
        for values, color in ((raw, _BEFORE), (corrected, _AFTER)):
            ax.plot(values[shown, i], values[shown, j], color=color, **_dots(1.5))
        ax.plot(part.norm * np.cos(angle), part.norm * np.sin(angle), **_TRUE)
        ax.set_aspect("equal", adjustable="datalim")
        ax.set_xlabel(f"{'xyz'[i]} ({unit})", fontsize=_NORMAL)
        ax.set_ylabel(f"{'xyz'[j]} ({unit})", fontsize=_NORMAL)
        _style(ax)
    ax = figure.add_subplot(grid[1, :])
    for values, color in ((raw, _BEFORE), (corrected, _AFTER)):
        ax.plot(shown, np.linalg.norm(values[shown], axis=1), color=color, **_dots(1.5))
    ax.axhline(part.norm, **_TRUE)
    ax.set_xlim(0, max(len(raw) - 1, 1))
    ax.set_xlabel("sample", fontsize=_NORMAL)
    ax.set_ylabel(f"size ({unit})", fontsize=_NORMAL)
    _style(ax)
    _legend(figure, part, recordings)
    return figure


def _dots(size: float) -> dict[str, Any]:
    return {"linestyle": "none", "marker": ".", "markersize": size, "rasterized": True}


def _style(ax: Axes) -> None:
    ax.grid(True, color="0.88", linewidth=0.5)
    ax.set_axisbelow(True)
    ax.tick_params(labelsize=_SMALL, length=3)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)


def _accelerometer(
    part: SensorCalibration, recordings: Sequence[Recording]
) -> tuple[FloatArray, FloatArray, str, str]:
    means = [rest.acc for r in recordings if r.acc is not None for rest in find_rests(r) if rest.acc is not None]
    if not means:
        raise InputError(expected("rests of the accelerometer to draw", "none"))
    raw = np.array(means)
    before, after = (np.linalg.norm(v, axis=1) - part.norm for v in (raw, part.correct(raw)))
    return before, after, "error of size (m/s²)", "rest"


def _gyroscope(part: SensorCalibration, recordings: Sequence[Recording]) -> tuple[FloatArray, FloatArray, str, str]:
    rested = [(r, find_rests(r)) for r in recordings if r.gyr is not None]
    if not np.array_equal(part.matrix, np.eye(3)):
        before, after = (np.degrees(turn_errors(rested, mat)) for mat in (np.eye(3), part.matrix))
        return before, after, "error of direction (°)", "turn"
    means = [rest.gyr for _, rests in rested for rest in rests if rest.gyr is not None]
    if not means:
        raise InputError(expected("rests of the gyroscope to draw", "none"))
    raw = np.array(means)
    before, after = (np.degrees(np.linalg.norm(v, axis=1)) for v in (raw, raw - part.offset))
    return before, after, "rate (°/s)", "rest"


def _legend(figure: Figure, part: SensorCalibration, recordings: Sequence[Recording]) -> None:
    names = {"gyr": "gyroscope", "acc": "accelerometer", "mag": "magnetometer"}
    name = recordings[0].name if len(recordings) == 1 and recordings[0].name else f"{len(recordings)} recordings"
    dots: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 4.0}
    figure.legend(
        handles=[
            line_handle("as recorded", color=_BEFORE, markerfacecolor="white", **dots),
            line_handle("calibrated", color=_AFTER, **dots),
            line_handle("as it should be", **_TRUE),
        ],
        loc="outside upper center",
        ncols=3,
        fontsize=_SMALL,
        frameon=False,
        title=f"{name}: {names[part.sensor]}, {part.evidence.model}",
        title_fontsize=_TITLE,
    )
