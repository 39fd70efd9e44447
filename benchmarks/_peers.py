"""The other libraries, each behind a call that does what its users call."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np

import northdown as nd

INSTALL = "not installed: pip install northdown[peers]"
GRAVITY = 9.80665

Call = Callable[[], object]


def find(name: str) -> ModuleType | None:
    """Import a peer, if it is there."""
    try:
        return import_module(name)
    except ImportError:
        return None


def batch(recording: nd.Recording) -> dict[str, tuple[int, Call] | None]:
    """Whole recordings: samples taken and call by name; None where the peer is missing."""
    n, period = len(recording), 1.0 / recording.rate
    gyr, acc, mag = recording.gyr, recording.acc, recording.mag
    cases: dict[str, tuple[int, Call] | None] = {}
    vqf = find("vqf")
    for name in ("BasicVQF", "VQF"):
        if vqf is None:
            cases[f"vqf.{name}"] = None
            continue

        kind = getattr(vqf, name)
        cases[f"vqf.{name}"] = (n, lambda kind=kind: kind(period).updateBatch(gyr, acc, mag))
    imufusion = find("imufusion")
    # a loop in Python over a part, and a filter written in Python over a smaller one: time is per sample
    part = min(n, 10_000)
    samples = [list(x[:part]) for x in (np.rad2deg(gyr), acc / GRAVITY, mag)]
    cases["imufusion (loop)"] = None
    if imufusion is not None:
        cases["imufusion (loop)"] = (part, lambda: loop(imufusion_update(imufusion, period), *samples))
    ahrs = find("ahrs")
    few = min(n, 500)
    cases["ahrs.Mahony"] = None
    if ahrs is not None:
        mahony = import_module("ahrs.filters").Mahony
        cases["ahrs.Mahony"] = (
            few,
            lambda: mahony(gyr=gyr[:few], acc=acc[:few], mag=mag[:few], frequency=1.0 / period),
        )
    return cases


def kalman(recording: nd.Recording) -> dict[str, tuple[int, Call] | None]:
    """Kalman filters of ahrs, four states each and without bias, over a few samples; its UKF leaves the field out."""
    ahrs, rate, few = find("ahrs"), recording.rate, min(len(recording), 200)
    if ahrs is None:
        return {"ahrs.filters.EKF": None, "ahrs.filters.UKF": None}
    filters = import_module("ahrs.filters")
    gyr, acc, mag = (x[:few].copy() for x in (recording.gyr, recording.acc, recording.mag))
    return {
        "ahrs.filters.EKF": (few, lambda: filters.EKF(gyr=gyr, acc=acc, mag=mag, frequency=rate)),
        "ahrs.filters.UKF": (few, lambda: filters.UKF(gyr=gyr, acc=acc, frequency=rate)),
    }


def stream(recording: nd.Recording) -> dict[str, Call | None]:
    """Live samples one by one: a call that loops over the recording's samples; None where the peer is missing."""
    period = 1.0 / recording.rate
    gyr, acc, mag = recording.gyr, recording.acc, recording.mag
    samples = [list(x) for x in (gyr, acc, mag)]
    cases: dict[str, Call | None] = {}
    imufusion, vqf = find("imufusion"), find("vqf")
    cases["imufusion update"] = cases["imufusion update, get_quaternion"] = None
    if imufusion is not None:
        scaled = [list(x) for x in (np.rad2deg(gyr), acc / GRAVITY, mag)]
        update = imufusion_update(imufusion, period)
        cases["imufusion update"] = lambda: loop(update, *scaled)
        if hasattr(imufusion.Ahrs, "get_quaternion"):
            cases["imufusion update, get_quaternion"] = lambda: loop_and_get(update, *scaled)
    for name in ("BasicVQF", "VQF"):
        cases[f"vqf.{name} update"] = cases[f"vqf.{name} update, getQuat9D"] = None
        if vqf is not None:
            filter_ = getattr(vqf, name)(period)
            cases[f"vqf.{name} update"] = lambda f=filter_: loop(f.update, *samples)
            cases[f"vqf.{name} update, getQuat9D"] = lambda f=filter_: loop_and_ask(f.update, f.getQuat9D, *samples)
    return cases


def imufusion_update(imufusion: ModuleType, period: float) -> Callable[..., Any]:
    """Ahrs.update of three arguments, for the signatures before and since version 1.3."""
    ahrs = imufusion.Ahrs()
    if hasattr(ahrs, "set_sample_period"):
        ahrs.set_sample_period(period)
        return ahrs.update  # type: ignore[no-any-return]
    return lambda gyr, acc, mag: ahrs.update(gyr, acc, mag, period)


def loop(update: Callable[..., object], gyr: list[Any], acc: list[Any], mag: list[Any]) -> None:
    for g, a, m in zip(gyr, acc, mag, strict=True):
        update(g, a, m)


def loop_and_get(update: Callable[..., Any], gyr: list[Any], acc: list[Any], mag: list[Any]) -> None:
    for g, a, m in zip(gyr, acc, mag, strict=True):
        update(g, a, m).get_quaternion()


def loop_and_ask(
    update: Callable[..., object], ask: Callable[[], object], gyr: list[Any], acc: list[Any], mag: list[Any]
) -> None:
    for g, a, m in zip(gyr, acc, mag, strict=True):
        update(g, a, m)
        ask()
