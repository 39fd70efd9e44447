"""How accurate the estimators are on public recordings with an optical reference, beside published figures and VQF.

    python benchmarks/accuracy.py [-e mahony,madgwick] [--data broad|repoimu] [--trials 1,3] [--root DIR]
                                  [--no-peers] [--flagship PARTS] [--json FILE]

The recordings are not part of northdown: --root, or the environment variable NORTHDOWN_DATA, names the folder that
has broad/ and repoimu/ in it. `--flagship all` goes on with all that flagship.py measures: coverage, ablation,
cross-validation and time of `calibrating-ekf`. See README.md in this folder.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

import _peers
import flagship
import northdown as nd

PUBLISHED = Path(__file__).resolve().parents[1] / "tests" / "reference" / "broad_published.json"
METRICS = ("total", "heading", "inclination")
CLIPPED = ("Test05", "Test10")

# Name under which Mahony runs once more, from the start of the published runs.
AS_PUBLISHED = "mahony from the published start"

Method = Callable[[nd.Recording], nd.Orientation]
Figures = dict[str, float]

console = Console(highlight=False, width=None if sys.stdout.isatty() else 160)


def estimators(names: str | None) -> dict[str, Method]:
    """Northdown's own that work with gyroscopes, with their defaults; and their smoothers, where there are any."""
    known = {name: chosen for name, chosen in nd.estimators.registry().items() if "array" not in chosen.needs}
    chosen = list(known) if names is None else [nd.estimators.get(n.strip()).name for n in names.split(",")]
    methods: dict[str, Method] = {}
    for name in chosen:
        methods[name] = lambda recording, name=name: known[name]().run(recording)
        if known[name].smooths:
            methods[f"{name}, offline"] = lambda recording, name=name: known[name]().smooth(recording)
    return methods


def mahony_as_published(recording: nd.Recording) -> nd.Orientation:
    """Mahony from where the published runs began.

    Their start has the axes of the frame, as seen from the body, for columns where they ought to be rows, and the
    wrong sign of north. The attitude forgets it in a few seconds, but the bias learnt meanwhile moves
    the figures by up to 0.4°.
    """
    from scipy.spatial.transform import Rotation

    up, field = recording.acc[0], recording.mag[0]
    x = np.cross(np.cross(up, -field), up)
    columns = [v / np.linalg.norm(v) for v in (x, np.cross(up, x), up)]
    start = Rotation.from_euler("z", 90.0, degrees=True) * Rotation.from_matrix(np.column_stack(columns))
    return nd.Mahony().run(recording, initial=start)


def peers() -> dict[str, Method]:
    """VQF, real time and offline, and its basic form."""
    vqf = _peers.find("vqf")
    if vqf is None:
        console.print(f"vqf: {_peers.INSTALL}")
        return {}

    def of(run: Callable[[nd.Recording, float], dict[str, np.ndarray]]) -> Method:
        return lambda recording: nd.Orientation(recording.time, run(recording, 1.0 / recording.rate)["quat9D"], "ENU")

    return {
        "vqf.BasicVQF": of(lambda r, period: vqf.BasicVQF(period).updateBatch(r.gyr, r.acc, r.mag)),
        "vqf.VQF": of(lambda r, period: vqf.VQF(period).updateBatch(r.gyr, r.acc, r.mag)),
        "vqf.offlineVQF": of(lambda r, period: vqf.offlineVQF(r.gyr, r.acc, r.mag, period)),
    }


def published(trials: Iterable[str]) -> dict[str, dict[str, Figures]]:
    """Figures that BROAD's authors published, by method and trial."""
    content = json.loads(PUBLISHED.read_text(encoding="utf-8"))
    return {
        f"{method} (published)": {t: content[method]["trials"][t] for t in trials if t in content[method]["trials"]}
        for method in ("mahony", "madgwick")
    }


def measure(method: Method, recording: nd.Recording) -> Figures | str:
    """RMSE in degrees of each metric, or why there is none."""
    try:
        summary = nd.attitude_error(method(recording), recording).rmse()
    except nd.NorthdownError as problem:
        return str(problem)
    return {m: getattr(summary, f"{m}_deg") for m in METRICS}


def load(data: str, name: str, root: Path) -> nd.Recording:
    if data == "broad":
        return nd.datasets.broad(name, root)
    match = re.search(r"Test(\d+)_(?:Trial(\d+)|Static)", name)
    if match is None:
        raise nd.InputError(f"expected a name such as TStick_Test02_Trial1, got {name!r}")
    return nd.datasets.repoimu(int(match[1]), int(match[2] or 1), root)


def groups(data: str, trials: Iterable[str]) -> dict[str, list[str]]:
    """Groups of trials over which means are formed."""
    names = list(trials)
    if data == "broad":
        parts = {g: [t for t in names if f"_{g}_" in t] for g in ("undisturbed", "disturbed")}
    else:
        parts = {"not clipped": [t for t in names if not any(c in t for c in CLIPPED)]}
    return {"all": names} | {k: v for k, v in parts.items() if v}


def show_trials(results: dict[str, dict[str, Figures]], trials: list[str]) -> None:
    table = Table(title="RMSE total, degrees", title_justify="left", title_style="bold")
    table.add_column("method")
    for trial in trials:
        table.add_column(trial.partition("_")[0] if trial[:2].isdigit() else trial, justify="right")
    for method, figures in results.items():
        table.add_row(method, *(f"{figures[t]['total']:.2f}" if t in figures else "–" for t in trials))
    console.print(table)


def show_means(results: dict[str, dict[str, Figures]], parts: dict[str, list[str]]) -> dict[str, dict[str, Figures]]:
    table = Table(title="Mean RMSE over trials, degrees", title_justify="left", title_style="bold")
    table.add_column("method")
    for part, names in parts.items():
        for metric in METRICS:
            table.add_column(f"{part} ({len(names)})\n{metric}", justify="right")
    means: dict[str, dict[str, Figures]] = {}
    for method, figures in results.items():
        cells = []
        for part, names in parts.items():
            have = [figures[t] for t in names if t in figures]
            complete = len(have) == len(names)
            values = {m: float(np.mean([f[m] for f in have])) for m in METRICS} if complete else {}
            means.setdefault(method, {})[part] = values
            cells += [f"{values[m]:.3f}" if complete else "–" for m in METRICS]
        table.add_row(method, *cells)
    console.print(table)
    return means


def main() -> int:
    """Run everything asked for and print it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-e", "--estimators", metavar="NAMES", help="comma-separated; all when not given")
    parser.add_argument("--data", choices=("broad", "repoimu"), default="broad")
    parser.add_argument("--trials", metavar="NUMBERS", help="BROAD trials or RepoIMU tests, comma-separated")
    parser.add_argument("--root", type=Path, default=os.environ.get("NORTHDOWN_DATA"), help="default: NORTHDOWN_DATA")
    parser.add_argument("--no-peers", action="store_true", help="northdown and published figures only")
    parser.add_argument(
        "--flagship", metavar="PARTS", help="also these parts of flagship.py, comma-separated, or all"
    )
    parser.add_argument("--json", metavar="FILE", type=Path, help="also write the figures there")
    options = parser.parse_args()
    if options.root is None:
        console.print("accuracy: skipped, as there are no recordings; set NORTHDOWN_DATA or give --root")
        return 0
    try:
        trials = list(nd.datasets.names(options.data, options.root))
        if options.trials:
            numbers = {int(n) for n in options.trials.split(",")}
            trials = [t for t in trials if int(re.search(r"\d+", t)[0]) in numbers]  # type: ignore[index]
        methods = estimators(options.estimators)
        if options.data == "broad" and "mahony" in methods:
            methods[AS_PUBLISHED] = mahony_as_published
        if not options.no_peers:
            methods |= peers()
    except (nd.NorthdownError, ValueError) as problem:
        console.print(f"accuracy: {problem}")
        return 1
    if not trials:
        console.print(f"accuracy: no such recordings of {options.data} in {options.root}")
        return 1

    results: dict[str, dict[str, Figures]] = {name: {} for name in methods}
    for trial in trials:
        recording = load(options.data, trial, options.root)
        for name, method in methods.items():
            figures = measure(method, recording)
            if isinstance(figures, str):
                console.print(f"{name}, {trial}: {figures}")
            else:
                results[name][trial] = figures
    if options.data == "broad":
        results |= published(trials)
    show_trials(results, trials)
    means = show_means(results, groups(options.data, trials))
    ours, theirs = results.get(AS_PUBLISHED, {}), results.get("mahony (published)", {})
    differences = [abs(ours[t][m] - theirs[t][m]) for t in ours if t in theirs for m in METRICS]
    if differences:
        console.print(
            f"{AS_PUBLISHED} differs from the published figures by at most {max(differences):.4f}° (bar 0.002°)"
        )
    found: dict[str, object] = {"trials": results, "means": means}
    if options.flagship:
        try:
            found["flagship"] = flagship.report(options.root, options.flagship)
        except ValueError as problem:
            console.print(f"accuracy: {problem}")
            return 1
    if options.json:
        options.json.write_text(json.dumps(found, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
