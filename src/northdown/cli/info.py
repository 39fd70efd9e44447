"""``northdown info``: what a recording holds, and what its check finds."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

import typer

from northdown.cli import console
from northdown.cli.reading import Reading, reads_recording
from northdown.errors import InputError

if TYPE_CHECKING:
    from northdown.arrays import AccelerometerArray
    from northdown.recording import Recording


@reads_recording
def info(
    reading: Reading,
    json: Annotated[bool, typer.Option("--json", help="Write JSON instead of text.")] = False,
) -> None:
    """Show what a recording holds, and what looks wrong in it."""
    recording = reading.load()
    if json:
        console.write_json(as_dict(reading, recording))
        return
    console.facts(_facts(reading, recording))
    print()
    findings = recording.check()
    for finding in findings:
        console.paragraph(f"{finding.severity}: {finding.message}")
    if not findings:
        print("The check found nothing to remark.")


def as_dict(reading: Reading, recording: Recording) -> dict[str, Any]:
    """Everything that is shown, for programs."""
    reference = recording.reference
    return {
        "file": reading.source,
        "format": format_name(reading),
        "name": recording.name,
        "samples": len(recording),
        "start": float(recording.time.min()) if len(recording) else None,
        "duration": recording.duration,
        "rate": recording.rate,
        "sensors": {sensor: {"missing": share} for sensor, share in missing(recording).items()},
        "array": None
        if recording.array is None
        else {"name": recording.array.name, "channels": list(recording.array.names)},
        "mag_unit": recording.mag_unit if recording.mag is not None else None,
        "frame": recording.frame,
        "reference": None
        if reference is None
        else {"samples": len(reference), "frame": reference.frame, "offset": recording.reference_offset},
        "movement": None if recording.movement is None else float(recording.movement.mean()),
        "findings": [
            {"kind": f.kind, "severity": f.severity, "message": f.message, "at": f.at} for f in recording.check()
        ],
    }


def format_name(reading: Reading) -> str | None:
    """Format of the file: as given, else by its content; None for standard input, which has been read already."""
    if reading.format is not None or reading.source == "-":
        return reading.format
    from northdown.io.source import open_source, recognise

    source = open_source(reading.source)
    return recognise(source.head, source.label)


def missing(recording: Recording) -> dict[str, float]:
    """Share (0 to 1) of samples at which each sensor of the recording has none."""
    import numpy as np

    return {
        sensor: float(np.isnan(getattr(recording, sensor)).any(axis=1).mean()) if len(recording) else 0.0
        for sensor in ("gyr", "acc", "mag", "array_acc")
        if getattr(recording, sensor) is not None
    }


def _facts(reading: Reading, recording: Recording) -> list[tuple[str, str]]:
    kind = format_name(reading)
    rows = [("Recording", f"{recording.name or reading.source}{f' ({kind})' if kind else ''}")]
    rows.append(("Samples", describe_samples(recording)))
    label = "Sensors"
    for sensor, share in missing(recording).items():
        there = "every sample" if share == 0.0 else f"{_percent(share)} missing"
        unit = ", unit unknown" if sensor == "mag" and recording.mag_unit == "arbitrary" else ""
        rows.append((label, f"{sensor.removesuffix('_acc')}  {there}{unit}"))
        label = ""
    if recording.array is not None:
        names = ", ".join(recording.array.names)
        rows.append(("Array", f"{recording.array.name or 'unnamed'}, {len(recording.array)} accelerometers: {names}"))
        rows.append(("", _worth(recording.array)))
    rows.append(("Frame", recording.frame))
    rows.append(("Reference", _reference(recording)))
    if recording.movement is not None:
        rows.append(("Movement", f"{_percent(float(recording.movement.mean()))} of the samples count for errors"))
    return rows


def _worth(array: AccelerometerArray) -> str:
    """Whether an array can stand in for a gyroscope."""
    from northdown.arrays import analyse

    try:
        found = analyse(array)
    except InputError as problem:
        return f"no substitute for a gyroscope: {problem}"
    return f"condition {found.condition:.3g}, angular noise {found.angular_dilution:.3g} rad/s² per m/s²"


def describe_samples(recording: Recording) -> str:
    """Number of samples, duration and rate in words."""
    n = len(recording)
    if n < 2:
        return f"{n}"
    rate = f"{recording.rate:.2f} Hz" if math.isfinite(recording.rate) else "no rate"
    return f"{n}, {recording.duration:.2f} s from {recording.time[0]:.2f} s on, {rate}"


def _reference(recording: Recording) -> str:
    reference = recording.reference
    if reference is None:
        return "none"
    offset = {
        "none": "no alignment needed",
        "heading": "heading to be aligned",
        "rotations": "world and body axes to be aligned",
    }[recording.reference_offset]
    return f"{len(reference)} samples in {reference.frame}; {offset}"


def _percent(share: float) -> str:
    percent = 100.0 * share
    return "less than 0.1 %" if 0.0 < percent < 0.1 else f"{percent:.1f} %"
