"""J14's table 1 made again in simulation: 7200 s at rest, the quaternion EKF beside the Euler UKF.

    python benchmarks/j14.py [--duration SECONDS] [--seeds N]

What is simulated, and what the columns are, stands in `northdown.evaluation.reproduce_j14`; the result is told in
docs/guides/j14-ekf-and-ukf.md.
"""

from __future__ import annotations

import argparse
import math
import sys

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.spatial.transform import Rotation

from northdown.evaluation import reproduce_j14 as j14

CASES = {
    "calibrated": {},
    "calibrated, no drift of the bias": {"drift": False},
    "as in the data sheets, not calibrated": {"calibrated": False},
}

console = Console(highlight=False, width=None if sys.stdout.isatty() else 110)


def steady(title: str, options: dict[str, bool], duration: float, seeds: int) -> None:
    """Table 1 of one case: root mean squares over the seeds, as the sign of a bias is chance."""
    rows: dict[tuple[str, str], list[j14.AngleStatistics]] = {}
    for seed in range(seeds):
        recording = j14.board(duration, seed, **options)
        for name, filter_ in j14.filters().items():
            found = j14.statistics(j14.angle_errors(filter_.run(recording), recording))
            for angle, row in found.items():
                rows.setdefault((angle, name), []).append(row)
    table = Table(title=f"{title}: degrees, rms over {seeds} seeds", title_justify="left", title_style="bold")
    for column in ("angle", "filter", "std", "bias", "error", "least", "most", "J14 std", "J14 bias", "J14 error"):
        table.add_column(column, justify="left" if column in ("angle", "filter") else "right")
    for (angle, name), found in rows.items():
        errors = [row.error for row in found]
        theirs = [f"{v:.4f}" for v in j14.PUBLISHED[angle].get(name, ())]
        means = [math.sqrt(np.mean(np.square(v))) for v in ([r.std for r in found], [r.bias for r in found], errors)]
        table.add_row(angle, name, *(f"{v:.4f}" for v in (*means, min(errors), max(errors))), *theirs)
    console.print(table)


def start(seeds: int) -> None:
    """How long each filter takes from a start that is wrong by 10° in tilt and 20° in heading."""
    wrong = Rotation.from_rotvec([10.0, 10.0, 20.0], degrees=True) * Rotation.from_euler("z", 90.0, degrees=True)
    table = Table(title=f"Wrong start: s until the error stays below 1° and 0.3°, medians of {seeds} seeds")
    for column in ("σ of the start", "filter", "1°", "0.3°"):
        table.add_column(column, justify="right")
    recordings = [j14.board(60.0, seed) for seed in range(seeds)]
    for sigma in (0.2, 0.05, 0.01, 0.002):
        for name, filter_ in j14.filters(sigma).items():
            errors = [j14.angle_errors(filter_.run(r, initial=wrong), r) for r in recordings]
            times = [np.median([j14.settling_time(e, limit) for e in errors]) for limit in (1.0, 0.3)]
            table.add_row(f"{math.degrees(sigma):.2g}°", name, *(f"{t:.2f}" for t in times))
    console.print(table)


def main() -> None:
    """Run everything and print it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--duration", type=float, default=7200.0, help="s; J14's 7200 when not given")
    parser.add_argument("--seeds", type=int, default=5, help="runs of each case")
    options = parser.parse_args()
    for title, case in CASES.items():
        steady(title, case, options.duration, options.seeds)
    start(max(options.seeds, 11))


if __name__ == "__main__":
    main()
