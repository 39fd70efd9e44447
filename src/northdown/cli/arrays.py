"""``northdown arrays``: what an array of accelerometers can measure, and which one would be better."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

import typer

from northdown.cli import console
from northdown.cli.geometry import read_geometry
from northdown.cli.numbers import read_count, read_number
from northdown.cli.output import FIGURE_SUFFIXES, check_target
from northdown.errors import InputError, expected

if TYPE_CHECKING:
    from northdown.arrays import ArrayAnalysis, ErrorBudget, Placement
    from northdown.arrays.design import Removal

_GEOMETRIES = "coplanar6, coplanar7, coplanar7-printed, cube6, cube9, tetrahedron12, ring6, ring8, …"


def arrays(
    file: Annotated[
        str | None, typer.Argument(metavar="FILE.toml", help="Geometry of your own; see --out for its form.")
    ] = None,
    geometry: Annotated[str | None, typer.Option("--geometry", metavar="NAME", help=f"{_GEOMETRIES}.")] = None,
    radius: Annotated[
        str | None, typer.Option("--radius", metavar="M", help="Of the named geometry; the side of a cube.")
    ] = None,
    best: Annotated[
        str | None, typer.Option("--best", metavar="K", help="Find the best places for K accelerometers.")
    ] = None,
    plane: Annotated[
        str | None, typer.Option("--plane", metavar="M", help="Side of the square for --best; 0.1 when not given.")
    ] = None,
    criterion: Annotated[
        str | None,
        typer.Option("--criterion", metavar="D|A", help="D: least volume of errors, A: least sum of squares. D."),
    ] = None,
    spacing: Annotated[
        str | None, typer.Option("--spacing", metavar="M", help="Least distance of two; a twentieth of --plane.")
    ] = None,
    seed: Annotated[str | None, typer.Option("--seed", metavar="N", help="Of the search of --best; 0.")] = None,
    noise_density: Annotated[
        str | None,
        typer.Option(
            "--noise-density", metavar="UG", help="Of an accelerometer's data sheet, µg/√Hz: errors of rate."
        ),
    ] = None,
    plot: Annotated[str | None, typer.Option("--plot", metavar="FILE", help="Draw it: .png, .svg or .pdf.")] = None,
    out: Annotated[str | None, typer.Option("--out", metavar="FILE.toml", help="Write the geometry.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Write JSON instead of text.")] = False,
) -> None:
    """Judge accelerometers that stand in for gyroscopes.

    Without a geometry, the named ones are compared.
    """
    _check_one(file, geometry, best)
    searching = {"--plane": plane, "--criterion": criterion, "--spacing": spacing, "--seed": seed}
    misplaced = [name for name, v in searching.items() if v is not None and best is None]
    misplaced += ["--radius"] if radius is not None and best is not None else []
    if misplaced:
        raise InputError(expected(f"{misplaced[0]} with {'--geometry' if best else '--best'}", "it without"))
    for option, path, suffixes in (("--plot", plot, FIGURE_SUFFIXES), ("--out", out, (".toml",))):
        if path is not None:
            check_target(option, path, source=file or "-", suffixes=suffixes)
    density = None
    if noise_density is not None:
        density = read_number("--noise-density", noise_density, above=0.0, unit="µg/√Hz")
    if file is None and geometry is None and best is None:
        if any(v is not None for v in (plot, out, radius, density)) or json:
            raise InputError(expected("a geometry", "none", do="give a TOML file, --geometry or --best"))
        _compare()
        return
    placement = None
    if best is not None:
        placement = _search(best, plane or "0.1", criterion or "D", spacing, seed or "0")
        analysis = placement.analysis
    else:
        from northdown.arrays import analyse

        analysis = analyse(read_geometry("the array", geometry or str(file), radius))
    written = _write(analysis, plot, out)
    if json:
        console.write_json(_as_dict(analysis, density))
        return
    _show(analysis, placement, density)
    if written:
        console.facts([("\nWritten", ", ".join(written))])


def _check_one(file: str | None, geometry: str | None, best: str | None) -> None:
    given = [name for name, v in (("a file", file), ("--geometry", geometry), ("--best", best)) if v is not None]
    if len(given) > 1:
        raise InputError(expected("one of a file, --geometry and --best", " and ".join(given)))
    if file is not None and not file.lower().endswith(".toml"):
        raise InputError(expected("a TOML file", repr(file), do="give names of geometries with --geometry"))


def _search(best: str, plane: str, criterion: str, spacing: str | None, seed: str) -> Placement:
    from northdown.arrays import best_in_plane

    count = read_count("--best", best)
    with console.busy("searching", show=True):
        return best_in_plane(
            count,
            read_number("--plane", plane, above=0.0, unit="m"),
            criterion=criterion.upper(),
            spacing=None if spacing is None else read_number("--spacing", spacing, low=0.0, unit="m"),
            seed=read_count("--seed", seed),
        )


def _compare() -> None:
    """Table of the named geometries."""
    from northdown.arrays import GEOMETRIES, analyse, geometry

    rows = []
    for name in (*GEOMETRIES, "ring6", "ring8", "ring12"):
        found = analyse(geometry(name))
        rows.append(
            (
                name,
                f"{len(found.array)}",
                f"{1e3 * found.length:.1f}",
                f"{found.condition:.2f}",
                f"{found.angular_dilution * found.length:.2f}",
                f"{found.force_dilution:.2f}",
                f"{len(found.measured_products)}",
            )
        )
    console.table(
        ("geometry", "number", "size mm", "condition", "angular noise · size", "force noise", "products"), rows
    )
    console.paragraph(
        "Noise is that of all axes together for each unit of an accelerometer's; products: how many combinations of "
        "products of rates the redundancy measures. Look at one: northdown arrays --geometry ring8 --radius 0.05"
    )


def _write(analysis: ArrayAnalysis, plot: str | None, out: str | None) -> list[str]:
    written = []
    if plot is not None:
        from northdown import plots

        plots.save(plots.array(analysis.array), plot)
        written.append(plot)
    if out is not None:
        from northdown.io import write_array

        write_array(analysis.array, out)
        written.append(out)
    return written


def _show(analysis: ArrayAnalysis, placement: Placement | None, density: float | None) -> None:
    from northdown.arrays.design import leave_one_out
    from northdown.arrays.summary import summary_rows

    rows = summary_rows(analysis)
    if placement is not None:
        text = (
            f"{placement.criterion}-optimal in {1e3 * placement.side:g} mm, {1e3 * placement.spacing:g} mm apart or "
            f"more; best of {placement.starts} starts, the third is {100.0 * placement.spread:.1f} % worse"
        )
        rows.insert(1, ("Search", text))
    console.facts(rows)
    if placement is not None:
        print()
        _places(analysis)
    print("\nWithout one of them, noise grows by the factor:\n")
    console.table(("without", "angular", "force", "condition"), [_removal(r) for r in leave_one_out(analysis)])
    if density is not None:
        print(f"\nAccelerometers of {density:g} µg/√Hz in place of a gyroscope:")
        for line in _budget(analysis, density).summary().splitlines():
            console.paragraph(line, indent=2)


def _budget(analysis: ArrayAnalysis, density: float) -> ErrorBudget:
    from northdown.arrays import ErrorBudget
    from northdown.simulation.motion import STANDARD_GRAVITY

    # one-sided density of a data sheet to the coefficient of the Allan deviation
    return ErrorBudget(analysis, density * 1e-6 * STANDARD_GRAVITY / math.sqrt(2.0))


def _places(analysis: ArrayAnalysis) -> None:
    array = analysis.array
    console.table(
        ("name", "x mm", "y mm", "senses x", "y", "z"),
        [
            (name, *(f"{1e3 * v:.1f}" for v in place[:2]), *(f"{v:.3f}" for v in line))
            for name, place, line in zip(array.names, array.position, array.direction, strict=True)
        ],
    )


def _removal(removal: Removal) -> tuple[str, str, str, str]:
    if removal.condition == math.inf:
        return removal.name, "not enough", "not enough", "singular"
    return removal.name, f"{removal.angular:.3f}", f"{removal.force:.3f}", f"{removal.condition:.3g}"


def _as_dict(analysis: ArrayAnalysis, density: float | None) -> dict[str, Any]:
    from northdown.arrays.design import leave_one_out
    from northdown.io.array_file import array_table

    return {
        **array_table(analysis.array),
        "length": analysis.length,
        "condition": analysis.condition,
        "angular_noise": analysis.angular_noise.tolist(),
        "force_noise": analysis.force_noise.tolist(),
        "angular_dilution": analysis.angular_dilution,
        "force_dilution": analysis.force_dilution,
        "inverse": analysis.inverse.tolist(),
        "leakage": analysis.leakage.tolist(),
        "measured_products": analysis.measured_products.tolist(),
        "rate_random_walk": None if density is None else _budget(analysis, density).rate_random_walk.tolist(),
        "without": [
            {"name": r.name, "angular": r.angular, "force": r.force, "condition": r.condition}
            for r in leave_one_out(analysis)
        ],
    }
