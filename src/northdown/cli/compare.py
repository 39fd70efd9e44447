"""``northdown compare``: several estimators side by side."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

import typer

from northdown.cli import console, gate
from northdown.cli.output import FIGURE_SUFFIXES, check_target
from northdown.cli.reading import Reading, reads_recording
from northdown.cli.runs import MOST_CURVES, Run, error_table, remarks, run_all
from northdown.cli.selection import all_for, check_sensors, named
from northdown.errors import InputError, expected

if TYPE_CHECKING:
    from northdown.evaluation import ClockOffset
    from northdown.recording import Recording


@reads_recording
def compare(
    reading: Reading,
    estimator: Annotated[
        list[str],
        typer.Option(
            "--estimator", "-e", metavar="A,B,…", help="Estimators; all that the sensors allow when not given."
        ),
    ] = [],  # noqa: B006  (typer copies it)
    offline: Annotated[
        bool, typer.Option("--offline", help="Also the estimators that can use the whole recording for each sample.")
    ] = False,
    align_clock: Annotated[
        bool,
        typer.Option("--align-clock", help="Take out the offset between the gyroscope's clock and the reference's."),
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Write JSON instead of a table.")] = False,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="Draw the first six: .png, .svg or .pdf.")
    ] = None,
    max_gap: gate.MaxGap = gate.MAX_GAP_TEXT,
    force: gate.Force = False,
) -> None:
    """Compare estimators with the reference, or with each other.

    Where the recording carries no reference, the numbers are differences from the first estimator.
    """
    wanted = named(estimator)
    if plot is not None:
        check_target("--plot", plot, source=reading.source, suffixes=FIGURE_SUFFIXES)
    longest = gate.read_max_gap(max_gap)
    recording = reading.load()
    offset = find_offset(recording) if align_clock else None
    left_out: list[str] = []
    if wanted:
        for chosen in wanted:
            check_sensors(chosen, recording)
    else:
        wanted, left_out = all_for(recording)
    gate.admit(recording, wanted, max_gap=longest, force=force)
    runs = run_all(recording, wanted, max_gap=longest, offline=offline, clock=offset)
    remarks(runs)
    if plot is not None:
        _draw(recording, runs, plot)
    if json:
        console.write_json(as_dict(recording, runs, left_out, offset))
        return
    console.paragraph(f"{recording.name or 'standard input'}: {headline(recording, runs, offset)}.")
    print()
    error_table(runs, end_heading=recording.reference is None)
    if left_out:
        print(f"\nLeft out: {', '.join(left_out)}")
    if plot is not None:
        print(console.one_line(f"Written: {plot}"))


def find_offset(recording: Recording) -> ClockOffset:
    """Offset between the clocks of gyroscope and reference; an error where there is nothing to find it from."""
    from northdown.evaluation import clock_offset

    if recording.reference is None:
        got, do = f"{recording.name or 'one'} without", "leave out --align-clock"
        raise InputError(expected("a recording with a reference, for --align-clock", got, do=do))
    return clock_offset(recording)


def headline(recording: Recording, runs: list[Run], offset: ClockOffset | None = None) -> str:
    """What the numbers of the table are."""
    errors = [run.error for run in runs if run.error is not None]
    if recording.reference is None:
        first = next(run.name for run in runs if run.orientation is not None)
        return f"no reference, so RMS differences from {first} over {len(recording)} samples"
    if not errors:
        return "no error could be counted"
    kind = "none" if errors[0].alignment is None else errors[0].alignment.kind
    what = {
        "none": "",
        "heading": ", each after aligning its heading, so they are lower bounds",
        "rotations": ", each after aligning world and body axes, so they are lower bounds",
    }[kind]
    still = " (the moving ones)" if recording.movement is not None else ""
    clocks = "" if offset is None else f", clocks aligned ({offset})"
    return f"RMS errors to the reference over {len(errors[0])} of {len(recording)} samples{still}{what}{clocks}"


def as_dict(
    recording: Recording, runs: list[Run], left_out: list[str], offset: ClockOffset | None = None
) -> dict[str, Any]:
    """The comparison for programs; angles in degrees."""
    has_reference = recording.reference is not None
    return {
        "recording": recording.name,
        "samples": len(recording),
        "duration": recording.duration,
        "compared_with": "reference" if has_reference else next(r.name for r in runs if r.orientation is not None),
        "alignment": recording.reference_offset if has_reference else None,
        "clock_offset": None if offset is None else {"offset_s": offset.offset, "sigma_s": offset.sigma},
        "movement_only": has_reference and recording.movement is not None,
        "estimators": [_run_as_dict(run) for run in runs],
        "left_out": left_out,
    }


def _run_as_dict(run: Run) -> dict[str, Any]:
    rms = None if run.error is None else run.error.rmse()
    return {
        "name": run.name,
        "frame": None if run.orientation is None else run.orientation.frame,
        "samples": 0 if run.error is None else len(run.error),
        "total_rms_deg": None if rms is None else rms.total_deg,
        "heading_rms_deg": None if rms is None else rms.heading_deg,
        "inclination_rms_deg": None if rms is None else rms.inclination_deg,
        "end_heading_deg": None if run.error is None else math.degrees(run.error.heading_signed[-1]),
        "ns_per_sample": run.nanoseconds,
        "problem": run.problem or None,
    }


def _draw(recording: Recording, runs: list[Run], path: str) -> None:
    """Errors to the reference, or the angles of all where there is none; no more than can be told apart."""
    from northdown import plots

    if recording.reference is not None:
        # the best comes last, as the last curve is on top
        figure = plots.errors([run.error for run in runs if run.error is not None][MOST_CURVES - 1 :: -1])
    else:
        figure = plots.euler([run.orientation for run in runs if run.orientation is not None][:MOST_CURVES])
    plots.save(figure, path)
