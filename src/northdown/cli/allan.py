"""``northdown allan``: how noisy the sensors are, from a recording in which they lay still."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from northdown.cli import console, gate
from northdown.cli.output import FIGURE_SUFFIXES, check_target
from northdown.cli.reading import Reading, reads_recording
from northdown.errors import InputError, expected

if TYPE_CHECKING:
    from northdown.calibration.noise_model import AllanResult, Coefficient, Sensor
    from northdown.recording import Recording

_CHOICES = ("all", "gyr", "acc", "mag")
_WALKS = {"gyr": "angle random walk", "acc": "velocity random walk", "mag": ""}
# What of a recording's check matters for noise: a wrong unit or size of the numbers, and a wrong time.
_KINDS = ("time-unit", "time-rate", "time-duplicate")


@reads_recording
def allan(
    reading: Reading,
    sensor: Annotated[
        str, typer.Option("--sensor", metavar="gyr|acc|mag", help="Which sensor; all there are when not given.")
    ] = "all",
    ramp: Annotated[bool, typer.Option("--ramp", help="Fit a steady ramp too.")] = False,
    plot: Annotated[
        str | None,
        typer.Option(
            "--plot", metavar="FILE", help="Draw it: .png, .svg or .pdf; of several sensors, FILE-gyr and so on."
        ),
    ] = None,
    toml: Annotated[
        str | None, typer.Option("--toml", metavar="FILE", help="Write the noise parameters of filters.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Write JSON instead of text.")] = False,
    force: gate.Force = False,
) -> None:
    """Find a still sensor's noise from its Allan deviation.

    The longest part in which the sensor lay still is found, unless --start or --stop is given.
    """
    from northdown._validation import check_choice

    check_choice("--sensor", sensor, _CHOICES)
    if plot is not None:
        check_target("--plot", plot, source=reading.source, suffixes=FIGURE_SUFFIXES)
    if toml is not None:
        check_target("--toml", toml, source=reading.source, suffixes=(".toml",))
    recording = reading.load()
    _admit(recording, sensor, force=force)
    whole = reading.start is not None or reading.stop is not None
    results, failed = _identify(recording, sensor, ramp=ramp, whole=whole)
    written = _write(results, plot, toml)
    for name, problem in failed.items():
        console.warn(f"warning: {name} is left out: {problem}")
    if json:
        console.write_json(_as_dict(recording, results, failed))
        return
    _print(results, written)


def _admit(recording: Recording, sensor: str, *, force: bool) -> None:
    """Stop for an error of unit or time, warn of a warning; what else a check finds is no matter for noise."""
    kinds = [*_KINDS, *(f"{s}-{what}" for s in _CHOICES[1:] if sensor in ("all", s) for what in ("unit", "size"))]
    for finding in recording.check():
        if finding.kind not in kinds or finding.severity == "note":
            continue
        if finding.severity == "error" and not force:
            raise InputError(f"{finding.message}; --force goes on all the same")
        console.warn(f"warning: {finding.message}")


def _identify(
    recording: Recording, sensor: str, *, ramp: bool, whole: bool
) -> tuple[list[AllanResult], dict[str, str]]:
    """Noise of the sensors asked for; of several, those without a result are told with the reason."""
    from northdown.calibration.noise import identify_noise

    sensors: tuple[Sensor, ...] = ("gyr", "acc", "mag")
    wanted = [s for s in sensors if sensor == s or (sensor == "all" and getattr(recording, s) is not None)]
    results: list[AllanResult] = []
    failed: dict[str, str] = {}
    for name in wanted:
        try:
            # as a part of the recording was chosen, all of it is meant
            start = float(recording.time[0]) if whole else None
            results.append(identify_noise(recording, name, start=start, ramp=ramp))
        except InputError as problem:
            failed[name] = str(problem)
    if not results:
        raise InputError(next(iter(failed.values()), expected("a sensor in the recording", "none")))
    return results, failed


def _write(results: list[AllanResult], plot: str | None, toml: str | None) -> list[str]:
    written = []
    if plot is not None:
        from northdown import plots

        for result in results:
            target = Path(plot)
            if len(results) > 1:
                target = target.with_name(f"{target.stem}-{result.sensor}{target.suffix}")
            plots.save(plots.allan(result), target)
            written.append(str(target))
    if toml is not None:
        from northdown.calibration.noise_parameters import write_noise_toml

        write_noise_toml(results, toml)
        written.append(toml)
    return written


def _as_dict(recording: Recording, results: list[AllanResult], failed: dict[str, str]) -> dict[str, Any]:
    from northdown.calibration.noise_parameters import noise_parameters

    return {
        "recording": recording.name,
        "sensors": {result.sensor: result.to_dict() for result in results},
        "parameters": noise_parameters(results),
        "failed": failed,
    }


def _print(results: list[AllanResult], written: list[str]) -> None:
    from northdown.calibration.noise_parameters import noise_parameters

    print(console.one_line(f"Noise of {results[0].name or 'the recording'} at rest"))
    for result in results:
        samples = int(result.curve.lengths.sum())
        span = f"{result.start:.2f} s to {result.stop:.2f} s"
        print(f"\n{result.sensor}: {span}, {samples} samples at {result.curve.rate:.2f} Hz\n")
        percent = f"{100.0 * result.confidence:g} % interval"
        console.table(("Axis", "Coefficient", "Value", percent, "Unit"), _rows(result), left=2)
        remarks = (*_reasons(result), *result.notes)
        if remarks:
            print()
        for text in remarks:
            console.paragraph(f"note: {text}")
    print()
    parameters = noise_parameters(results)
    rows = [("For filters" if k == 0 else "", f"{n} = {v:.4g}") for k, (n, v) in enumerate(parameters.items())]
    if written:
        rows.append(("Written", ", ".join(written)))
    console.facts(rows)


def _rows(result: AllanResult) -> Iterator[tuple[str, ...]]:
    """One line for each coefficient of each axis, in the units of data sheets."""
    shown = {c.symbol for model in result.axes for c in model if c.value is not None} | {"N", "B", "K"}
    for model in result.axes:
        axis = model.axis
        for c in model:
            if c.symbol not in shown:
                continue
            name = f"{c.symbol} {c.name}"
            for unit in result.units(c.symbol):
                low, high = _digits(unit.factor * c.low), _digits(unit.factor * c.high)
                if c.value is None:
                    yield axis, name, "-", f"at most {high}" if math.isfinite(c.high) else "", unit.name
                else:
                    yield axis, name, _digits(unit.factor * c.value), f"{low} to {high}", unit.name
                # the same once more, under the name that data sheets of this unit give it
                axis, name = "", f"  as {_WALKS[result.sensor]}"


def _digits(value: float) -> str:
    """Three digits, with their zeros."""
    return f"{value:.0f}" if 1e3 <= value < 1e6 else f"{value:#.3g}".removesuffix(".")


def _reasons(result: AllanResult) -> Iterator[str]:
    """Why coefficients are not determined, axes of one reason together."""
    found: dict[tuple[str, str], list[str]] = {}
    for model in result.axes:
        for c in (c for c in model if _matters(c)):
            found.setdefault((f"{c.symbol} {c.name}", c.reason), []).append(model.axis)
    for (name, reason), axes in found.items():
        yield f"{name} of {', '.join(axes)}: {reason}"


def _matters(c: Coefficient) -> bool:
    return c.value is None and c.symbol in ("N", "B", "K")
