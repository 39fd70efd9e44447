"""What linear acceleration and a distorted field do to heading and inclination, on recordings and on simulations.

    python benchmarks/disturbances.py [--part broad,simulated,gravity,vehicle] [--root DIR] [--runs 5]
                                      [--scenarios "NAME;…"] [--plot DIR] [--json FILE]

`broad`: the disturbed trials of BROAD, and all trials without magnetometer (--root, or NORTHDOWN_DATA, names the
folder that has broad/ in it).
`simulated`: magnets and manoeuvres with known truth, as many runs of each as --runs says, of different seeds (see
_scenarios.py). `gravity`: gyroscopes whose bias changes with attitude. In these, every estimator has its defaults.
`vehicle`: what one changed parameter makes of sustained accelerations, and what it costs elsewhere. --plot draws each
trial, and the first run of each scenario.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

import _disturbance_figures
import northdown as nd
from _scenarios import SCENARIOS, Case, feeling
from northdown.evaluation import AttitudeError

PARTS = ("broad", "simulated", "gravity", "vehicle")
TRIALS = {
    25: "tapping",
    27: "phone vibration",
    29: "stationary magnet B",
    31: "stationary magnet D",
    33: "attached magnet 2 cm",
    35: "attached magnet 4 cm",
}
METHODS: dict[str, Callable[[nd.Recording], nd.Orientation]] = {
    "mahony": lambda r: nd.Mahony().run(r),
    "mekf": lambda r: nd.MEKF().run(r),
    "vqf": lambda r: nd.VQF().run(r),
    "vqf offline": lambda r: nd.VQF().smooth(r),
    "calibrating-ekf": lambda r: nd.CalibratingEKF().run(r),
    "calibrating-ekf offline": lambda r: nd.CalibratingEKF().smooth(r),
}
# What levels more slowly, by its estimator's own parameter.
VEHICLE: dict[str, Callable[[nd.Recording], nd.Orientation]] = {
    "mekf": METHODS["mekf"],
    "mekf acc_noise=3": lambda r: nd.MEKF(acc_noise=3.0).run(r),
    "mekf acc_noise=10": lambda r: nd.MEKF(acc_noise=10.0).run(r),
    "vqf": METHODS["vqf"],
    "vqf tau_acc=10": lambda r: nd.VQF(tau_acc=10.0).run(r),
    "vqf tau_acc=30": lambda r: nd.VQF(tau_acc=30.0).run(r),
    "calibrating-ekf": METHODS["calibrating-ekf"],
    "calibrating-ekf speed_noise=0.5": lambda r: nd.CalibratingEKF(speed_noise=0.5).run(r),
    "calibrating-ekf speed_noise=2": lambda r: nd.CalibratingEKF(speed_noise=2.0).run(r),
}
PER_G = (0.0, 0.005, 0.01, 0.02, 0.05, 0.1)  # °/s
VEHICLE_SCENARIOS = ("car in town", "long level turn", "long banked turn", "fast hand", "no disturbance")
SETTLED = 20.0  # s from the start of a simulation that do not count
FINAL = 30.0  # s at the end of a simulation that are also reported alone
LOST = 20.0  # ° of heading, over these, with which a run counts as lost

Figures = dict[str, float]
Results = dict[str, dict[str, Figures]]  # by row and method
Scenarios = dict[str, Callable[[int], Case]]
Methods = dict[str, Callable[[nd.Recording], nd.Orientation]]

console = Console(highlight=False, width=None if sys.stdout.isatty() else 170)


def estimates(recording: nd.Recording, methods: Methods = METHODS) -> dict[str, nd.Orientation]:
    return {name: method(recording) for name, method in methods.items()}


def share(mask: np.ndarray) -> float:
    """Part of the samples, %; NaN of none."""
    return 100.0 * float(mask.mean()) if mask.size else float("nan")


def within(estimate: nd.Orientation, error: AttitudeError) -> Figures:
    """Share of the samples within 3σ, %: about the vertical, and the worse of the two horizontal axes."""
    if estimate.covariance is None:
        return {}
    sigma = np.sqrt(np.einsum("nii->ni", estimate.covariance[error.index]))
    inside = np.abs(error.rotvec) < 3.0 * sigma
    return {"heading within": share(inside[:, 2]), "tilt within": float(min(share(inside[:, i]) for i in (0, 1)))}


def rmse(error: AttitudeError, prefix: str = "") -> Figures:
    summary = error.rmse()
    return {f"{prefix}heading": summary.heading_deg, f"{prefix}inclination": summary.inclination_deg}


def flagged(estimate: nd.Orientation, mask: np.ndarray, where: str) -> Figures:
    flags = estimate.flags[mask]
    return {
        f"mag {where}": share((flags & nd.Flag.MAG_REJECTED) != 0),
        f"acc {where}": share((flags & nd.Flag.ACC_REJECTED) != 0),
    }


# ---- recordings ----


def broad(root: Path, plot: Path | None) -> Results:
    found: Results = {}
    for number, words in TRIALS.items():
        recording = nd.datasets.broad(number, root)
        runs = estimates(recording)
        errors = {name: nd.attitude_error(run, recording) for name, run in runs.items()}
        row = f"{number} {words}"
        found[row] = {
            name: rmse(errors[name])
            | within(run, errors[name])
            | flagged(run, np.isin(np.arange(len(run)), errors[name].index), "all")
            for name, run in runs.items()
        }
        if plot is not None:
            _disturbance_figures.draw(plot / f"broad-{number}.png", f"BROAD {row}", runs, errors)
    return found


def without_magnetometer(root: Path) -> Results:
    """Mean over all trials; heading counts from the start, that is, its constant part is taken out."""
    each: list[dict[str, Figures]] = []
    for name in nd.datasets.names("broad", root):
        recording = dataclasses.replace(nd.datasets.broad(name, root), mag=None)
        runs = estimates(recording)
        each.append({m: rmse(nd.attitude_error(o, recording, alignment="heading")) for m, o in runs.items()})
    keys = ("heading", "inclination")
    means = {m: {k: float(np.mean([e[m][k] for e in each])) for k in keys} for m in METHODS}
    return {f"{len(each)} trials": means}


# ---- simulations ----


def judge(case: Case, run: nd.Orientation) -> Figures:
    time = case.recording.time
    counted = time >= SETTLED
    error = nd.attitude_error(run, case.recording.reference, mask=counted)
    last = nd.attitude_error(run, case.recording.reference, mask=time >= time[-1] - FINAL)
    return (
        rmse(error)
        | rmse(last, "final ")
        | {"lost": float(last.rmse().heading_deg > LOST)}
        | within(run, error)
        | flagged(run, counted & case.disturbed, "disturbed")
        | flagged(run, counted & ~case.disturbed, "else")
    )


def simulated(scenarios: Scenarios, runs: int, plot: Path | None = None, methods: Methods = METHODS) -> Results:
    found: Results = {}
    for name, scenario in scenarios.items():
        each: list[dict[str, Figures]] = []
        for seed in range(1, runs + 1):
            case = scenario(seed)
            done = estimates(case.recording, methods)
            each.append({method: judge(case, run) for method, run in done.items()})
            if plot is not None and seed == 1:
                counted = case.recording.time >= SETTLED
                errors = {m: nd.attitude_error(o, case.recording.reference, mask=counted) for m, o in done.items()}
                target = plot / f"simulated-{name.replace(',', '').replace(' ', '-')}.png"
                _disturbance_figures.draw(target, f"{name} (simulated)", done, errors, case.disturbed)
        found[name] = {method: pooled([e[method] for e in each]) for method in methods}
    return found


def pooled(runs: list[Figures]) -> Figures:
    """Errors as the root of the mean square over the runs, shares as their mean, lost runs as their number."""
    keys = runs[0]
    values = {k: np.array([r[k] for r in runs]) for k in keys}
    angle = ("heading", "inclination", "final heading", "final inclination")
    means = {k: float(np.sqrt(np.mean(v * v)) if k in angle else np.mean(v)) for k, v in values.items()}
    return means | {"lost": float(values["lost"].sum())}


# ---- tables ----


def show(title: str, results: Results, keys: tuple[str, ...], form: str) -> None:
    """One row for each recording, one column for each method that has these figures."""
    first = next(iter(results.values()))
    methods = [m for m in first if any(k in first[m] for k in keys)]
    table = Table(title=title, title_justify="left", title_style="bold")
    table.add_column("")
    for method in methods:
        table.add_column(method.replace(" ", "\n"), justify="right")
    for row, figures in results.items():
        table.add_row(row, *(" / ".join(number(figures[m].get(k), form) for k in keys) for m in methods))
    console.print(table)


def number(value: float | None, form: str) -> str:
    return "–" if value is None or np.isnan(value) else format(value, form)


def show_broad(results: Results) -> None:
    show("BROAD: RMSE of heading / inclination, degrees", results, ("heading", "inclination"), ".2f")
    show("BROAD: within 3σ, %: heading / tilt", results, ("heading within", "tilt within"), ".1f")
    show("BROAD: samples flagged, %: MAG_REJECTED / ACC_REJECTED", results, ("mag all", "acc all"), ".0f")


def show_simulated(results: Results, runs: int) -> None:
    of = f"{runs} runs each"
    show(f"RMSE of heading / inclination, degrees; {of}", results, ("heading", "inclination"), ".2f")
    show(f"The same, last {FINAL:.0f} s", results, ("final heading", "final inclination"), ".2f")
    show(f"Runs that end more than {LOST:.0f}° off in heading; {of}", results, ("lost",), ".0f")
    show("Within 3σ, %: heading / tilt", results, ("heading within", "tilt within"), ".1f")
    show("MAG_REJECTED, % of samples: disturbed / else", results, ("mag disturbed", "mag else"), ".0f")
    show("ACC_REJECTED, % of samples: disturbed / else", results, ("acc disturbed", "acc else"), ".0f")


def cost_on_broad(root: Path) -> Results:
    """Mean total error over the trials of BROAD, which have no sustained acceleration, degrees."""
    recordings = [nd.datasets.broad(name, root) for name in nd.datasets.names("broad", root)]
    mean = {
        name: {"total": float(np.mean([nd.attitude_error(method(r), r).rmse().total_deg for r in recordings]))}
        for name, method in VEHICLE.items()
    }
    return {f"{len(recordings)} trials": mean}


def show_vehicle(results: Results, runs: int) -> None:
    keys = ("heading", "inclination")
    show(f"One parameter changed: RMSE of heading / inclination, degrees; {runs} runs each", results, keys, ".1f")
    show("Within 3σ, %: heading / tilt", results, ("heading within", "tilt within"), ".0f")


def main() -> int:
    """Run the parts asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", default=",".join(PARTS), metavar="NAMES")
    parser.add_argument("--root", type=Path, default=os.environ.get("NORTHDOWN_DATA"), help="default: NORTHDOWN_DATA")
    parser.add_argument("--runs", type=int, default=5, help="of each scenario")
    parser.add_argument("--scenarios", metavar="NAMES", help=f"of {'; '.join(SCENARIOS)}; separated by semicolons")
    parser.add_argument("--plot", metavar="DIR", type=Path, help="write figures (.png) there")
    parser.add_argument("--json", metavar="FILE", type=Path, help="also write the figures there")
    options = parser.parse_args()
    parts = options.part.split(",")
    names = [n.strip() for n in options.scenarios.split(";")] if options.scenarios else list(SCENARIOS)
    if unknown := [n for n in parts if n not in PARTS] + [n for n in names if n not in SCENARIOS]:
        console.print(f"disturbances: unknown: {', '.join(unknown)}; see --help")
        return 1
    runs = max(1, options.runs)
    if options.plot:
        options.plot.mkdir(parents=True, exist_ok=True)
    found: dict[str, Results] = {}
    if "broad" in parts and options.root is None:
        console.print("broad: skipped, as there are no recordings; set NORTHDOWN_DATA or give --root")
    elif "broad" in parts:
        show_broad(found.setdefault("broad", broad(options.root, options.plot)))
        found["without magnetometer"] = without_magnetometer(options.root)
        title = "BROAD without magnetometer: mean RMSE of heading (aligned) / inclination, degrees"
        show(title, found["without magnetometer"], ("heading", "inclination"), ".2f")
    if "simulated" in parts:
        found["simulated"] = simulated({n: SCENARIOS[n] for n in names}, runs, options.plot)
        show_simulated(found["simulated"], runs)
    if "gravity" in parts:
        rows: Scenarios = {f"{g:g} °/s per g": partial(feeling, per_g=g) for g in PER_G}
        found["gravity"] = simulated(rows, runs)
        title = f"Gyroscope that feels gravity: RMSE of heading / inclination, degrees; {runs} runs each"
        show(title, found["gravity"], ("heading", "inclination"), ".2f")
    if "vehicle" in parts:
        found["vehicle"] = simulated({n: SCENARIOS[n] for n in VEHICLE_SCENARIOS}, runs, methods=VEHICLE)
        show_vehicle(found["vehicle"], runs)
        if options.root is not None:
            found["cost"] = cost_on_broad(options.root)
            show("What it costs on BROAD: mean total error, degrees", found["cost"], ("total",), ".2f")
    if options.json:
        options.json.write_text(json.dumps(found, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
