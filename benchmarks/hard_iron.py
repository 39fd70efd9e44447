"""Hard iron that nobody has calibrated: heading of BROAD's trials with iron added to the body.

    python benchmarks/hard_iron.py [--root DIR] [--draws 3] [--json FILE]

To the magnetometer of each trial a constant is added, of 3 to 24 µT in a random direction (the field has 45 to 49).
Heading counts from 75 s on, over samples in motion: by then the body has turned enough for iron to show, or never
does. See README.md in this folder.
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

SIZES = (3.0, 6.0, 12.0, 24.0)
FROM = 75.0
"""Time (s) after the beginning from which heading counts."""


def heading(estimate: nd.Orientation, truth: nd.Recording) -> tuple[float, float]:
    """RMS error of heading (degrees), and the share (%) within three sigmas if the estimate has any."""
    error = nd.attitude_error(estimate, truth, mask=truth.time > truth.time[0] + FROM)
    share = np.nan
    if estimate.covariance is not None:
        sigma = np.sqrt(estimate.covariance[error.index, 2, 2])
        share = 100.0 * float((np.abs(error.rotvec[:, 2]) < 3.0 * sigma).mean())
    return error.rmse().heading_deg, share


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, default=os.environ.get("NORTHDOWN_DATA"), help="default: NORTHDOWN_DATA")
    parser.add_argument("--draws", type=int, default=3, help="directions of the iron for each trial and size")
    parser.add_argument("--json", metavar="FILE", type=Path, help="also write the figures there")
    options = parser.parse_args()
    if options.root is None:
        flagship.console.print("hard_iron: skipped, as there are no recordings; set NORTHDOWN_DATA or give --root")
        return 0
    recordings = [nd.datasets.broad(name, options.root) for name in nd.datasets.names("broad", options.root)]
    methods = flagship.methods()
    rng = np.random.default_rng(3)
    rows: dict[str, list[str]] = {}
    found: dict[str, dict[str, list[list[float]]]] = {}
    for size in SIZES:
        values: dict[str, list[list[float]]] = {name: [] for name in methods}
        for recording in recordings:
            for _ in range(options.draws):
                direction = rng.normal(size=3)
                iron = size * direction / np.linalg.norm(direction)
                magnetic = dataclasses.replace(recording, mag=recording.mag + iron)
                for name, method in methods.items():
                    estimate = method(magnetic)
                    taken = estimate.diagnostics["mag_iron"][-1] if "mag_iron" in estimate.diagnostics else 0.0
                    values[name].append([*heading(estimate, recording), float(taken)])
        cells = []
        for name in methods:
            error, share, taken = np.array(values[name]).T
            cell = f"{np.median(error):.1f} ({error.mean():.1f})"
            if "calibrating" in name:
                cell += f"; {np.mean(taken > 0.0):.0%}; {share.mean():.0f} %"
            cells.append(cell)
        rows[f"{size:g} µT"] = cells
        found[f"{size:g}"] = values
    title = (
        f"Heading error after {FROM:g} s, degrees: median (mean) over {len(recordings)} trials × {options.draws}; "
        "of ours also: iron found; share within 3σ"
    )
    flagship.table(title, "iron added", list(methods), rows)
    if options.json:
        options.json.write_text(json.dumps(found, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
