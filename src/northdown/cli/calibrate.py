"""``northdown calibrate``: find what a sensor is to be corrected by, and write it to a file."""

from __future__ import annotations

import dataclasses
import functools
from typing import TYPE_CHECKING, Annotated, Any

import typer

from northdown.cli import console
from northdown.cli.gate import Force
from northdown.cli.numbers import read_number
from northdown.cli.output import FIGURE_SUFFIXES, check_target
from northdown.cli.reading import Reading, reads_recording, same_file
from northdown.errors import InputError, expected

if TYPE_CHECKING:
    from northdown.calibration.model import Calibration
    from northdown.calibration.part import SensorCalibration
    from northdown.recording import Recording

_SENSORS = ("mag", "acc", "gyr")
# Options that concern one sensor only.
_OF = {"--field": "mag", "--turn-to": "mag", "--gravity": "acc"}
# What of a recording's check matters here; a wrong size or a varying field is what calibration is for.
_KINDS = ("time-unit", "time-rate", "time-backwards", "gyr-unit", "acc-unit")
# By what the rotation to a sensor's axes is found.
_METHODS = {"gyr": "gyr", "acc": "dip"}
_STANDARD_GRAVITY = "9.80665"


@reads_recording
def calibrate(
    reading: Reading,
    sensor: Annotated[str, typer.Argument(metavar="mag|acc|gyr", help="Which sensor.")],
    more: Annotated[
        list[str] | None, typer.Argument(metavar="REC", help="Further recordings of the same sensor.")
    ] = None,
    output: Annotated[
        str | None, typer.Option("--output", "-o", metavar="FILE", help="Write the calibration: .toml or .json.")
    ] = None,
    field: Annotated[
        str | None,
        typer.Option("--field", metavar="UT", help="mag: local field in µT; kept as it is when not given."),
    ] = None,
    turn_to: Annotated[
        str | None,
        typer.Option("--turn-to", metavar="gyr|acc", help="mag: find the rotation to this sensor's axes too."),
    ] = None,
    gravity: Annotated[
        str, typer.Option("--gravity", metavar="M/S2", help="acc: local gravity.")
    ] = _STANDARD_GRAVITY,
    tolerance: Annotated[
        str | None,
        typer.Option(
            "--tolerance", metavar="SHARE", help="Accept a larger uncertainty (1-σ) than usual, such as 0.1."
        ),
    ] = None,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="Draw before and after: .png, .svg or .pdf.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Write JSON instead of text.")] = False,
    force: Force = False,
) -> None:
    """Find a sensor's offset, scale and axes from recordings.

    mag: turned slowly about all axes. acc: at rest in nine positions or more. gyr: at rest; with turns between rests
    also scale and alignment. What --calibration names is applied first, and written together with what is found.
    """
    from northdown._validation import check_choice

    check_choice("the sensor", sensor, _SENSORS)
    if turn_to is not None:
        check_choice("--turn-to", turn_to, tuple(_METHODS))
    given = {
        "--field": field is not None,
        "--turn-to": turn_to is not None,
        "--gravity": gravity != _STANDARD_GRAVITY,
    }
    wrong = [name for name, is_given in given.items() if is_given and _OF[name] != sensor]
    if wrong:
        raise InputError(expected(f"{wrong[0]} with {_OF[wrong[0]]} only", sensor, do="leave it out"))
    sources = [*(more or []), reading.source]
    _check_targets(output, plot, sources)
    numbers = _numbers(field, gravity, tolerance)
    if reading.remap is not None:
        raise InputError(expected("the sensor's own axes", f"--remap {reading.remap}", do="leave it out here"))
    first = _load(reading.calibration)
    recordings = [dataclasses.replace(reading, source=source, calibration=None).load() for source in sources]
    for recording in recordings:
        _admit(recording, sensor, force=force)
    if first is not None:
        recordings = [_corrected(first, recording) for recording in recordings]
    steps = _find(sensor, recordings, turn_to, numbers)
    found = functools.reduce(lambda one, other: one.then(other), steps)
    whole = found if first is None else first.then(found)
    written = _write(whole, found, recordings, output, plot)
    if json:
        console.write_json(_as_dict(found, steps, recordings))
        return
    _print(found, steps, recordings, written)


def _check_targets(output: str | None, plot: str | None, sources: list[str]) -> None:
    from northdown.calibration.files import SUFFIXES

    for source in sources:
        if output is not None:
            check_target("--output", output, source=source, suffixes=SUFFIXES)
        if plot is not None:
            check_target("--plot", plot, source=source, suffixes=FIGURE_SUFFIXES)
    if sources.count("-") > 1:
        raise InputError(expected("standard input once", "twice"))
    for i, one in enumerate(sources):
        if any(same_file(one, other) for other in sources[:i]):
            raise InputError(expected("each recording once", f"{one!r} twice"))


def _numbers(field: str | None, gravity: str, tolerance: str | None) -> dict[str, float]:
    """Options as the library's arguments; those not given are left to it."""
    numbers = {"gravity": read_number("--gravity", gravity, low=9.0, high=10.5, unit="m/s²")}
    if field is not None:
        numbers["field"] = read_number("--field", field, above=0.0, unit="µT")
    if tolerance is not None:
        numbers["tolerance"] = read_number("--tolerance", tolerance, low=1e-6, high=0.1)
    return numbers


def _admit(recording: Recording, sensor: str, *, force: bool) -> None:
    """Stop for errors of unit or time."""
    for finding in recording.check():
        concerned = finding.kind.partition("-")[0] in ("time", sensor)
        if finding.kind in _KINDS and concerned and finding.severity == "error":
            if not force:
                raise InputError(f"{finding.message}; --force goes on all the same")
            console.warn(f"warning, forced: {finding.message}")


def _load(path: str | None) -> Calibration | None:
    if path is None:
        return None
    from northdown.calibration import load

    return load(path)


def _corrected(first: Calibration, recording: Recording) -> Recording:
    """Apply a calibration that may be of other sensors only."""
    if any(getattr(recording, part.sensor) is not None for part in first.parts):
        return first.apply(recording)
    return recording


def _find(
    sensor: str, recordings: list[Recording], turn_to: str | None, numbers: dict[str, float]
) -> list[Calibration]:
    """What is found, step by step: each is for recordings to which those before it were applied."""
    from northdown import calibration

    chosen: dict[str, Any] = {"tolerance": numbers["tolerance"]} if "tolerance" in numbers else {}
    if sensor == "acc":
        return [calibration.calibrate_accelerometer(recordings, gravity=numbers["gravity"], **chosen)]
    if sensor == "gyr":
        return [calibration.calibrate_gyroscope(recordings, **chosen)]
    iron = calibration.calibrate_magnetometer(recordings, field=numbers.get("field"), **chosen)
    if turn_to is None:
        return [iron]
    corrected = [iron.apply(recording) for recording in recordings]
    return [iron, calibration.align_magnetometer(corrected, method=_METHODS[turn_to], **chosen)]


def _write(
    whole: Calibration, found: Calibration, recordings: list[Recording], output: str | None, plot: str | None
) -> list[str]:
    written = []
    if output is not None:
        from northdown.calibration import save

        save(whole, output)
        written.append(output)
    if plot is not None:
        from northdown.plots._calibration import calibration as draw
        from northdown.plots._save import save as save_figure

        save_figure(draw(found, recordings), plot)
        written.append(plot)
    return written


def _as_dict(found: Calibration, steps: list[Calibration], recordings: list[Recording]) -> dict[str, Any]:
    part = found.parts[0]
    return {
        "sensor": part.sensor,
        "recordings": [recording.name for recording in recordings],
        "unit": part.unit,
        "offset": part.offset.tolist(),
        "offset_sigma": part.offset_sigma.tolist(),
        "matrix": part.matrix.tolist(),
        "matrix_sigma": part.matrix_sigma.tolist(),
        "norm": part.norm,
        "steps": [dataclasses.asdict(step.parts[0].evidence) for step in steps],
    }


def _print(found: Calibration, steps: list[Calibration], recordings: list[Recording], written: list[str]) -> None:
    from northdown.calibration.words import evidence_rows, rows

    part = found.parts[0]
    names = ", ".join(recording.name or "standard input" for recording in recordings)
    facts = [("Recording" if len(recordings) == 1 else "Recordings", names), *rows(part)]
    for step in steps:
        facts += evidence_rows(step.parts[0].evidence)
    if written:
        facts.append(("Written", ", ".join(written)))
    console.facts(facts)
    print()
    for note in part.evidence.notes:
        console.paragraph(f"note: {note}")
    console.paragraph(_advice(part, written))


def _advice(part: SensorCalibration, written: list[str]) -> str:
    """What to do next."""
    if not written or not written[0].endswith((".toml", ".json")):
        return "Write it with -o cal.toml, and use it with: northdown estimate REC --calibration cal.toml"
    return f"Use it with: northdown estimate REC --calibration {written[0]}"
