"""An estimate in a few labelled lines, in degrees."""

from __future__ import annotations

from typing import TYPE_CHECKING

from northdown.cli import console
from northdown.cli.parameters import describe
from northdown.cli.runs import warnings_of

if TYPE_CHECKING:
    from northdown.estimators import Estimator
    from northdown.evaluation import AttitudeError
    from northdown.orientation import Orientation
    from northdown.recording import Recording

_ALIGNED = {
    "none": "not aligned",
    "heading": "after aligning heading (a lower bound)",
    "rotations": "after aligning axes (a lower bound)",
}


def summarise(
    recording: Recording, estimator: Estimator, orientation: Orientation, *, offline: bool = False
) -> list[tuple[str, str]]:
    """Labelled lines: what was run, where it ended, how sure it is, and its error where the truth is known."""
    rows = [
        ("Recording", f"{recording.name or 'standard input'}, {len(recording)} samples, {recording.duration:.1f} s"),
        ("Estimator", estimator.name + _settings(estimator) + (", offline" if offline else "")),
    ]
    if not len(orientation):
        return rows
    roll, pitch, yaw = orientation.as_euler(degrees=True)[-1]
    rows.append(("At the end", f"roll {roll:.2f}°, pitch {pitch:.2f}°, yaw {yaw:.2f}° (body to {orientation.frame})"))
    rows += _certainty(orientation)
    if "mag_iron" in orientation.diagnostics and (iron := orientation.diagnostics["mag_iron"][-1]) > 0.0:
        rows.append(("Magnetometer", f"hard iron of {iron:.1f} µT taken out"))
    if "acc_bias" in orientation.diagnostics and (bias := orientation.diagnostics["acc_bias"][-1]) > 0.0:
        rows.append(("Accelerometer", f"bias of {bias:.2f} m/s² taken out"))
    if recording.reference is not None:
        rows += _error(recording, orientation)
    flagged = ", ".join(f"{name}: {count}" for name, count in flag_counts(orientation).items())
    if flagged:
        rows.append(("Flagged", f"{flagged} samples"))
    return rows


def _settings(estimator: Estimator) -> str:
    """All parameters when they are few, else those that are not at their defaults."""
    known = describe(type(estimator))
    values = {name: getattr(estimator, name) for name in known}
    if len(known) > 3:
        values = {name: value for name, value in values.items() if value != known[name].default}
    text = ", ".join(f"{name}={known[name].show(value)}" for name, value in values.items())
    if text:
        return f" ({text})"
    return " (defaults)" if known else ""


def _certainty(orientation: Orientation) -> list[tuple[str, str]]:
    """Standard deviation of the attitude and the gyroscope's bias at the end, for methods that know them."""
    import numpy as np

    rows: list[tuple[str, str]] = []
    if orientation.covariance is not None:
        # the vertical is the third axis of every frame
        x, y, z = np.diag(orientation.covariance[-1])
        tilt, heading = np.rad2deg(np.sqrt(x + y)), np.rad2deg(np.sqrt(z))
        rows.append(("1 sigma", f"tilt {tilt:.2f}°, heading {heading:.2f}°"))
    if orientation.gyr_bias is not None:
        bias = [f"{value:.3f}" for value in np.rad2deg(orientation.gyr_bias[-1])]
        if orientation.gyr_bias_sigma is not None:
            sigma = np.rad2deg(orientation.gyr_bias_sigma[-1])
            bias = [f"{value} ± {s:.3f}" for value, s in zip(bias, sigma, strict=True)]
        rows.append(("Gyro bias", ", ".join(f"{axis} {v}" for axis, v in zip("xyz", bias, strict=True)) + " °/s"))
    return rows


def _error(recording: Recording, orientation: Orientation) -> list[tuple[str, str]]:
    from northdown.errors import InputError
    from northdown.evaluation import attitude_error

    try:
        error = attitude_error(orientation, recording)
    except InputError as problem:
        return [("RMS error", f"none: {problem}")]
    for finding in warnings_of(error):
        console.warn(f"warning: {finding.message}")
    rms = error.rmse()
    parts = f"heading {rms.heading_deg:.2f}°, inclination {rms.inclination_deg:.2f}°"
    return [
        ("RMS error", f"{rms.total_deg:.2f}° ({parts})"),
        ("", f"over {len(error)} of {len(orientation)} samples, {_ALIGNED[_kind(error)]}"),
    ]


def _kind(error: AttitudeError) -> str:
    return "none" if error.alignment is None else error.alignment.kind


def flag_counts(orientation: Orientation) -> dict[str, int]:
    """How many samples carry each flag, for those that occur."""
    from northdown.orientation import Flag

    counts = {flag.name.lower().replace("_", " "): int(orientation.has(flag).sum()) for flag in Flag if flag.name}
    return {name: count for name, count in counts.items() if count}
