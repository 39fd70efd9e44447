"""``northdown navigate``: track position with zero-velocity updates."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated

import typer

from northdown.cli import console, gate
from northdown.cli.numbers import read_number
from northdown.cli.output import FIGURE_SUFFIXES, check_target
from northdown.cli.reading import Reading, reads_recording

if TYPE_CHECKING:
    from northdown.navigation import Detector, Trajectory
    from northdown.recording import Recording

_SUFFIXES = (".csv", ".tum", ".txt")


@reads_recording
def navigate(
    reading: Reading,
    output: Annotated[
        str | None,
        typer.Option("--output", "--out", "-o", metavar="FILE", help="Write .csv or .tum; '-': CSV here."),
    ] = None,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="Draw the path: .png, .svg or .pdf.")
    ] = None,
    detector: Annotated[
        str, typer.Option("--detector", metavar="NAME", help="How stillness is found: shoe, or rate (gyr alone).")
    ] = "shoe",
    threshold: Annotated[
        str | None, typer.Option("--threshold", metavar="T", help="Of the detector; higher finds more stillness.")
    ] = None,
    window: Annotated[
        str | None, typer.Option("--window", metavar="S", help="Of the detector; shorter finds shorter stances.")
    ] = None,
    no_zupt: Annotated[bool, typer.Option("--no-zupt", help="Do not use stillness: how it drifts.")] = False,
    forward: Annotated[bool, typer.Option("--forward", help="Use only the past at each time.")] = False,
    max_gap: Annotated[
        str, typer.Option("--max-gap", metavar="S", help="Longest time without samples that is bridged.")
    ] = gate.MAX_GAP_TEXT,
    force: gate.Force = False,
) -> None:
    """Track the position of a foot, from stance to stance."""
    from northdown import navigation

    found = _detector(detector, threshold, window)
    if output is not None and output != "-":
        check_target("--output", output, source=reading.source, suffixes=_SUFFIXES)
    if plot is not None:
        check_target("--plot", plot, source=reading.source, suffixes=FIGURE_SUFFIXES)
    longest = gate.read_max_gap(max_gap)
    recording = reading.load()
    gate.admit_sensors(recording, {"gyr", "acc"}, max_gap=longest, force=force)
    trajectory = navigation.navigate(
        recording, zero_velocity=not no_zupt, smooth=not forward, detector=found, max_gap=longest
    )
    rows = _summary(recording, trajectory, zupt=not no_zupt)
    if output == "-":
        from northdown.navigation.writing import write_csv

        sys.stdout.flush()
        write_csv(trajectory, sys.stdout.buffer)
    elif output is not None:
        navigation.write_trajectory(trajectory, output)
    if plot is not None:
        from northdown import plots

        plots.save(plots.path(trajectory), plot)
    written = [name for name in (output, plot) if name not in (None, "-")]
    if written:
        rows.append(("Written", ", ".join(str(name) for name in written)))
    console.facts(rows, sys.stderr if output == "-" else sys.stdout)


def _detector(name: str, threshold: str | None, window: str | None) -> Detector:
    from northdown._validation import check_choice
    from northdown.navigation import AngularRateEnergy, Shoe

    settings = {
        "threshold": None if threshold is None else read_number("--threshold", threshold, above=0.0),
        "window": None if window is None else read_number("--window", window, above=0.0, unit="s"),
    }
    given = {key: value for key, value in settings.items() if value is not None}
    kinds: dict[str, type[Shoe] | type[AngularRateEnergy]] = {"shoe": Shoe, "rate": AngularRateEnergy}
    return kinds[check_choice("--detector", name, tuple(kinds))](**given)


def _summary(recording: Recording, trajectory: Trajectory, *, zupt: bool) -> list[tuple[str, str]]:
    """Labelled lines: how far, where to, how sure, and how often it stood still."""
    import numpy as np

    from northdown.navigation.trajectory import AXES
    from northdown.orientation import Flag

    still = np.zeros(len(trajectory), np.bool_) if trajectory.still is None else trajectory.still
    stops = int((np.diff(np.concatenate([[False], still]).astype(np.int8)) == 1).sum())
    length, away = trajectory.distance(horizontal=True), trajectory.closure(horizontal=True)
    ratio = f", {100.0 * away / length:.1f} % of it" if length > 0.0 else ""
    names = AXES[trajectory.frame]
    place = ", ".join(f"{axis} {value:.2f}" for axis, value in zip(names, trajectory.position[-1], strict=True))
    rows = [
        ("Recording", f"{recording.name or 'standard input'}, {len(recording)} samples, {recording.duration:.1f} s"),
        ("Still", f"{stops} times, {100.0 * still.mean():.0f} % of the samples{'' if zupt else '; not used'}"),
        ("Way", f"{length:.2f} m over ground; ends {away:.2f} m from its start{ratio}"),
        ("At the end", f"{place} m ({trajectory.frame})"),
    ]
    if trajectory.position_sigma is not None:
        sigma = ", ".join(
            f"{axis} {value:.2f}" for axis, value in zip(names, trajectory.position_sigma[-1], strict=True)
        )
        rows.append(("1 sigma", f"{sigma} m"))
    if trajectory.orientation.has(Flag.HEADING_UNKNOWN).any():
        rows.append(("Heading", "unknown without a magnetometer: the sensor's x axis points north at the start"))
    return rows
