"""What K06 claims beside its tables, put to simulated runs, with what would make each claim false."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from northdown._validation import FloatArray
from northdown.evaluation.kao2006 import published
from northdown.evaluation.kao2006.comparison import Comparison
from northdown.evaluation.kao2006.constants import DOCUMENTED, RATE, Constants
from northdown.evaluation.kao2006.published import ENTRIES, Method, MotionName, Row
from northdown.evaluation.kao2006.signals import simulate
from northdown.evaluation.kao2006.thesis_filter import DRIVING, ITERATIONS, Estimate, estimate
from northdown.simulation.seeds import Seed, generator

METHODS: Final[tuple[Method, ...]] = ("indirect", "direct")
MOTIONS: Final[tuple[MotionName, ...]] = ("sine", "rest")
FEW_PERCENT: Final = 0.05
"""What counts as "a few percent"."""
LOST: Final = math.radians(10.0)
"""Error of the attitude, rad, from which a filter has failed: some twenty times its usual one."""
_SETTLED: Final = 1.0
_T_LIMIT: Final = 4.0


@dataclass(frozen=True)
class Claim:
    """A claim and what became of it.

    Parameters
    ----------
    source : str
        Where K06 makes it.
    text : str
        What it says.
    held : bool
        Whether it held here.
    finding : str
        The figures it was judged by.
    """

    source: str
    text: str
    held: bool
    finding: str


def no_drift(seed: Seed = 0, *, runs: int = 40, duration: float = 10.0, constants: Constants = DOCUMENTED) -> Claim:
    """At rest neither the mean error nor its size grows with time."""
    rng = generator(seed)
    worst_growth, worst_t = 0.0, 0.0
    for method in METHODS:
        found = estimate(simulate(constants.motion("rest", duration), constants, runs, rng), method)
        early, late = _window(found, _SETTLED, 0.5 * duration), _window(found, 0.5 * duration, duration)
        worst_growth = max(worst_growth, _rms(late) / _rms(early))
        means = found.euler_error[:, round(0.5 * duration * RATE) :].mean(axis=1)
        t = np.abs(means.mean(axis=0)) / (means.std(axis=0, ddof=1) / math.sqrt(runs))
        worst_t = max(worst_t, float(t.max()))
    return Claim(
        "4-3",
        "no drift at rest",
        worst_growth < 1.1 and worst_t < _T_LIMIT,
        f"{duration:g} s, {runs} runs: the RMS error of the second half is {worst_growth:.2f} times that of the "
        f"first, mean errors are within {worst_t:.1f} of their standard errors; the accelerometers alone, "
        f"integrated, would be {_integrated(constants, duration):.0f}° off",
    )


def _integrated(constants: Constants, duration: float) -> float:
    """Standard deviation (degrees) of roll when angular acceleration is integrated twice."""
    array = simulate(constants.motion("rest", 1.0 / RATE), constants).array
    to_acceleration = np.linalg.inv(array.matrix[list(DRIVING)])[0]
    density = constants.acc_noise * float(np.linalg.norm(to_acceleration)) / math.sqrt(RATE)
    return math.degrees(density * duration**1.5 / math.sqrt(3.0))


def ikf_is_near_ekf(
    seed: Seed = 0, *, runs: int = 50, constants: Constants = DOCUMENTED
) -> tuple[Claim, dict[tuple[MotionName, Method], tuple[Estimate, Estimate]]]:
    """The iterated filter's standard deviations and errors are within a few percent of the plain one's.

    Returns
    -------
    claim : Claim
    estimates : dict
        Of EKF and IKF by motion and method, for use elsewhere.
    """
    rng = generator(seed)
    kept, sigma_change, error_change = {}, 0.0, 0.0
    for motion in MOTIONS:
        signals = simulate(constants.motion(motion), constants, runs, rng)
        for method in METHODS:
            ekf, ikf = (estimate(signals, method, n) for n in ITERATIONS.values())
            kept[motion, method] = ekf, ikf
            ratio = ikf.sigma(-1).mean(axis=0) / ekf.sigma(-1).mean(axis=0)
            sigma_change = max(sigma_change, float(np.abs(ratio - 1.0).max()))
            error_change = max(error_change, abs(_rms(_window(ikf)) / _rms(_window(ekf)) - 1.0))
    theirs, name = _published_change()
    claim = Claim(
        "4-1, 4-3",
        "the IKF is within a few percent of the EKF",
        max(sigma_change, error_change) < FEW_PERCENT,
        f"largest change of a standard deviation {100 * sigma_change:.2f} %, of the RMS error "
        f"{100 * error_change:.2f} % ({runs} runs each); K06's tables differ by up to {100 * theirs:.0f} % ({name})",
    )
    return claim, kept


def _published_change() -> tuple[float, str]:
    """Largest change from EKF to IKF in K06's tables, and where."""
    found = [(abs(b / a - 1.0), name) for _, name, a, b in _published_pairs()]
    return max(found)


def _published_pairs() -> list[tuple[Row, str, float, float]]:
    pairs = []
    for row, values in published.SIGMA.items():
        if row.filter == "EKF":
            other = published.SIGMA[Row(row.motion, row.method, "IKF")]
            pairs += [(row, name, a, b) for name, a, b in zip(ENTRIES, values, other, strict=True)]
    return pairs


def ikf_is_better(found: dict[tuple[MotionName, Method], tuple[Estimate, Estimate]]) -> Claim:
    """K06 reads from its tables that the IKF is a little more accurate."""
    gains = {key: _rms(_window(ikf)) / _rms(_window(ekf)) - 1.0 for key, (ekf, ikf) in found.items()}
    fewer = sum(b < a for _, _, a, b in _published_pairs())
    shown = ", ".join(f"{motion} {method} {100 * gain:+.2f} %" for (motion, method), gain in gains.items())
    return Claim(
        "4-1.1, 4-1.2",
        "the IKF is a little more accurate than the EKF",
        all(gain < -1e-3 for gain in gains.values()),
        f"RMS errors change by {shown}; in K06's tables the IKF's figure is the smaller in {fewer} of "
        f"{len(_published_pairs())}",
    )


def pitch_through_90(
    seed: Seed = 0, *, runs: int = 50, constants: Constants = DOCUMENTED
) -> tuple[Claim, dict[Method, Estimate]]:
    """The indirect filter fails where pitch passes ±90°, and the direct one does not.

    Returns
    -------
    claim : Claim
    estimates : dict
        By method, for use elsewhere.
    """
    signals = simulate(constants.motion("pitch"), constants, runs, seed)
    found: dict[Method, Estimate] = {method: estimate(signals, method) for method in METHODS}
    worst = {method: _worst(found[method]) for method in METHODS}
    lost = {method: float(np.mean(worst[method] > LOST)) for method in METHODS}
    claim = Claim(
        "4-2",
        "when pitch passes 90° the indirect filter fails and the direct one works",
        lost["indirect"] > 0.9 and lost["direct"] == 0.0,
        f"{runs} runs through +90° and −90°, twice each: more than {math.degrees(LOST):g}° off in "
        f"{100 * lost['indirect']:.0f} % of the indirect and {100 * lost['direct']:.0f} % of the direct; "
        f"median of the largest errors {math.degrees(float(np.median(worst['indirect']))):.0f}° and "
        f"{math.degrees(float(np.median(worst['direct']))):.1f}°",
    )
    return claim, found


def _worst(found: Estimate) -> FloatArray:
    """Largest error of each run, rad; half a turn where the filter has no attitude any more."""
    error = found.error[:, round(0.1 * RATE) :]
    largest: FloatArray = np.where(np.isnan(error), np.pi, error).max(axis=1)
    return largest


def accuracy_between(found: Comparison) -> list[Claim]:
    """Where the gyro-free filter stands between measurement alone and a filter with a gyroscope."""
    rows = found.second
    good, free, alone = rows.gyro_based[0.1], rows.gyro_free["direct"], rows.measurement
    cross = rows.crossing()
    return [
        Claim(
            "4-5, 5-1",
            "accuracy lies between that of direct measurement and that of the filter with gyroscopes",
            bool((good < free).all() and (free < alone).all()),
            f"{_three(free)}° in roll, pitch, yaw; measurement {_three(alone)}°, "
            f"gyroscope of 0.1 rad/s {_three(good)}°",
        ),
        Claim(
            "4-5",
            "about as good as with a gyroscope of 0.2 rad/s (here: of 0.1 to 1 rad/s)",
            bool(((cross > 0.1) & (cross < 1.0)).all()),
            f"equal at {_three(cross, 2)} rad/s in roll, pitch, yaw",
        ),
    ]


def check_all(
    seed: Seed, comparison: Comparison, *, runs: int = 50, progress: Callable[[str], object] | None = None
) -> tuple[list[Claim], dict[tuple[MotionName, Method], tuple[Estimate, Estimate]]]:
    """All claims, and the estimates of EKF and IKF they were judged by."""
    rng, tell = generator(seed), progress or (lambda _: None)
    tell("no drift at rest")
    drift = no_drift(rng, runs=runs)
    tell("IKF and EKF")
    near, pairs = ikf_is_near_ekf(rng, runs=runs)
    tell("pitch through 90°")
    pitch, _ = pitch_through_90(rng, runs=runs)
    return [drift, near, ikf_is_better(pairs), pitch, *accuracy_between(comparison)], pairs


def _window(found: Estimate, start: float = _SETTLED, stop: float = math.inf) -> FloatArray:
    """Errors (rad) of all runs from start to stop, s."""
    inside = (found.signals.time >= start) & (found.signals.time < stop)
    return found.error[:, inside]


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _three(values: FloatArray, digits: int = 3) -> str:
    return " / ".join(f"{v:.{digits}f}" for v in values)
