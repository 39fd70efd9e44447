"""What magnetometer calibration does to public recordings: the spread of the field's size before and after.

    python benchmarks/calibration.py [--root DIR] [--tolerance SHARE] [--plot FILE] [--heading] [--json FILE]

The recordings are not part of northdown: --root, or the environment variable NORTHDOWN_DATA, names the folder that
has any of broad/, repoimu/, ximu/ and fusion/ in it. --heading also runs `mekf` with and without calibration on those
with a reference.
See docs/calibration-on-real-data.md.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

import northdown as nd
from northdown.calibration import calibrate_magnetometer, coverage
from northdown.evaluation import attitude_error

console = Console(highlight=False, width=None if sys.stdout.isatty() else 160)

# Rates of recordings that have packet numbers for times.
XIMU_RATE = 256.0
# Tests of RepoIMU that drive the gyroscope beyond its range.
CLIPPED = ("05", "10")


@dataclass(frozen=True)
class Outcome:
    """One recording; spreads are relative, in %."""

    name: str
    seen: float
    before: float
    after: float
    held_before: float
    held_after: float
    sigma: float
    verdict: str

    @property
    def accepted(self) -> bool:
        """Whether there is a calibration."""
        return np.isfinite(self.after)


def recordings(root: Path) -> Iterator[tuple[str, nd.Recording]]:
    """All recordings in the folder that have a magnetometer."""
    for data, short in (("broad", "BROAD"), ("repoimu", "RepoIMU")):
        if not (root / data).is_dir():
            continue
        for name in nd.datasets.names(data, root):
            if data == "broad":
                number, _, words = name.partition("_")
                words = words.replace("undisturbed_", "").replace("disturbed_", "").replace("_", " ")
                yield f"{short} {number} {words}", nd.datasets.broad(name, root)
            else:
                _, test, trial = name.split("_")
                yield f"{short} {test[4:]}", nd.datasets.repoimu(int(test[4:]), int(trial[5:]), root)
    for path in sorted((root / "ximu").glob("*.csv")):
        yield "x-IMU walk", nd.read(path, rate=XIMU_RATE)
    for path in sorted((root / "fusion").glob("*.csv")):
        yield "Fusion example", nd.read(path)


def sizes(recording: nd.Recording) -> np.ndarray:
    """Size of the field, (N,), without missing samples."""
    size: np.ndarray = np.linalg.norm(recording.mag[~np.isnan(recording.mag).any(axis=1)], axis=1)
    return size


def spread(recording: nd.Recording) -> float:
    """Standard deviation of the field's size over all samples, % of its mean."""
    size = sizes(recording)
    return 100.0 * float(size.std() / size.mean())


def judge(name: str, recording: nd.Recording, tolerance: float | None) -> tuple[Outcome, nd.Recording | None]:
    """Calibrate, and say what came out; the corrected recording if there is one."""
    given = {} if tolerance is None else {"tolerance": tolerance}
    nothing = (float("nan"),) * 4
    before, missing = spread(recording), float("nan")
    try:
        calibration = calibrate_magnetometer(recording, **given)
    except nd.InputError as problem:
        got = str(problem).partition(", got ")[2].partition(";")[0]
        return Outcome(name, missing, before, *nothing, f"refused: {got}"), None
    part, evidence = calibration.mag, calibration.mag.evidence
    corrected = calibration.apply(recording)
    verdict = "accepted"
    if evidence.held_out_after >= evidence.held_out_before:
        verdict += ", no gain"
    elif spread(corrected) >= before:
        verdict += ", no gain over all samples"
    if any("no larger than their uncertainty" in note for note in evidence.notes):
        verdict += ", iron within its σ"
    sigma = 100.0 * float(part.offset_sigma.max()) / part.norm
    held = (100.0 * evidence.held_out_before / part.norm, 100.0 * evidence.held_out_after / part.norm)
    return Outcome(
        name,
        coverage(corrected.mag).share,
        before,
        spread(corrected),
        *held,
        sigma,
        verdict,
    ), corrected


def show(outcomes: list[Outcome]) -> None:
    table = Table(
        title="Spread of the field's size, % of it; held out: robust, over parts left out of the fit",
        title_justify="left",
        title_style="bold",
    )
    for column in (
        "recording",
        "directions\nseen",
        "all samples\nbefore → after",
        "held out\nbefore → after",
        "offset\n1-σ",
    ):
        table.add_column(column, justify="left" if column == "recording" else "right")
    table.add_column("verdict")
    for o in outcomes:
        if o.accepted:
            held = f"{o.held_before:.2f} → {o.held_after:.2f}"
            table.add_row(
                o.name, f"{o.seen:.0%}", f"{o.before:.2f} → {o.after:.2f}", held, f"{o.sigma:.1f} %", o.verdict
            )
        else:
            table.add_row(o.name, "", f"{o.before:.2f}", "", "", o.verdict)
    console.print(table)
    fine = [o for o in outcomes if o.accepted]
    better = sum(o.after < o.before for o in fine)
    held = sum(o.held_after < o.held_before for o in fine)
    console.print(
        f"{len(fine)} of {len(outcomes)} recordings are accepted; of these the spread falls in {better} over all "
        f"samples and in {held} over parts left out"
    )


def heading(recording: nd.Recording, judged: nd.Recording) -> float:
    """RMSE of mekf's heading in degrees over the movement of `judged`."""
    return float(attitude_error(nd.Mekf().run(recording), judged).rmse().heading_deg)


def heading_errors(recording: nd.Recording, tolerance: float | None) -> list[float | None]:
    """As it is and calibrated on itself; over the second half as it is and calibrated on the first."""
    given = {} if tolerance is None else {"tolerance": tolerance}
    half = len(recording) // 2
    late = np.arange(len(recording)) >= half
    moving = late if recording.movement is None else recording.movement & late
    row: list[float | None] = []
    for judged, learnt in ((recording, recording), (replace(recording, movement=moving), recording[:half])):
        row.append(heading(recording, judged))
        try:
            row.append(heading(calibrate_magnetometer(learnt, **given).apply(recording), judged))
        except nd.InputError:
            row.append(None)
    return row


def show_heading(root: Path, tolerance: float | None) -> dict[str, list[float | None]]:
    """Heading errors of mekf on recordings with a reference, and their means over those that are calibrated."""
    table = Table(title="RMSE of mekf's heading, degrees", title_justify="left", title_style="bold")
    table.add_column("recording")
    for column in ("as it is", "calibrated\non itself", "second half\nas it is", "calibrated on\nthe first half"):
        table.add_column(column, justify="right")
    results: dict[str, list[float | None]] = {}
    for name, recording in recordings(root):
        if recording.reference is None or (name.startswith("RepoIMU") and name[-2:] in CLIPPED):
            continue
        results[name] = heading_errors(recording, tolerance)
        table.add_row(name, *("refused" if v is None else f"{v:.2f}" for v in results[name]))
    table.add_section()
    for data in ("BROAD", "RepoIMU"):
        cells, counts = [], []
        for first in (0, 2):
            both = [
                r[first : first + 2] for n, r in results.items() if n.startswith(data) and r[first + 1] is not None
            ]
            counts.append(str(len(both)))
            cells += [f"{m:.2f}" for m in np.mean(both, axis=0)] if both else ["", ""]
        table.add_row(f"{data}, mean of those calibrated ({', '.join(counts)})", *cells)
    console.print(table)
    return results


def draw(outcomes: list[Outcome], pairs: dict[str, tuple[np.ndarray, np.ndarray | None]], path: Path) -> None:
    """Deviation of the field's size from its median, before and after, as bands of percentiles."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(11.0, 0.42 * len(outcomes) + 1.4), layout="constrained")
    colours = {"before": "#8a8f98", "after": "#0b6fa4"}
    for row, outcome in enumerate(outcomes):
        for key, size, dy in zip(colours, pairs[outcome.name], (-0.17, 0.17), strict=True):
            if size is None:
                continue
            off = 100.0 * (size / np.median(size) - 1.0)
            low, first, third, high = np.percentile(off, (2.5, 25.0, 75.0, 97.5))
            place = row + (dy if outcome.accepted else 0.0)
            axes.plot((low, high), (place, place), color=colours[key], linewidth=1.5)
            axes.plot((first, third), (place, place), color=colours[key], linewidth=6.0, solid_capstyle="butt")
        text = f"{outcome.before:.1f} → {outcome.after:.1f} %" if outcome.accepted else reason(outcome)
        axes.text(12.6, row, text, va="center", fontsize=8.5, color="black" if outcome.accepted else "#9c2f2f")
    for key, colour in colours.items():
        axes.plot([], [], color=colour, linewidth=6.0, label=key)
    axes.set_xlim(-12.0, 12.0)
    axes.set_ylim(len(outcomes) - 0.4, -0.6)
    axes.set_yticks(range(len(outcomes)), [o.name for o in outcomes], fontsize=9)
    axes.set_xlabel(
        "size of the field, deviation from its median, %\nbar: middle half of the samples; line: 95 % of them"
    )
    axes.set_title("Magnetometer calibration on real recordings; at the right the standard deviation", loc="left")
    axes.grid(axis="x", alpha=0.3)
    axes.legend(loc="upper right", fontsize=9, frameon=True)
    figure.savefig(path, dpi=110, bbox_inches="tight")
    plt.close(figure)


def reason(outcome: Outcome) -> str:
    """A refusal in a few words."""
    for sign, words in (
        ("no ellipsoid", "no ellipsoid fits"),
        ("close", "turned too little"),
        ("a plane", "turned too little"),
        ("uncertain", "too uncertain"),
        ("left out of the fit", "no gain on parts left out"),
        ("size fits for", "field not constant"),
    ):
        if sign in outcome.verdict:
            return f"{outcome.before:.1f} %; refused: {words}"
    return f"{outcome.before:.1f} %; refused"


def main() -> int:
    """Run everything asked for and print it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, default=os.environ.get("NORTHDOWN_DATA"), help="default: NORTHDOWN_DATA")
    parser.add_argument("--tolerance", type=float, help="as of calibrate_magnetometer; its default when not given")
    parser.add_argument("--plot", metavar="FILE", type=Path, help="draw the spread before and after")
    parser.add_argument("--heading", action="store_true", help="also what becomes of mekf's heading")
    parser.add_argument("--json", metavar="FILE", type=Path, help="also write the figures there")
    options = parser.parse_args()
    if options.root is None:
        console.print("calibration: skipped, as there are no recordings; set NORTHDOWN_DATA or give --root")
        return 0
    outcomes: list[Outcome] = []
    pairs: dict[str, tuple[np.ndarray, np.ndarray | None]] = {}
    try:
        for name, recording in recordings(options.root):
            outcome, corrected = judge(name, recording, options.tolerance)
            outcomes.append(outcome)
            pairs[name] = sizes(recording), None if corrected is None else sizes(corrected)
    except nd.NorthdownError as problem:
        console.print(f"calibration: {problem}")
        return 1
    if not outcomes:
        console.print(f"calibration: no recordings in {options.root}")
        return 1
    show(outcomes)
    turned = show_heading(options.root, options.tolerance) if options.heading else {}
    if options.plot:
        draw(outcomes, pairs, options.plot)
    if options.json:
        content = {"recordings": [asdict(o) for o in outcomes], "heading": turned}
        options.json.write_text(json.dumps(content, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
