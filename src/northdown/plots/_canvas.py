"""What all figures share: size, palette, axes, legend and shading, without pyplot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray
from northdown.errors import InputError, expected
from northdown.io.optional import import_optional
from northdown.orientation import Orientation
from northdown.plots._lines import band, isolated, spans, trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_CM: Final = 1.0 / 2.54
_WIDTH: Final = 18.0 * _CM  # text width of an A4 page, in inches
_SMALL, _NORMAL, _TITLE = 8.0, 9.0, 10.0  # font sizes, points

# M. Okabe, K. Ito, "Color Universal Design", 2008; ordered so that neighbours differ in lightness too, which
# together with the line style tells them apart in grey print. Black is the reference's.
STYLES: Final[tuple[tuple[str, Any], ...]] = (
    ("#0072B2", "-"),
    ("#E69F00", "-."),
    ("#009E73", (0, (1, 1))),
    ("#D55E00", (0, (6, 1.5))),
    ("#56B4E9", (0, (3, 1, 1, 1, 1, 1))),
    ("#CC79A7", (0, (2, 1))),
)
REFERENCE: Final[dict[str, Any]] = {"color": "black", "linestyle": (0, (4, 2)), "linewidth": 0.9, "zorder": 3}


def new_figure(heights: Sequence[float], height_cm: float | None = None) -> tuple[Figure, list[Axes]]:
    """Figure with panels one below the other, of these relative heights, sharing the time axis."""
    figure = empty_figure(height_cm if height_cm is not None else 2.5 + 3.6 * float(sum(heights)))
    axes = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=list(heights))[:, 0]
    for ax in axes:
        prepare(ax)
    return figure, list(axes)


def empty_figure(height_cm: float) -> Figure:
    """Figure without panels, as wide as the text on a page of A4."""
    import_optional("matplotlib", "plots")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH, height_cm * _CM), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def prepare(ax: Axes) -> None:
    """Grid, small tick labels, and no frame at the top and the right."""
    ax.grid(True, color="0.88", linewidth=0.5)
    ax.set_axisbelow(True)
    ax.tick_params(labelsize=_SMALL, length=3)
    ax.xaxis.get_offset_text().set_fontsize(_SMALL)
    ax.yaxis.get_offset_text().set_fontsize(_SMALL)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)


class Clock:
    """Times as drawn: since the start where the clock counts from long ago, else as they are."""

    def __init__(self, first: float, last: float) -> None:
        far = abs(first) > 100.0 * max(last - first, 1.0)
        self.zero = first if far else 0.0
        margin = 0.0 if last > first else 0.5
        self.limits = (first - self.zero - margin, last - self.zero + margin)
        self.label = f"time after {first:.3f} s (s)" if far else "time (s)"

    def __call__(self, time: FloatArray) -> FloatArray:
        shown: FloatArray = time - self.zero
        return shown


def label(ax: Axes, text: str) -> None:
    """Name the vertical axis of a panel, with its unit."""
    ax.set_ylabel(text, fontsize=_NORMAL)


def finish(figure: Figure, axes: Sequence[Axes], clock: Clock, title: str, handles: Sequence[Any]) -> None:
    """Time axis, aligned labels, and title and legend above the panels, where they cover no data."""
    axes[-1].set_xlabel(clock.label, fontsize=_NORMAL)
    axes[-1].set_xlim(*clock.limits)
    figure.align_ylabels(axes)
    figure.legend(
        handles=list(handles),
        loc="outside upper center",
        ncols=_legend_columns([len(str(h.get_label())) for h in handles]),
        fontsize=_SMALL,
        frameon=False,
        handlelength=3.0,
        title=title,
        title_fontsize=_TITLE,
    )


def _legend_columns(lengths: Sequence[int]) -> int:
    """As many columns as fit, counted in characters; then as few as give the same number of rows."""
    if sum(lengths) + 8 * len(lengths) <= 110:
        return len(lengths)
    most = max(1, min(len(lengths), 110 // (max(lengths) + 8)))
    rows = -(-len(lengths) // most)
    return -(-len(lengths) // rows)


def draw(
    ax: Axes,
    clock: Clock,
    time: FloatArray,
    value: FloatArray,
    *,
    gap: float,
    period: float | None = None,
    **style: Any,
) -> None:
    """Draw a line through samples; single samples get a dot."""
    t, v = trace(clock(time), value, gap=gap, period=period)
    style = {"linewidth": 1.0, **style}
    ax.plot(t, v, **style)
    alone = isolated(v)
    if alone.any():
        ax.plot(t[alone], v[alone], color=style["color"], linestyle="none", marker=".", markersize=4.0)


def draw_band(
    ax: Axes,
    clock: Clock,
    time: FloatArray,
    low: FloatArray,
    high: FloatArray,
    *,
    gap: float,
    color: str,
    period: float | None = None,
) -> None:
    """Fill between two lines, lightly."""
    t, a, b = band(clock(time), low, high, gap=gap, period=period)
    ax.fill_between(t, a, b, color=color, alpha=0.22, linewidth=0.0, zorder=1)


def usual(width: FloatArray) -> float:
    """Width of a band that three quarters of its samples do not exceed; zero where nothing is known."""
    known = width[np.isfinite(width)]
    return float(np.percentile(known, 75.0)) if len(known) else 0.0


def shade(ax: Axes, clock: Clock, time: FloatArray, mask: npt.NDArray[np.bool_], **style: Any) -> None:
    """Mark the stretches of time where a mask is true, over the full height of a panel."""
    found = spans(clock(time), mask)
    if found:
        ax.broken_barh(found, (0.0, 1.0), transform=ax.get_xaxis_transform(), **style)


def within(orientation: Orientation, clock: Clock) -> Orientation:
    """The part that the time axis shows, and one sample more on each side."""
    time = clock(orientation.time)
    start = int(np.searchsorted(time, clock.limits[0])) - 1
    stop = int(np.searchsorted(time, clock.limits[1], side="right")) + 1
    return orientation[max(start, 0) : stop]


REST: Final[dict[str, Any]] = {"facecolor": "0.92", "edgecolor": "none", "zorder": 0.0}
MISSING: Final[dict[str, Any]] = {
    "facecolor": "none",
    "edgecolor": "0.6",
    "hatch": "////",
    "linewidth": 0.0,
    "zorder": 0.5,
}


def reference_handle(name: str) -> Any:
    """Entry of a legend for the reference."""
    return line_handle(f"reference ({name})" if name else "reference", **REFERENCE)


def line_handle(text: str, **style: Any) -> Any:
    """Entry of a legend for a line."""
    from matplotlib.lines import Line2D

    return Line2D([], [], **{"linewidth": 1.4, **style}, label=text)


def patch_handle(text: str, **style: Any) -> Any:
    """Entry of a legend for an area."""
    from matplotlib.patches import Patch

    return Patch(**style, label=text)


def check_orientations(value: Orientation | Sequence[Orientation]) -> list[Orientation]:
    """One or several orientations with samples, not more than can be told apart."""
    found = [value] if isinstance(value, Orientation) else list(value)
    wrong = [type(o).__name__ for o in found if not isinstance(o, Orientation)]
    if wrong:
        raise InputError(expected("orientations to draw", wrong[0]))
    check_count("orientations", len(found))
    for i, orientation in enumerate(found):
        if not len(orientation):
            raise InputError(
                expected("orientations with samples", f"none in {orientation.name or f'number {i + 1}'}")
            )
    return found


def check_count(what: str, count: int) -> None:
    """Not none, and not more than there are line styles."""
    if not 1 <= count <= len(STYLES):
        raise InputError(
            expected(
                f"1 to {len(STYLES)} {what} in a figure", f"{count}", do="draw several figures" if count else None
            )
        )


def names_of(values: Sequence[Any]) -> list[str]:
    """A name for each, no two alike."""
    plain = [v.name or "estimate" for v in values]
    return [f"{n} ({i + 1})" if plain.count(n) > 1 else n for i, n in enumerate(plain)]
