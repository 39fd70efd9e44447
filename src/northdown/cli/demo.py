"""``northdown demo``: everything once, on a simulated recording whose truth is known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from northdown.cli import console, gate
from northdown.cli.numbers import read_count, read_number
from northdown.cli.output import make_folder
from northdown.cli.runs import MOST_CURVES, Run, error_table, remarks, run_all
from northdown.errors import MissingDependencyError

if TYPE_CHECKING:
    from northdown.recording import Recording

# A day at 100 Hz would fill the memory of a small computer.
_LONGEST = 3600.0


def demo(
    out: Annotated[str, typer.Option("--out", "-o", metavar="DIR", help="Folder to write to.")] = "demo-output",
    duration: Annotated[str, typer.Option("--duration", metavar="S", help="Length of the recording.")] = "60",
    seed: Annotated[str, typer.Option("--seed", metavar="N", help="Another seed, another motion.")] = "0",
) -> None:
    """Try every estimator on simulated data with known truth."""
    from northdown.cli.selection import all_for
    from northdown.simulation import simulate

    length = read_number("--duration", duration, low=5.0, high=_LONGEST, unit="s")
    number = read_count("--seed", seed)
    folder = make_folder(out)
    recording = simulate(length, seed=number)
    print(f"A low-cost sensor in the hand, simulated: {length:g} s at {recording.rate:g} Hz, truth known.")
    runs = run_all(recording, all_for(recording)[0], max_gap=gate.DEFAULT_MAX_GAP)
    print("RMS errors, while it moves:\n")
    error_table(runs, end_heading=False)
    remarks(runs)
    with console.busy(f"writing to {folder}", show=True):
        written = _write(folder, recording, runs)
    print(f"\nWritten to {console.one_line(str(folder))}:")
    console.facts((f"  {name}", text) for name, text in written)
    _what_to_look_at(folder, runs)


def _write(folder: Path, recording: Recording, runs: Sequence[Run]) -> list[tuple[str, str]]:
    """Write what was simulated and found; a file whose package is not installed is left out with a warning."""
    import northdown.io

    done: list[tuple[str, str]] = []

    def write(name: str, text: str, writer: Callable[[Path], object]) -> None:
        try:
            writer(folder / name)
        except MissingDependencyError as problem:
            console.warn(f"warning: no {name}: {problem}")
        else:
            done.append((name, text))

    for name in ("recording.csv", "recording.parquet"):
        write(name, "sensors and truth", lambda path: northdown.io.write_recording(recording, path))
    for run in runs:
        orientation = run.orientation
        if orientation is not None:
            northdown.io.write_orientation(orientation, folder / f"orientation-{run.name}.csv")
    done.append(("orientation-*.csv", "what each made of it: quaternion, angles in rad"))
    write("sensors.png", "what the sensors said", lambda path: _save("sensors", path, recording, runs))
    write("angles.png", "Euler angles of the best, and the truth", lambda path: _save("euler", path, recording, runs))
    write(
        "errors.png",
        f"errors of the best {MOST_CURVES} over time",
        lambda path: _save("errors", path, recording, runs),
    )
    return done


def _save(kind: str, path: Path, recording: Recording, runs: Sequence[Run]) -> None:
    from northdown import plots

    best = runs[0].orientation
    if kind == "sensors":
        figure = plots.sensors(recording)
    elif kind == "euler" and best is not None:
        figure = plots.euler(best, recording)
    else:
        # the best comes last, as the last curve is on top
        figure = plots.errors([run.error for run in runs if run.error is not None][MOST_CURVES - 1 :: -1])
    plots.save(figure, path)


def _what_to_look_at(folder: Path, runs: Sequence[Run]) -> None:
    scored = {run.name: run.error.rmse() for run in runs if run.error is not None}
    best = next(iter(scored))
    print("\nWhat to look at:")
    print(f"- {best} is best here, {scored[best].total_deg:.1f}° off. Other motions may have other winners.")
    if "gyro-integration" in scored:
        print(f"- gyro-integration drifts to {scored['gyro-integration'].total_deg:.1f}°: nothing corrects its bias.")
    if "tilt-compass" in scored:
        print(f"- tilt-compass is off by {scored['tilt-compass'].total_deg:.1f}°: it takes acceleration for gravity.")
    path = console.one_line(str(folder / "recording.csv"))
    print(f"- Now yourself: northdown compare {path} -e mahony,madgwick")
