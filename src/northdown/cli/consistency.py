"""``northdown consistency``: whether a filter's covariance is to be believed."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from northdown.cli import console, gate
from northdown.cli.numbers import read_count, read_number
from northdown.cli.output import FIGURE_SUFFIXES, check_target
from northdown.cli.parameters import read_assignments
from northdown.cli.reading import NO_RECORDING, Reading, reads_recording, recording_optional
from northdown.cli.selection import check_sensors
from northdown.errors import InputError, expected

if TYPE_CHECKING:
    from northdown._validation import FloatArray
    from northdown.estimators import Estimator
    from northdown.evaluation import ConsistencyResult, NormalizedError

_RUNS, _SEED = 50, 0
_MOST_RUNS: Final = 100_000


@recording_optional
@reads_recording
def consistency(
    reading: Reading,
    estimator: Annotated[
        str, typer.Option("--estimator", "-e", metavar="NAME", help="One of the Kalman filters.")
    ] = "mekf",
    parameter: Annotated[
        list[str], typer.Option("--parameter", "-p", metavar="NAME=VALUE", help="Such as gyr_noise=0.01; repeatable.")
    ] = [],  # noqa: B006  (typer copies it)
    runs: Annotated[
        str | None, typer.Option("--runs", metavar="N", help=f"Simulated runs, {_RUNS} when not given.")
    ] = None,
    seed: Annotated[str | None, typer.Option("--seed", metavar="N", help="Of the runs.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Write JSON instead of a table.")] = False,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="Draw errors and bands: .png, .svg or .pdf.")
    ] = None,
    max_gap: gate.MaxGap = gate.MAX_GAP_TEXT,
    force: gate.Force = False,
) -> None:
    """Compare a filter's errors with the covariance it claims.

    On a recording with a reference, with the filter's default parameters. Without a recording, over simulated runs
    that are just as the filter's model supposes, with the filter told their noise: what is then wrong is the filter.
    """
    from northdown.estimators import get

    chosen = get(estimator)
    _check_covariance(chosen)
    values = read_assignments(chosen, parameter)
    if plot is not None:
        check_target("--plot", plot, source=reading.source or "-", suffixes=FIGURE_SUFFIXES)
    found: ConsistencyResult | NormalizedError
    mean_nis = None
    if reading.source == NO_RECORDING:
        if reading != Reading(source=NO_RECORDING) or force or max_gap != gate.MAX_GAP_TEXT:
            raise InputError(expected("a recording with the options for reading one", "none", do="name a file first"))
        found = _simulated(chosen, values, runs, seed)
    else:
        if runs is not None or seed is not None:
            raise InputError(expected("either a recording, or --runs and --seed", "both"))
        found, mean_nis = _recorded(reading, chosen(**values), gate.read_max_gap(max_gap), force)
    if plot is not None:
        from northdown import plots

        plots.save(plots.consistency(found), plot)
    if json:
        console.write_json(as_dict(found, mean_nis))
        return
    _show(found, mean_nis)
    if plot is not None:
        print(console.one_line(f"Written: {plot}"))


def _check_covariance(chosen: type[Estimator]) -> None:
    from northdown.estimators import registry

    if "covariance" not in chosen.outputs:
        able = [name for name, other in registry().items() if "covariance" in other.outputs]
        raise InputError(expected(f"an estimator with a covariance out of {', '.join(able)}", chosen.name))


def _simulated(
    chosen: type[Estimator], values: dict[str, Any], runs: str | None, seed: str | None
) -> ConsistencyResult:
    from northdown.evaluation import monte_carlo

    count = _RUNS if runs is None else read_count("--runs", runs)
    read_number("--runs", str(count), low=2, high=_MOST_RUNS)
    number = _SEED if seed is None else read_count("--seed", seed)
    with console.progress([f"{k + 1} of {count}" for k in range(count)], "run") as names:
        return monte_carlo(chosen, count, number, parameters=values, progress=lambda _: next(names, None))


def _recorded(
    reading: Reading, configured: Estimator, longest: float, force: bool
) -> tuple[NormalizedError, float | None]:
    """Errors over what the covariance says, and the mean NIS per measurement where the filter tells it."""
    from northdown.evaluation import nees

    recording = reading.load()
    check_sensors(type(configured), recording)
    gate.admit(recording, [type(configured)], max_gap=longest, force=force)
    result = configured.run(recording, max_gap=longest)
    found = nees(result, recording)
    if found.alignment is not None:
        for finding in found.alignment.findings:
            if finding.severity != "note":
                console.warn(f"warning: {finding.message}")
    dof = float(result.diagnostics["nis_dof"].sum()) if "nis_dof" in result.diagnostics else 0.0
    return found, float(result.diagnostics["nis"].sum()) / dof if dof > 0.0 else None


def _show(found: ConsistencyResult | NormalizedError, mean_nis: float | None) -> None:
    from northdown.evaluation import ConsistencyResult, coverage

    if isinstance(found, ConsistencyResult):
        console.paragraph(f"{found.name}: {found.verdict}.")
        print()
        _axis_table("NED", found.share, found.rms_error, found.rms_sigma)
        print()
        console.facts(_facts(found))
        return
    what = coverage(found)
    aligned = "" if found.alignment is None else ", after aligning axes, which makes errors look smaller"
    console.paragraph(f"{found.name}: {_judgement(what.factor)} ({what.count} samples that count{aligned}).")
    print()
    _axis_table(what.frame, what.share, what.rms_error, what.rms_sigma)
    print()
    rows = [("Mean NEES", f"{what.mean_nees:.3g}; 3 is right")]
    if mean_nis is not None:
        rows.append(("Mean NIS", f"{mean_nis:.3g}; 1 per measurement is right"))
    console.facts(rows)


def _judgement(factor: float) -> str:
    """A recording's errors over what the covariance says, in words; one recording proves no small departure."""
    if factor > 1.0:
        return f"errors are {factor:.2f} times what its covariance says"
    return f"its covariance says {1.0 / factor:.2f} times the errors"


def _facts(found: ConsistencyResult) -> list[tuple[str, str]]:
    percent = f"{100.0 * found.confidence:g} %"
    rows = [
        ("Runs", f"{found.runs} of {found.time[-1]:g} s, seed {found.seed}"),
        (
            "Mean NEES",
            f"{found.anees:.3f} ({percent}: {found.interval[0]:.3f} to {found.interval[1]:.3f}); 3 is right",
        ),
        (
            "Over time",
            f"{100.0 * found.inside:.1f} % of the times within {found.bounds[0]:.2f} to {found.bounds[1]:.2f}; "
            f"{percent} is right",
        ),
    ]
    if found.anis is not None and found.nis_interval is not None:
        low, high = found.nis_interval
        rows.append(
            ("Mean NIS", f"{found.anis:.4f} ({percent}: {low:.4f} to {high:.4f}); 1 per measurement is right")
        )
    if found.bias is not None and found.bias_bounds is not None:
        axes = ", ".join(f"{v:.2f}" for v in found.bias)
        low, high = found.bias_bounds
        rows.append(("Bias", f"(error/sigma)² of x, y, z: {axes} ({low:.2f} to {high:.2f} is right)"))
    return rows


def _axis_table(frame: Any, share: FloatArray, rms_error: FloatArray, rms_sigma: FloatArray) -> None:
    from northdown.evaluation.consistency import AXIS_NAMES, NORMAL_SHARES

    rows = [
        (
            f"about {axis}",
            f"{math.degrees(rms_error[k]):.3f}",
            f"{math.degrees(rms_sigma[k]):.3f}",
            *(f"{100.0 * s:.1f}" for s in share[:, k]),
        )
        for k, axis in enumerate(AXIS_NAMES[frame])
    ]
    rows.append(("when right", "", "", *(f"{100.0 * s:.1f}" for s in NORMAL_SHARES)))
    console.table(("", "RMS error °", "RMS sigma °", "% in 1σ", "% in 2σ", "% in 3σ"), rows)


def as_dict(found: ConsistencyResult | NormalizedError, mean_nis: float | None = None) -> dict[str, Any]:
    """The figures for programs; angles in degrees. `mean_nis` is that of a recording."""
    from northdown.evaluation import ConsistencyResult

    if isinstance(found, ConsistencyResult):
        return _simulation_as_dict(found)
    return {**_recording_as_dict(found), "mean_nis": mean_nis}


def _simulation_as_dict(found: ConsistencyResult) -> dict[str, Any]:
    return {
        "estimator": found.name,
        "runs": found.runs,
        "seed": found.seed,
        "confidence": found.confidence,
        "mean_nees": found.anees,
        "mean_nees_interval": list(found.interval),
        "nees_bounds": list(found.bounds),
        "times_inside": found.inside,
        "factor": found.factor,
        "consistent": found.consistent,
        "verdict": found.verdict,
        **_axes_as_dict("NED", found.share, found.rms_error, found.rms_sigma),
        "mean_nis": found.anis,
        "mean_nis_interval": None if found.nis_interval is None else list(found.nis_interval),
        "nis_bounds": None if found.nis_bounds is None else list(found.nis_bounds),
        "bias_mean_square": None if found.bias is None else found.bias.tolist(),
        "bias_bounds": None if found.bias_bounds is None else list(found.bias_bounds),
    }


def _recording_as_dict(found: NormalizedError) -> dict[str, Any]:
    from northdown.evaluation import coverage

    what = coverage(found)
    return {
        "estimator": found.name,
        "samples": what.count,
        "alignment": None if found.alignment is None else found.alignment.kind,
        "mean_nees": what.mean_nees,
        "factor": what.factor,
        **_axes_as_dict(what.frame, what.share, what.rms_error, what.rms_sigma),
    }


def _axes_as_dict(frame: Any, share: FloatArray, rms_error: FloatArray, rms_sigma: FloatArray) -> dict[str, Any]:
    from northdown.evaluation.consistency import AXIS_NAMES

    return {
        "frame": frame,
        "axes": [
            {
                "about": axis,
                "rms_error_deg": math.degrees(rms_error[k]),
                "rms_sigma_deg": math.degrees(rms_sigma[k]),
                "within_sigma": share[:, k].tolist(),
            }
            for k, axis in enumerate(AXIS_NAMES[frame])
        ],
    }
