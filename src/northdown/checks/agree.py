"""Checks of the sensors against each other: the gyroscope's unit and sense, axes that do not match, the dip."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from northdown._validation import BoolArray, FloatArray
from northdown.checks.base import SENSOR_NAMES, Finding, Severity, Signals
from northdown.checks.motion import AXES, SCALES, Averages, Windows, average, axes_name, make_windows

# Disagreement (squared angle, rad²) that needs an explanation: 0.1 rad rms. Right recordings of all kinds of motion
# stay below 0.007.
_SUSPICIOUS = 0.01
# Disagreement at which nothing fits any more.
_HOPELESS = 0.15
# An explanation must leave less than this share of the disagreement, and win in this share of the windows.
_LEFT, _WON = 0.25, 0.75
# Explanations this much worse than the best one are as good.
_AS_GOOD, _FLOOR = 2.0, 5e-4
# Disagreement without any turning below which a vector stood still: 0.6°.
_STILL = 1e-4
# Rates (rad/s): faster than a body turns about the vertical unnoticed; noise and bias of no common gyroscope; a bias
# worth knowing; more than any common range (2000 °/s is 35).
_TURNING = 0.35
_NOISE, _BIAS_WARNING, _BIAS_NOTE = 0.03, 0.1, 0.02
_GYR_FASTEST = 40.0
# Standard deviation of the dip, degrees.
_DIP_NOTE, _DIP_WARNING = 5.0, 8.0


@dataclass(frozen=True, order=True)
class Hypothesis:
    """What may be wrong: how many things at once, and which (indices into SCALES, senses and AXES)."""

    changes: int
    scale: int
    sense: int
    axes: int

    @property
    def factor(self) -> float:
        """What the gyroscope is multiplied by."""
        return SCALES[self.scale] * (1.0, -1.0)[self.sense]

    def gyr_axes(self) -> FloatArray:
        """The map of the gyroscope's axes that is the same as this map of the other sensor's axes."""
        mat: FloatArray = AXES[self.axes]
        swapped: FloatArray = (1.0, -1.0)[self.sense] * round(float(np.linalg.det(mat))) * mat.T
        return swapped


def _hypotheses() -> list[Hypothesis]:
    found = []
    for axes, mat in enumerate(AXES):
        moved = int((np.diag(mat) != 1.0).sum())
        for scale in range(len(SCALES)):
            for sense in (0, 1):
                found.append(Hypothesis(moved + (scale > 0) + sense, scale, sense, axes))
    return sorted(found)


_HYPOTHESES = _hypotheses()


class Agreement:
    """Disagreement of each sensor with the gyroscope, per window, as it stands and under each hypothesis.

    Attributes
    ----------
    still : (W,) array of bool
        Windows in which no vector turned.
    bias : (3,) array
        Mean of the gyroscope in these, rad/s; it is taken off first, lest it pass for motion. Zero without any.
    noise : float
        Standard deviation of the gyroscope in the quietest of these, rad/s, averaged over bins; NaN without any.
    moved : bool
        Whether a vector turned in any window.
    """

    def __init__(self, windows: Windows) -> None:
        unturned = {name: average(windows, 0.0).disagreement(name)[0] for name in windows.vectors}
        rate = windows.angle / windows.bin_step
        self.still = np.all([e < _STILL for e in unturned.values()], axis=0)
        if len(unturned) == 1:  # about the vertical, a single vector does not see the body turn
            self.still &= np.abs(rate.mean(axis=1)).max(axis=1) < _TURNING
        self.bias = np.median(rate[self.still].mean(axis=1), axis=0) if self.still.any() else np.zeros(3)
        spread = np.sqrt(rate[self.still].var(axis=1).sum(axis=1))
        self.noise = float(spread.min()) if spread.size else math.nan
        self._windows = replace(windows, angle=windows.angle - self.bias * windows.bin_step)
        self.plain: Averages = average(self._windows, 1.0)
        angle = self._windows.angle
        turned = np.sqrt(np.einsum("wlj,wlj->wl", angle, angle)).sum(axis=1) > 0.3
        self.used: dict[str, BoolArray] = {}
        self.now: dict[str, FloatArray] = {}
        self.moved = False
        for name, moved in unturned.items():
            self.now[name] = self.plain.disagreement(name)[0]
            # a window says something when the gyroscope turns, or when the vector does
            known = ~np.isnan(self.now[name])
            self.used[name] = (turned | (moved > 0.5 * _SUSPICIOUS)) & known
            self.moved |= bool((moved[known] > 0.5 * _SUSPICIOUS).any())

    def mean(self, name: str) -> float:
        """Mean disagreement over the windows that say something; NaN when none does."""
        used = self.used.get(name)
        return float(self.now[name][used].mean()) if used is not None and used.sum() >= 2 else math.nan

    def under_all(self) -> dict[str, FloatArray]:
        """Disagreement under each of the hypotheses, (H, W), by sensor."""
        table = {name: np.empty((len(_HYPOTHESES), len(self.used[name]))) for name in self.used}
        rows: dict[float, list[int]] = {}
        for i, h in enumerate(_HYPOTHESES):
            rows.setdefault(h.factor, []).append(i)
        for factor, where in rows.items():
            averages = average(self._windows, factor)
            for name in table:
                maps = AXES[[_HYPOTHESES[i].axes for i in where]]
                table[name][where] = averages.disagreement(name, maps)
        return table

    def explain(self, tables: dict[str, FloatArray], names: Sequence[str]) -> list[Hypothesis]:
        """The simplest hypotheses that make these sensors agree with the gyroscope; empty when none does."""
        # joined, so that one explanation has to serve all the sensors
        joined = np.concatenate([tables[n][:, self.used[n]] for n in names], axis=1)
        error = joined.mean(axis=1)
        best = int(np.argmin(error))
        won = float((joined[best] < joined[0]).mean())
        if not (error[best] < _LEFT * error[0] and error[best] < _HOPELESS and won >= _WON):
            return []
        good = [h for h, e in zip(_HYPOTHESES, error, strict=True) if e <= max(_AS_GOOD * error[best], _FLOOR)]
        return [h for h in good if h.changes == good[0].changes]


def agreement(s: Signals) -> Iterator[Finding]:
    """Unit, sense and axes of the gyroscope against gravity and the field, and the axes of these."""
    windows = make_windows(s)
    if windows is None or not windows.vectors:
        yield from gyr_size(s)
        return
    a = Agreement(windows)
    means = {name: a.mean(name) for name in windows.vectors}
    judged = [name for name, m in means.items() if not math.isnan(m)]
    wrong = [name for name in judged if means[name] > _SUSPICIOUS]
    right = [name for name in judged if name not in wrong]
    findings = list(_explained(a, wrong, right)) if wrong else []
    yield from findings
    if not findings:
        known = bool(right) and a.moved
        if not known:
            yield from gyr_size(s)
        if judged and min(means[name] for name in judged) > _HOPELESS:
            yield _disagrees(judged, min(means[name] for name in judged))
        else:
            yield from _at_rest(a, known=known)
    if "acc" in right and "mag" in windows.vectors and not findings:
        yield from _dip(a)


def _disagrees(names: list[str], disagreement: float) -> Finding:
    return Finding(
        "gyr-disagrees",
        "warning",
        f"the gyroscope turns otherwise than {_and(names)} (after taking its turn off they still scatter by "
        f"{math.degrees(math.sqrt(disagreement)):.0f}°), and no other unit or axes explain it; look for clipping, a "
        "wrong scale (raw counts), wrong times, or sensors on different bodies",
    )


def _at_rest(a: Agreement, *, known: bool) -> Iterator[Finding]:
    """Noise and bias of the gyroscope while gravity and field stand still; `known` when motion confirms the unit."""
    if a.noise > _NOISE and not known:
        yield Finding(
            "gyr-unit",
            "warning",
            f"gyr has a noise of {a.noise:.3g} rad/s ({math.degrees(a.noise):.3g} deg/s) while gravity and field "
            "stand still; it looks like deg/s (multiply by π/180), unless the body vibrates",
            0,
        )
        return
    bias = float(np.sqrt(a.bias @ a.bias))
    if bias > _BIAS_NOTE:
        values = ", ".join(f"{v:.3g}" for v in np.degrees(a.bias))
        severity: Severity = "warning" if bias > _BIAS_WARNING else "note"
        yield Finding(
            "gyr-bias",
            severity,
            f"gyr reads ({values}) deg/s at rest; subtract it, or use an estimator that learns the bias",
        )


def _explained(a: Agreement, wrong: list[str], right: list[str]) -> Iterator[Finding]:
    tables = a.under_all()
    together = a.explain(tables, wrong) if not right else []
    if together and together[0].scale:
        yield _wrong_scale(together, wrong)
    elif together and (len(wrong) == 2 or together[0].sense):
        yield _wrong_gyr_axes(together, wrong)
    else:
        for name in wrong:
            hypotheses = [h for h in a.explain(tables, [name]) if not h.scale and not h.sense]
            if hypotheses:
                yield _wrong_axes(hypotheses, name, right)


def _wrong_scale(hypotheses: list[Hypothesis], names: list[str]) -> Finding:
    h = hypotheses[0]
    if SCALES[h.scale] < 1.0:
        text, do = "57.3 times faster than", "it looks like deg/s: multiply by π/180"
    else:
        text, do = "57.3 times slower than", "it looks as if converted from deg/s twice: multiply by 180/π"
    more = "; its axes seem wrong too: check again after that" if h.changes > 1 else ""
    return Finding("gyr-unit", "error", f"gyr turns {text} {_and(names)}; {do}{more}", 0)


def _wrong_gyr_axes(hypotheses: list[Hypothesis], names: list[str]) -> Finding:
    first = hypotheses[0].gyr_axes()
    reversed_all = bool((first == -np.eye(3)).all())
    what = "turns the other way than" if reversed_all else "has other axes than"
    do = _replace("gyr", [h.gyr_axes() for h in hypotheses])
    return Finding("gyr-axes", "error", f"gyr {what} {_and(names)}; to make them agree, {do}", 0)


def _wrong_axes(hypotheses: list[Hypothesis], name: str, right: list[str]) -> Finding:
    maps = [AXES[h.axes] for h in hypotheses]
    do = _replace(name, maps) + f" (or the opposite, ({axes_name(-maps[0])}): the motion cannot tell)"
    if not right:
        do += f", or {_replace('gyr', [h.gyr_axes() for h in hypotheses])}"
    others = _and(["gyr", *right])
    return Finding(f"{name}-axes", "error", f"{name} has other axes than {others}; to make them agree, {do}", 0)


def _replace(name: str, maps: list[FloatArray]) -> str:
    texts = [f"({axes_name(m)})" for m in maps[:3]]
    doubt = "" if len(maps) == 1 else f", {len(maps)} possibilities, as the body turned about too few axes"
    return f"replace {name} (x, y, z) by {' or '.join(texts)}{doubt}"


def _and(names: Sequence[str]) -> str:
    return " and ".join(f"the {SENSOR_NAMES[n]}" for n in names)


def gyr_size(s: Signals) -> Iterator[Finding]:
    """Rates that no common sensor reaches, where the motion has not confirmed the unit."""
    if "gyr" not in s.sensors:
        return
    fast = float(np.quantile(s.norms["gyr"], 0.99))
    if fast > _GYR_FASTEST:
        at = int(np.flatnonzero(s.present["gyr"])[np.argmax(s.norms["gyr"] > _GYR_FASTEST)])
        yield Finding(
            "gyr-unit",
            "error",
            f"gyr reaches {fast:.4g} rad/s ({math.degrees(fast):.4g} deg/s; 99th percentile), more than common "
            "sensors can; it looks like deg/s (multiply by π/180) or raw counts",
            at,
        )


def _dip(a: Agreement) -> Iterator[Finding]:
    """Angle between field and horizontal that varies, where the accelerometer agrees with the gyroscope."""
    steady = a.now["acc"] < 2.0 * _SUSPICIOUS
    dip = dip_angles(a.plain, steady)
    if len(dip) < 8:
        return
    spread = math.degrees(float(dip.std()))
    if spread > _DIP_NOTE:
        severity: Severity = "warning" if spread > _DIP_WARNING else "note"
        low, high = np.degrees(np.quantile(dip, [0.05, 0.95]))
        yield Finding(
            "mag-dip",
            severity,
            f"the field's dip varies by {spread:.1f}° (std; mostly from {low:.0f}° to {high:.0f}°); the field is "
            "disturbed on the way or the magnetometer is not calibrated, and heading may err by more",
        )


def dip_angles(averages: Averages, windows: BoolArray) -> FloatArray:
    """Dip (rad, positive down) of each part of some windows, taking the accelerometer to point up."""
    up = averages.vectors("acc")[0][windows].reshape(-1, 3)
    mag = averages.vectors("mag")[0][windows].reshape(-1, 3)
    size = np.sqrt(np.einsum("ij,ij->i", up, up) * np.einsum("ij,ij->i", mag, mag))
    good = size > 0.0
    dip: FloatArray = -np.arcsin(np.clip(np.einsum("ij,ij->i", up, mag)[good] / size[good], -1.0, 1.0))
    return dip


CHECKS = (agreement,)
