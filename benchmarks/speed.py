"""How fast northdown is beside other libraries and beside C, all measured in one run.

    python benchmarks/speed.py [--quick] [--json FILE]

See README.md in this folder for what is measured and how ratios are formed.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import _c
import _peers
import _timing
import northdown as nd

SAMPLES = 53_000
STREAMED = 5_000
OURS = "northdown Mahony().run(recording)"
KERNEL = "northdown, kernel alone"
COLUMNS = 100

console = Console(highlight=False, width=None if sys.stdout.isatty() else COLUMNS)
results: dict[str, Any] = {}


def find_recording() -> nd.Recording:
    """A trial of BROAD where there is one, else a simulation of the same length and rate."""
    if os.environ.get("NORTHDOWN_DATA"):
        try:
            return nd.datasets.broad(nd.datasets.names("broad")[0])
        except (nd.NorthdownError, IndexError):
            console.print("no trial of BROAD in NORTHDOWN_DATA: simulating instead")
    return nd.simulate(SAMPLES / 286.0, rate=286.0, seed=1, frame="ENU")[:SAMPLES]


def table(title: str, *columns: str) -> Table:
    made = Table(title=title, title_justify="left", title_style="bold")
    made.add_column(columns[0])
    for column in columns[1:]:
        made.add_column(column, justify="right")
    return made


def verdict(what: str, value: float, target: float, *, at_least: bool = False, unit: str = "") -> None:
    """Print one target with what was measured."""
    good = value >= target if at_least else value <= target
    sign = "≥" if at_least else "≤"
    mark = "[green]met[/]" if good else "[red]missed[/]"
    console.print(f"  {what}: {value:.2f}{unit}, target {sign} {target:g}{unit}: {mark}")
    results.setdefault("targets", {})[what] = {"measured": value, "target": target, "met": bool(good)}


def bench_batch(recording: nd.Recording, rounds: int) -> None:
    """Whole recording: northdown's public call and its kernel alone, C, and the peers."""
    n = len(recording)
    estimator = nd.Mahony()
    kernel, work = estimator.kernel, estimator.stream(frame=recording.frame)._work
    start, out, flags = work.state.copy(), np.empty((n, 7)), np.zeros(n, np.uint8)
    data = (recording.time, recording.gyr, recording.acc, recording.mag, np.empty((n, 0)))

    def bare() -> None:
        work.state[:] = start
        kernel.run(work.params, work.state, work.turn, *data, out, flags)

    cases: dict[str, tuple[int, Callable[[], object]]] = {
        OURS: (n, lambda: nd.Mahony().run(recording)),
        KERNEL: (n, bare),
    }
    missing: dict[str, str] = {}
    try:
        library = _c.load()
    except _c.NoCompilerError as reason:
        missing["C, -O3 -march=native"] = str(reason)
    else:
        expected = estimator.run(recording, frame="NED")
        for name, function in (("C, textbook", "mahony"), ("C, shortened", "mahony_short")):
            run = _c.runner(library, function, recording, estimator)
            found = run(np.empty((n, 7)))
            worst = max(np.abs(found[:, :4] - expected.quat).max(), np.abs(found[:, 4:] - expected.gyr_bias).max())
            agree = "agrees" if worst < 1e-9 else "[red]does not agree[/]"
            console.print(f"{name} {agree} with northdown: largest difference {worst:.1e}")
            cases[f"{name}, new result array"] = (n, lambda run=run: run(np.empty((n, 7))))
            cases[f"{name}, kernel alone"] = (n, lambda run=run: run(out))
    for name, case in _peers.batch(recording).items():
        if case is None:
            missing[name] = _peers.INSTALL
        else:
            cases[name] = case

    times = _timing.take_turns({k: call for k, (_, call) in cases.items()}, rounds)
    per_sample = {k: times[k] / count for k, (count, _) in cases.items()}
    shown = table(f"Mahony over {n} samples, ns/sample", "", "best", "median", "÷ run", "÷ kernel alone")
    for name, t in per_sample.items():
        to_run, to_kernel = (_timing.ratio(t, per_sample[k]) for k in (OURS, KERNEL))
        shown.add_row(name, f"{t.min() * 1e9:.1f}", f"{np.median(t) * 1e9:.1f}", f"{to_run:.2f}", f"{to_kernel:.2f}")
        results.setdefault("batch", {})[name] = {"ns_per_sample": float(np.median(t) * 1e9), "ratio": to_run}
    for name, why in missing.items():
        shown.add_row(name, why, "", "", "")
    console.print(shown)
    if "vqf.BasicVQF" in per_sample:
        basic = _timing.ratio(per_sample["vqf.BasicVQF"], per_sample[OURS])
        verdict("vqf.BasicVQF's time ÷ run's", basic, 4.0, at_least=True)
    for name in ("C, textbook", "C, shortened"):
        if f"{name}, kernel alone" in per_sample:
            bare_ratio = _timing.ratio(per_sample[KERNEL], per_sample[f"{name}, kernel alone"])
            verdict(f"kernel's time ÷ {name}'s", bare_ratio, 1.1)
            whole_ratio = _timing.ratio(per_sample[OURS], per_sample[f"{name}, new result array"])
            verdict(f"run's time ÷ {name}'s with a new array", whole_ratio, 1.1)


def bench_estimators(recording: nd.Recording, rounds: int) -> None:
    """All estimators over the same recording, beside VQF where it is there."""
    part = recording[:10_000]
    cases: dict[str, Callable[[], object]] = {}
    for name, kind in nd.estimators.registry().items():
        if all(getattr(part, sensor) is not None for sensor in kind.needs):
            cases[name] = lambda kind=kind: kind().run(part)
    peer = _peers.batch(part)["vqf.VQF"]
    if peer is not None:
        cases["vqf.VQF"] = peer[1]
    times = _timing.take_turns(cases, rounds)
    shown = table(f"All estimators over {len(part)} samples, ns/sample", "", "median", "÷ vqf.VQF")
    for name, t in times.items():
        to_peer = f"{_timing.ratio(t, times['vqf.VQF']):.2f}" if peer else "–"
        shown.add_row(name, f"{np.median(t) / len(part) * 1e9:.0f}", to_peer)
        results.setdefault("estimators", {})[name] = float(np.median(t) / len(part) * 1e9)
    console.print(shown)


def bench_kalman(recording: nd.Recording, rounds: int) -> None:
    """Kalman filters' public run beside VQF and the Kalman filters of ahrs, which are written in Python."""
    part = recording[:20_000]
    names = ("mekf", "quaternion-ekf", "double-stage-ekf", "euler-ukf")
    cases: dict[str, tuple[int, Callable[[], object]]] = {
        name: (len(part), lambda name=name: nd.estimators.get(name)().run(part)) for name in names
    }
    peers = {"vqf.VQF": _peers.batch(part)["vqf.VQF"], **_peers.kalman(part)}
    cases |= {name: case for name, case in peers.items() if case is not None}
    times = _timing.take_turns({k: call for k, (_, call) in cases.items()}, rounds)
    per_sample = {k: times[k] / count for k, (count, _) in cases.items()}
    shown = table(f"Kalman filters over {len(part)} samples, ns/sample", "", "best", "median", "÷ vqf.VQF")
    for name, t in per_sample.items():
        to_peer = f"{_timing.ratio(t, per_sample['vqf.VQF']):.2f}" if "vqf.VQF" in per_sample else "–"
        shown.add_row(name, f"{t.min() * 1e9:.0f}", f"{np.median(t) * 1e9:.0f}", to_peer)
        results.setdefault("kalman", {})[name] = float(np.median(t) * 1e9)
    for name, case in peers.items():
        if case is None:
            shown.add_row(name, _peers.INSTALL, "", "")
    console.print(shown)
    for name in names[1:3]:
        if "vqf.VQF" in per_sample:
            verdict(f"{name}'s time ÷ vqf.VQF's", _timing.ratio(per_sample[name], per_sample["vqf.VQF"]), 0.5)
        if "ahrs.filters.EKF" in per_sample:
            slower = _timing.ratio(per_sample["ahrs.filters.EKF"], per_sample[name])
            verdict(f"ahrs EKF's time ÷ {name}'s", slower, 700.0, at_least=True)
    verdict("euler-ukf", float(np.median(per_sample["euler-ukf"]) * 1e6), 4.0, unit=" µs")
    if "ahrs.filters.UKF" in per_sample:
        slower = _timing.ratio(per_sample["ahrs.filters.UKF"], per_sample["euler-ukf"])
        verdict("ahrs UKF's time ÷ euler-ukf's", slower, 150.0, at_least=True)


def bench_stream(recording: nd.Recording, rounds: int) -> None:
    """One sample per call from Python."""
    part = recording[:STREAMED]
    live = nd.Mahony().stream(rate=recording.rate)
    samples = [list(x) for x in (part.gyr, part.acc, part.mag)]
    ours = "northdown stream.update"
    cases: dict[str, Callable[[], object]] = {ours: lambda: _peers.loop(live.update, *samples)}
    missing = []
    for name, call in _peers.stream(part).items():
        if call is None:
            missing.append(name)
        else:
            cases[name] = call
    times = _timing.take_turns(cases, rounds)
    shown = table("One call per sample, ns", "", "best", "median", "÷ northdown")
    for name, t in times.items():
        to_ours = _timing.ratio(t, times[ours])
        best, middle = t.min() / STREAMED * 1e9, np.median(t) / STREAMED * 1e9
        shown.add_row(name, f"{best:.0f}", f"{middle:.0f}", f"{to_ours:.2f}")
        results.setdefault("stream", {})[name] = {"ns_per_call": float(middle), "ratio": to_ours}
    for name in missing:
        shown.add_row(name, _peers.INSTALL, "", "")
    console.print(shown)
    if "imufusion update" in times:
        verdict(
            "imufusion update's time ÷ stream.update's",
            _timing.ratio(times["imufusion update"], times[ours]),
            1.0,
            at_least=True,
        )


FIRST_RESULT = """
import numpy as np
import northdown as nd
n = 1000
flat = lambda *v: np.tile(v, (n, 1)).astype(float)
recording = nd.Recording(np.arange(n) / 100.0, flat(0, 0, 0), flat(0, 0, -9.81), flat(20, 0, 40))
nd.Mahony().run(recording)
"""
FIRST_VQF = """
import numpy as np
import vqf
n = 1000
flat = lambda *v: np.tile(v, (n, 1)).astype(float)
vqf.BasicVQF(0.01).updateBatch(flat(0, 0, 0), flat(0, 0, 9.81), flat(0, 20, -40))
"""


def bench_start(repeats: int) -> None:
    """New processes, from start to end, the interpreter's own start included."""

    def process(*arguments: str, cache: str | None = None) -> None:
        environment = os.environ | ({"NUMBA_CACHE_DIR": cache} if cache else {})
        subprocess.run([sys.executable, *arguments], env=environment, check=True, stdout=subprocess.DEVNULL)

    def with_empty_cache() -> None:
        with tempfile.TemporaryDirectory() as folder:
            process("-c", FIRST_RESULT, cache=folder)

    first, empty = "northdown, first result", "northdown, first result, empty cache"
    bare, help_ = "import northdown", "northdown --help"
    with tempfile.TemporaryDirectory() as folder:
        cases: dict[str, Callable[[], object]] = {
            "python -c pass": lambda: process("-c", "pass"),
            bare: lambda: process("-c", "import northdown"),
            help_: lambda: process("-m", "northdown", "--help"),
            first: lambda: process("-c", FIRST_RESULT, cache=folder),
            empty: with_empty_cache,
            "import numpy": lambda: process("-c", "import numpy"),
        }
        peers = {
            "vqf": ("import vqf, first result", FIRST_VQF),
            "imufusion": ("import imufusion", "import imufusion"),
        }
        for package, (name, code) in peers.items():
            if _peers.find(package) is not None:
                cases[name] = lambda code=code: process("-c", code)
        times = _timing.processes(cases, repeats)
    shown = table("New process, start to end, s", "", "best", "median", "median CPU")
    for name, t in times.items():
        middle, cpu = np.median(t, axis=0)
        shown.add_row(name, f"{t[:, 0].min():.2f}", f"{middle:.2f}", f"{cpu:.2f}")
        results.setdefault("start", {})[name] = {"s": float(middle), "cpu_s": float(cpu)}
    for package, (name, _) in peers.items():
        if _peers.find(package) is None:
            shown.add_row(name, _peers.INSTALL, "", "")
    console.print(shown)
    for name, target in ((bare, 0.3), (help_, 0.3), (first, 1.3), (empty, 3.0)):
        verdict(f"{name}, best", float(times[name][:, 0].min()), target, unit=" s")


def main() -> None:
    """Measure everything and print it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer rounds: a minute instead of three")
    parser.add_argument("--json", metavar="FILE", help="also write the figures there")
    options = parser.parse_args()
    rounds, repeats = (7, 2) if options.quick else (31, 7)
    results["machine"] = _timing.machine()
    results["versions"] = _timing.versions("northdown", "numpy", "numba", "vqf", "imufusion", "ahrs")
    console.print(f"{results['machine']}; {results['versions']}")
    recording = find_recording()
    results["recording"] = recording.name or "simulated"
    console.print(f"{recording!r}\n")
    bench_batch(recording, rounds)
    bench_stream(recording, rounds)
    bench_estimators(recording, rounds)
    bench_kalman(recording, rounds)
    bench_start(repeats)
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump(results, file, indent=1)


if __name__ == "__main__":
    main()
