"""``northdown simulate``: write a recording whose truth is known."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from northdown.cli import console
from northdown.cli.geometry import read_geometry
from northdown.cli.numbers import read_count, read_number
from northdown.cli.output import check_target
from northdown.errors import InputError, expected
from northdown.simulation.motion_library import MOTIONS
from northdown.simulation.presets import PRESETS
from northdown.simulation.writing import SUFFIXES

if TYPE_CHECKING:
    from northdown.simulation.imu_errors import SensorErrors

# Eleven days at the highest rate would fill a large disk.
_LONGEST = 1e6
_FASTEST = 10_000.0
# Samples from which on one wonders how long it takes.
_MANY = 200_000


def simulate(
    output: Annotated[
        str, typer.Option("--output", "-o", metavar="FILE", help=f"Write {', '.join(SUFFIXES)}; '-': CSV here.")
    ],
    motion: Annotated[
        str, typer.Option("--motion", metavar="NAME", help=f"What the body does: {', '.join(MOTIONS)}.")
    ] = "random",
    preset: Annotated[
        str, typer.Option("--preset", metavar="NAME", help=f"Sensors, as delivered: {', '.join(PRESETS)}.")
    ] = "low-cost",
    calibrated: Annotated[
        bool, typer.Option("--calibrated", help="Leave only a fiftieth of constant errors.")
    ] = False,
    duration: Annotated[str, typer.Option("--duration", metavar="S", help="Length.")] = "60",
    rate: Annotated[str, typer.Option("--rate", metavar="HZ", help="Sampling rate.")] = "100",
    seed: Annotated[str, typer.Option("--seed", metavar="N", help="Another seed, another recording.")] = "0",
    frame: Annotated[str, typer.Option("--frame", metavar="NED|ENU|NWU", help="Frame of the truth.")] = "NED",
    array: Annotated[
        str | None,
        typer.Option("--array", metavar="NAME", help="Add an array of accelerometers: see 'arrays'; or its .toml."),
    ] = None,
    radius: Annotated[str | None, typer.Option("--radius", metavar="M", help="Of the named array.")] = None,
    misplacement: Annotated[
        str, typer.Option("--misplacement", metavar="M", help="Of the array's accelerometers, 1 sigma of each axis.")
    ] = "0",
) -> None:
    """Write a recording of simulated sensors, with its truth."""
    from northdown._validation import check_choice
    from northdown.frames import check_frame
    from northdown.simulation.recordings import simulate_to_file

    check_choice("--motion", motion, tuple(MOTIONS))
    sensors = PRESETS[check_choice("--preset", preset, tuple(PRESETS))]
    length = read_number("--duration", duration, low=1.0, high=_LONGEST, unit="s")
    samples_per_second = read_number("--rate", rate, low=1.0, high=_FASTEST, unit="Hz")
    number = read_count("--seed", seed)
    axes = check_frame(frame)
    surroundings = _array(array, radius, misplacement, sensors.calibrated() if calibrated else sensors)
    if output != "-":
        check_target("--output", output, source="-", suffixes=SUFFIXES)
    name = f"simulated-{motion}-{preset}{'-calibrated' if calibrated else ''}-{number}"
    with _progress(round(length * samples_per_second) + 1) as progress:
        count = simulate_to_file(
            sys.stdout.buffer if output == "-" else output,
            length,
            rate=samples_per_second,
            seed=number,
            frame=axes,
            motion=motion,
            sensors=sensors.calibrated() if calibrated else sensors,
            name=name,
            progress=progress,
            **surroundings,
        )
    if output != "-":
        rows = [
            ("Recording", f"{name}, {count} samples, {length:g} s at {samples_per_second:g} Hz, truth in {axes}"),
            *([("Array", surroundings["array"].name or str(array))] if surroundings else []),
            ("Written", f"{output}, {os.path.getsize(Path(output)) / 1e6:.1f} MB"),
        ]
        console.facts(rows)


def _array(array: str | None, radius: str | None, misplacement: str, sensors: SensorErrors) -> dict[str, Any]:
    """An array of accelerometers like the preset's, for the simulation."""
    if array is None:
        if radius is not None or misplacement != "0":
            raise InputError(expected("--array with --radius and --misplacement", "these alone"))
        return {}
    from northdown.simulation import ArrayErrors

    own = read_geometry("--array", array, radius)
    if sensors.acc is None:
        raise InputError(expected("a --preset with an accelerometer for --array", "one without"))
    shift = read_number("--misplacement", misplacement, low=0.0, unit="m")
    return {"array": own, "array_errors": ArrayErrors.of(sensors.acc, misplacement=shift)}


@contextlib.contextmanager
def _progress(total: int) -> Iterator[Callable[[int], None] | None]:
    """Bar on standard error when that is a terminal and there is much to do."""
    if total < _MANY or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("simulating", total=total)
        yield lambda done: bar.update(task, completed=done)
