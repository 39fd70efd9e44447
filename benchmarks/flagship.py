"""The calibrating filter against VQF: accuracy, ablations, coverage, cross-validation and time, in one run.

    python benchmarks/flagship.py [--root DIR] [--part accuracy,ablation,coverage,iron,time,delay,cross,…]
                                   [--json FILE]

One set of parameters for everything. `cross` chooses the parameters anew for each trial that is left out, from the
same start and on the other trials only, by the cross-entropy method (see `_search.py`); what is reported is the error
on the trial that was left out. The cost is the mean logarithm of the errors, real time and smoothed; RepoIMU takes
part as a guard. It takes an hour and a half for each of its three seeds, which run beside each other. `delay` and
`cross-delay` tell the filter the gyroscope's delay as the other trials show it by their reference: a calibration of
the sensor and no default. `cross-delay` takes as long again and is left out of `all`. See README.md in this folder.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import dataclasses
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.spatial.transform import Rotation

import _bands
import _peers
import _search
import _timing
import northdown as nd
from northdown.evaluation import AttitudeError, ClockOffset

CLIPPED = ("Test05", "Test10")
# Some reference samples of these trials are plainly wrong (errors of up to 130° that every method shares).
BAD_REFERENCE = ("Test03", "Test06")
SPOILED = np.deg2rad(6.0)

# From where `cross` starts, and what it may change: one significant digit each, by order of magnitude.
START = {
    "gyr_scale": 1e-4,
    "gyr_bias_walk": 1e-4,
    "acc_noise": 0.01,
    "acc_motion": 1e-3,
    "speed_noise": 0.1,
    "speed_motion": 0.1,
    "mag_noise": 0.02,
    "norm_gate": 0.1,
    "dip_gate": 0.05,
    "gate_power": 2.0,
    "field_window": 100.0,
    "rest_noise": 2e-4,
    "rest_offset": 1e-4,
    "gyr_matrix": 1e-3,
    "mag_delay_sigma": 0.02,
    "smooth_walk": 1.0,
}
GUARD = 0.5
"""Weight of RepoIMU's mean error beside BROAD's in the choice."""

SEEDS = (1, 2, 3)
"""Of the points that `cross` draws; what it reports is the mean over them."""

ABLATIONS = {
    "as it is": {},
    "no gyroscope matrix": {"gyr_matrix": 0.0},
    "no magnetometer delay": {"mag_delay_sigma": 0.0},
    "no magnetic gate": {"gate_power": 0.0},
    "gate by the moment": {"gate_window": 0.0},
    "gate reference follows (10 s)": {"field_window": 10.0},
    "no rest detection": {"rest_gyr": 0.0},
    "no rest offset": {"rest_offset": 0.0},
    "no growth with motion": {"acc_motion": 0.0, "speed_motion": 0.0},
    "no growth with rate": {"gyr_scale": 0.0},
    "no second pass": {"heading_outlier": 0.0, "smooth_walk": 1.0},
    "second pass, headings alike": {"heading_outlier": 0.0},
    "second pass, same bias walk": {"smooth_walk": 1.0},
}

Method = Callable[[nd.Recording], nd.Orientation]
console = Console(highlight=False, width=None if sys.stdout.isatty() else 170)


@dataclasses.dataclass(frozen=True)
class Trial:
    """A recording, its group, and its true attitude in NED at the samples that count.

    Where the rotations of the reference have to be found, `truth` has those that fit the smoothed estimate best.
    """

    name: str
    recording: nd.Recording
    group: str
    index: np.ndarray
    truth: np.ndarray

    def error(self, estimate: nd.Orientation, clock: ClockOffset | str = "as recorded") -> AttitudeError:
        """Error, aligned to this estimate; of trials with a spoiled reference without those samples."""
        mask = None
        if any(bad in self.name for bad in BAD_REFERENCE):
            mask = np.zeros(len(estimate), bool)
            mask[self.index] = True
        return nd.attitude_error(estimate, self.recording, mask=mask, clock=clock)

    def total(self, estimate: nd.Orientation) -> float:
        """Total RMSE, degrees, of an estimate in NED by `truth`: quick, for searches."""
        cosine = np.abs(np.einsum("ni,ni->n", estimate.quat[self.index], self.truth))
        half = np.arccos(np.minimum(cosine, 1.0))
        return float(np.rad2deg(2.0 * np.sqrt(np.mean(half * half))))


def load(root: Path) -> list[Trial]:
    recordings = []
    for name in nd.datasets.names("broad", root):
        group = "undisturbed" if "_undisturbed_" in name else "disturbed"
        recordings.append((name, nd.datasets.broad(name, root), group))
    for name in nd.datasets.names("repoimu", root):
        if not any(c in name for c in CLIPPED):
            recordings.append((name, nd.datasets.repoimu(int(name[11:13]), int(name[-1]), root), "RepoIMU"))
    return [prepare(*r) for r in recordings]


def prepare(name: str, recording: nd.Recording, group: str) -> Trial:
    estimate = ours().smooth(recording, frame="NED")
    error = nd.attitude_error(estimate, recording)
    truth = Rotation.from_rotvec(-error.rotvec) * estimate.rotation[error.index]
    keep = np.ones(len(error), bool)
    if any(bad in name for bad in BAD_REFERENCE):
        keep = error.total < SPOILED
    return Trial(name, recording, group, error.index[keep], np.roll(truth.as_quat(), 1, axis=1)[keep])


def ours(**parameters: float) -> nd.CalibratingEKF:
    return nd.CalibratingEKF(**parameters)


def methods() -> dict[str, Method]:
    found: dict[str, Method] = {
        "calibrating-ekf": lambda r: ours().run(r),
        "calibrating-ekf, smoothed": lambda r: ours().smooth(r),
        "mekf": lambda r: nd.MEKF().run(r),
    }
    vqf = _peers.find("vqf")
    if vqf is None:
        console.print(f"vqf: {_peers.INSTALL}")
        return found

    def orientation(r: nd.Recording, result: dict[str, np.ndarray]) -> nd.Orientation:
        return nd.Orientation(r.time, result["quat9D"], "ENU")

    found["vqf.VQF"] = lambda r: orientation(r, vqf.VQF(1.0 / r.rate).updateBatch(r.gyr, r.acc, r.mag))
    found["vqf.offlineVQF"] = lambda r: orientation(r, vqf.offlineVQF(r.gyr, r.acc, r.mag, 1.0 / r.rate))
    return found


def figures(error: AttitudeError) -> tuple[float, float, float]:
    e = error.rmse()
    return e.total_deg, e.heading_deg, e.inclination_deg


def means(trials: list[Trial], values: np.ndarray) -> dict[str, np.ndarray]:
    """Mean over the trials of each group; BROAD is both of its groups."""
    group = np.array([t.group for t in trials])
    chosen = {"BROAD": group != "RepoIMU", **{g: group == g for g in ("undisturbed", "disturbed", "RepoIMU")}}
    return {name: values[mask].mean(axis=0) for name, mask in chosen.items() if mask.any()}


def table(title: str, first: str, columns: list[str], rows: dict[str, list[str]]) -> None:
    shown = Table(title=title, title_justify="left", title_style="bold")
    shown.add_column(first)
    for column in columns:
        shown.add_column(column, justify="right")
    for name, cells in rows.items():
        shown.add_row(name, *cells)
    console.print(shown)


def accuracy(trials: list[Trial]) -> dict[str, object]:
    offsets = [nd.clock_offset(t.recording) for t in trials]
    results, aligned = {}, {}
    for name, method in methods().items():
        estimates = [method(t.recording) for t in trials]
        results[name] = np.array([figures(t.error(e)) for t, e in zip(trials, estimates, strict=True)])
        aligned[name] = np.array(
            [figures(t.error(e, clock)) for t, e, clock in zip(trials, estimates, offsets, strict=True)]
        )
    rows = {t.name: ["{:.2f} ({:.2f}, {:.2f})".format(*results[m][k]) for m in results] for k, t in enumerate(trials)}
    for name in means(trials, np.zeros((len(trials), 3))):
        rows[f"mean {name}"] = ["{:.3f} ({:.3f}, {:.3f})".format(*means(trials, v)[name]) for v in results.values()]
    table("RMSE total (heading, inclination), degrees, clocks as recorded", "trial", list(results), rows)
    rows = {}
    for name in means(trials, np.zeros((len(trials), 3))):
        rows[f"mean {name}"] = ["{:.3f} ({:.3f}, {:.3f})".format(*means(trials, v)[name]) for v in aligned.values()]
    table("The same with clocks aligned, each trial by its own offset, all methods alike", "of", list(aligned), rows)
    clocks(trials, offsets)
    errors = {m: {t.name: list(v[k]) for k, t in enumerate(trials)} for m, v in results.items()}
    errors |= {f"{m}, clocks aligned": {t.name: list(v[k]) for k, t in enumerate(trials)} for m, v in aligned.items()}
    return errors | {"clock offset": {t.name: [c.offset, c.sigma] for t, c in zip(trials, offsets, strict=True)}}


def clocks(trials: list[Trial], offsets: list[ClockOffset]) -> None:
    """What the offsets of the trials have in common, and the error of an estimate that has no other."""
    both = list(zip(trials, offsets, strict=True))
    made = {t.name: of_offset(t, c.offset) for t, c in both}
    rows = {t.name: [f"{1e3 * c.offset:+.3f}", f"{1e3 * c.sigma:.3f}", f"{made[t.name]:.3f}"] for t, c in both}
    for name, group in (
        ("BROAD", {"undisturbed", "disturbed"}),
        ("undisturbed", {"undisturbed"}),
        ("RepoIMU", {"RepoIMU"}),
    ):
        chosen = [(1e3 * c.offset, made[t.name]) for t, c in both if t.group in group]
        if len(chosen) > 1:
            found, inclination = np.array(chosen).T
            cells = [f"{found.mean():+.3f}", f"{found.std(ddof=1):.3f} (scatter)", f"{inclination.mean():.3f}"]
            rows[f"mean {name}"] = cells
    table("Gyroscope behind the reference, ms", "trial", ["offset", "sigma", "inclination by it alone, °"], rows)


def of_offset(trial: Trial, offset: float) -> float:
    """RMS error of inclination (degrees) of the truth itself when its clock is off by so much (s)."""
    truth = Rotation.from_quat(np.roll(trial.truth, -1, axis=1))
    late = truth * Rotation.from_rotvec(offset * trial.recording.gyr[trial.index]) * truth.inv()
    _, x, y, _ = np.roll(late.as_quat(), 1, axis=1).T
    inclination = 2.0 * np.arcsin(np.minimum(np.hypot(x, y), 1.0))
    return float(np.rad2deg(np.sqrt(np.mean(inclination**2))))


def ablation(trials: list[Trial]) -> dict[str, object]:
    rows, found = {}, {}
    for name, changed in ABLATIONS.items():
        filter_ = ours(**changed)
        totals = np.array([_totals(filter_, t) for t in trials])
        m = means(trials, totals)
        rows[name] = [f"{m[g][0]:.2f} / {m[g][1]:.2f}" for g in m]
        found[name] = {g: list(v) for g, v in m.items()}
    table("Without one mechanism: mean total, real time / smoothed, degrees", "filter", list(m), rows)
    return found


def delays(trials: list[Trial]) -> list[float]:
    """Delay (s) of each trial's gyroscope, as the other trials of BROAD's sensor show it; 0 for RepoIMU's."""
    found = np.array([nd.clock_offset(t.recording).offset for t in trials])
    broad = np.array([t.group != "RepoIMU" for t in trials])
    others = [broad & (np.arange(len(trials)) != k) for k in range(len(trials))]
    return [float(found[o].mean()) if here and o.any() else 0.0 for here, o in zip(broad, others, strict=True)]


def delay_given(trials: list[Trial]) -> dict[str, object]:
    """Accuracy, clocks as recorded, when the filter is told the gyroscope's delay: one number for a sensor."""
    values = {"real time": [], "smoothed": []}
    for trial, delay in zip(trials, delays(trials), strict=True):
        for name, way in (("real time", "run"), ("smoothed", "smooth")):
            values[name].append(figures(trial.error(getattr(ours(gyr_delay=delay), way)(trial.recording))))
    grouped = {name: means(trials, np.array(v)) for name, v in values.items()}
    rows = {
        f"mean {group}": ["{:.3f} ({:.3f}, {:.3f})".format(*grouped[name][group]) for name in values]
        for group in grouped["smoothed"]
    }
    title = "RMSE total (heading, inclination), degrees, clocks as recorded, gyr_delay from the other trials"
    table(title, "of", list(values), rows)
    return {name: {t.name: list(e) for t, e in zip(trials, v, strict=True)} for name, v in values.items()}


def _totals(filter_: nd.CalibratingEKF, trial: Trial, delay: float = 0.0) -> tuple[float, float]:
    """Total error, real time and smoothed; RepoIMU by the rotations found beforehand."""
    r, filter_ = trial.recording, dataclasses.replace(filter_, gyr_delay=delay)
    return trial.total(filter_.run(r, frame="NED")), trial.total(filter_.smooth(r, frame="NED"))


BANDS = {"filter": {}, "heading": {"heading_sigma": 1.0}, "time": {"time_sigma": 1.0}}
NOTHING = {"inflation": 1.0, "tilt_sigma": 0.0, "heading_sigma": 0.0, "time_sigma": 0.0}


def bands(trial: Trial, recording: nd.Recording | None = None) -> list[_bands.Band]:
    """In real time and smoothed; of another recording than the trial's own if given."""
    found = []
    for run in ("run", "smooth"):
        squares: dict[str, np.ndarray] = {}
        for part, changed in BANDS.items():
            estimate = getattr(ours(**(NOTHING | changed)), run)(recording or trial.recording)
            error = trial.error(estimate)
            squares[part] = np.einsum("nii->ni", estimate.covariance[error.index])
        heading, late = (squares[part] - squares["filter"] for part in ("heading", "time"))
        found.append(_bands.Band(error.rotvec, squares["filter"], heading, late))
    return found


def defaults() -> tuple[float, ...]:
    return tuple(getattr(ours(), name) for name in _bands.GRID)


def coverage(trials: list[Trial]) -> dict[str, object]:
    """Shares within three sigmas: by trial, over the samples of all, and with constants chosen without the trial."""
    all_bands = [bands(t) for t in trials]
    repo = np.array([t.group == "RepoIMU" for t in trials])
    good = np.array([not any(bad in t.name for bad in BAD_REFERENCE) for t in trials])
    groups = {"all samples, BROAD": ~repo, "all samples, RepoIMU 02, 04, 07, 08": repo & good}
    groups = {name: mask for name, mask in groups.items() if mask.any()}
    values = np.array([[b.share(*defaults()) for b in pair] for pair in all_bands])
    columns = ["real time", "smoothed"]
    pooled = _bands.pooled(all_bands, values, groups)
    rows = {t.name: _bands.words(v) for t, v in zip(trials, values, strict=True)}
    rows |= {name: _bands.words(v) for name, v in pooled.items()}
    table("Share of samples within 3σ, %: x, y (tilt), z (heading)", "trial", columns, rows)
    console.print("of {} shares, {} from 95 to 99.9 %, {} below, {} above".format(values.size, *_bands.count(values)))
    chosen = _bands.chosen_without(all_bands, groups)
    left = np.array([[b.share(*c) for b in pair] for c, pair in zip(chosen, all_bands, strict=True)])
    rows = {
        f"{t.name}: {', '.join(f'{n} {v:g}' for n, v in zip(_bands.GRID, c, strict=True))}": _bands.words(v)
        for t, c, v in zip(trials, chosen, left, strict=True)
        if c != defaults()
    }
    rows |= {name: _bands.words(v) for name, v in _bands.pooled(all_bands, left, groups).items()}
    table("The same, constants chosen without the trial; trials for which they differ", "over", columns, rows)
    console.print("of {} shares, {} from 95 to 99.9 %, {} below, {} above".format(left.size, *_bands.count(left)))
    found = {t.name: v.tolist() for t, v in zip(trials, values, strict=True)}
    return found | {name: v.tolist() for name, v in pooled.items()} | {"left out": left.tolist()}


def iron(trials: list[Trial], draws: int = 3) -> dict[str, object]:
    """Heading band of BROAD's trials with iron on the body that they do not have: 1 µT (1σ) on each axis."""
    rng = np.random.default_rng(1)
    found: dict[str, list[tuple[float, float, float, float]]] = {"real time": [], "smoothed": []}
    for trial in (t for t in trials if t.group != "RepoIMU"):
        for _ in range(draws):
            magnetic = dataclasses.replace(trial.recording, mag=trial.recording.mag + rng.normal(0.0, 1.0, 3))
            for way, band in zip(found, bands(trial, magnetic), strict=True):
                error, sigma = np.rad2deg(band.error[:, 2]), np.rad2deg(np.sqrt(band.variance(*defaults())[:, 2]))
                share = 100.0 * float((np.abs(error) < 3.0 * sigma).mean())
                found[way].append((len(error), share, float(np.mean(error**2)), float(np.mean(sigma**2))))
    rows = {}
    for way, values in found.items():
        size, share, error2, sigma2 = np.array(values).T
        alike = np.corrcoef(np.sqrt(error2), np.sqrt(sigma2))[0, 1]
        cells = (np.average(share, weights=size), np.sqrt(error2.mean()), np.sqrt(sigma2.mean()), alike)
        rows[way] = ["{:.1f}", "{:.2f}", "{:.2f}", "{:.2f}"]
        rows[way] = [text.format(v) for text, v in zip(rows[way], cells, strict=True)]
    columns = ["within 3σ, %", "RMS error, °", "RMS σ, °", "correlation of both over the runs"]
    table("Heading with iron on the body", "BROAD", columns, rows)
    return dict(found)


def cross(trials: list[Trial], known_delay: bool = False) -> dict[str, object]:
    """Leave one trial of BROAD out, choose on the others, report on the one left out; mean over the seeds."""
    delay = delays(trials) if known_delay else [0.0] * len(trials)
    with concurrent.futures.ProcessPoolExecutor(min(len(SEEDS), os.cpu_count() or 1)) as workers:
        found = list(workers.map(_cross_of_seed, [trials] * len(SEEDS), [delay] * len(SEEDS), SEEDS))
    names = [t.name for t in trials if t.group != "RepoIMU"]
    held = np.array([[f["left out"][name] for name in names] for f in found])
    everything = np.array([[f["chosen on all"][name] for name in names] for f in found])
    start = np.array([found[0]["at the start"][name] for name in names])
    rows = {name: _both(held[:, k].mean(axis=0)) for k, name in enumerate(names)}
    rows["mean, left out"] = _both(held.mean(axis=(0, 1)))
    rows["mean, chosen on all"] = _both(everything.mean(axis=(0, 1)))
    rows["mean, at the start"] = _both(start.mean(axis=0))
    rows |= {f"seed {s}, left out": _both(h.mean(axis=0)) for s, h in zip(SEEDS, held, strict=True)}
    rows |= {f"seed {s}, chosen on all": _both(e.mean(axis=0)) for s, e in zip(SEEDS, everything, strict=True)}
    table("Left-out error, total, degrees, mean over the seeds", "left out", ["real time", "smoothed"], rows)
    return {f"seed {s}": f for s, f in zip(SEEDS, found, strict=True)}


def _both(values: np.ndarray) -> list[str]:
    return [f"{v:.3f}" for v in values]


def _cross_of_seed(trials: list[Trial], delay: list[float], seed: int) -> dict[str, dict[str, object]]:
    """Errors of each trial left out, and of all by the choice on all, with the points drawn from one seed."""
    guard = np.array([t.group == "RepoIMU" for t in trials])

    def errors(point: _search.Point) -> np.ndarray:
        return np.array([_totals(ours(**point), t, d) for t, d in zip(trials, delay, strict=True)])

    def costs(point: _search.Point) -> np.ndarray:
        return np.log(errors(point)).sum(axis=1)

    def allowed(point: _search.Point) -> bool:
        try:
            ours(**point)
        except nd.InputError:
            return False
        return True

    search = _search.Search(START, costs, allowed, seed)

    def choose(out: int) -> _search.Point:
        weight = np.where(guard, GUARD / max(guard.sum(), 1), 1.0)
        weight[~guard] /= (~guard).sum() - (out >= 0)
        weight[[out] if out >= 0 else []] = 0.0
        return search.choose(weight)

    choices = {trials[k].name: choose(int(k)) for k in np.flatnonzero(~guard)}
    everything = choose(-1)
    held = {t.name: list(errors(choices[t.name])[k]) for k, t in enumerate(trials) if t.name in choices}
    return {
        "left out": held,
        "chosen on all": {t.name: list(e) for t, e in zip(trials, errors(everything), strict=True)},
        "at the start": {t.name: list(e) for t, e in zip(trials, errors(START), strict=True)},
        "choices": choices | {"all": everything},
    }


def speed(trials: list[Trial]) -> dict[str, object]:
    vqf = _peers.find("vqf")
    if vqf is None:
        return {}
    r = max((t.recording for t in trials), key=len)
    period = 1.0 / r.rate
    cases = {
        "run": lambda: ours().run(r),
        "VQF": lambda: vqf.VQF(period).updateBatch(r.gyr, r.acc, r.mag),
        "smooth": lambda: ours().smooth(r),
        "offlineVQF": lambda: vqf.offlineVQF(r.gyr, r.acc, r.mag, period),
    }
    times = _timing.take_turns(cases, 9)
    found = {
        "run / VQF": _timing.ratio(times["run"], times["VQF"]),
        "smooth / offlineVQF": _timing.ratio(times["smooth"], times["offlineVQF"]),
    }
    rows = {k: [f"{v:.2f}", bar] for (k, v), bar in zip(found.items(), ("2", "1.2"), strict=True)}
    table(f"Time as a ratio, {len(r)} samples", "of", ["median", "bar"], rows)
    return found


PARTS = {
    "accuracy": accuracy,
    "ablation": ablation,
    "coverage": coverage,
    "iron": iron,
    "time": speed,
    "delay": delay_given,
    "cross": cross,
    "cross-delay": lambda trials: cross(trials, known_delay=True),
}


def report(root: Path, names: str) -> dict[str, object]:
    """Print the parts of these names, comma-separated, or all but the second search; what they found.

    Raises
    ------
    ValueError
        When a name is none of a part.
    """
    chosen = [name for name in PARTS if name != "cross-delay"] if names == "all" else names.split(",")
    if unknown := [name for name in chosen if name not in PARTS]:
        raise ValueError(f"expected parts out of {', '.join(PARTS)}, got {', '.join(unknown)}")
    trials = load(root)
    return {name: PARTS[name](trials) for name in chosen}


def main() -> int:
    """Run the parts asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, default=os.environ.get("NORTHDOWN_DATA"), help="default: NORTHDOWN_DATA")
    parser.add_argument("--part", default="all", metavar="NAMES")
    parser.add_argument("--json", metavar="FILE", type=Path, help="also write the figures there")
    options = parser.parse_args()
    if options.root is None:
        console.print("flagship: skipped, as there are no recordings; set NORTHDOWN_DATA or give --root")
        return 0
    try:
        found = report(options.root, options.part)
    except ValueError as problem:
        console.print(f"flagship: {problem}")
        return 1
    if options.json:
        options.json.write_text(json.dumps(found, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
