"""Constant errors that nobody has calibrated: BROAD's trials with hard iron, or with a bias of the accelerometer.

    python benchmarks/offsets.py [--root DIR] [--part mag,acc,delivered] [--draws 3] [--json FILE]

To the magnetometer (the field has 45 to 49 µT) or the accelerometer of each trial a constant in a random direction
is added. Of the magnetometer it is heading that counts, of the accelerometer inclination, over samples in motion from
75 s on: by then the body has turned enough for the constant to show, or never does. `delivered` simulates a hand that
moves an accelerometer as delivered: bias 0.4 m/s², scale and misalignment 1 or 2 % (1σ, each axis). See README.md in
this folder.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import sys
from pathlib import Path

import numpy as np

import flagship
import northdown as nd
from northdown.simulation import measure, random_motion

FROM = 75.0
"""Time (s) after the beginning from which the error counts."""


@dataclasses.dataclass(frozen=True)
class Added:
    """What is added to a sensor, and what is looked at."""

    sizes: tuple[float, ...]
    unit: str
    diagnostic: str
    axes: slice
    what: str

    def error(self, estimate: nd.Orientation, truth: nd.Recording) -> tuple[float, float]:
        """RMS error (degrees), and the share (%) within three sigmas if the estimate has any."""
        error = nd.attitude_error(estimate, truth, mask=truth.time > truth.time[0] + FROM)
        share = np.nan
        if estimate.covariance is not None:
            sigma = np.sqrt(np.einsum("nii->ni", estimate.covariance[error.index]))
            share = 100.0 * float((np.abs(error.rotvec) < 3.0 * sigma)[:, self.axes].mean())
        return getattr(error.rmse(), f"{self.what}_deg"), share


SENSORS = {
    "mag": Added((3.0, 6.0, 12.0, 24.0), "µT", "mag_iron", slice(2, 3), "heading"),
    "acc": Added((0.1, 0.2, 0.4, 0.8), "m/s²", "acc_bias", slice(0, 2), "inclination"),
}


def table_of(sensor: str, recordings: list[nd.Recording], draws: int) -> dict[str, dict[str, list[list[float]]]]:
    """Print the table of one sensor; its figures."""
    added, methods = SENSORS[sensor], flagship.methods()
    rng = np.random.default_rng(3)
    rows: dict[str, list[str]] = {}
    found: dict[str, dict[str, list[list[float]]]] = {}
    for size in added.sizes:
        values: dict[str, list[list[float]]] = {name: [] for name in methods}
        for recording in recordings:
            for _ in range(draws):
                direction = rng.normal(size=3)
                constant = size * direction / np.linalg.norm(direction)
                changed = dataclasses.replace(recording, **{sensor: getattr(recording, sensor) + constant})
                for name, method in methods.items():
                    estimate = method(changed)
                    taken = estimate.diagnostics.get(added.diagnostic, np.zeros(1))[-1]
                    values[name].append([*added.error(estimate, recording), float(taken)])
        cells = []
        for name in methods:
            error, share, taken = np.array(values[name]).T
            cell = f"{np.median(error):.2f} ({error.mean():.2f})"
            if "calibrating" in name:
                cell += f"; {np.mean(taken > 0.0):.0%}; {share.mean():.0f} %"
            cells.append(cell)
        rows[f"{size:g} {added.unit}"] = cells
        found[f"{size:g}"] = values
    title = (
        f"Error of {added.what} after {FROM:g} s, degrees: median (mean) over {len(recordings)} trials × {draws}; "
        "of ours also: constant found; share within 3σ"
    )
    flagship.table(title, f"{sensor}, added", list(methods), rows)
    return found


def hand(seed: int, turn: float, percent: float) -> nd.Recording:
    """Two minutes of motion of a hand, turning by `turn` rad (1σ), of an accelerometer as delivered."""
    exact = measure(random_motion(120.0, seed, turn=turn, reach=0.05 + 0.07 * turn), rate=100.0, seed=seed)
    noise, errors = np.random.default_rng(seed), np.random.default_rng(100 + seed)
    matrix = np.eye(3) + 0.01 * percent * errors.normal(size=(3, 3))
    bias = 0.4 * errors.normal(size=3)
    return dataclasses.replace(
        exact,
        gyr=exact.gyr + 2e-3 * noise.normal(size=exact.gyr.shape),
        acc=exact.acc @ matrix.T + bias + 0.03 * noise.normal(size=exact.acc.shape),
        mag=exact.mag + 0.3 * noise.normal(size=exact.mag.shape),
    )


def delivered(sensors: int = 6) -> dict[str, dict[str, list[float]]]:
    """Print the table of sensors as delivered; total errors."""
    methods = flagship.methods()
    left = flagship.ours(acc_share=1.0)
    methods |= {"bias left in": left.run, "left in, smoothed": left.smooth}
    rows: dict[str, list[str]] = {}
    found: dict[str, dict[str, list[float]]] = {}
    for percent in (1.0, 2.0):
        for turn in (0.3, 1.0, 3.0):
            recordings = [hand(seed, turn, percent) for seed in range(sensors)]
            key = f"{percent:g} %, turns by {turn:g} rad"
            found[key] = {
                name: [nd.attitude_error(method(r), r).rmse().total_deg for r in recordings]
                for name, method in methods.items()
            }
            rows[key] = [f"{np.mean(v):.2f}" for v in found[key].values()]
    rows["mean"] = [f"{np.mean([v[name] for v in found.values()]):.2f}" for name in methods]
    title = f"Accelerometers as delivered: total error, degrees, mean over {sensors} sensors"
    flagship.table(title, "scale and misalignment", list(methods), rows)
    return found


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, default=os.environ.get("NORTHDOWN_DATA"), help="default: NORTHDOWN_DATA")
    parser.add_argument("--part", default="mag,acc,delivered", metavar="NAMES", help="comma-separated")
    parser.add_argument("--draws", type=int, default=3, help="directions of the constant for each trial and size")
    parser.add_argument("--json", metavar="FILE", type=Path, help="also write the figures there")
    options = parser.parse_args()
    parts = options.part.split(",")
    if unknown := [name for name in parts if name not in (*SENSORS, "delivered")]:
        flagship.console.print(f"offsets: expected parts out of mag, acc, delivered, got {', '.join(unknown)}")
        return 1
    found: dict[str, object] = {}
    if "delivered" in parts:
        found["delivered"] = delivered()
    sensors = [name for name in parts if name in SENSORS]
    if sensors and options.root is None:
        flagship.console.print(
            "offsets: mag and acc skipped, as there are no recordings; set NORTHDOWN_DATA or --root"
        )
    elif sensors:
        recordings = [nd.datasets.broad(name, options.root) for name in nd.datasets.names("broad", options.root)]
        found |= {sensor: table_of(sensor, recordings, options.draws) for sensor in sensors}
    if options.json:
        options.json.write_text(json.dumps(found, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
