"""Fair timing on a machine that others use too: competitors take turns, and ratios are formed within a turn."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import time
from collections.abc import Callable, Mapping

import numpy as np

LONG = 0.05  # s


def take_turns(cases: Mapping[str, Callable[[], object]], rounds: int, seed: int = 0) -> dict[str, np.ndarray]:
    """CPU time (s) of each case in each round, (rounds,).

    Each round calls every case, in an order of its own: two times, of which the better counts, or once if it is long.
    CPU time, as another program that wants the core would otherwise be measured too; all cases run on one thread.
    """
    rng = np.random.default_rng(seed)
    names = list(cases)
    times = {name: np.full(rounds, np.inf) for name in names}
    for case in cases.values():
        case()
    for i in range(rounds):
        for name in rng.permutation(names):
            for _ in range(2):
                start = time.process_time()
                cases[name]()
                times[name][i] = min(times[name][i], time.process_time() - start)
                if times[name][i] > LONG:
                    break
    return times


def processes(cases: Mapping[str, Callable[[], object]], rounds: int, seed: int = 0) -> dict[str, np.ndarray]:
    """Wall-clock and CPU time (s), (rounds, 2), of cases that each run a new process; taking turns likewise."""
    rng = np.random.default_rng(seed)
    times = {name: np.empty((rounds, 2)) for name in cases}
    for case in cases.values():
        case()
    for i in range(rounds):
        for name in rng.permutation(list(cases)):
            start, used = time.perf_counter(), os.times()
            cases[name]()
            now = os.times()
            cpu = now.children_user + now.children_system - used.children_user - used.children_system
            times[name][i] = time.perf_counter() - start, cpu
    return times


def ratio(slower: np.ndarray, faster: np.ndarray) -> float:
    """Median over the rounds of slower / faster, both of the same round."""
    return float(np.median(slower / faster))


def machine() -> str:
    """What the figures were measured on, without naming the machine."""
    info: dict[str, str] = {}
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            for line in file:
                key, _, value = line.partition(":")
                info.setdefault(key.strip(), value.strip())
    except OSError:
        pass
    vendor = info.get("vendor_id", "").replace("Authentic", "").replace("Genuine", "")
    family = f"{vendor} family {info['cpu family']}" if "cpu family" in info else platform.machine()
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return f"{family}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}{load}"


def versions(*packages: str) -> str:
    """Installed versions, for the record."""
    found = []
    for package in packages:
        try:
            found.append(f"{package} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            found.append(f"{package} –")
    return ", ".join(found)
