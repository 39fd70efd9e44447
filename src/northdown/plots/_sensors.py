"""Figure of what the sensors said."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from northdown._validation import FloatArray, check_increasing
from northdown.errors import InputError, expected
from northdown.plots._canvas import (
    MISSING,
    REST,
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
from northdown.recording import SENSORS, Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_GRAVITY = 9.81
_GRAVITY_LINE: Final[dict[str, Any]] = {"color": "black", "linewidth": 0.8, "linestyle": ":", "zorder": 3}
_GREY = "0.45"


def sensors(recording: Recording) -> Figure:
    """Draw gyroscope, accelerometer and magnetometer over time, with the sizes of the latter two, and an array.

    Parameters
    ----------
    recording : Recording
        Of increasing time.

    Returns
    -------
    matplotlib.figure.Figure
        A panel for each sensor there is (°/s, m/s², µT), and one each for the size of acceleration and field; one
        for all accelerometers of an array, whose lines are not told apart. Grey: not `movement`; hatched: no samples
        for longer than three of the sensor's own periods.

    Raises
    ------
    InputError
        When the recording is empty or its time runs backwards.
    MissingDependencyError
        Without matplotlib.
    """
    if not isinstance(recording, Recording):
        raise InputError(expected("a Recording", type(recording).__name__))
    if not len(recording):
        raise InputError(expected("a recording with samples", "none"))
    check_increasing(recording.time)
    panels = _panels(recording)
    figure, axes = new_figure([height for _, _, height in panels])
    clock = Clock(float(recording.time[0]), float(recording.time[-1]))
    any_missing = False
    for ax, (text, value, _) in zip(axes, panels, strict=True):
        any_missing |= _draw_sensor(ax, clock, recording.time, value)
        label(ax, text)
    handles = [line_handle(n, color=c, linestyle=s) for n, (c, s) in zip("xyz", STYLES, strict=False)]
    for ax, (text, _, _) in zip(axes, panels, strict=True):
        if text.startswith("|acc|"):
            ax.axhline(_GRAVITY, **_GRAVITY_LINE)
            handles.append(line_handle(f"{_GRAVITY} m/s²", **_GRAVITY_LINE))
    if recording.movement is not None:
        for ax in axes:
            shade(ax, clock, recording.time, ~recording.movement, **REST)
        handles.append(patch_handle("no movement", **REST))
    if any_missing:
        handles.append(patch_handle("no samples", **MISSING))
    finish(figure, axes, clock, recording.name or "sensors", handles)
    return figure


def _panels(recording: Recording) -> list[tuple[str, FloatArray, float]]:
    """Label, values and relative height of each panel."""
    field = "µT" if recording.mag_unit == "uT" else "arb. unit"
    unit = {"gyr": "°/s", "acc": "m/s²", "mag": field}
    panels: list[tuple[str, FloatArray, float]] = []
    for sensor in SENSORS:
        value: FloatArray | None = getattr(recording, sensor)
        if value is None:
            continue
        shown = np.rad2deg(value) if sensor == "gyr" else value
        panels.append((f"{sensor}\n({unit[sensor]})", shown, 1.2))
        if sensor != "gyr" and not np.isnan(value).any(axis=1).all():
            panels.append((f"|{sensor}|\n({unit[sensor]})", np.linalg.norm(value, axis=1)[:, None], 0.8))
    if recording.array_acc is not None:
        panels.append(("array\n(m/s²)", recording.array_acc, 1.2))
    return panels


def _draw_sensor(ax: Axes, clock: Clock, time: FloatArray, value: FloatArray) -> bool:
    """Draw the columns of a sensor; whether samples are missing."""
    there = ~np.isnan(value).any(axis=1)
    if not there.any():
        ax.text(0.5, 0.5, "no samples", transform=ax.transAxes, ha="center", va="center", fontsize=9.0)
        ax.set_yticks([])
        return False
    seen = time[there]
    steps = np.diff(seen)
    gap = 3.0 * float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    for i in range(value.shape[1]):
        color, style = STYLES[i] if value.shape[1] == 3 else (_GREY, "-")
        column = np.where(there, value[:, i], np.nan)
        draw(ax, clock, time, column, gap=gap, color=color, linestyle=style, linewidth=0.8, alpha=0.85)
    return _shade_missing(ax, clock, time, seen, gap)


def _shade_missing(ax: Axes, clock: Clock, time: FloatArray, seen: FloatArray, gap: float) -> bool:
    """Hatch from sample to sample where they are too far apart, and from the ends of the recording."""
    edges = np.concatenate([time[:1], seen, time[-1:]])
    long = np.diff(edges) > gap
    start, width = edges[:-1][long], np.diff(edges)[long]
    if not len(start):
        return False
    found = list(zip(clock(start).tolist(), width.tolist(), strict=True))
    ax.broken_barh(found, (0.0, 1.0), transform=ax.get_xaxis_transform(), **MISSING)
    return True
