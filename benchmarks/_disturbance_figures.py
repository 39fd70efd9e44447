"""Figure of one recording: heading and inclination error of several estimates, and what each of them flagged."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

import northdown as nd
from northdown.evaluation import AttitudeError

# Colour by estimator, dashed where it is offline (M. Okabe, K. Ito, "Color Universal Design", 2008).
STYLES = {
    "mahony": ("#999999", "-"),
    "mekf": ("#E69F00", "-"),
    "vqf": ("#0072B2", "-"),
    "vqf offline": ("#0072B2", "--"),
    "calibrating-ekf": ("#D55E00", "-"),
    "calibrating-ekf offline": ("#D55E00", "--"),
}
MAG, ACC = "#CC79A7", "#009E73"
POINTS = 3000  # drawn of each curve; more cannot be seen


def spans(time: np.ndarray, mask: np.ndarray) -> list[tuple[float, float]]:
    """Start and length of each stretch of samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    last = len(time) - 1
    return [(time[a], time[min(b, last)] - time[a]) for a, b in edges.reshape(-1, 2)]


def unbroken(time: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Angles (°) with a gap, not a line across, where they pass 180° and where samples are left out."""
    shown = angle.copy()
    step = np.diff(time)
    shown[1:][(np.abs(np.diff(angle)) > 180.0) | (step > 5.0 * np.median(step))] = np.nan
    return shown


def draw(
    path: Path,
    title: str,
    estimates: Mapping[str, nd.Orientation],
    errors: Mapping[str, AttitudeError],
    disturbed: np.ndarray | None = None,
) -> None:
    """Write the figure; the stretches known to be disturbed are grey in all panels."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.5, 7.0), layout="constrained")
    FigureCanvasAgg(figure)
    heading, inclination, flags = figure.subplots(3, 1, sharex=True, height_ratios=[3.0, 3.0, 2.2])
    for name, error in errors.items():
        color, line = STYLES[name]
        rmse = error.rmse()
        text = f"{name}: {rmse.heading_deg:.1f}° / {rmse.inclination_deg:.1f}°"
        few = slice(None, None, max(1, len(error) // POINTS))
        style = {"color": color, "linestyle": line, "linewidth": 0.9}
        for ax, values, label in ((heading, error.heading_signed, text), (inclination, error.inclination, None)):
            ax.plot(error.time[few], unbroken(error.time[few], np.rad2deg(values[few])), **style, label=label)
    rows = list(estimates)
    for row, name in enumerate(rows):
        estimate = estimates[name]
        for flag, color, low in ((nd.Flag.MAG_REJECTED, MAG, 0.05), (nd.Flag.ACC_REJECTED, ACC, -0.4)):
            flags.broken_barh(spans(estimate.time, (estimate.flags & flag) != 0), (row + low, 0.35), color=color)
    if disturbed is not None:
        for ax in (heading, inclination, flags):
            stretches = spans(next(iter(estimates.values())).time, disturbed)
            ax.broken_barh(stretches, (0, 1), transform=ax.get_xaxis_transform(), color="0.9", zorder=0)
    heading.set_ylabel("heading error (°)")
    inclination.set_ylabel("inclination error (°)")
    inclination.set_ylim(bottom=0.0)
    flags.set_yticks(range(len(rows)), rows, fontsize=8)
    flags.set_ylim(len(rows) - 0.5, -0.5)
    flags.set_xlabel("time (s)")
    flags.set_ylabel("flagged")
    for ax in (heading, inclination):
        ax.grid(True, color="0.9", linewidth=0.5)
    _legend(figure, title, disturbed is not None)
    figure.savefig(path, dpi=110)


def _legend(figure, title: str, shaded: bool) -> None:  # type: ignore[no-untyped-def]
    from matplotlib.patches import Patch

    lines, texts = figure.axes[0].get_legend_handles_labels()
    patches = [Patch(color=MAG, label="MAG_REJECTED"), Patch(color=ACC, label="ACC_REJECTED")]
    if shaded:
        patches.append(Patch(color="0.9", label="disturbed (truth)"))
    figure.legend(
        [*lines, *patches],
        [*texts, *(p.get_label() for p in patches)],
        loc="outside upper center",
        ncols=3,
        fontsize=8,
        frameon=False,
        title=f"{title}; RMSE heading / inclination",
    )
