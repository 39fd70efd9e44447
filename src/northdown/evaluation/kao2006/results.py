"""Everything of K06's chapters 3 and 4 in one call, and its tables as text, for a screen or for a file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from northdown._validation import FloatArray
from northdown.evaluation.kao2006 import published
from northdown.evaluation.kao2006.claims import Claim, check_all
from northdown.evaluation.kao2006.comparison import RUNS, Comparison, Rows, compare, published_crossing
from northdown.evaluation.kao2006.observable import Configured, as_printed, configurations
from northdown.evaluation.kao2006.published import ENTRIES, MotionName, Row
from northdown.evaluation.kao2006.tables import Entry, agreement, sigma_entries
from northdown.evaluation.kao2006.thesis_filter import Estimate
from northdown.evaluation.printed_table import PrintedTable
from northdown.simulation.seeds import check_seed, generator

ROW_LEAST_NOISE: Final = 0.03
"""Row of table 4.14 that the statistic over a second does not give, rad/s."""

_ANGLES: Final = ("roll", "pitch", "yaw")


class Calibration(NamedTuple):
    """RMS errors of many runs at two seconds over the filter's own standard deviations."""

    motion: MotionName
    method: str
    ratio: FloatArray


@dataclass(frozen=True, eq=False)
class Results:
    """What came of K06's experiments.

    Parameters
    ----------
    seed : int
        Of all noise.
    entries : tuple of Entry
        Tables 4.2 to 4.13.
    comparison : Comparison
        Tables 4.14 and 4.15.
    claims : tuple of Claim
        What K06 claims beside.
    calibrations : tuple of Calibration
        Whether the standard deviations are those of the errors.
    configurations : tuple of Configured
        Figures 3.4 to 3.11.
    printed : Configured
        The first of them with K06's equations to the letter.
    """

    seed: int
    entries: tuple[Entry, ...]
    comparison: Comparison
    claims: tuple[Claim, ...]
    calibrations: tuple[Calibration, ...]
    configurations: tuple[Configured, ...]
    printed: Configured

    def tables(self) -> list[PrintedTable]:
        """All tables, ours beside K06's."""
        return [
            *_sigma_tables(self.entries),
            _calibration_table(self.calibrations),
            _second_table(self.comparison),
            _half_table(self.comparison),
            _rate_table(self.comparison),
            _observability_table(self.configurations, self.printed),
            _claims_table(self.claims),
        ]


def reproduce(
    seed: int = 0, *, runs: int = 50, compared: int = RUNS, progress: Callable[[str], object] | None = None
) -> Results:
    """Make K06's tables and put its claims to the test.

    Parameters
    ----------
    seed : int
        Of all noise.
    runs : int
        Simulated runs for each of the claims.
    compared : int
        Simulated runs for table 4.14.
    progress : callable, optional
        Called with what comes next.
    """
    number = check_seed(seed)
    tell = progress or (lambda _: None)
    entries = sigma_entries(generator(number, 1), progress=lambda name: tell(f"tables 4.2 to 4.13: {name}"))
    comparison = compare(compared, generator(number, 2), progress=lambda name: tell(f"table 4.14: {name}"))
    claims, pairs = check_all(
        generator(number, 3), comparison, runs=runs, progress=lambda name: tell(f"claims: {name}")
    )
    tell("observability")
    return Results(
        seed=number,
        entries=entries,
        comparison=comparison,
        claims=tuple(claims),
        calibrations=tuple(_calibration(key[0], key[1], ekf) for key, (ekf, _) in pairs.items()),
        configurations=configurations(),
        printed=as_printed(),
    )


STEPS: Final = len(published.SIGMA) + 2 + len(published.GYRO_BASED) + 3 + 1
"""How often `reproduce` calls `progress`."""


def _calibration(motion: MotionName, method: str, found: Estimate) -> Calibration:
    truth = found.signals
    error = np.concatenate([found.rate[:, -1] - truth.rate[-1], np.rad2deg(found.euler_error[:, -1])], axis=1)
    own = np.sqrt(np.mean(np.square(found.sigma(-1)), axis=0))[[0, 1, 2, 7, 8, 9]]
    return Calibration(motion, method, np.sqrt(np.mean(error**2, axis=0)) / own)


def _sigma_tables(entries: Sequence[Entry]) -> list[PrintedTable]:
    header = ("table", "motion", "method", "filter", "1-σ of", "K06", "ours", "ratio", "derived", "derived ratio")
    rows = [
        (
            e.table,
            *e.row,
            f"{e.name} {e.unit}".strip(),
            f"{e.published:.6g}",
            f"{e.ours:.6g}",
            f"{e.ratio:.3f}",
            f"{e.derived:.6g}",
            f"{e.derived_ratio:.3f}",
        )
        for e in entries
    ]
    near, free = agreement([e.ratio for e in entries]), agreement([e.derived_ratio for e in entries])
    notes = [
        "ours: K06's filter with the constants above; derived: northdown's gyro-free filters, with all noise derived "
        "and one attitude at the start (level, yaw 15°).",
        f"ours: {100 * near.rms:.1f} % rms, no entry off by more than a factor {near.worst:.2f}; derived: "
        f"{100 * free.rms:.1f} % and {free.worst:.2f}.",
    ]
    by_row = []
    for row in published.SIGMA:
        ratios = {e.name: e for e in entries if e.row == row}
        by_row.append((*row, *(f"{ratios[name].ratio:.3f}" for name in ENTRIES)))
        by_row.append(("", "", "derived", *(f"{ratios[name].derived_ratio:.3f}" for name in ENTRIES)))
    short = PrintedTable(
        "ratios",
        "Tables 4.2 to 4.13: ratio of the filters' own 1-σ at t = 2 s to K06's",
        ("motion", "method", "filter", *ENTRIES),
        by_row,
        notes,
        3,
    )
    return [
        PrintedTable("tables-4.2-4.13", "Tables 4.2 to 4.13: the filters' own 1-σ at t = 2 s", header, rows, [], 5),
        short,
    ]


def _calibration_table(found: Sequence[Calibration]) -> PrintedTable:
    names = ("ωx", "ωy", "ωz", *_ANGLES)
    rows = [(c.motion, c.method, *(f"{v:.2f}" for v in c.ratio)) for c in found]
    note = "1 is right; below, the filter is better than it says, as with the noise of gravity's y component doubled."
    title = "RMS error at t = 2 s over the filter's own 1-σ (EKF, constants above)"
    return PrintedTable("errors-over-sigma", title, ("motion", "method", *names), rows, [note], 2)


def _comparison_table(rows: Rows, key: str, notes: Sequence[str]) -> PrintedTable:
    header = ("errors (°)", *(f"{a}{what}" for a in _ANGLES for what in (" K06", " ours", " ratio")))
    lines = [("measurement alone", published.MEASUREMENT, rows.measurement)]
    lines += [(f"gyroscope of {n:g} rad/s", published.GYRO_BASED[n], row) for n, row in rows.gyro_based.items()]
    lines += [(f"gyro-free, {name}", published.GYRO_FREE, row) for name, row in rows.gyro_free.items()]
    title = f"Table 4.14: with and without a gyroscope, standard deviation over {rows.start:g} to 2 s"
    return PrintedTable(key, title, header, [(name, *_compared(k06, ours)) for name, k06, ours in lines], notes)


def _second_table(found: Comparison) -> PrintedTable:
    shown, k06 = found.second.crossing(), published_crossing()
    notes = [
        f"At rest, about the mean of each of {found.runs} runs. K06 does not say which statistic it prints; this one "
        f"does not give the row of {ROW_LEAST_NOISE:g} rad/s.",
        "A gyroscope is as good as none at "
        + ", ".join(f"{a} {h:.2f} (K06 {t:.2f})" for a, h, t in zip(_ANGLES, shown, k06, strict=True))
        + " rad/s.",
    ]
    return _comparison_table(found.second, "table-4.14", notes)


def _half_table(found: Comparison) -> PrintedTable:
    ratios = np.concatenate([row / published.GYRO_BASED[n] for n, row in found.half.gyro_based.items()])
    near = agreement(ratios)
    note = (
        f"Over half a second all rows with a gyroscope come out, {100 * near.rms:.0f} % rms and within a factor "
        f"{near.worst:.2f}; the gyro-free ones with twice the radius."
    )
    return _comparison_table(found.half, "table-4.14-half-second", [note])


def _rate_table(found: Comparison) -> PrintedTable:
    header = ("rate (rad/s)", "over", *(f"ω{a}{what}" for a in "xyz" for what in (" K06", " ours", " ratio")))
    rows = [
        (name, f"{part.start:g} to 2 s", *_compared(published.GYRO_FREE_RATE, rate, 4))
        for part in (found.second, found.half)
        for name, rate in part.rate.items()
    ]
    own = published.SIGMA[Row("rest", "direct", "EKF")][:3]
    note = "K06's own 1-σ in table 4.11 is about twice that of 4.15: " + ", ".join(f"{s:.4f}" for s in own)
    return PrintedTable("table-4.15", "Table 4.15: rate of the gyro-free filter", header, rows, [note], 2)


def _compared(k06: Sequence[float], ours: FloatArray, digits: int = 3) -> list[str]:
    """Published, ours and ratio of each of three."""
    return [
        text
        for a, b in zip(k06, ours, strict=True)
        for text in (f"{a:.{digits}f}", f"{b:.{digits}f}", f"{b / a:.2f}")
    ]


def _observability_table(found: Sequence[Configured], printed: Configured) -> PrintedTable:
    rows = []
    for one in found:
        c, (least, most) = one.configuration, one.zeros
        zeros = f"{least}" if least == most else f"{least} to {most}"
        agrees = "yes" if one.agrees else "no"
        rows.append((c.figure, c.method, c.state, c.sensors, f"{c.zeros}", zeros, f"{one.smallest:.3g}", agrees))
    note = (
        "Figure 3.4 holds with equations that do not depend on the quaternion's length. With K06's to the letter no "
        f"value is zero; the smallest is {printed.smallest:.2g}."
    )
    header = ("figure", "method", "states", "sensors", "zeros K06", "ours", "smallest other", "agrees")
    return PrintedTable(
        "figures-3.4-3.11", "Figures 3.4 to 3.11: singular values that are zero", header, rows, [note], 4
    )


def _claims_table(claims: Sequence[Claim]) -> PrintedTable:
    rows = [(c.source, c.text, "yes" if c.held else "NO", c.finding) for c in claims]
    return PrintedTable("claims", "What K06 claims", ("section", "claim", "held", "finding"), rows, [], 4)
