"""``northdown observability``: what of attitude, bias and field the sensors can tell along a motion."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from northdown.cli import console, gate
from northdown.cli.numbers import read_count, read_number
from northdown.cli.output import FIGURE_SUFFIXES, check_target
from northdown.cli.reading import NO_RECORDING, Reading, reads_recording, recording_optional
from northdown.cli.selection import DEFAULT_ESTIMATOR, check_sensors
from northdown.errors import InputError, expected
from northdown.simulation.motion_library import MOTIONS

if TYPE_CHECKING:
    from northdown.evaluation.observability_result import Observability
    from northdown.orientation import Orientation
    from northdown.simulation import Motion

_MOTION, _DURATION, _SEED = "k06-sine", 10.0, 0
_LONGEST: Final = 1e5
_MOST_POINTS: Final = 100_000


@recording_optional
@reads_recording
def observability(
    reading: Reading,
    motion: Annotated[
        str | None, typer.Option("--motion", metavar="NAME", help=f"Without REC: {', '.join(MOTIONS)}.")
    ] = None,
    duration: Annotated[str | None, typer.Option("--duration", metavar="S", help="Of the motion.")] = None,
    seed: Annotated[str | None, typer.Option("--seed", metavar="N", help="Of a random motion.")] = None,
    sensors: Annotated[
        str, typer.Option("--sensors", metavar="AXES", help="Such as 'acc yz, mag xy'; gyr with an unknown rate.")
    ] = "acc xyz, mag xyz",
    state: Annotated[
        str, typer.Option("--state", metavar="NAME", help="quaternion, quaternion+norm, euler or tangent.")
    ] = "quaternion",
    unknown: Annotated[
        list[str],
        typer.Option("--unknown", metavar="NAME", help="gyr_bias, field, dip or rate, also to be found; repeatable."),
    ] = [],  # noqa: B006  (typer copies it)
    method: Annotated[
        str, typer.Option("--method", metavar="NAME", help="direct: the axes; indirect: angles made of them.")
    ] = "direct",
    variant: Annotated[
        str, typer.Option("--variant", metavar="NAME", help="scale-free, printed-pitch, printed-rate or printed.")
    ] = "scale-free",
    order: Annotated[str, typer.Option("--order", metavar="N", help="Highest derivative, 0 to 8.")] = "3",
    dip: Annotated[str, typer.Option("--dip", metavar="DEG", help="Of the magnetic field.")] = "60",
    tolerance: Annotated[
        str, typer.Option("--tolerance", metavar="PART", help="Of the largest singular value; up to it is zero.")
    ] = "1e-10",
    points: Annotated[str, typer.Option("--points", metavar="N", help="Times to look at.")] = "1001",
    bandwidth: Annotated[
        str, typer.Option("--bandwidth", metavar="HZ", help="Of a recording's motion; smoothed above it.")
    ] = "10",
    estimator: Annotated[
        str, typer.Option("--estimator", "-e", metavar="NAME", help="For a recording without reference.")
    ] = DEFAULT_ESTIMATOR,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="Draw singular values and rank: .png, .svg or .pdf.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Write JSON instead of text.")] = False,
    max_gap: gate.MaxGap = gate.MAX_GAP_TEXT,
    force: gate.Force = False,
) -> None:
    """Tell which states can be found from which sensors.

    Rank and singular values of the derivatives of what is measured by the states, along a motion by name, or along
    that of a recording: its reference, or an estimate.
    """
    options = _options(state, unknown, method, variant, order, dip, tolerance)
    count = int(read_number("--points", str(read_count("--points", points)), low=2, high=_MOST_POINTS))
    width = read_number("--bandwidth", bandwidth, above=0.0, unit="Hz")
    if plot is not None:
        check_target("--plot", plot, source=reading.source or "-", suffixes=FIGURE_SUFFIXES)
    path: Motion | Orientation
    if reading.source == NO_RECORDING:
        if reading != Reading(source=NO_RECORDING) or force or max_gap != gate.MAX_GAP_TEXT:
            raise InputError(expected("a recording with the options for reading one", "none", do="name a file first"))
        path, origin = _simulated(motion, duration, seed), ""
    else:
        if motion is not None or duration is not None or seed is not None:
            raise InputError(expected("either a recording, or --motion, --duration and --seed", "both"))
        path, origin = _recorded(reading, estimator, gate.read_max_gap(max_gap), force)
    found = _analyse(path, sensors, options, count, width)
    if plot is not None:
        from northdown import plots

        plots.save(plots.observability(found), plot)
    if json:
        console.write_json(as_dict(found))
        return
    _show(found, origin, plot)


def _options(
    state: str, unknown: list[str], method: str, variant: str, order: str, dip: str, tolerance: str
) -> dict[str, Any]:
    """What the library's function takes, from what was typed."""
    from northdown._validation import check_choice
    from northdown.evaluation.observability_analysis import HIGHEST_ORDER
    from northdown.evaluation.observability_models import METHODS, STATES, UNKNOWNS, VARIANTS

    return {
        "state": check_choice("--state", state, STATES),
        "unknown": [check_choice("--unknown", name, UNKNOWNS) for name in unknown],
        "method": check_choice("--method", method, METHODS),
        "variant": check_choice("--variant", variant, VARIANTS),
        "order": int(read_number("--order", str(read_count("--order", order)), high=HIGHEST_ORDER)),
        "dip": math.radians(read_number("--dip", dip, low=-90.0, high=90.0, unit="°")),
        "tolerance": read_number("--tolerance", tolerance, above=0.0, high=0.1),
    }


def _analyse(
    path: Motion | Orientation, sensors: str, options: dict[str, Any], count: int, bandwidth: float
) -> Observability:
    import numpy as np

    from northdown.evaluation import observability as analyse
    from northdown.evaluation.observability_analysis import follow

    law = follow(path, bandwidth=bandwidth)
    return analyse(law, sensors, times=np.linspace(law.start, law.stop, count), **options)


def _simulated(motion: str | None, duration: str | None, seed: str | None) -> Motion:
    from northdown._validation import check_choice

    name = check_choice("--motion", _MOTION if motion is None else motion, tuple(MOTIONS))
    length = (
        _DURATION if duration is None else read_number("--duration", duration, above=0.0, high=_LONGEST, unit="s")
    )
    return MOTIONS[name](length, _SEED if seed is None else read_count("--seed", seed))


def _recorded(reading: Reading, estimator: str, longest: float, force: bool) -> tuple[Orientation, str]:
    """Attitude over a recording, and where it comes from: the reference if its vertical is the true one."""
    from northdown.estimators import get

    recording = reading.load()
    if recording.reference is not None and recording.reference_offset != "rotations":
        return recording.reference, "the recording's reference"
    chosen = get(estimator)
    check_sensors(chosen, recording)
    gate.admit(recording, [chosen], max_gap=longest, force=force)
    return chosen().run(recording, max_gap=longest), f"an estimate of {chosen.name}"


def _show(found: Observability, origin: str, plot: str | None) -> None:
    rows = list(found.lines())
    if origin:
        rows.append(("Attitude", origin))
        if found.order > 1:
            rows.append(("", "its noise makes what is weakly observable look better; --order 0 is free of that"))
    if plot is not None:
        rows.append(("Written", plot))
    if found.defined.any():
        console.table(("singular value", "smallest", "median", "largest"), _rows(found))
        print()
    console.facts(rows)


def _rows(found: Observability) -> list[tuple[str, ...]]:
    import numpy as np

    values = found.singular_values[found.defined]
    values = np.where(values > found.limit[found.defined, None], values, 0.0)
    columns = zip(values.min(axis=0), np.median(values, axis=0), values.max(axis=0), strict=True)
    return [(f"{k + 1} of {found.states}", *(f"{v:.3g}" for v in row)) for k, row in enumerate(columns)]


def as_dict(found: Observability) -> dict[str, Any]:
    """The figures for programs."""
    import numpy as np

    values = found.singular_values[found.defined]
    return {
        "motion": found.name,
        "times": len(found),
        "undefined": int((~found.defined).sum()),
        "states": list(found.model.state_names),
        "measurements": list(found.model.measurement_names),
        "method": found.model.method,
        "variant": found.model.variant,
        "order": found.order,
        "tolerance": found.tolerance,
        "observable": found.observable,
        "rank": [
            {"rank": int(r), "share": float(c) / len(found)}
            for r, c in zip(*np.unique(found.rank[found.defined], return_counts=True), strict=True)
        ],
        "unobservable": [{"text": f.text, "share": f.share} for f in found.findings],
        "smallest_singular_values": values.min(axis=0).tolist() if len(values) else [],
        "largest_singular_values": values.max(axis=0).tolist() if len(values) else [],
        "weakest": found.weakest,
        "overall": {
            "rank": found.overall_rank,
            "singular_values": found.overall.tolist(),
            "unobservable": list(found.overall_unobservable),
        },
    }
