"""``northdown estimate``: run one estimator over a recording."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated

import typer

from northdown.cli import console, gate
from northdown.cli.output import FIGURE_SUFFIXES, ORIENTATION_SUFFIXES, check_target, write_orientation
from northdown.cli.parameters import read_assignments
from northdown.cli.reading import Reading, reads_recording
from northdown.cli.selection import DEFAULT_ESTIMATOR, check_sensors, check_smooths
from northdown.cli.summary import summarise
from northdown.errors import InputError, expected

if TYPE_CHECKING:
    from collections.abc import Callable

    from northdown.estimators import Estimator, LearntCalibration
    from northdown.orientation import Orientation
    from northdown.recording import Recording


@reads_recording
def estimate(
    reading: Reading,
    estimator: Annotated[
        str, typer.Option("--estimator", "-e", metavar="NAME", help="See 'northdown estimators'.")
    ] = DEFAULT_ESTIMATOR,
    parameter: Annotated[
        list[str], typer.Option("--parameter", "-p", metavar="NAME=VALUE", help="Such as kp=0.5; repeatable.")
    ] = [],  # noqa: B006  (typer copies it)
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", metavar="FILE", help="Write .csv, .parquet or .tum; '-': CSV here."),
    ] = None,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="Draw the Euler angles: .png, .svg or .pdf.")
    ] = None,
    offline: Annotated[
        bool, typer.Option("--offline", help="Use the whole recording, past and future, for each sample.")
    ] = False,
    learnt: Annotated[
        str | None,
        typer.Option("--learnt", metavar="FILE", help="Begin with what was learnt before (calibrating-ekf)."),
    ] = None,
    save_learnt: Annotated[
        str | None,
        typer.Option("--save-learnt", metavar="FILE", help="Write what is learnt of the sensors: .toml or .json."),
    ] = None,
    max_gap: gate.MaxGap = gate.MAX_GAP_TEXT,
    force: gate.Force = False,
) -> None:
    """Estimate the orientation over a recording, and sum it up."""
    from northdown.estimators import get

    chosen = get(estimator)
    configured = chosen(**read_assignments(chosen, parameter))
    if offline:
        check_smooths(chosen)
        if max_gap != gate.MAX_GAP_TEXT:
            raise InputError(expected("either --offline or --max-gap", "both", do="leave one out"))
    if output is not None and output != "-":
        check_target("--output", output, source=reading.source, suffixes=ORIENTATION_SUFFIXES)
    if plot is not None:
        check_target("--plot", plot, source=reading.source, suffixes=FIGURE_SUFFIXES)
    if save_learnt is not None:
        check_target("--save-learnt", save_learnt, source=reading.source, suffixes=(".toml", ".json"))
    warm = learnt is not None or save_learnt is not None
    begin = _learning(configured, learnt) if warm else None
    longest = gate.read_max_gap(max_gap)
    recording = reading.load()
    check_sensors(chosen, recording)
    gate.admit(recording, [chosen], max_gap=longest, force=force)
    if begin is not None:
        orientation, found = begin(recording, offline, longest)
        if save_learnt is not None:
            found.save(save_learnt)
    else:
        orientation = configured.smooth(recording) if offline else configured.run(recording, max_gap=longest)
    rows = summarise(recording, configured, orientation, offline=offline)
    if output is not None:
        write_orientation(orientation, output)
    if plot is not None:
        _draw(orientation, recording, plot)
    written = [name for name in (output, plot, save_learnt) if name not in (None, "-")]
    if written:
        rows.append(("Written", ", ".join(str(name) for name in written)))
    console.facts(rows, sys.stderr if output == "-" else sys.stdout)


def _learning(
    configured: Estimator, learnt: str | None
) -> Callable[[Recording, bool, float], tuple[Orientation, LearntCalibration]]:
    """The run of an estimator that begins with the file `learnt`, if there is one, and also gives what it learns.

    Raises
    ------
    InputError
        When the estimator learns nothing, or the file is not one of what was learnt.
    """
    from northdown.estimators import LearntCalibration
    from northdown.estimators.calibrating_ekf import CalibratingEKF

    if not isinstance(configured, CalibratingEKF):
        what = f"{CalibratingEKF.name} for --learnt and --save-learnt"
        raise InputError(expected(what, configured.name, do=f"choose -e {CalibratingEKF.name}"))
    known = None if learnt is None else LearntCalibration.load(learnt)
    return lambda recording, offline, longest: configured.learn(
        recording, known=known, offline=offline, max_gap=longest
    )


def _draw(orientation: Orientation, recording: Recording, path: str) -> None:
    from northdown import plots

    truth = recording if recording.reference is not None else None
    plots.save(plots.euler(orientation, truth), path)
