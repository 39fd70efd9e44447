"""Figure of Euler angles, with the reference and the errors beneath."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from northdown._validation import FloatArray, check_choice
from northdown.evaluation import AttitudeError, Truth, attitude_error
from northdown.evaluation.matching import find_reference, longest_gap
from northdown.frames import EULER_COLUMNS
from northdown.orientation import Orientation
from northdown.plots._canvas import (
    REFERENCE,
    REST,
    STYLES,
    Clock,
    check_orientations,
    draw,
    draw_band,
    finish,
    label,
    line_handle,
    names_of,
    new_figure,
    patch_handle,
    reference_handle,
    shade,
    usual,
    within,
)
from northdown.plots._errors import draw_errors, limit_errors
from northdown.recording import Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def euler(
    orientations: Orientation | Sequence[Orientation],
    reference: Truth | None = None,
    *,
    convention: str = "zyx",
    degrees: bool = True,
) -> Figure:
    """Draw Euler angles over time and, with a reference, the errors beneath.

    Parameters
    ----------
    orientations : Orientation or sequence of Orientation
        Estimates, at most six. All are drawn in the frame of the first.
    reference : Orientation or Recording, optional
        The truth, drawn in black dashes. A recording also says how it is to be aligned (`reference_offset`; found
        with the first estimate) and which samples count (others are shaded, and left out of the RMSE in the legend).
    convention : {"zyx", "rfu"}
        As for `Orientation.as_euler`.
    degrees : bool
        Angles in degrees, else in radians. Errors are always in degrees.

    Returns
    -------
    matplotlib.figure.Figure
        Three panels of angles and, with a reference, three of errors. Lines are broken where an angle passes ±180°.
        Where an estimate has a covariance, a band of three sigma is drawn with it.

    Raises
    ------
    InputError
        When there is nothing to draw or too much to be told apart, or when the reference does not fit.
    MissingDependencyError
        Without matplotlib.
    """
    found = check_orientations(orientations)
    check_choice("convention", convention, tuple(EULER_COLUMNS))
    found = [o.to_frame(found[0].frame) for o in found]
    counted = [] if reference is None else [attitude_error(o, reference) for o in found]
    heights = [1.0] * 3 + [0.75] * (3 if counted else 0)
    frame = "ENU" if convention == "rfu" else found[0].frame
    figure, axes = new_figure(heights, 25.0 if counted else 15.0)
    clock = Clock(min(o.time[0] for o in found), max(o.time[-1] for o in found))
    names = names_of(found)
    if counted:
        names = [f"{n}: RMSE {e.rmse().total_deg:.2f}°" for n, e in zip(names, counted, strict=True)]
    handles = [line_handle(n, color=c, linestyle=s) for n, (c, s) in zip(names, STYLES, strict=False)]
    turn = 360.0 if degrees else 2.0 * np.pi
    bands = np.zeros(3)
    for orientation, (color, style) in zip(found, STYLES, strict=False):
        bands = np.maximum(bands, _draw_angles(axes[:3], clock, orientation, convention, turn, color, style))
    if reference is not None:
        handles.append(_draw_reference(axes[:3], clock, reference, counted[0], convention, turn))
        _draw_error_panels(axes[3:], clock, found, reference, counted)
    for ax, name, band in zip(axes, EULER_COLUMNS[convention], bands, strict=False):
        label(ax, f"{name} ({'°' if degrees else 'rad'})")
        _angle_axis(ax, clock, turn, float(band))
    if any(o.covariance is not None for o in found):
        handles.append(patch_handle("3 sigma", color="0.5", alpha=0.35, linewidth=0.0))
    if isinstance(reference, Recording) and reference.movement is not None:
        for ax in axes:
            shade(ax, clock, reference.time, ~reference.movement, **REST)
        handles.append(patch_handle("not counted", **REST))
    finish(figure, axes, clock, f"Euler angles {convention}, body → {frame}", handles)
    return figure


def _draw_angles(
    axes: Sequence[Axes],
    clock: Clock,
    orientation: Orientation,
    convention: str,
    turn: float,
    color: str,
    style: object,
) -> FloatArray:
    """Draw the angles, in units of which a full turn has `turn`; usual widths (3,) of the bands."""
    unit = turn / (2.0 * np.pi)
    angles = unit * orientation.as_euler(convention)
    gap = longest_gap(orientation.time)
    widths = np.zeros(3)
    if orientation.covariance is not None:
        width = 3.0 * unit * euler_sigma(orientation, convention)
        for i, ax in enumerate(axes):
            low, high = angles[:, i] - width[:, i], angles[:, i] + width[:, i]
            draw_band(ax, clock, orientation.time, low, high, gap=gap, color=color, period=turn)
        widths = np.array([usual(w) for w in width.T])
    look = {"color": color, "linestyle": style, "linewidth": 1.5}
    for i, ax in enumerate(axes):
        draw(ax, clock, orientation.time, angles[:, i], gap=gap, period=turn, **look)
    return widths


def _draw_reference(
    axes: Sequence[Axes], clock: Clock, reference: Truth, error: AttitudeError, convention: str, turn: float
) -> object:
    truth = find_reference(reference)
    if error.alignment is not None:
        truth = error.alignment.apply_inverse(truth)
    truth = within(truth, clock)
    angles = turn / (2.0 * np.pi) * truth.to_frame(error.frame).as_euler(convention)
    for i, ax in enumerate(axes):
        draw(ax, clock, truth.time, angles[:, i], gap=longest_gap(truth.time), period=turn, **REFERENCE)
    return reference_handle(truth.name)


def _draw_error_panels(
    axes: Sequence[Axes],
    clock: Clock,
    found: Sequence[Orientation],
    reference: Truth,
    counted: Sequence[AttitudeError],
) -> None:
    """Errors wherever the truth is known, also where they do not count."""
    shown, bands = [], np.zeros(3)
    for orientation, error, (color, style) in zip(found, counted, STYLES, strict=False):
        everywhere = attitude_error(orientation, find_reference(reference), alignment=error.alignment or "none")
        covariance = None if orientation.covariance is None else orientation.covariance[everywhere.index]
        bands = np.maximum(bands, draw_errors(axes, clock, everywhere, color, style, covariance))
        shown.append(everywhere)
    limit_errors(axes, shown, bands)


def euler_sigma(orientation: Orientation, convention: str = "zyx") -> FloatArray:
    """Standard deviations (N, 3), rad, of the Euler angles, from the covariance to first order.

    A small turn δ in the navigation frame changes zyx angles by

    roll' = u / cos pitch, pitch' = v, yaw' = δ_z + u tan pitch

    with u = δ_x cos yaw + δ_y sin yaw and v = −δ_x sin yaw + δ_y cos yaw; for rfu, with yaw = −heading,

    pitch' = u, roll' = v / cos pitch, heading' = v tan pitch − δ_z.
    """
    rfu = convention == "rfu"
    shown = orientation.to_frame("ENU") if rfu else orientation
    covariance = shown.covariance
    if covariance is None:
        return np.full((len(orientation), 3), np.nan)
    angles = shown.as_euler(convention)
    pitch, yaw = (angles[:, 0], -angles[:, 2]) if rfu else (angles[:, 1], angles[:, 2])
    cy, sy, zero, one = np.cos(yaw), np.sin(yaw), np.zeros(len(yaw)), np.ones(len(yaw))
    # at ±90° the angles are undetermined; the bound keeps the band drawable there
    cos_pitch = np.maximum(np.cos(pitch), 1e-6)[:, None]
    u, v, down = np.stack([cy, sy, zero], -1), np.stack([-sy, cy, zero], -1), np.stack([zero, zero, one], -1)
    tangent = np.sin(pitch)[:, None] / cos_pitch
    jacobian: FloatArray
    if rfu:
        jacobian = np.stack([u, v / cos_pitch, v * tangent - down], axis=1)
    else:
        jacobian = np.stack([u / cos_pitch, v, down + u * tangent], axis=1)
    turned: FloatArray = jacobian @ covariance @ jacobian.transpose(0, 2, 1)
    variance = np.diagonal(turned, axis1=1, axis2=2)
    result: FloatArray = np.sqrt(np.maximum(variance, 0.0))
    return result


def _angle_axis(ax: Axes, clock: Clock, turn: float, band: float) -> None:
    """Ticks at round angles, and limits that show the lines and the usual band."""
    from matplotlib.ticker import MultipleLocator

    low, high = np.inf, -np.inf
    for line in ax.lines:
        t, value = (np.asarray(x, dtype=np.float64) for x in line.get_data())
        value = value[(t >= clock.limits[0]) & (t <= clock.limits[1]) & np.isfinite(value)]
        if len(value):
            low, high = min(low, float(value.min())), max(high, float(value.max()))
    degree = turn / 360.0
    margin = max(0.06 * (high - low), 0.5 * degree, min(1.1 * band, max(high - low, 30.0 * degree)))
    edge = 0.5 * turn + 5.0 * degree
    ax.set_ylim(max(low - margin, -edge), min(high + margin, edge))
    if turn == 360.0 and high - low > 150.0:
        ax.yaxis.set_major_locator(MultipleLocator(90.0 if high - low > 200.0 else 45.0))
