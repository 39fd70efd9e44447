"""What K06's figures 4.2 to 4.58 show: a table of which signal of which run, and the curves of each.

Figures 4.1, 4.15 and 4.59 are block diagrams.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, NamedTuple, get_args

import numpy as np

from northdown._validation import FloatArray
from northdown.evaluation.kao2006 import measurements
from northdown.evaluation.kao2006.constants import DOCUMENTED
from northdown.evaluation.kao2006.published import Method
from northdown.evaluation.kao2006.signals import Signals, simulate
from northdown.evaluation.kao2006.thesis_filter import DRIVING, ITERATIONS, Estimate, estimate
from northdown.simulation.seeds import Seed

Shown = Literal[
    "in-plane accelerometers",
    "normal accelerometers",
    "magnetometer",
    "measurements",
    "rate",
    "rate error",
    "quaternion",
    "quaternion error",
    "Euler angles",
    "Euler angle error",
    "rate sigma",
    "quaternion sigma",
    "Euler angle sigma",
]
MOTION_NAMES: Final = {"sine": "three-axis rotation", "pitch": "pitch through ±90°", "rest": "rest"}
_ALL: Final[tuple[Shown, ...]] = get_args(Shown)
_ANGLES: Final = ("roll", "pitch", "yaw")


class ThesisFigure(NamedTuple):
    """One of K06's figures."""

    number: str
    motion: str
    method: Method
    shown: Shown

    @property
    def title(self) -> str:
        """Caption."""
        return f"K06 figure {self.number}: {self.method}, {MOTION_NAMES[self.motion]}: {self.shown}"


def _series(first: int, motion: str, method: Method, shown: tuple[Shown, ...] = _ALL) -> list[ThesisFigure]:
    return [ThesisFigure(f"4.{first + k}", motion, method, what) for k, what in enumerate(shown)]


FIGURES: Final[tuple[ThesisFigure, ...]] = (
    *_series(2, "sine", "indirect"),
    *_series(16, "sine", "direct"),
    *_series(29, "pitch", "indirect", ("quaternion", "Euler angles")),
    *_series(31, "pitch", "direct", ("quaternion", "Euler angles")),
    *_series(33, "rest", "indirect"),
    *_series(46, "rest", "direct"),
)
"""Figures 4.2 to 4.58."""
COUNT: Final = 8 + len(FIGURES) + 1
"""Number of all figures, with 3.4 to 3.11 and 4.60."""


@dataclass(frozen=True, eq=False)
class Run:
    """One run and what both filters made of it."""

    signals: Signals
    method: Method
    filters: dict[str, Estimate]


class Panel(NamedTuple):
    """Curves (N,) in one panel with the label of its axis: truth, measured, EKF, IKF; angles in degrees."""

    label: str
    curves: dict[str, FloatArray]


def simulate_run(motion: str, method: Method, seed: Seed) -> Run:
    """Simulate what a group of figures shows, with `DOCUMENTED` constants."""
    signals = simulate(DOCUMENTED.motion(motion), DOCUMENTED, 1, seed)
    return Run(signals, method, {name: estimate(signals, method, n) for name, n in ITERATIONS.items()})


def panels(figure: ThesisFigure, run: Run) -> list[Panel]:
    """The panels of a figure."""
    shown = figure.shown
    if shown in ("in-plane accelerometers", "normal accelerometers", "magnetometer", "measurements"):
        return _sensor_panels(shown, run)
    if shown.endswith("sigma"):
        return _sigma_panels(shown, run)
    return _state_panels(shown, run)


def _sensor_panels(shown: Shown, run: Run) -> list[Panel]:
    signals, direct = run.signals, run.method == "direct"
    if shown == "magnetometer":
        return [
            Panel(f"m{a} (gauss)", {"measured": signals.mag[0, :, k]})
            for k, a in enumerate("xy" if direct else "xyz")
        ]
    if shown == "measurements":
        return _measurement_panels(run)
    used = [k for k in range(7) if not direct or k in DRIVING]
    chosen = [k for k in used if (k >= 4) == (shown == "normal accelerometers")]
    return [Panel(f"{signals.array.names[k]} (m/s²)", {"measured": signals.array_acc[0, :, k]}) for k in chosen]


def _measurement_panels(run: Run) -> list[Panel]:
    signals = run.signals
    gravity, mag, constants = signals.gravity()[0], signals.mag[0], signals.constants
    if run.method == "direct":
        names = ["z1 = mx\n(gauss)", "z2 = my\n(gauss)", "z3 = gy\n(m/s²)", "z4 = gz\n(m/s²)"]
        found = measurements.direct_measured(gravity, mag)
        true = measurements.direct_expected(signals.quat, constants).value
    else:
        names = ["z1 = −tan ψ", "z2 = −sin θ", "z3 = tan φ"]
        found = measurements.indirect_measured(gravity, mag, constants)
        true = measurements.indirect_expected(signals.quat).value
    return [Panel(name, {"measured": found[:, k], "truth": true[:, k]}) for k, name in enumerate(names)]


def _state_panels(shown: Shown, run: Run) -> list[Panel]:
    signals = run.signals
    labels, true, measured, error = _state(shown, signals)
    found = {name: _estimated(shown, e) for name, e in run.filters.items()}
    result = []
    for k, text in enumerate(labels):
        curves: dict[str, FloatArray] = {}
        if not error:
            if measured is not None:
                curves["measured"] = measured[:, k]
            curves["truth"] = true[:, k]
        for name, values in found.items():
            curves[name] = values[:, k]
        result.append(Panel(text, curves))
    return result


def _state(shown: Shown, signals: Signals) -> tuple[list[str], FloatArray, FloatArray | None, bool]:
    """Labels, truth, direct measurement, and whether errors are shown."""
    error = shown.endswith("error")
    extra = "error of " if error else ""
    if shown.startswith("rate"):
        return [f"{extra}ω{a}\n(rad/s)" for a in "xyz"], signals.rate, None, error
    if shown.startswith("quaternion"):
        return [f"{extra}q{k}" for k in range(1, 5)], _scalar_last(signals.quat), None, error
    measured = np.rad2deg(signals.measured_angles()[0])
    return [f"{extra}{a} (°)" for a in _ANGLES], np.rad2deg(signals.euler), measured, error


def _estimated(shown: Shown, found: Estimate) -> FloatArray:
    truth = found.signals
    values: FloatArray
    if shown.startswith("rate"):
        values = found.rate[0] - (truth.rate if shown == "rate error" else 0.0)
    elif shown.startswith("quaternion"):
        # of the two quaternions of an attitude the one nearer to the truth
        same = np.where(np.sum(found.quat[0] * truth.quat, axis=1) < 0.0, -1.0, 1.0)[:, None]
        values = _scalar_last(same * found.quat[0] - (truth.quat if shown == "quaternion error" else 0.0))
    else:
        values = np.rad2deg(found.euler_error[0] if shown == "Euler angle error" else found.euler[0])
    return values


def _sigma_panels(shown: Shown, run: Run) -> list[Panel]:
    first, labels = {
        "rate sigma": (0, [f"σ of ω{a}\n(rad/s)" for a in "xyz"]),
        "quaternion sigma": (3, [f"σ of q{k}" for k in range(1, 5)]),
        "Euler angle sigma": (7, [f"σ of {a} (°)" for a in _ANGLES]),
    }[shown]
    found = {name: e.sigma()[0] for name, e in run.filters.items()}
    return [
        Panel(text, {name: values[:, first + k] for name, values in found.items()}) for k, text in enumerate(labels)
    ]


def _scalar_last(quat: FloatArray) -> FloatArray:
    """K06's order."""
    values: FloatArray = quat[..., [1, 2, 3, 0]]
    return values
