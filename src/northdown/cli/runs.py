"""Several estimators over one recording: their results, errors and times."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from northdown.cli import console
from northdown.errors import InputError

if TYPE_CHECKING:
    from northdown.checks import Finding
    from northdown.estimators import Estimator
    from northdown.evaluation import AttitudeError, ClockOffset
    from northdown.orientation import Orientation
    from northdown.recording import Recording

# As many as a figure shows distinctly.
MOST_CURVES = 6


@dataclass(frozen=True, eq=False)
class Run:
    """One estimator's result on a recording.

    Parameters
    ----------
    name : str
        The estimator's name; "(offline)" after it where it used the whole recording for each sample.
    orientation : Orientation, optional
        None when the estimator could not run.
    nanoseconds : float
        Time per sample of a compiled run, ns.
    error : AttitudeError, optional
        Against the reference, or against the first of the runs where there is no reference.
    problem : str
        Why there is no orientation or no error; empty when there are both.
    """

    name: str
    orientation: Orientation | None = None
    nanoseconds: float = float("nan")
    error: AttitudeError | None = None
    problem: str = ""


def run_all(
    recording: Recording,
    estimators: Sequence[type[Estimator]],
    *,
    max_gap: float,
    offline: bool = False,
    clock: ClockOffset | None = None,
) -> list[Run]:
    """Run estimators with their default parameters; best first where there is a reference.

    With `offline`, those that smooth do so too. `clock` is taken out of all errors to the reference.

    Raises
    ------
    InputError
        When none of them could run: the first one's reason.
    """
    ways: dict[str, Callable[[Recording], Orientation]] = {}
    for chosen in estimators:
        estimator = chosen()
        ways[chosen.name] = partial(estimator.run, max_gap=max_gap)
        if offline and chosen.smooths:
            ways[f"{chosen.name} (offline)"] = estimator.smooth
    runs: list[Run] = []
    with console.progress(list(ways), "running") as names:
        for name in names:
            first = next((r.orientation for r in runs if r.orientation is not None), None)
            try:
                runs.append(_run(name, ways[name], recording, first, clock))
            except InputError as problem:
                runs.append(Run(name, problem=str(problem)))
    if runs and all(run.orientation is None for run in runs):
        raise InputError(runs[0].problem)
    if recording.reference is not None:
        runs.sort(key=lambda run: float("inf") if run.error is None else run.error.rmse().total)
    return runs


def _run(
    name: str,
    way: Callable[[Recording], Orientation],
    recording: Recording,
    first: Orientation | None,
    clock: ClockOffset | None,
) -> Run:
    from northdown.evaluation import attitude_error

    # compile, or load the compiled code, outside of what is timed
    way(recording[:1])
    begin = time.perf_counter_ns()
    orientation = way(recording)
    nanoseconds = (time.perf_counter_ns() - begin) / max(len(recording), 1)
    try:
        if recording.reference is not None:
            error = attitude_error(orientation, recording, clock=clock or "as recorded")
        else:
            error = attitude_error(orientation, orientation if first is None else first)
    except InputError as problem:
        return Run(name, orientation, nanoseconds, problem=str(problem))
    return Run(name, orientation, nanoseconds, error)


def error_table(runs: Sequence[Run], *, end_heading: bool) -> None:
    """Write the table of errors (degrees, RMS) to standard output."""
    import math

    header = ["estimator", "total °", "heading °", "inclination °"]
    if end_heading:
        header.append("end heading °")
    rows = []
    for run in runs:
        if run.error is None:
            cells = ["–"] * (len(header) - 1)
        else:
            rms = run.error.rmse()
            cells = [f"{v:.2f}" for v in (rms.total_deg, rms.heading_deg, rms.inclination_deg)]
            if end_heading:
                cells.append(f"{math.degrees(run.error.heading_signed[-1]):+.2f}")
        speed = "–" if run.orientation is None else f"{run.nanoseconds:.0f}"
        rows.append((run.name, *cells, speed))
    console.table((*header, "ns/sample"), rows)


def remarks(runs: Sequence[Run]) -> None:
    """Write what went wrong, and what is doubtful about an alignment, to standard error."""
    doubtful: dict[str, list[tuple[str, str]]] = {}
    for run in runs:
        if run.problem:
            console.warn(f"warning: {run.name}: {run.problem}")
        for finding in warnings_of(run.error):
            doubtful.setdefault(finding.kind, []).append((run.name, finding.message))
    for (name, message), *others in doubtful.values():
        likewise = f" (likewise for {len(others)} more)" if others else ""
        console.warn(f"warning: {name}: {message}{likewise}")


def warnings_of(error: AttitudeError | None) -> list[Finding]:
    """What to know before trusting the alignment that was made for an error."""
    if error is None or error.alignment is None:
        return []
    return [finding for finding in error.alignment.findings if finding.severity != "note"]
